"""The paper's own samples run as written, and where they break the paper's own rules the validator says so."""

from __future__ import annotations

from pathlib import Path

import pytest

from gap_cli.analysis.catalog import Catalog
from gap_cli.builder.assemble import assemble
from gap_cli.builder.workflow import WorkflowSpec
from gap_cli.sandbox import run_builder
from gap_cli.validate.validator import validate
from gap_runtime.contracts.skill import SkillContract
from gap_runtime.errors import WorkflowError
from gap_runtime.graph.checkpoints import Checkpoint
from gap_runtime.graph.load import parse_workflow
from gap_runtime.graph.scripts import read_signature
from tests.unit.validate.kit import TOOLS, Ref, Subgraph, declare, fill, run, workflow_of

PAPER = Path(__file__).parent / "paper"
OBB, POSE = "OrientedBoundingBox[world]", "Se3Pose[world]"
PERCEIVE = """
from typing import Annotated, NamedTuple
from gap_runtime.contracts.types import WORLD, CameraObservation, Mask, PointCloud

class Perceived(NamedTuple):
    found: bool
    cloud: Annotated[PointCloud, WORLD]
    mask: Mask
    score: float

def run(ctx, cameras: list[CameraObservation], object_name: str, text_prompts: list[str] | None = None,
        min_points: int = 50, min_score: float = 0.3, use_multiview: bool = False, box_threshold: float = 0.2,
        text_threshold: float = 0.2, dino_prompt: str = "", object_description: str = "") -> Perceived: ...
"""


def contract(success, failure, **keys):
    exits = {"success": {success: "it did"}, "failure": failure}
    return SkillContract(kind="composite", template="t.j2", exits=exits, tools=[*TOOLS], **keys)


SKILLS = {
    "perception-single": contract(
        "found", "not_found", outputs={"<name>_obb": OBB, "<name>_mask": "Mask", "<name>_cloud": "PointCloud[world]"}
    ),
    "grasp-moe": contract(
        "grasped", "failed", stage="grasp", outputs={"ee_pose_at_grasp": POSE},
        inputs={"target_obb": OBB, "target_mask": "Mask", "target_cloud": "PointCloud[world]"},
    ),
    "transport-to-drop": contract(
        "placed", "blocked", stage="place",
        inputs={"container_obb": OBB, "container_mask": "Mask", "target_obb": OBB, "target_mask": "Mask",
                "ee_pose_at_grasp": POSE},
    ),
}  # fmt: skip
CATALOG = Catalog(TOOLS, SKILLS, {"scripts/perceive_dino_vlm.py": read_signature(PERCEIVE, "perceive_dino_vlm")})


def sample(name):
    return run_builder((PAPER / f"{name}.txt").read_text())


def written_to(declaration, name):
    """A subgraph that keeps to the planner's declaration word for word."""
    sg = Subgraph(name, skill=declaration["skill"])
    for key, kind in declaration["inputs"].items():
        sg.add_input(key, kind)
    sg.add_node("look", type="tool", tool="observation.GetObservation")
    inputs = {"cameras": Ref("look.cameras"), "object_name": name}
    sg.add_node("find", type="script", script="scripts/perceive_dino_vlm.py", inputs=inputs)
    sg.add_node("box", type="tool", tool="geometry_svc.FilterAndComputeOBB", inputs={"point_cloud": Ref("find.cloud")})
    sg.add_node("pose", type="tool", tool="robot_control.GetEEPose")
    for value in declaration["exit_success_values"]:
        sg.add_exit(value)
    gives = {"obb": Ref("box"), "mask": Ref("find.mask"), "cloud": Ref("find.cloud"), "grasp": Ref("pose.pose")}
    sg.set_outputs(**{key: gives[key.rpartition("_")[2]] for key in declaration["outputs"]})
    sg.set_on_error(declaration["on_error"])
    return fill(sg).to_dict()


def test_the_two_samples_do_not_fit_each_other():
    spec = sample("behaviour_agent")
    built = {n: written_to(d, n) for n, d in spec["def"]["subgraphs"].items()}
    with pytest.raises(WorkflowError) as error:
        assemble(spec, {**built, "container_sg": sample("subgraph_agent")})
    (finding,) = error.value.findings
    assert finding.path == "subgraphs.container_sg.on_error"
    assert "declared 'abort', written 'not_found'" in finding.message


