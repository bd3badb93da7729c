"""What may go wrong between branches, threads and the operator, one test or more for each of C1 to C20."""

from __future__ import annotations

import itertools
import multiprocessing
import os
import signal
import subprocess
import sys
import textwrap
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gap_runtime.contracts.failures import CancelledError, MotionError, ToolError
from gap_runtime.contracts.tool import ToolContext, tool
from gap_runtime.contracts.types import Observation, Trajectory
from gap_runtime.errors import ExecutionError
from gap_runtime.graph.model import Workflow
from gap_runtime.run.execute import RunSetup, run_graph
from gap_runtime.run.pool import Pool
from gap_runtime.safety.protective_stop import stop_arms
from gap_runtime.testing import FakeCell, compile_fake, fake_workflow, run_fake

SOON = {"grace_s": 0.05, "patience": 1.0}


def node(name, deadline_s=None, **inputs):
    made = {"type": "tool", "tool": f"fake.{name}", "inputs": inputs}
    return made if deadline_s is None else {**made, "deadline_s": deadline_s}


def fan(**nodes):
    """All nodes at once, then done."""
    edges = [("START", n) for n in nodes] + [(n, "done") for n in nodes]
    return fake_workflow(nodes, edges)


def chain(**nodes):
    names = ["START", *nodes, "done"]
    return fake_workflow(nodes, list(itertools.pairwise(names)))


def watched(workflow, *tools, **setup):
    seen = []
    return run_fake(workflow, *tools, observers=[seen.append], **setup), seen


def finished(seen):
    return [e.path.partition("/")[2] for e in seen if e.kind == "node_finished"]


class Busy:
    """Counts how many are inside at once."""

    def __init__(self):
        self.now = self.most = 0
        self.lock = threading.Lock()

    def __enter__(self):
        with self.lock:
            self.now += 1
            self.most = max(self.most, self.now)

    def __exit__(self, *_):
        with self.lock:
            self.now -= 1


# C1


def test_c1_two_nodes_that_would_hold_one_arm_are_refused_before_either_moves():
    world = FakeCell()
    result = run_fake(fan(a=node("Move"), b=node("Move")), cell=world)
    assert result.status == "failure"
    assert {e.code for e in result.causes} == {"lease"} and "arm:0" in result.error
    assert world.arms[0].commands == []


def test_c1_an_arm_named_at_run_time_is_refused_too():
    world = FakeCell(arms=2)
    w = fake_workflow(
        {"which": node("Echo", value=0), "a": node("Move", arm_id={"$ref": "which"}), "b": node("Move")},
        [("START", "which"), ("which", "a"), ("which", "b"), ("a", "done"), ("b", "done")],
    )
    result = run_fake(w, cell=world)
    assert result.causes[0].code == "lease" and len(world.arms[0].commands) == 1


# C2: see also test_in_flight


def test_c2_one_node_may_hold_arm_and_gripper_and_two_nodes_one_each():
    @tool("fake.Pick", effect="actuate", resources=("arm:0", "gripper:0"))
    def pick(ctx: ToolContext) -> None:
        """Uses both."""
        ctx.cell.arms[0].gripper.set_width(0.0)
        ctx.cell.arms[0].execute(Trajectory(np.array([0.0, 0.1]), np.zeros((2, 2))))

    world = FakeCell()
    assert run_fake(chain(a={"type": "tool", "tool": "fake.Pick"}), pick, cell=world).status == "success"
    assert run_fake(fan(a=node("Move"), b=node("Grip")), cell=world).status == "success"
    assert world.arms[0].commands == ["set_width", "execute", "execute", "set_width"]


