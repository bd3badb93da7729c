"""track-object in physics: a streaming node beside an arm that carries away what is tracked."""

from __future__ import annotations

import threading
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pytest

from gap_geometry.clouds import mask_to_world_points
from gap_runtime.contracts.skill import Exits, SkillContract
from gap_runtime.contracts.tool import ToolContext, tool
from gap_runtime.contracts.types import Mask
from gap_runtime.graph.compile import compile_workflow
from gap_runtime.graph.model import Workflow
from gap_runtime.run.execute import RunSetup, run_graph
from tests.sim.skills_perception.cell import LIBRARY, REGISTRY

pytestmark = pytest.mark.sim
HZ = 4.0
INIT, UPDATE = "sam3_tracker.InitTracker", "sam3_tracker.UpdateTracker"
TRACKERS = "gap_perception.trackers"
SPOT, THERE = (-0.05, -0.15), (0.05, 0.10)  # m: where the milk stands, and where it is carried
MOVES = ["robot_control.GoToPose", "robot_control.GoToPoseCartesian", "gripper.Close", "gripper.Open"]
CARRY = SkillContract(
    kind="composite",
    template="none",
    tools=["track-object", "test.Read", *MOVES],
    exits=Exits(success={"done": "carried"}, failure="failed"),
)


def down(x, y, z):
    """A node's input: the TCP straight down."""
    return {"position": {"x": x, "y": y, "z": z}, "rotation": {"w": 0.0, "x": 1.0, "y": 0.0, "z": 0.0}}


def carrying(text, *, until=None):
    """A graph that tracks what `text` names beside a pick and a place of what stands at SPOT."""
    straight = "robot_control.GoToPoseCartesian"
    steps: dict[str, Any] = {
        "first": {"tool": "test.Read", "inputs": {"mask": {"$ref": "tracker.mask"}}},
        "fail": {"tool": straight, "inputs": {"pose": down(2.0, 0.0, 0.2)}},
        "above": {"tool": MOVES[0], "inputs": {"pose": down(*SPOT, 0.25)}},
        "reach": {"tool": straight, "inputs": {"pose": down(*SPOT, 0.10)}},
        "close": {"tool": "gripper.Close"},
        "lift": {"tool": straight, "inputs": {"pose": down(*SPOT, 0.20), "lin_vel_norm": 0.25}},
        "carry": {"tool": straight, "inputs": {"pose": down(*THERE, 0.20), "lin_vel_norm": 0.25}},
        "lower": {"tool": straight, "inputs": {"pose": down(*THERE, 0.105), "lin_vel_norm": 0.25}},
        "open": {"tool": "gripper.Open"},
        "leave": {"tool": straight, "inputs": {"pose": down(*THERE, 0.30)}},
        "last": {"tool": "test.Read", "inputs": {"mask": {"$ref": "tracker.mask"}}},
    }
    last = len(steps) if until is None else list(steps).index(until) + 1
    names = [n for n in list(steps)[:last] if n != "fail" or until == "fail"]
    tracker = {
        "type": "tool", "tool": "track-object", "streaming": True,
        "inputs": {"observation_stream": {"$ref": "in.observation_stream"}, "object_name": text},
    }  # fmt: skip
    definition = {
        "skill": "carry",
        "nodes": {"tracker": tracker, **{n: {"type": "tool", **steps[n]} for n in names}, "done": {"type": "noop"}},
        "edges": [
            ["START", "tracker"],
            *map(list, zip(["START", *names], [*names, "done"], strict=True)),
            ["done", "END"],
        ],
        "exit": {"success_values": ["done"]},
        "on_error": "failed",
        "outputs": {"mask": {"$ref": "tracker.mask"}, "stamp": {"$ref": "tracker.stamp"}},
    }
    top = {
        "main": {"type": "subgraph", "ref": "carry"},
        "success": {"type": "end", "status": "success"},
        "abort": {"type": "end", "status": "failure"},
    }
    routing = {"main": {"router_field": "exit", "mapping": {"done": "success", "failed": "abort"}}}
    return Workflow.load(
        {
            "meta": {"observation_stream_hz": str(HZ)}, "nodes": top, "edges": [["START", "main"]],
            "conditional_edges": routing, "subgraphs": {"carry": definition},
        },
        "carrying",
    )  # fmt: skip


