"""One harness for every registered tool: its contract is whole, and it is the catalogue's where it has the name."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from gap_runtime.contracts.encoding.codec import from_plain, to_plain
from gap_runtime.plugins import load_registry

CATALOGUE = json.loads((Path(__file__).parent / "catalogue.json").read_text())
REGISTRY = load_registry(entry_points=False)
TOOLS = [tool for by in REGISTRY.providers.values() for tool in by.values()]
IDS = [f"{t.spec.name}@{t.provider}" for t in TOOLS]
MOVING = ("robot_control.", "gripper.Open", "gripper.Close")


def test_every_first_party_plugin_loads():
    assert REGISTRY.broken == {}


@pytest.mark.parametrize("tool", TOOLS, ids=IDS)
def test_the_contract_is_whole(tool):
    spec = tool.spec
    assert spec.summary.endswith((".", ";")), "the first line of the docstring is one sentence"
    assert spec.deadline_s > 0
    assert not (spec.output and spec.fields)
    if spec.effect == "actuate":
        assert any(r.startswith(("arm:", "gripper:")) for r in spec.resources) and "clock" in spec.resources
    if spec.effect == "pure":
        assert spec.resources == () and not spec.privileged


@pytest.mark.parametrize("tool", TOOLS, ids=IDS)
def test_defaults_are_values_of_their_type(tool):
    for parameter in tool.spec.inputs:
        if not parameter.required:
            value = from_plain(to_plain(parameter.default), parameter.type, where=parameter.name)
            assert to_plain(value) == to_plain(parameter.default)


@pytest.mark.parametrize("tool", [t for t in TOOLS if t.spec.name in CATALOGUE], ids=lambda t: t.spec.name)
def test_names_and_defaults_are_the_catalogues(tool):
    known = CATALOGUE[tool.spec.name]
    inputs = {p.name: p for p in tool.spec.inputs}
    assert set(known["inputs"]) <= set(inputs), "inputs of the catalogue are missing"
    assert all(not inputs[extra].required for extra in set(inputs) - set(known["inputs"])), "additions need defaults"
    for name, default in known["inputs"].items():
        if default is not None:
            assert inputs[name].default == default, name
    outputs = known["outputs"]
    if isinstance(outputs, str):
        assert str(tool.spec.output).replace("[world]", "").replace("[camera]", "") == outputs
    else:
        assert list(tool.spec.fields) == outputs and tool.spec.output is None


def test_reading_ground_truth_is_declared():
    privileged = {t.spec.name for t in TOOLS if t.spec.privileged}
    assert privileged <= {n for n in CATALOGUE if n.startswith("sim_bridge.")}
    assert {"sim_bridge.GetState", "sim_bridge.CheckTaskCompletion", "sim_bridge.Reset"} <= privileged


def test_what_moves_the_robot_says_so():
    for tool in TOOLS:
        if tool.spec.name.startswith(MOVING) and "Get" not in tool.spec.name:
            assert tool.spec.effect == "actuate", tool.spec.name