def test_c2_a_tool_cannot_command_what_it_did_not_declare():
    @tool("fake.Sneak", effect="actuate", resources=("gripper:0",))
    def sneak(ctx: ToolContext) -> None:
        """Declares the gripper, moves the arm."""
        ctx.cell.arms[0].execute(Trajectory(np.array([0.0, 0.1]), np.zeros((2, 2))))

    world = FakeCell()
    result = run_fake(chain(a={"type": "tool", "tool": "fake.Sneak"}), sneak, cell=world)
    assert "commands arm:0 without holding it" in result.error and world.arms[0].commands == []


# C3: see also test_leases


def test_c3_claims_in_opposite_order_are_refused_not_deadlocked(tmp_path):
    source = "def run(ctx) -> None:\n    ctx.tool('fake.{0}')\n    ctx.tool('fake.{1}')\n"
    canonical = {}
    for name, order in (("a", ("Move", "Grip")), ("b", ("Grip", "Move"))):
        file = tmp_path / f"{name}.py"
        file.write_text(source.format(*order))
        canonical[f"scripts/{name}.py"] = file
    w = fan(a={"type": "script", "script": "scripts/a.py"}, b={"type": "script", "script": "scripts/b.py"})
    result = run_graph(compile_fake(w, canonical=canonical), RunSetup(cell=FakeCell()))
    assert result.failed_node == "main/b" and result.causes[0].code == "lease"


# C4


def _die(ctx):
    raise SystemExit(3)


def _spin(ctx):
    while True:
        ctx.raise_if_cancelled()
        time.sleep(0.001)


def _deaf(ctx):
    time.sleep(0.5)


def _fail(ctx):
    raise MotionError("stalled", "stuck")


@pytest.mark.parametrize("how", [_fail, _die, _spin, _deaf])
def test_c4_leases_return_however_a_node_ends(how):
    @tool("fake.Bad", effect="actuate", resources=("arm:0",))
    def bad(ctx: ToolContext) -> None:
        """Moves, then ends badly."""
        ctx.cell.arms[0].execute(Trajectory(np.array([0.0, 0.1]), np.zeros((2, 2))))
        how(ctx)

    world = FakeCell()
    w = fake_workflow(
        {"bad": {"type": "tool", "tool": "fake.Bad", "deadline_s": 0.15}}, [("START", "bad"), ("bad", "done")],
        recovery=[{"tool": "fake.Move"}],
    )  # fmt: skip
    result = run_fake(w, bad, cell=world, **SOON)
    assert result.status == "failure" and result.recovery_failures == []
    assert world.arms[0].commands == ["execute", "execute"]


# C5


def test_c5_nothing_follows_an_arm_that_does_not_confirm_its_stop(monkeypatch):
    monkeypatch.setattr("gap_runtime.safety.protective_stop.CONFIRM_S", 0.05)
    world = FakeCell()
    world.arms[0].deaf = True
    w = fake_workflow({"a": "fake.Fail"}, [("START", "a"), ("a", "done")], recovery=[{"tool": "fake.Move"}])
    result = run_fake(w, cell=world)
    assert result.status == "error" and "did not confirm its stop" in str(result.causes)
    assert world.arms[0].commands == []


def test_c5_the_arm_is_stopped_before_the_next_node_commands_it():
    world, log = FakeCell(), []
    arm = world.arms[0]
    stop, execute = arm.stop, arm.execute
    arm.stop = lambda: (log.append("stop"), stop())
    arm.execute = lambda *a, **k: (log.append("execute"), execute(*a, **k))
    w = fake_workflow(
        {"a": node("Move", 0.1, duration=50.0)}, [("START", "a"), ("a", "done")], recovery=[{"tool": "fake.Move"}]
    )
    world._pace = 1.0
    result = run_fake(w, cell=world, recovery_budget_s=5, **SOON)
    assert log[0] == "execute" and "stop" in log[1 : log.index("execute", 1)]
    assert result.causes[0].code == "deadline" and isinstance(result.causes[0].__cause__, MotionError)


# C6