@dataclass
class Watched:
    """What the tracker answered by the picture it was shown, what was true then, and what its state holds after."""

    cell: Any
    answers: list[tuple[bytes, Any]] = field(default_factory=list)
    frames: dict[bytes, Any] = field(default_factory=dict)
    state: dict[str, Any] = field(default_factory=dict)
    outputs: dict[str, Any] = field(default_factory=dict)
    result: Any = None

    def strays(self, name):
        """For every frame: its time, whether the object was there, and how far [m] the mean pixel of its mask lies
        outside the true object."""
        found = []
        for key, answer in self.answers:
            frame = self.frames[key]
            camera, box = frame.observation.cameras[0], frame.snapshot.bodies[name].box
            points = mask_to_world_points(
                None, mask=answer.mask, depth=camera.depth, intrinsics=camera.intrinsics, camera_pose=camera.pose
            ).points
            local = (points - box.center.array) @ box.orientation.rotation.as_matrix()
            outside = np.maximum(np.abs(local) - box.extent.array, 0)
            found.append((frame.time, answer.object_present, float(np.linalg.norm(outside, axis=1).mean())))
        return found


@pytest.fixture
def watch(kitchen):
    def go(text, **options):
        world = kitchen.cell("groceries", milk=(*SPOT, 0), alphabet_soup=(-0.15, 0.05, 0), basket=(0.1, 0.3, 0))
        seen = Watched(world)

        def started(ctx, inputs):
            seen.state = ctx.state
            return REGISTRY.tool(INIT).call(ctx, inputs)

        def updated(ctx, inputs):
            value = REGISTRY.tool(UPDATE).call(ctx, inputs)
            seen.answers.append((inputs["image"].data.tobytes(), value))
            return value

        @tool("test.Read")
        def read(ctx: ToolContext, mask: Mask) -> None:
            """Waits for a snapshot and reads it."""

        spied = {name: replace(REGISTRY.tool(name), call=f) for name, f in ((INIT, started), (UPDATE, updated))}
        tools = {**REGISTRY.tools, "test.Read": read, **spied}
        workflow = carrying(text, **options)
        skills = {"carry": CARRY, "track-object": LIBRARY["track-object"].contract}
        graph = compile_workflow(workflow, kitchen.folder, tools, skills, LIBRARY.canonical_scripts(workflow))

        def keep(frame):
            seen.frames[frame.observation.cameras[0].rgb.data.tobytes()] = frame

        def listen(event):
            if event.kind == "subgraph_exited":
                seen.outputs |= event.data["outputs"]

        unsubscribe = world.subscribe(keep, HZ, world.camera_names)
        try:
            seen.result = run_graph(
                graph,
                RunSetup(cell=world, task=kitchen.task, seed=1, lockstep=True, renderer=REGISTRY.renderer),
                [listen],
            )
        finally:
            unsubscribe()
        return seen

    return go


def nothing_is_left(seen):
    return not seen.state[TRACKERS] and not any(t.name == "gap-main/tracker" for t in threading.enumerate())


def test_what_the_arm_carries_is_followed_and_forgotten(watch):
    seen = watch("milk")
    assert seen.result.status == "success", seen.result.error
    moved = seen.cell.snapshot().body("milk")
    assert moved.moved() > 0.25 and moved.is_settled()
    followed = seen.strays("milk")
    times = [time for time, _, _ in followed]
    assert np.diff(times) == pytest.approx(1 / HZ, abs=0.02)  # every frame: in a rehearsal the world waits
    assert len(times) >= HZ * (seen.cell.time - 0.5) and all(present for _, present, _ in followed)
    assert max(stray for _, _, stray in followed) < 0.003
    assert seen.outputs["stamp"] in times
    assert nothing_is_left(seen)


def test_what_is_published_depends_on_no_clock(watch):
    runs = [watch("milk", until="reach") for _ in range(2)]
    published = [[(key, answer.mask, answer.confidence) for key, answer in seen.answers] for seen in runs]
    assert len(published[0]) > 2 and published[0] == published[1]
    assert runs[0].outputs == runs[1].outputs


def test_a_tracker_is_free_when_its_subgraph_fails(watch):
    seen = watch("milk", until="fail")
    assert seen.result.failed_node == "main/fail" and seen.result.exits == [("main", "failed")]
    assert nothing_is_left(seen)


@pytest.mark.parametrize("text", ["bbq sauce", "unicorn"])
def test_what_the_first_frame_does_not_show_is_lost(watch, text):
    seen = watch(text, until="first")
    assert seen.result.exits == [("main", "failed")] and f"does not show the {text}" in seen.result.error
    assert nothing_is_left(seen)
