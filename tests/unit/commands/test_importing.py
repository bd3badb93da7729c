"""`gap import`: what is mapped is right, what is guessed or left is said, and foreign code stays in the sandbox."""

import json

import pytest

BUILDER = """
import argparse
from pathlib import Path
from gap.builder import END, Ref, Subgraph, Workflow

LABEL = "red mug"
HERE = Path(__file__).parent

def _chain(sg, *names):
    for pair in zip(("START",) + names, names + (END,)):
        sg.add_edge(*pair)

def build(out: Path = None, label: str = LABEL) -> Workflow:
    wf = Workflow(name="mug", description=f"Take the {label}.")
    look = Subgraph(name="look_sg", skill="perceiving-objects", generated=False)
    look.add_node("observe", type="tool", tool="robot.get_observation")
    look.add_node("fit", type="tool", tool="geometry.filter_and_compute_obb", inputs={"points": Ref("observe.cloud")})
    look.add_exit("found")
    _chain(look, "observe", "fit", "found")
    look.set_outputs(target_obb=Ref("fit.obb"), pose=Ref("observe.arms.0.ee_pose"))
    look.set_on_error("not_found")
    wf.add_subgraph(look)
    grab = Subgraph(name="grab_sg", skill="grasping-direct-ik")
    grab.add_input("target_obb", type_name="OrientedBoundingBox")
    grab.add_input("thing", type_name="FunctionalFeature")
    grab.add_node("plan", type="tool", tool="geometry.top_down_grasp_candidates", inputs={"obb": Ref("in.target_obb")})
    grab.add_node("go", type="tool", tool="robot.go_to_pose",
                  inputs={"pose": Ref("plan.candidates.poses.0"), "arm_id": 1})
    grab.add_node("wave", type="tool", tool="robot.wave")
    grab.add_node("close", type="tool", tool="robot.close_gripper", inputs={"settle_steps": 60})
    grab.add_exit("grasped")
    _chain(grab, "plan", "go", "wave", "close", "grasped")
    grab.set_on_error("failed")
    grab.add_checkpoint("held", lambda w, o: w.body(label).is_grasped(), rationale="it is held", weight=2.0)
    grab.add_checkpoint("on", predicate=lambda world: not world.body(label).is_on_strict("table"))
    grab.add_checkpoint("sure", predicate=lambda w, o: o["score"] > 0.5)
    grab.add_checkpoint("odd", predicate=lambda w: w.held_body == label)
    wf.add_subgraph(grab)
    wf.add_node("look", type="subgraph", ref="look_sg")
    wf.add_node("grab", type="subgraph", ref="grab_sg")
    wf.add_node("done", type="end", status="success")
    wf.add_end("abort", status="failure", recovery=[{"tool": "robot.open_gripper"}, {"tool": "robot.go_home"}])
    wf.add_edge("START", "look")
    wf.add_conditional_edges("look", {"found": "grab", "not_found": "abort"}, router_field="exit")
    wf.add_conditional_edges("grab", {"grasped": "done", "failed": "abort"}, router_field="exit")
    return wf

def main():
    wf = build(argparse.ArgumentParser().parse_args())
    wf.save("x")
    open("/tmp/never", "w")

if __name__ == "__main__":
    main()
"""
SCRIPT = """
from typing import TypedDict

from gap import NodeContext
from gap.types import (
    CameraFrame,
    PointCloud,
)

class Output(TypedDict):
    cloud: PointCloud

def run(ctx: NodeContext, cameras: list[CameraFrame], *, label: str = "a") -> Output:
    # a comment is kept
    found = ctx.tool("grounding-dino.detect", image=cameras[0]["rgb"], text_prompt=label)
    return {"cloud": ctx.tool("geometry.filter_noise", points=found)}
"""
SIDECAR = """
from gap.checkpoints import Checkpoint
MUG = "red mug"
CHECKPOINTS = [Checkpoint("held", subgraph="look_sg", predicate=lambda w, o: w.body(MUG).is_grasped(), validate=True)]
"""
SKILL = """---
name: stacking-cups
description: >
  Stacks one cup on another.
  Use when cups stand about.
license: MIT
metadata: {category: transport, tags: [cups, stacking], version: 1.0}
gap:
  requires: {gpu: true}
  allowed_tools:
    - robot.go_to_pose
    - robot.open_gripper
    - robot.wave
  exit_conditions:
    stacked: The cup stands on the other.
    blocked: Anything else.
  required_inputs:
    target_obb: OrientedBoundingBox
  produces_outputs:
    "<name>_pose": Se3Pose
  canonical_scripts:
    - plan_stack: scripts/plan_stack.py
    - gone: scripts/gone.py
  prompts:
    ask: prompts/ask.md
  examples:
    - title: canonical
      path: examples/canonical.json
  hard_rules:
    - Never stack a full cup.
  streaming: false
---

# stacking-cups

Stack.
"""
PLAN_STACK = """
from typing import TypedDict
from gap import NodeContext
from gap.types import OrientedBoundingBox, Se3Pose

class Output(TypedDict):
    pose: Se3Pose

def run(ctx: NodeContext, target_obb: OrientedBoundingBox) -> Output:
    return {"pose": ctx.tool("geometry.top_down_grasp_from_obb", obb=target_obb)}
"""
EXAMPLE = {
    "skill": "stacking-cups",
    "nodes": {
        "plan": {
            "type": "script",
            "script": "scripts/plan_stack.py",
            "inputs": {"target_obb": {"$ref": "in.target_obb"}},
        },
        "go": {"type": "tool", "tool": "robot.go_to_pose", "inputs": {"pose": {"$ref": "plan.pose"}}},
        "open": {"type": "tool", "tool": "robot.open_gripper"},
        "stacked": {"type": "noop"},
    },
    "edges": [["START", "plan"], ["plan", "go"], ["go", "open"], ["open", "stacked"], ["stacked", "END"]],
    "outputs": {"cup_pose": {"$ref": "plan.pose"}},
    "exit": {"router_field": None, "success_values": ["stacked"]},
    "on_error": "blocked",
}