def test_c6_a_failing_branch_cancels_its_siblings_and_stops_the_arm():
    world = FakeCell()
    result, seen = watched(fan(a=node("Spin"), b=node("Fail"), c=node("Spin"), d=node("Move")), cell=world)
    assert result.failed_node == "main/b" and len(result.failures) == 1
    cancelled = {e.path for e in seen if e.kind == "node_cancelled"}
    assert cancelled == {"main/a", "main/c", "main/d"}
    assert world.arms[0].stops and world.arms[0].commands == []


def test_c6_a_branch_that_has_not_begun_when_another_fails_never_does():
    began = []

    @tool("fake.Begin")
    def begin(n: int) -> None:
        """Notes that it began."""
        began.append(n)

    nodes = {f"n{i}": {"type": "tool", "tool": "fake.Begin", "inputs": {"n": i}} for i in range(5)}
    no_threads = Pool(max_threads=0)  # one after the other, on the graph's own
    assert run_fake(fan(a=node("Fail"), **nodes), begin, pool=no_threads).failed_node == "main/a"
    assert began == []


def test_c6_the_exception_of_every_branch_is_kept():
    gate = threading.Barrier(2)

    @tool("fake.Both")
    def both(text: str) -> None:
        """Fails when the other one does."""
        gate.wait(5)
        raise ToolError("both", text)

    w = fan(
        a={"type": "tool", "tool": "fake.Both", "inputs": {"text": "one"}},
        b={"type": "tool", "tool": "fake.Both", "inputs": {"text": "two"}},
    )
    result = run_fake(w, both)
    assert [(p, str(e)) for p, e in result.failures] == [("main/a", "one"), ("main/b", "two")]
    with pytest.raises(ExecutionError) as caught:
        result.raise_for_status()
    assert len(caught.value.causes) == 2


# C7


def test_c7_a_node_that_swallows_its_cancellation_does_not_count_as_finished():
    @tool("fake.Swallow")
    def swallow(ctx: ToolContext) -> int:
        """Goes on as if nothing had happened."""
        while True:
            try:
                ctx.raise_if_cancelled()
            except (CancelledError, ToolError):
                return 42

    result, seen = watched(chain(a={"type": "tool", "tool": "fake.Swallow", "deadline_s": 0.05}), swallow, **SOON)
    assert result.causes[0].code == "deadline" and "a" not in finished(seen)


@pytest.mark.parametrize("parallel", [False, True])
def test_c7_a_node_stuck_where_python_cannot_reach_it_is_left_behind(parallel):
    release = threading.Event()

    @tool("fake.Stuck")
    def stuck() -> int:
        """Stands in for a call into C that never returns."""
        release.wait(30)
        return 1

    stuck_node = {"type": "tool", "tool": "fake.Stuck", "deadline_s": 0.05}
    w = fan(a=stuck_node, b=node("Nothing")) if parallel else chain(a=stuck_node, b=node("Nothing"))
    pool = Pool()
    result = run_fake(w, stuck, pool=pool, cell=FakeCell(), **SOON)
    release.set()
    assert result.status == "failure" and result.failed_node == "main/a" and result.causes[0].code == "deadline"


def test_c7_a_stuck_node_costs_one_thread_not_the_pool():
    release = threading.Event()

    @tool("fake.Stuck")
    def stuck(n: int) -> int:
        """Never returns."""
        release.wait(30)
        return n

    pool = Pool(max_threads=2)
    nodes = {f"n{i}": {"type": "tool", "tool": "fake.Stuck", "deadline_s": 0.05, "inputs": {"n": i}} for i in range(4)}
    assert run_fake(fan(**nodes), stuck, pool=pool, **SOON).status == "failure"
    gate = threading.Barrier(2)

    @tool("fake.Meet")
    def meet() -> None:
        """Needs another thread to go on."""
        gate.wait(5)

    together = {"type": "tool", "tool": "fake.Meet"}
    done = run_fake(fan(a=together, b=together), meet, pool=pool)
    release.set()
    assert done.status == "success"


