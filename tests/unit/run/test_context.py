"""What a running node may reach, and what is refused."""

from __future__ import annotations

import re
import threading
from pathlib import Path

import pytest

from gap_runtime.contracts.failures import PrivilegedReadError, UnknownNameError
from gap_runtime.contracts.tool import ToolContext, tool
from gap_runtime.run.execute import RunSetup, run_graph
from gap_runtime.run.services import SharedStore
from gap_runtime.testing import FAKE_ROBOT, FakeCell, compile_fake, fake_workflow, run_fake


@pytest.fixture
def run_script(tmp_path):
    """Run one trusted script as the only node of a graph."""

    def go(source, *tools, setup=None, **skill):
        file = tmp_path / "s.py"
        file.write_text("from gap_runtime.contracts.types import *\n" + source)
        w = fake_workflow({"s": {"type": "script", "script": "scripts/s.py"}}, [("START", "s"), ("s", "done")])
        graph = compile_fake(w, *tools, canonical={"scripts/s.py": Path(file)}, **skill)
        seen = []
        result = run_graph(graph, RunSetup(**{"cell": FakeCell(), **(setup or {})}), [seen.append])
        output = next((e.data["output"] for e in seen if e.kind == "node_finished" and e.path == "main/s"), None)
        return result, output, seen

    return go


def test_a_script_gets_named_results_and_bare_ones(run_script):
    _, output, _ = run_script(
        "def run(ctx) -> float:\n    return ctx.tool('fake.Add', a=1, b=2).total + ctx.tool('fake.Count')\n"
    )
    assert output == 4.0


def test_tool_calls_are_events_between_the_start_and_the_end_of_their_node(run_script):
    _, _, seen = run_script("def run(ctx) -> None:\n    ctx.tool('fake.Add', a=1)\n    ctx.tool('fake.Look')\n")
    kinds = [(e.kind, e.data.get("tool")) for e in seen if e.path == "main/s"]
    assert kinds == [
        ("node_started", None), ("tool_called", "fake.Add"), ("tool_returned", "fake.Add"),
        ("tool_called", "fake.Look"), ("tool_returned", "fake.Look"), ("node_finished", None),
    ]  # fmt: skip


@pytest.mark.parametrize(
    "call, says",
    [
        ("'fake.Add', a='x'", r"fake\.Add\.a: expected float"),
        ("'fake.Add'", r"needs the input 'a'"),
        ("'fake.Add', a=1, c=2", r"no input 'c'"),
        ("'fake.Add', a=float('nan')", r"not a finite"),
        ("'fake.Echo', value={'x': [1.0, float('inf')]}", r"value\.x\[1\] is not finite"),
        ("'fake.Nope'", r"Unknown tool 'fake.Nope'"),
    ],
)
def test_a_bad_call_is_refused_before_the_tool_sees_it(run_script, call, says):
    result, _, _ = run_script(f"def run(ctx) -> None:\n    ctx.tool({call})\n")
    assert result.status == "failure"
    assert re.search(says, str(result.causes[0]))


def test_a_tool_outside_the_skills_list_is_refused(run_script):
    result, _, _ = run_script("def run(ctx) -> None:\n    ctx.tool('fake.Move')\n", tools=["fake.Add"])
    assert result.causes[0].code == "allow_list" and "fake.Add" in str(result.causes[0])


def test_a_privileged_tool_is_refused_and_ends_the_run(run_script):
    @tool("fake.Truth", privileged=True)
    def truth(ctx: ToolContext) -> None:
        """Reads ground truth."""

    result, _, _ = run_script("def run(ctx) -> None:\n    ctx.tool('fake.Truth')\n", truth)
    assert result.status == "error" and isinstance(result.causes[0], PrivilegedReadError)


@pytest.mark.parametrize("read", ["snapshot()", "sample(1)", "reset(None)", "close()", "subscribe(print, 1.0)"])
def test_the_guard_bites_whatever_a_tool_tries(read):
    @tool("fake.Cheat", effect="sense")
    def cheat(ctx: ToolContext) -> None:
        """Wants what only the simulator knows."""
        eval(f"ctx.cell.{read}")

    world = FakeCell()
    result = run_fake(fake_workflow({"a": "fake.Cheat"}, [("START", "a"), ("a", "done")]), cheat, cell=world)
    assert result.status == "error" and isinstance(result.causes[0], PrivilegedReadError)
    assert not world.closed


def test_the_guard_bites_in_a_thread_of_the_tools_own():
    @tool("fake.Cheat", effect="sense")
    def cheat(ctx: ToolContext) -> None:
        """Tries from another thread, where no node is marked as running."""
        caught = []

        def read():
            try:
                ctx.cell.snapshot()
            except PrivilegedReadError as error:
                caught.append(error)

        thread = threading.Thread(target=read)
        thread.start()
        thread.join()
        raise caught[0]

    result = run_fake(fake_workflow({"a": "fake.Cheat"}, [("START", "a"), ("a", "done")]), cheat, cell=FakeCell())
    assert isinstance(result.causes[0], PrivilegedReadError)


