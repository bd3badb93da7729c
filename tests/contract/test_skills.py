"""One harness for every registered skill: the format's own validator, the contract, the sandbox, the graph's rules."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from skills_ref import validate as skills_ref_validate

from gap_cli.author.skill_check import check_skill, draft_alone
from gap_cli.skills import load_library
from gap_runtime.graph.checkpoints import parse_checkpoints
from gap_runtime.graph.scripts import read_signature
from gap_runtime.plugins import load_registry

REGISTRY = load_registry()
LIBRARY = load_library(REGISTRY.skill_paths)
TOOLS = {name: tool.spec for name, tool in REGISTRY.tools.items()}
SECTIONS = ["When to use", "When not to use", "Recommended node flow", "Hard rules", "Exits", "See also"]
every_skill = pytest.mark.parametrize("name", list(LIBRARY))
every_composite = pytest.mark.parametrize("name", [n for n, b in LIBRARY.items() if b.contract.kind == "composite"])
every_atomic = pytest.mark.parametrize("name", [n for n, b in LIBRARY.items() if b.contract.kind == "atomic"])


@every_skill
def test_skill_md_is_spec_pure(name):
    assert skills_ref_validate(LIBRARY[name].path) == []


@every_skill
def test_the_skill_makes_a_valid_graph(name):
    assert check_skill(LIBRARY[name], TOOLS) == []


@every_skill
def test_skill_md_says_what_an_author_needs(name):
    bundle = LIBRARY[name]
    heads = re.findall(r"^## (.+)$", bundle.body, re.MULTILINE)
    assert heads == SECTIONS
    for value in (*bundle.contract.exits.success, bundle.contract.exits.failure):
        assert f"| `{value}` |" in bundle.body
    for relative in bundle.contract.references.values():
        assert f"`{relative}`" in bundle.body
    assert "Use " in bundle.description


@every_skill
def test_contract_names_every_file_of_the_skill(name):
    bundle = LIBRARY[name]
    there = {p for p in bundle.path.rglob("*") if p.is_file() and "__pycache__" not in p.parts}
    assert there == set(bundle.files)


@every_composite
def test_script_inputs_are_parameters_or_wired(name):
    """A parameter and the script input of its name agree, and every parameter reaches a node."""
    bundle = LIBRARY[name]
    used = json.dumps([d.model_dump() for d in draft_alone(bundle, TOOLS).workflow.subgraphs.values()])
    for parameter, given in bundle.contract.parameters.items():
        assert f"param.{parameter}" in used
        for file in bundle.scripts.values():
            for read in read_signature(file.read_text(), str(file)).inputs:
                if read.name == parameter:
                    assert (read.type.name, read.default) == (given.type, given.default)


@every_composite
def test_checkpoints_parse_and_promise_something(name):
    made = draft_alone(LIBRARY[name], TOOLS)
    points = parse_checkpoints(made.checkpoints["sample"], name)
    assert any(p.validate and p.rationale for p in points)


@every_atomic
def test_an_atomic_skill_is_its_script(name):
    contract = LIBRARY[name].contract
    spec = read_signature(LIBRARY[name].scripts["run"].read_text(), name)
    given = {**contract.inputs, **contract.literals, **{n: p.type for n, p in contract.parameters.items()}}
    assert {p.name: str(p.type) for p in spec.inputs} == given
    assert {n: str(t) for n, t in spec.fields.items()} == contract.outputs
    assert {p.name: p.default for p in spec.inputs if not p.required} == {
        n: p.default for n, p in contract.parameters.items()
    }
    assert spec.publishes == contract.streaming
    assert set(spec.tools) == set(contract.tools)


@every_skill
def test_swaps_do_the_same_and_give_no_less(name):
    contract = LIBRARY[name].contract
    for other in contract.swaps:
        swap = LIBRARY[other].contract
        assert (swap.stage, swap.roles, swap.needs) == (contract.stage, contract.roles, contract.needs)
        assert contract.outputs.items() <= swap.outputs.items()
        assert set(contract.effects) <= set(swap.effects)


def test_no_skill_knows_one_robot():
    for file in (p for b in LIBRARY.values() if b.plugin == "morsl" for p in b.files):
        for robot in REGISTRY.robots:
            assert robot.split("-")[0] not in file.read_text().lower(), file


CATALOGUE = {
    "perception-single": (
        {},
        {"<name>_obb": "OrientedBoundingBox", "<name>_mask": "Mask", "<name>_cloud": "PointCloud"},
    ),
    "perception-multi": ({}, {"<name>_obb": "OrientedBoundingBox", "<name>_mask": "Mask"}),
    "perception-any": (
        {},
        {"<name>_obb": "OrientedBoundingBox", "<name>_mask": "Mask", "<name>_cloud": "PointCloud"},
    ),
    "perception-subpart": (
        {},
        {"<name>_obb": "OrientedBoundingBox", "<name>_mask": "Mask", "<name>_cloud": "PointCloud"},
    ),
    "grasp-direct-ik": ({"target_obb": "OrientedBoundingBox"}, {}),
    "grasp-curobo-obb": (
        {"target_obb": "OrientedBoundingBox", "target_mask": "Mask"},
        {"ee_pose_at_grasp": "Se3Pose", "grasp_pose": "Se3Pose"},
    ),
    "grasp-short-axis": (
        {"target_obb": "OrientedBoundingBox", "target_mask": "Mask", "base_obb": "OrientedBoundingBox"},
        {"ee_pose_at_grasp": "Se3Pose", "grasp_pose": "Se3Pose"},
    ),
    "grasp-moe": (
        {"target_obb": "OrientedBoundingBox", "target_mask": "Mask", "target_cloud": "PointCloud"},
        {"ee_pose_at_grasp": "Se3Pose"},
    ),
    "transport-to-drop": (
        {
            "container_obb": "OrientedBoundingBox",
            "container_mask": "Mask",
            "target_obb": "OrientedBoundingBox",
            "target_mask": "Mask",
            "ee_pose_at_grasp": "Se3Pose",
        },
        {},
    ),
}


@pytest.mark.parametrize("name", CATALOGUE)
def test_interfaces_are_those_of_the_catalogue(name):
    """Inputs exactly, outputs at least; frames and optionality are ours to add."""
    contract = LIBRARY[name].contract
    inputs, outputs = CATALOGUE[name]
    assert {n: re.match(r"\w+", t)[0] for n, t in contract.inputs.items()} == inputs
    assert outputs.items() <= {n: re.match(r"\w+", t)[0] for n, t in contract.outputs.items()}.items()


def test_morsl_is_read_from_the_checkout_or_the_wheel():
    import morsl

    folders = {p.parent for p in Path(morsl.__file__).parent.glob("*/SKILL.md")}
    assert folders == {b.path for b in LIBRARY.values() if b.plugin == "morsl"}