def test_c7_a_call_over_a_pipe_that_never_answers_is_left_behind():
    reader, writer = os.pipe()

    @tool("fake.Rpc")
    def rpc() -> None:
        """Waits for an answer that does not come."""
        os.read(reader, 1)

    result = run_fake(chain(a={"type": "tool", "tool": "fake.Rpc", "deadline_s": 0.05}), rpc, **SOON)
    os.write(writer, b"x")
    assert result.causes[0].code == "deadline"


# C8


def test_c8_the_late_result_of_an_abandoned_attempt_changes_nothing():
    release, returned, refused = threading.Event(), threading.Event(), []

    @tool("fake.Late", effect="actuate", resources=("arm:0",))
    def late(ctx: ToolContext) -> int:
        """Comes back long after it was given up, and wants to move."""
        release.wait(30)
        try:
            ctx.cell.arms[0].execute(Trajectory(np.array([0.0, 0.1]), np.zeros((2, 2))))
        except ToolError as error:
            refused.append(error.code)
            returned.set()
            raise
        return 99

    world = FakeCell()
    w = chain(a={"type": "tool", "tool": "fake.Late", "deadline_s": 0.05}, b=node("Nothing"))
    result, seen = watched(w, late, cell=world, **SOON)
    release.set()
    assert returned.wait(5) and refused == ["deadline"]
    assert result.status == "failure" and world.arms[0].commands == []
    assert finished(seen) == [] and [e.seq for e in seen] == list(range(len(seen)))


def test_c8_a_thread_that_comes_back_while_the_graph_goes_on_without_it_touches_nothing():
    release, back = threading.Event(), threading.Event()
    runs = []

    @tool("fake.Late")
    def late() -> int:
        """Comes back when the next subgraph is under way."""
        release.wait(30)
        back.set()
        return 99

    @tool("fake.Next")
    def following(n: int) -> int:
        """Lets the late one come back, and gives it time to do harm."""
        runs.append(n)
        release.set()
        back.wait(5)
        time.sleep(0.05)
        return n

    stuck = {"type": "tool", "tool": "fake.Late", "deadline_s": 0.05}
    after = {f"m{i}": {"type": "tool", "tool": "fake.Next", "inputs": {"n": i}} for i in range(3)}
    data = chain(a=stuck, b=node("Nothing")).model_dump()
    data["subgraphs"]["main_sg"]["outputs"] = {"value": {"$ref": "a"}}
    data["subgraphs"]["next_sg"] = chain(**after).model_dump()["subgraphs"]["main_sg"]
    data["nodes"]["next"] = {"type": "subgraph", "ref": "next_sg"}
    routes = {"done": "success", "failed": "next"}, {"done": "success", "failed": "abort"}
    data["conditional_edges"] = {
        n: {"router_field": "exit", "mapping": m} for n, m in zip(("main", "next"), routes, strict=True)
    }
    result, seen = watched(Workflow.load(data, "two"), late, following, **SOON)
    assert result.status == "success" and result.exits == [("main", "failed"), ("next", "done")]
    assert runs == [0, 1, 2] and finished(seen) == ["m0", "m1", "m2", "done"]
    assert [e.seq for e in seen] == list(range(len(seen)))


# C9


def stream(**inputs):
    return {"type": "tool", "tool": "fake.Ticker", "streaming": True, "inputs": inputs}


def beside(producer, **consumers):
    """A streaming producer beside a chain of consumers."""
    names = ["START", *consumers, "done"]
    return fake_workflow({"s": producer, **consumers}, [("START", "s"), *itertools.pairwise(names)])


def test_c9_a_stream_that_never_ends_ends_with_its_subgraph():
    before = threading.active_count()
    result, seen = watched(beside(stream(), c=node("Echo", value={"$ref": "s"})))
    assert result.status == "success" and finished(seen) == ["c", "done", "s"]
    assert not any(t.name == "gap-main/s" and t.is_alive() for t in threading.enumerate())
    assert threading.active_count() <= before + 2


