"""In a rehearsal world time waits for streaming nodes: none misses a frame for want of a faster machine."""

from __future__ import annotations

import threading

import pytest

from gap_runtime.contracts.tool import ToolContext, tool
from gap_runtime.run.execute import RunSetup, run_graph
from gap_runtime.testing import FakeCell, compile_fake, fake_workflow

FOLLOWS = """
from collections.abc import Iterator
from typing import Any

def run(ctx, observation_stream: Any) -> Iterator[float]:
    while (frame := observation_stream.next()) is not None:
        ctx.tool("fake.Ponder")
        {}
        yield frame.stamp
"""
SEEN: list[float] = []


@tool("fake.Ponder")
def ponder(ctx: ToolContext) -> None:
    """Takes longer than the world takes to move on."""
    threading.Event().wait(0.01)


@tool("fake.Note")
def note(ctx: ToolContext, stamp: float) -> None:
    """Reads what was published last."""
    SEEN.append(stamp)


@pytest.fixture
def last_stamps(tmp_path):
    def run(line="pass", **setup):
        SEEN.clear()
        file = tmp_path / "s.py"
        file.write_text(FOLLOWS.format(line))
        feed = {"observation_stream": {"$ref": "in.observation_stream"}}
        read = {"type": "tool", "tool": "fake.Note", "inputs": {"stamp": {"$ref": "s"}}}
        nodes = {
            "s": {"type": "script", "script": "scripts/s.py", "streaming": True, "inputs": feed},
            "a": read, "move": {"type": "tool", "tool": "fake.Move", "inputs": {"duration": 2.0}}, "b": read,
        }  # fmt: skip
        edges = [("START", "s"), ("START", "a"), ("a", "move"), ("move", "b"), ("b", "done")]
        graph = compile_fake(fake_workflow(nodes, edges), ponder, note, canonical={"scripts/s.py": file})
        result = run_graph(graph, RunSetup(cell=FakeCell(), lockstep=True, budget_s=60.0, **setup))
        assert result.status == "success", result.error
        return tuple(SEEN)

    return run


def test_what_is_read_after_a_motion_is_of_its_last_frame_however_slow_the_reader(last_stamps):
    first, last = last_stamps()
    assert (first, last) == last_stamps()
    assert last - first >= 1.9


def test_a_node_that_looks_at_the_world_by_itself_does_not_hold_it_up(last_stamps, monkeypatch):
    monkeypatch.setattr("gap_runtime.run.streaming.READERS_S", 3600.0)
    assert last_stamps('ctx.tool("fake.Look")')