def write(root, files):
    for name, text in files.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text if isinstance(text, str) else json.dumps(text))


@pytest.fixture
def imported(gap, tmp_path):
    """`imported(path, files)`: exit code, the folder of the result, its data, and verdict by what was."""

    def run(path, files):
        write(tmp_path, files)
        done = gap("import", tmp_path / path, "--json")
        data = json.loads(done.out)[0]
        rows = {(row["was"], row.get("now", "")): row["verdict"] for row in data["translations"]}
        return done.code, tmp_path / data["path"], data, rows

    return run


def test_a_builder_script_becomes_a_workflow(imported):
    code, folder, data, rows = imported("mug.py", {"mug.py": BUILDER})
    workflow = json.loads((folder / "workflow.json").read_text())
    look, grab = (workflow["subgraphs"][name] for name in ("look_sg", "grab_sg"))
    assert look["nodes"]["fit"] == {
        "type": "tool",
        "tool": "geometry_svc.FilterAndComputeOBB",
        "inputs": {"point_cloud": {"$ref": "observe.cloud"}},
    }
    assert look["outputs"] == {"target_obb": {"$ref": "fit"}, "pose": {"$ref": "observe.arm_states.0.ee_pose"}}
    assert grab["inputs"] == {"target_obb": "OrientedBoundingBox", "thing": "any"}
    assert grab["nodes"]["go"]["tool"] == "robot_control.GoToPoseArm"
    assert grab["nodes"]["go"]["inputs"]["pose"] == {"$ref": "plan.poses.0"}
    assert [call["tool"] for call in workflow["nodes"]["abort"]["recovery"]] == ["gripper.Open", "robot_control.GoHome"]
    assert (look["skill"], grab["skill"]) == ("perception-single", "grasp-direct-ik")
    assert rows["robot.close_gripper", "gripper.Close"] == "mapped"
    for was, now in (("points", "point_cloud"), ("fit.obb", "fit"), ("perceiving-objects", "perception-single")):
        assert rows[was, now] == "guessed"
    assert rows["robot.wave", ""] == rows["main", ""] == "left"
    assert code == 1 and any("robot.wave" in f["message"] for f in data["findings"])


def test_predicates_over_the_world_become_expressions(imported):
    _, folder, data, _ = imported("mug.py", {"mug.py": BUILDER})
    text = (folder / "checkpoints/grab_sg.py").read_text()
    assert "w.body('red mug').is_grasped()" in text and "weight=2.0" in text
    assert "not w.body('red mug').is_on(w.body('table'))" in text
    left = {row["where"]: row["note"] for row in data["translations"] if row["verdict"] == "left"}
    assert "outputs" in left["checkpoint 'sure'"] and "held_body" in left["checkpoint odd"]
    assert "sure" not in text and "odd" not in text