def test_c9_the_last_value_of_a_stream_that_ended_first_stays():
    w = beside(stream(items=3), wait=node("Spin", seconds=0.05), c=node("Echo", value={"$ref": "s"}))
    _, seen = watched(w)
    assert next(e.data["output"] for e in seen if e.kind == "node_finished" and e.path == "main/c") == 2


def test_c9_a_stream_without_items_is_an_error_for_its_reader():
    result = run_fake(beside(stream(items=0), c=node("Echo", value={"$ref": "s"})))
    assert result.failed_node == "main/c" and "published nothing" in result.error


def test_c9_a_stream_that_breaks_fails_its_subgraph_and_cancels_what_runs():
    @tool("fake.Broken", streaming=True)
    def broken(ctx: ToolContext) -> int:
        """Publishes nothing and breaks."""
        raise ToolError("lost", "the target is lost")

    w = beside({"type": "tool", "tool": "fake.Broken", "streaming": True}, c=node("Spin"))
    result = run_fake(w, broken)
    assert result.failed_node == "main/s" and "lost" in result.error


def test_c9_a_stream_that_breaks_later_cancels_what_runs_then():
    running = threading.Event()

    @tool("fake.Breaks", streaming=True)
    def breaks(ctx: ToolContext) -> int:
        """Breaks once its reader works."""
        running.wait(5)
        raise ToolError("lost", "the target is lost")

    @tool("fake.Works")
    def works(ctx: ToolContext) -> None:
        """Works until it is told to stop."""
        running.set()
        while True:
            ctx.raise_if_cancelled()
            time.sleep(0.001)

    w = beside({"type": "tool", "tool": "fake.Breaks", "streaming": True}, c={"type": "tool", "tool": "fake.Works"})
    result = run_fake(w, breaks, works)
    assert [path for path, _ in result.failures] == ["main/s"]


def test_c9_a_stream_deaf_to_its_end_is_left_behind_and_can_do_nothing_more(monkeypatch):
    monkeypatch.setattr("gap_runtime.run.streaming.ENDING_S", 0.05)
    release, outcome = threading.Event(), []

    @tool("fake.Deaf", streaming=True, effect="sense")
    def deaf(ctx: ToolContext) -> int:
        """Publishes, goes deaf, and wants to look and publish again much later."""
        yield 1
        release.wait(30)
        try:
            ctx.cell.observe()
        except CancelledError as error:
            outcome.append(error)
        yield 2
        outcome.append("went on")

    w = beside({"type": "tool", "tool": "fake.Deaf", "streaming": True}, c=node("Echo", value={"$ref": "s"}))
    result, seen = watched(w, deaf, cell=FakeCell())
    thread = next(t for t in threading.enumerate() if t.name == "gap-main/s")
    release.set()
    thread.join(5)
    assert result.status == "success" and [type(o) for o in outcome] == [CancelledError]
    assert [e.kind for e in seen if e.path == "main/s"] == ["node_started", "node_cancelled"]


def test_c9_a_consumer_that_dies_takes_the_stream_with_it():
    result = run_fake(beside(stream(), c=node("Fail")))
    assert result.failed_node == "main/c"
    assert not any(t.name == "gap-main/s" and t.is_alive() for t in threading.enumerate())


def test_c9_observations_are_a_stream_in_world_time():
    w = fake_workflow(
        {
            "a": node("Echo", value={"$ref": "in.observation_stream"}),
            "m": node("Move"),
            "b": node("Latest", obs={"$ref": "in.observation_stream"}),
        },
        [("START", "a"), ("a", "m"), ("m", "b"), ("b", "done")],
    )

    @tool("fake.Latest")
    def latest(obs: Observation) -> float:
        """When it was taken."""
        return obs.stamp

    world = FakeCell()
    result, seen = watched(w, latest, cell=world)
    assert result.status == "success", result.error
    stamp = next(e.data["output"] for e in seen if e.kind == "node_finished" and e.path == "main/b")
    assert 0.5 < stamp <= world.time
    assert world._listeners == {}


