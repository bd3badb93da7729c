"""A streaming node that is told to stop frees what it holds, and does nothing else."""

from __future__ import annotations

from typing import Any

import pytest

from gap_runtime.contracts.tool import OBSERVED, ToolContext, tool
from gap_runtime.run.execute import RunSetup, run_graph
from gap_runtime.testing import FakeCell, compile_fake, fake_workflow, run_fake

SCRIPT = """
from collections.abc import Iterator

def run(ctx) -> Iterator[int]:
    ctx.tool("fake.Hold")
    try:
        while True:
            ctx.raise_if_cancelled()
            yield 1
    finally:
        {}
"""
CLOSES = "with ctx.cleanup():\n            ctx.tool('fake.Free')"
FORGETS = "ctx.tool('fake.Free')"
MOVES = "with ctx.cleanup():\n            ctx.tool('fake.' + 'Move', to=[1.0])\n            ctx.tool('fake.Free')"
HELD: set[str] = set()


@tool("fake.Hold", effect="sense")
def hold(ctx: ToolContext) -> None:
    """Holds something."""
    HELD.add("it")


@tool("fake.Free", effect="sense")
def free(ctx: ToolContext) -> None:
    """Frees it."""
    HELD.clear()


@pytest.fixture
def run(tmp_path):
    def go(in_the_end, consumer="fake.Echo"):
        HELD.clear()
        file, world = tmp_path / "s.py", FakeCell()
        file.write_text(SCRIPT.format(in_the_end))
        nodes = {
            "s": {"type": "script", "script": "scripts/s.py", "streaming": True},
            "first": {"type": "tool", "tool": "fake.Echo", "inputs": {"value": {"$ref": "s"}}},
            "last": {"type": "tool", "tool": consumer} | ({"inputs": {"value": 1}} if consumer == "fake.Echo" else {}),
        }
        edges = [("START", "s"), ("START", "first"), ("first", "last"), ("last", "done")]
        graph = compile_fake(fake_workflow(nodes, edges), hold, free, canonical={"scripts/s.py": file})
        result = run_graph(graph, RunSetup(cell=world))
        assert result.status == ("success" if consumer == "fake.Echo" else "failure"), result.error
        return world

    return go


@pytest.mark.parametrize("consumer", ["fake.Echo", "fake.Fail"])
def test_what_a_stream_holds_is_free_when_its_subgraph_is_left(run, consumer):
    run(CLOSES, consumer)
    assert not HELD


def test_outside_cleanup_a_stopped_stream_may_call_nothing(run):
    run(FORGETS)
    assert HELD


def test_a_stopped_stream_may_move_nothing_even_while_it_closes(run):
    world = run(MOVES)
    assert HELD and world.time == 0


def test_what_was_taken_from_the_observation_stream_is_known_to_the_episodes_tools():
    known = []

    @tool("fake.Looks")
    def looks(ctx: ToolContext, frame: Any) -> None:
        """Is handed a frame of the stream."""
        known.append((frame, list(ctx.state[OBSERVED])))

    node = {"type": "tool", "tool": "fake.Looks", "inputs": {"frame": {"$ref": "in.observation_stream"}}}
    result = run_fake(fake_workflow({"a": node}, [("START", "a"), ("a", "done")]), looks, cell=FakeCell())
    assert result.status == "success", result.error
    frame, taken = known[0]
    assert taken == [frame]