def test_a_graph_takes_its_scripts_and_checkpoints_along(imported):
    node = {"type": "script", "script": "scripts/see.py", "inputs": {}, "gpu": True}
    subgraph = {
        "skill": "perception_single",
        "nodes": {"see": node, "gone": {**node, "script": "scripts/gone.py"}, "found": {"type": "noop"}},
        "edges": [["START", "see"], ["see", "found"], ["found", "END"]],
        "exit": {"router_field": None, "success_values": ["found"]},
    }
    graph = {
        "version": "3",
        "meta": {"observation_stream_hz": 5},
        "nodes": {"look": {"type": "subgraph", "ref": "look_sg"}, "pick": {"type": "router", "script": "scripts/r.py"}},
        "edges": [["START", "look"]],
        "subgraphs": {"look_sg": subgraph},
    }
    files = {"theirs/workflow.json": graph, "theirs/scripts/see.py": SCRIPT, "theirs/checkpoints/look_sg.py": SIDECAR}
    _, folder, data, rows = imported("theirs", files)
    workflow = json.loads((folder / "workflow.json").read_text())
    assert (workflow["version"], workflow["meta"]["observation_stream_hz"]) == (3, "5")
    assert workflow["subgraphs"]["look_sg"]["on_error"] == "failed"
    script = (folder / "scripts/see.py").read_text()
    for line in (
        "from gap_runtime.contracts.tool import ScriptContext as NodeContext",
        "from gap_runtime.contracts.types import CameraObservation as CameraFrame",
        "# a comment is kept",
        'ctx.tool("grounding_dino.Detect", image=cameras[0]["rgb"], text_prompt=label)',
        'ctx.tool("geometry_svc.FilterNoise", point_cloud=found)',
    ):
        assert line in script
    assert "w.body('red mug').is_grasped()" in (folder / "checkpoints/look_sg.py").read_text()
    assert rows["3", "3"] == rows["absent", "failed"] == "guessed"
    for was in ("gpu", "router", "scripts/gone.py", "cameras[0]['rgb']"):
        assert rows[was, ""] == "left"
    assert any(f["code"] == "K3" for f in data["findings"])


def test_a_skill_becomes_one_that_checks(gap, imported, tmp_path):
    files = {
        "theirs/stacking-cups/SKILL.md": SKILL,
        "theirs/stacking-cups/scripts/plan_stack.py": PLAN_STACK,
        "theirs/stacking-cups/prompts/ask.md": "Which cup?\n",
        "theirs/stacking-cups/examples/canonical.json": EXAMPLE,
    }
    code, folder, data, rows = imported("theirs", files)
    assert code == 1 and [f["code"] for f in data["findings"]] == ["K8"]  # a checkpoint is all that it lacks
    head = (folder / "SKILL.md").read_text()
    assert "tags: cups, stacking" in head and "Never stack a full cup." in head and "\ngap:" not in head
    contract = (folder / "contract.yaml").read_text()
    assert "failure: blocked" in contract and "geometry_svc.TopDownGraspFromOBB" in contract
    assert rows["robot.wave", ""] == rows["scripts/gone.py", ""] == rows["requires", ""] == "left"
    assert rows["not listed", "geometry_svc.TopDownGraspFromOBB"] == "guessed"
    done = gap("skills", "check", folder)
    assert done.code == 1 and "1 problem" in done.out


@pytest.mark.parametrize(
    ("code", "says"),
    [
        ("import os\nos.system('touch {mark}')\nwf = Workflow(name='x')", ""),
        ("wf = Workflow(name='x')\nwf.add_subgraph([c for c in ().__class__.__mro__])", "out of bounds"),
        ("wf = Workflow(name='x')\nopen('{mark}', 'w')", "not available"),
        ("x = 1", "binds no Workflow"),
        ("def broken(", "is not Python"),
    ],
)
def test_foreign_code_runs_in_the_sandbox_or_not_at_all(gap, tmp_path, code, says):
    (tmp_path / "evil.py").write_text(code.format(mark=tmp_path / "mark"))
    done = gap("import", "evil.py")
    assert not (tmp_path / "mark").exists()
    assert says in done.err and "Traceback" not in done.err


def test_nothing_is_overwritten(gap, tmp_path):
    write(tmp_path, {"mug.py": BUILDER, "imported/mug/mine.txt": "mine"})
    done = gap("import", "mug.py")
    assert done.code == 1 and "exists already" in done.err
    assert [p.name for p in (tmp_path / "imported/mug").iterdir()] == ["mine.txt"]