# C10: see test_schedules


# C11


def test_c11_branches_cannot_change_each_others_values():
    @tool("fake.Vandal")
    def vandal(value: list[Any], n: int) -> list[Any]:
        """Changes what it was given."""
        value.append(n)
        value[0][:] = n
        return value

    @tool("fake.Make")
    def make() -> list[Any]:
        """A list with an array in it."""
        return [np.zeros(3)]

    read = {"value": {"$ref": "make"}}
    w = fake_workflow(
        {"make": {"type": "tool", "tool": "fake.Make"},
         "a": {"type": "tool", "tool": "fake.Vandal", "inputs": {**read, "n": 1}},
         "b": node("Echo", **read)},
        [("START", "make"), ("make", "a"), ("make", "b"), ("a", "done"), ("b", "done")],
    )  # fmt: skip
    result, _ = watched(w, vandal, make)
    assert result.failed_node == "main/a" and "read-only" in result.error


def test_c11_a_list_is_each_readers_own():
    @tool("fake.Append")
    def append(value: list[Any], n: int) -> int:
        """Appends and counts."""
        value.append(n)
        return len(value)

    w = fake_workflow(
        {
            "make": node("Echo", value=[1, 2]),
            **{
                k: {"type": "tool", "tool": "fake.Append", "inputs": {"value": {"$ref": "make"}, "n": 3}} for k in "abc"
            },
        },
        [("START", "make"), *[("make", k) for k in "abc"], *[(k, "done") for k in "abc"]],
    )
    _, seen = watched(w, append)
    assert [
        e.data["output"] for e in seen if e.path in ("main/a", "main/b", "main/c") and e.kind == "node_finished"
    ] == [3, 3, 3]


# C12


def test_c12_when_the_graph_is_taken_over_finished_siblings_are_not_run_again():
    release = threading.Event()

    @tool("fake.Stuck")
    def stuck() -> None:
        """Never returns."""
        release.wait(30)

    counted = []

    @tool("fake.Once")
    def once(n: int) -> None:
        """Notes each call."""
        counted.append(n)

    nodes = {f"n{i}": {"type": "tool", "tool": "fake.Once", "inputs": {"n": i}} for i in range(3)}
    result = run_fake(fan(a={"type": "tool", "tool": "fake.Stuck", "deadline_s": 0.1}, **nodes), stuck, once, **SOON)
    release.set()
    assert result.status == "failure" and sorted(counted) == [0, 1, 2]


# C13


def test_c13_a_run_cancelled_before_it_starts_moves_nothing_but_its_recovery():
    world, cancel = FakeCell(), threading.Event()
    cancel.set()
    w = fake_workflow(
        {"s": node("Spin", seconds=1), "a": node("Move")},
        [("START", "s"), ("s", "a"), ("a", "done")],
        recovery=[{"tool": "fake.Grip"}],
    )
    result = run_fake(w, cell=world, cancel=cancel)
    assert (result.status, result.end) == ("cancelled", "abort") and world.arms[0].commands == ["set_width"]


def test_c13_cancelling_twice_from_other_threads_is_the_same_as_once():
    world, cancel = FakeCell(pace=1.0), threading.Event()
    w = chain(a=node("Move", duration=30.0))
    for _ in range(2):
        threading.Timer(0.1, cancel.set).start()
    result = run_fake(w, cell=world, cancel=cancel)
    assert result.status == "cancelled" and world.arms[0].stops and world.time < 29