def test_the_behaviour_agent_s_sample_routes_exits_it_does_not_have():
    spec = sample("behaviour_agent")
    workflow = assemble(spec, {n: written_to(d, n) for n, d in spec["def"]["subgraphs"].items()})
    found = validate(workflow, CATALOG)
    assert {f.code for f in found} == {"W8", "K1", "K5"}
    strange = {f.path.rpartition(".")[2]: f for f in found if ".mapping." in f.path}
    assert set(strange) == {"not_found", "failed", "blocked"}
    assert strange["not_found"].hint == 'Declare on_error="not_found", or route "abort".'
    assert sum("on_error 'abort'" in f.message for f in found if f.code == "W8") == 4
    assert [f.message for f in found if f.code == "K1"] == ["there is no skill 'grasp_multi'"]


def test_put_right_the_sample_is_sound():
    spec = sample("behaviour_agent")
    failures = {"target_sg": "not_found", "container_sg": "not_found", "grasp_sg": "failed", "transport_sg": "blocked"}
    for name, value in failures.items():
        spec["def"]["subgraphs"][name]["on_error"] = value
    spec["def"]["subgraphs"]["grasp_sg"]["skill"] = "grasp_moe"
    workflow = assemble(spec, {n: written_to(d, n) for n, d in spec["def"]["subgraphs"].items()})
    assert validate(workflow, CATALOG) == []


def test_the_subgraph_agent_s_sample_is_sound_but_for_the_checkpoint_another_agent_writes():
    data = sample("subgraph_agent")
    spec = WorkflowSpec("sample")
    sg = run((PAPER / "subgraph_agent.txt").read_text().partition("\n")[2])["sg"]
    assert sg.to_dict()["def"] == data["def"]
    declare(spec, sg)
    workflow, _, lines = workflow_of(spec, [sg])
    assert validate(workflow, CATALOG, lines) == []
    bare = Catalog(CATALOG.tools, CATALOG.skills, CATALOG.scripts, checkpoints={})
    assert [f.code for f in validate(workflow, bare)] == ["K8"]
    promise = Checkpoint("placed", 'w.body("basket").is_settled()', "It stands still.")
    given = Catalog(CATALOG.tools, CATALOG.skills, CATALOG.scripts, checkpoints={"container_sg": (promise,)})
    assert validate(workflow, given) == []


def test_the_prompt_s_subgraph_runs_as_written():
    data = sample("subgraph_prompt")["def"]
    assert list(data["nodes"]) == ["observe", "perceive", "found"]
    assert data["nodes"]["perceive"]["inputs"] == {"cameras": {"$ref": "observe.cameras"}, "object": "{{target_full}}"}
    assert data["outputs"]["target_mask"] == {"$ref": "perceive.mask"}


@pytest.mark.parametrize(("name", "success"), [
    ("linear", ["found"]), ("streaming", ["done"]), ("conditional", ["alt_done", "done"]),
])  # fmt: skip
def test_the_prompt_s_patterns_have_a_sound_structure(name, success):
    code = (PAPER / f"pattern_{name}.txt").read_text().replace("{...}", "{}")
    sg = run_builder(f'sg = Subgraph(name="p_sg", skill="p")\n{code}')["def"]
    assert sg["exit"]["success_values"] == success
    data = {
        "version": 3, "subgraphs": {"p_sg": sg},
        "nodes": {
            "p": {"type": "subgraph", "ref": "p_sg"},
            "done": {"type": "end", "status": "success"},
            "abort": {"type": "end", "status": "failure"},
        },
        "edges": [["START", "p"]],
        "conditional_edges": {
            "p": {"router_field": "exit", "mapping": {**dict.fromkeys(success, "done"), sg["on_error"]: "abort"}},
        },
    }  # fmt: skip
    found = validate(parse_workflow(data, name), CATALOG)
    placeholders = {"K1", "K2"}
    own = {"linear": {"K3"}, "conditional": {"S2"}, "streaming": set()}  # the conditional one forgets START
    assert {f.code for f in found} == placeholders | own[name]


def test_the_paper_s_recovery_is_read():
    data = {
        "version": 3, "subgraphs": {},
        "nodes": {"abort": {"type": "end", "status": "failure", "recovery": [
            {"service": "gripper.v1.Gripper", "method": "Open", "inputs": {}}]}},
    }  # fmt: skip
    assert parse_workflow(data, "it").nodes["abort"].recovery[0].tool == "gripper.Open"
