"""track-object: a stream of snapshots from the observation stream, opened once and closed with its subgraph."""

from __future__ import annotations

from contextlib import nullcontext
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import pytest

from gap_runtime.contracts.tool import ToolContext, tool
from gap_runtime.contracts.types import BoundingBox2D, Image, Mask
from gap_runtime.errors import PerceptionError
from gap_runtime.graph.compile import compile_workflow
from gap_runtime.run.execute import RunSetup, run_graph
from gap_runtime.testing import FakeCell, fake_skill, fake_tools, fake_workflow
from tests.unit.skills.stage import LIBRARY, ROBOTS, Stage, script

run = script("track-object", "run")
BOX = BoundingBox2D(0, 0, 2, 2)
MASK = Mask(np.ones((4, 6), bool))


class Feed:
    """The newest of the frames that came since the last was taken; none after the last."""

    def __init__(self, frames):
        self.frames, self.skip = list(frames), 0

    def next(self):
        del self.frames[: self.skip]
        self.skip = 0
        return self.frames.pop(0) if self.frames else None


def frame(stamp, cameras=2):
    image = Image(np.full((4, 6, 3), int(10 * stamp), np.uint8))
    return SimpleNamespace(cameras=[SimpleNamespace(rgb=image)] * cameras, stamp=stamp)


def stage(present=True):
    def update(tracker_id, image):
        return SimpleNamespace(mask=MASK, box=BOX, confidence=image.data[0, 0, 0] / 100, object_present=True)

    started = SimpleNamespace(tracker_id="t", initial_mask=MASK, initial_box=BOX, score=0.9, object_present=present)
    made = Stage(
        ROBOTS[0],
        sam3_tracker__InitTracker=started,
        sam3_tracker__UpdateTracker=update,
        sam3_tracker__CloseTracker=lambda tracker_id: None,
    )
    made.raise_if_cancelled = lambda: None
    made.cleanup = nullcontext
    return made


def called(made):
    return [name.partition(".")[2] for name, _ in made.calls]


def test_every_new_frame_gives_one_snapshot():
    made = stage()
    snapshots = list(run(made, Feed([frame(0.0), frame(0.1), frame(0.2)]), "can"))
    assert [s.stamp for s in snapshots] == [0.0, 0.1, 0.2]
    assert [round(s.confidence, 2) for s in snapshots] == [0.9, 0.01, 0.02]
    assert called(made) == ["InitTracker", "UpdateTracker", "UpdateTracker", "CloseTracker"]


def test_frames_that_came_meanwhile_are_skipped():
    feed = Feed([frame(0.1 * i) for i in range(5)])
    tracking = run(stage(), feed, "can")
    next(tracking)
    feed.skip = 3
    assert next(tracking).stamp == pytest.approx(0.4)


def test_a_tracker_is_closed_when_its_reader_goes_away():
    made = stage()
    tracking = run(made, Feed([frame(0.0)]), "can")
    next(tracking)
    tracking.close()
    assert called(made)[-1] == "CloseTracker"


def test_an_object_the_first_frame_does_not_show_is_not_found():
    made = stage(present=False)
    with pytest.raises(PerceptionError, match="does not show the can"):
        next(run(made, Feed([frame(0.0)]), "can"))
    assert called(made)[-1] == "CloseTracker"


def test_a_camera_that_is_not_there_is_named():
    with pytest.raises(PerceptionError, match="no camera 3; the observation has 2"):
        next(run(stage(), Feed([frame(0.0)]), "can", camera_index=3))


class Started(NamedTuple):
    """What InitTracker gives."""

    tracker_id: str
    initial_mask: Mask
    initial_box: BoundingBox2D
    score: float
    object_present: bool


class Updated(NamedTuple):
    """What UpdateTracker gives."""

    mask: Mask
    box: BoundingBox2D
    confidence: float
    object_present: bool


def test_a_graph_reads_the_latest_snapshot_while_the_arm_moves():
    frames: list[Any] = []
    closed: list[str] = []

    @tool("sam3_tracker.InitTracker", effect="sense")
    def start(ctx: ToolContext, image: Image, text: str = "", object_name: str = "") -> Started:
        """Starts."""
        return Started("t", MASK, BOX, 0.5, True)

    @tool("sam3_tracker.UpdateTracker", effect="sense")
    def update(ctx: ToolContext, tracker_id: str, image: Image) -> Updated:
        """Counts frames."""
        frames.append(image)
        return Updated(MASK, BOX, 0.75, True)

    @tool("sam3_tracker.CloseTracker", effect="sense")
    def close(ctx: ToolContext, tracker_id: str) -> None:
        """Closes."""
        closed.append(tracker_id)

    tracker = {
        "type": "tool", "tool": "track-object", "streaming": True,
        "inputs": {"observation_stream": {"$ref": "in.observation_stream"}, "object_name": "can"},
    }  # fmt: skip
    read = {"type": "tool", "tool": "fake.Echo", "inputs": {"value": {"$ref": "tracker.confidence"}}}
    workflow = fake_workflow(
        {"tracker": tracker, "first": read, "move": "fake.Move", "last": read},
        [("START", "tracker"), ("START", "first"), ("first", "move"), ("move", "last"), ("last", "done")],
    )
    served = fake_tools(start, update, close)
    skills = {"fake": fake_skill([*served, "track-object"]), "track-object": LIBRARY["track-object"].contract}
    graph = compile_workflow(
        workflow, LIBRARY["track-object"].path, served, skills, LIBRARY.canonical_scripts(workflow)
    )
    world = FakeCell(pace=0.3)
    result = run_graph(graph, RunSetup(cell=world))
    assert result.status == "success", result.error
    assert frames and closed == ["t"]
    assert world._listeners == {}