def test_c13_one_ctrl_c_recovers_a_second_one_stops_the_recovery():
    world, presses = FakeCell(pace=1.0), []
    arm = world.arms[0]
    execute = arm.execute

    def interrupted(*args, **kwargs):
        presses.append(arm.commands[:])
        threading.Timer(0.05, os.kill, [os.getpid(), signal.SIGINT]).start()
        execute(*args, **kwargs)

    arm.execute = interrupted
    w = fake_workflow(
        {"a": node("Move", duration=30.0)},
        [("START", "a"), ("a", "done")],
        recovery=[{"tool": "fake.Move", "inputs": {"duration": 30.0}}, {"tool": "fake.Grip"}],
    )
    result = run_fake(w, cell=world)
    assert result.status == "cancelled" and len(presses) == 2
    assert arm.commands == ["execute", "execute"] and world.time < 50


# C14


def test_c14_an_arm_whose_stop_raises_does_not_keep_the_other_from_stopping():
    world = FakeCell(arms=2)
    world.arms[0].stop_problem = RuntimeError("driver is gone")
    assert stop_arms(world) == ["arm 0 could not be stopped (driver is gone)"]
    assert world.arms[1].stops == 1
    result = run_fake(
        fake_workflow({"a": "fake.Fail"}, [("START", "a"), ("a", "done")], recovery=[{"tool": "fake.Move"}]),
        cell=world,
    )
    assert result.status == "error" and "by hand" in str(result.causes[-1])
    assert world.arms[1].stops == 2 and world.arms[0].commands == []


def test_c14_an_arm_that_cannot_be_stopped_is_not_recovered_when_time_is_up_either():
    world = FakeCell()
    world.arms[0].stop_problem = RuntimeError("driver is gone")
    w = fake_workflow(
        {"a": node("Move"), "b": node("Nothing")}, [("START", "a"), ("a", "b"), ("b", "done")],
        recovery=[{"tool": "fake.Move"}],
    )  # fmt: skip
    result = run_fake(w, cell=world, cell_budget_s=0.5)
    assert result.status == "error" and "by hand" in str(result.causes[-1])
    assert world.arms[0].commands == ["execute"]


# C16


def test_c16_a_recovery_that_fails_does_not_start_another():
    seen = []
    w = fake_workflow(
        {"a": "fake.Fail"}, [("START", "a"), ("a", "done")], recovery=[{"tool": "fake.Fail"}, {"tool": "fake.Fail"}]
    )
    result = run_fake(w, observers=[seen.append])
    assert len(result.recovery_failures) == 2
    assert [e.kind for e in seen].count("recovery_started") == 1


def test_c16_a_recovery_that_does_not_end_is_cut_by_its_own_budget():
    w = fake_workflow(
        {"a": "fake.Fail"}, [("START", "a"), ("a", "done")], recovery=[{"tool": "fake.Spin"}, {"tool": "fake.Grip"}]
    )
    world = FakeCell()
    result = run_fake(w, cell=world, recovery_budget_s=0.1, **SOON)
    assert result.status == "failure" and world.arms[0].commands == []


# C17


def test_c17_a_node_that_hogs_the_interpreter_cannot_silence_the_watchdog(tmp_path):
    program = f"""
    import re, sys
    from gap_runtime.contracts.tool import tool
    from gap_runtime.run.execute import RunSetup, run_graph
    from gap_runtime.safety.watchdog import Watchdog
    from gap_runtime.testing import compile_fake, fake_workflow

    @tool("fake.Hog")
    def hog() -> bool:
        "Holds the interpreter lock in C for minutes."
        return re.match("(a+)+$", "a" * 40 + "b") is not None

    stop = [sys.executable, "-c", "open({str(tmp_path / "stopped")!r}, 'w').close()"]
    w = fake_workflow({{"a": {{"type": "tool", "tool": "fake.Hog"}}}}, [("START", "a"), ("a", "done")])
    with Watchdog(silence_s=0.5, on_silence=stop) as watchdog:
        run_graph(compile_fake(w, hog), RunSetup(heartbeat=watchdog.beat))
    """
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(program)], timeout=60, capture_output=True, check=False
    )
    assert done.returncode == -signal.SIGKILL, done.stderr
    assert (tmp_path / "stopped").exists()