def test_the_worlds_own_guard_bites_where_a_tool_holds_the_world_itself():
    world = FakeCell()

    @tool("fake.Smuggle")
    def smuggle() -> None:
        """Has the world from elsewhere."""
        world.snapshot()

    result = run_fake(fake_workflow({"a": "fake.Smuggle"}, [("START", "a"), ("a", "done")]), smuggle, cell=world)
    assert isinstance(result.causes[0], PrivilegedReadError) and "main/a" in str(result.causes[0])


def test_a_script_that_hides_what_it_calls_cannot_move_the_robot(run_script):
    world = FakeCell()
    source = "def run(ctx) -> None:\n    getattr(ctx, 'to' + 'ol')('fake.Move')\n"
    result, _, _ = run_script(source, setup={"cell": world})
    assert result.causes[0].code == "lease" and "Write the name out" in result.error and world.arms[0].commands == []


def test_an_observer_may_look_where_a_node_may_not():
    world, times = FakeCell(), []
    w = fake_workflow({"a": "fake.Move"}, [("START", "a"), ("a", "done")])
    run_fake(w, cell=world, observers=[lambda e: times.append(world.snapshot().time)])
    assert times[0] == 0.0 and times[-1] == world.time > 0


def test_the_context_knows_robot_seed_and_state():
    @tool("fake.Ask")
    def ask(ctx: ToolContext) -> str:
        """Says what it knows."""
        with pytest.raises(UnknownNameError):
            ctx.robot(7)
        return f"{ctx.robot().name} {ctx.seed} {sorted(ctx.state)}"

    w = fake_workflow({"a": "fake.Ask"}, [("START", "a"), ("a", "done")], outputs={"o": {"$ref": "a"}})
    seen = []
    run_fake(w, ask, cell=FakeCell(), seed=5, observers=[seen.append])
    assert seen[-2].data["outputs"]["o"] == f"{FAKE_ROBOT.name} 5 []"


def test_without_a_world_a_tool_that_needs_one_says_so():
    result = run_fake(fake_workflow({"a": "fake.Look"}, [("START", "a"), ("a", "done")]))
    assert result.causes[0].code == "no_cell"


def test_state_is_new_in_every_run():
    graph = compile_fake(
        fake_workflow({"a": "fake.Count"}, [("START", "a"), ("a", "done")], outputs={"n": {"$ref": "a"}})
    )
    for _ in range(2):
        seen = []
        run_graph(graph, RunSetup(), [seen.append])
        assert seen[-2].data["outputs"]["n"] == 1


def test_a_script_may_outlive_the_deadline_of_a_tool_it_called(run_script):
    @tool("fake.Slow", deadline_s=0.05)
    def slow(ctx: ToolContext) -> None:
        """Takes longer than it may."""
        threading.Event().wait(0.08)
        ctx.raise_if_cancelled()

    source = """
def run(ctx) -> str:
    try:
        ctx.tool('fake.Slow')
    except Exception as error:
        return error.code
    return 'finished'
"""
    result, output, _ = run_script(source, slow, setup={"patience": 1.0})
    assert (result.status, output) == ("success", "deadline")


def test_world_time_counts_against_a_deadline_however_fast_the_simulator_is():
    w = fake_workflow(
        {"a": {"type": "tool", "tool": "fake.Move", "deadline_s": 3.0, "inputs": {"duration": 4.0}}},
        [("START", "a"), ("a", "done")],
    )
    result = run_fake(w, cell=FakeCell())
    assert result.causes[0].code == "deadline"


def test_publishing_outside_a_streaming_node_is_refused(run_script):
    result, _, _ = run_script("def run(ctx) -> None:\n    ctx.publish(1)\n")
    assert "not a streaming node" in result.error


def test_a_streaming_script_publishes_its_latest_value(tmp_path):
    file = tmp_path / "s.py"
    file.write_text(
        "from typing import NamedTuple\nclass Out(NamedTuple):\n    n: int\n"
        "def run(ctx, start: int) -> Out:\n    i = start\n    while True:\n"
        "        ctx.raise_if_cancelled()\n        ctx.publish(Out(i))\n        i += 1\n"
    )
    w = fake_workflow(
        {
            "s": {"type": "script", "script": "scripts/s.py", "streaming": True, "inputs": {"start": 100}},
            "c": {"type": "tool", "tool": "fake.Echo", "inputs": {"value": {"$ref": "s.n"}}},
        },
        [("START", "s"), ("START", "c"), ("c", "done")],
        outputs={"n": {"$ref": "c"}},
    )
    seen = []
    run_graph(compile_fake(w, canonical={"scripts/s.py": file}), RunSetup(), [seen.append])
    assert seen[-2].data["outputs"]["n"] >= 100


def test_shared_things_are_made_once_however_many_ask_at_once():
    store, made = SharedStore(), []

    def make():
        made.append(1)
        return object()

    found = []
    threads = [threading.Thread(target=lambda: found.append(store.get("k", make))) for _ in range(8)]
    for t in threads:
        t.start()
    for t in threads:
        t.join()
    assert len(made) == 1 and len(set(map(id, found))) == 1