# Nothing piles up


def test_thousands_of_nodes_leave_no_thread_and_no_file_behind():
    nodes = {f"n{i:02d}": node("Count") for i in range(20)}
    parallel, serial = compile_fake(fan(**nodes)), compile_fake(chain(**nodes))
    w = beside(stream(), c=node("Echo", value={"$ref": "s"}))
    streaming, pool = compile_fake(w), Pool(4)

    def work(times):
        for _ in range(times):
            run_graph(parallel, RunSetup(pool=pool))
            run_graph(serial, RunSetup(cell=FakeCell()))
        run_graph(streaming, RunSetup())

    def held():
        return threading.active_count(), len(list(Path("/proc/self/fd").iterdir()))

    work(5)
    before = held()
    work(100)
    threads, files = held()
    assert threads <= before[0] + 4 and files <= before[1]


# C18


def test_c18_graphs_side_by_side_in_one_process_do_not_know_of_each_other():
    w = fake_workflow(
        {"n": "fake.Count", "m": node("Move"), "o": "fake.Count"},
        [("START", "n"), ("n", "m"), ("m", "o"), ("o", "done")],
        outputs={"count": {"$ref": "o"}, "time": {"$ref": "m"}},
    )
    graph = compile_fake(w)
    results = [None] * 8

    def one(i):
        seen = []
        run_graph(graph, RunSetup(cell=FakeCell(), seed=i), [seen.append])
        results[i] = [(e.seq, e.kind, e.path, e.cell_time, e.data.get("output"), e.data.get("attempt")) for e in seen]

    threads = [threading.Thread(target=one, args=(i,)) for i in range(8)]
    for t in threads:
        t.start()
    for t in threads:
        t.join()
    assert all(r == results[0] for r in results)
    counted = [e[4] for e in results[0] if e[1] == "node_finished" and e[2] in ("main/n", "main/o")]
    assert counted == [1, 2]


# C19


def _in_child(queue):
    gate = threading.Barrier(2)

    @tool("fake.Meet")
    def meet() -> None:
        """Needs a second thread, which did not come along from the parent."""
        gate.wait(5)

    together = {"type": "tool", "tool": "fake.Meet"}
    queue.put(run_fake(fan(a=together, b=together), meet).status)


def test_c19_a_process_forked_after_threads_ran_can_run_graphs():
    assert run_fake(fan(a=node("Spin", seconds=0.01), b=node("Spin", seconds=0.01))).status == "success"
    context = multiprocessing.get_context("fork")
    queue = context.Queue()
    child = context.Process(target=_in_child, args=(queue,))
    child.start()
    assert queue.get(timeout=20) == "success"
    child.join(10)
    assert child.exitcode == 0


# C20


def test_c20_observers_see_one_ordered_sequence_whatever_ran_in_parallel():
    inside, threads = Busy(), set()
    seqs = []

    def observer(event):
        with inside:
            threads.add(threading.get_ident())
            seqs.append(event.seq)

    run_fake(fan(**{f"n{i}": node("Spin", seconds=0.002) for i in range(20)}), observers=[observer])
    assert seqs == list(range(len(seqs))) and len(seqs) == 1 + 1 + 2 * 21 + 2
    assert inside.most == 1


def test_c20_an_observer_that_breaks_is_dropped_and_an_essential_one_ends_the_run():
    calls = []

    def broken(event):
        calls.append(event)
        raise RuntimeError("no")

    class Journal:
        essential = True

        def __call__(self, event):
            if event.kind == "node_started":
                raise OSError("disk full")

    w = fan(a=node("Move"))
    assert run_fake(w, observers=[broken], cell=FakeCell()).status == "success" and len(calls) == 1
    world = FakeCell()
    with pytest.raises(OSError, match="disk full"):
        run_fake(w, observers=[Journal()], cell=world)
    assert world.arms[0].commands == [] and world.arms[0].stops == 1
