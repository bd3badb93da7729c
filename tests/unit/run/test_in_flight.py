"""Nodes that command the cell at the same time: at once on a real clock, in turns on a stepped one."""

from __future__ import annotations

import random
import threading
import time
from itertools import pairwise

import numpy as np
import pytest

from gap_runtime.contracts.failures import MotionError
from gap_runtime.contracts.tool import ToolContext, tool
from gap_runtime.contracts.types import Trajectory
from gap_runtime.graph.model import Workflow
from gap_runtime.run.execute import RunSetup, run_graph
from gap_runtime.run.pool import Pool
from gap_runtime.testing import FakeCell, compile_fake, fake_workflow, run_fake

JITTER = random.Random()  # on purpose not seeded: real timing differs, the result must not
PACE = 0.05


def cell_of(clock, arms=2):
    return FakeCell(arms=arms) if clock == "stepped" else FakeCell(arms=arms, real_time=True, pace=PACE)


both_clocks = pytest.mark.parametrize("clock", ["stepped", "real"])


def move(arm_id, duration, to=1.0):
    return {"type": "tool", "tool": "test.Move", "inputs": {"arm_id": arm_id, "duration": duration, "to": to}}


@tool("test.Move", effect="actuate", resources=("arm:{arm_id}", "clock"), deadline_s=60.0)
def jittery_move(ctx: ToolContext, duration: float, arm_id: int = 0, to: float = 1.0) -> list[float]:
    """Thinks for an unforeseeable moment, moves, thinks, reads every arm, and says what it saw."""
    time.sleep(JITTER.choice((0, 0, 0.0002, 0.0005)))
    arm = ctx.cell.arms[arm_id]
    start = arm.state().joints.positions
    arm.execute(Trajectory(np.array([0.0, duration]), np.stack([start, np.full_like(start, to)])))
    time.sleep(JITTER.choice((0, 0, 0.0002, 0.0005)))
    return [float(a.state().joints.positions[0]) for a in ctx.cell.arms]


def branches(*chains, **workflow):
    """Chains of nodes side by side, then done."""
    nodes = {f"{'abcdef'[i]}{j}": n for i, chain in enumerate(chains) for j, n in enumerate(chain)}
    edges = []
    for i, chain in enumerate(chains):
        edges += pairwise(["START", *(f"{'abcdef'[i]}{j}" for j in range(len(chain))), "done"])
    return fake_workflow(nodes, edges, **workflow)


def run(workflow, cell, **setup):
    seen = []
    result = run_graph(compile_fake(workflow, jittery_move), RunSetup(cell=cell, **setup), [seen.append])
    return result, seen


@pytest.mark.parametrize(
    ("a", "b"), [([1.0], [2.0]), ([2.0], [1.0]), ([1.0, 3.0], [3.0, 1.0]), ([0.5, 0.5, 0.5], [1.6])]
)
def test_two_branches_take_as_long_as_the_longer_one(a, b):
    cell = FakeCell(arms=2)
    chains = [[move(i, d, to=float(k % 2)) for k, d in enumerate(durations)] for i, durations in enumerate((a, b))]
    assert run(branches(*chains), cell)[0].status == "success"
    assert max(sum(a), sum(b)) <= cell.time < max(sum(a), sum(b)) + 0.1


def test_on_a_real_clock_two_nodes_are_at_work_at_once():
    gate = threading.Barrier(3)

    @tool("test.Meet", effect="actuate", resources=("arm:{arm_id}", "clock"))
    def meet(ctx: ToolContext, arm_id: int) -> None:
        """Needs the others to be under way."""
        ctx.cell.wait(0.1)
        gate.wait(20)

    @tool("test.Think")
    def think() -> None:
        """Needs them too, and moves nothing."""
        gate.wait(20)

    chains = [[{"type": "tool", "tool": "test.Meet", "inputs": {"arm_id": i}}] for i in (0, 1)]
    w = branches(*chains, [{"type": "tool", "tool": "test.Think"}])
    assert run_fake(w, meet, think, cell=cell_of("real")).status == "success"


def test_a_stepped_cell_gives_one_result_under_a_thousand_schedules():
    w = branches(
        [move(0, 0.3), move(0, 0.2, 0.0)],
        [move(1, 0.2), {"type": "tool", "tool": "fake.Look"}, move(1, 0.1, 0.5)],
        [{"type": "tool", "tool": "fake.Add", "inputs": {"a": 1.0}}, move(2, 0.1), move(2, 0.34, 0.2)],
    )
    graph = compile_fake(w, jittery_move)

    def outcome(schedule):
        cell, seen, rng = FakeCell(arms=3), [], random.Random(schedule)
        setup = RunSetup(cell=cell, lockstep=True, shuffle=rng, pool=Pool(rng.randint(1, 4)))
        result = run_graph(graph, setup, [seen.append])
        assert result.status == "success"
        return cell.time, [(e.kind, e.path, e.cell_time, repr(e.data.get("output"))) for e in seen]

    first = outcome(0)
    for schedule in range(1, 1000):
        assert outcome(schedule) == first


def test_a_real_clock_gives_the_same_values_whatever_happens_first():
    w = branches([move(0, 0.1), move(0, 0.1, 0.0)], [move(1, 0.1), move(1, 0.1, 0.5)])
    graph = compile_fake(w, jittery_move)
    for _ in range(20):
        cell, seen = cell_of("real"), []
        assert run_graph(graph, RunSetup(cell=cell), [seen.append]).status == "success"
        ended = [e.path for e in seen if e.kind == "node_finished"]
        assert sorted(ended) == ["main/a0", "main/a1", "main/b0", "main/b1", "main/done"]
        assert ended.index("main/a0") < ended.index("main/a1") and ended[-1] == "main/done"
        np.testing.assert_allclose([a.state().joints.positions[0] for a in cell.arms], [0.0, 0.5])


def test_what_is_ready_at_an_instant_runs_before_time_passes():
    cell = FakeCell(arms=2)
    _, seen = run(branches([{"type": "tool", "tool": "fake.Look"}, move(0, 1.0)], [move(1, 1.0)]), cell)
    times = {e.path: e.cell_time for e in seen if e.kind == "node_started"}
    assert times["main/a1"] == times["main/b0"] == 0.0 and cell.time == pytest.approx(1.0, abs=0.1)


@tool("test.Bump", effect="actuate", resources=("arm:{arm_id}", "clock"), deadline_s=60.0)
def bump(ctx: ToolContext, arm_id: int) -> None:
    """Moves for a second and then touches something."""
    ctx.cell.wait(1.0)
    raise MotionError("contact", "touched")


BUMP = {"type": "tool", "tool": "test.Bump", "inputs": {"arm_id": 1}}


@both_clocks
def test_a_failing_arm_stops_the_other_at_once(clock):
    cell, seen = cell_of(clock), []
    began = cell.time
    w = branches([move(0, 30.0)], [BUMP], recovery=[{"tool": "fake.Grip"}])
    result = run_fake(w, jittery_move, bump, cell=cell, observers=[seen.append])
    assert result.status == "failure" and [p for p, _ in result.failures] == ["main/b0"]
    assert [e.path for e in seen if e.kind == "node_cancelled"] == ["main/a0"]
    assert cell.time - began < 10 and cell.arms[0].commands == ["execute", "set_width"]
    assert result.recovery_failures == []


def side_by_side(**subgraphs):
    """Two subgraphs at once; the first one's failure is made good by a third."""
    data = fake_workflow({"n": "fake.Nothing"}, [("START", "n"), ("n", "done")]).model_dump()
    inner = data["subgraphs"]["main_sg"]
    data["subgraphs"] = {}
    for name, node in {**subgraphs, "mend": {"type": "tool", "tool": "fake.Nothing"}}.items():
        data["nodes"][name] = {"type": "subgraph", "ref": f"{name}_sg"}
        data["subgraphs"][f"{name}_sg"] = {**inner, "nodes": {**inner["nodes"], "n": node}}
    del data["nodes"]["main"]
    data["edges"] = [("START", name) for name in subgraphs]
    first, *others = subgraphs
    routes = {first: "mend", **dict.fromkeys(others, "abort"), "mend": "abort"}
    data["conditional_edges"] = {
        name: {"router_field": "exit", "mapping": {"done": "success", "failed": to}} for name, to in routes.items()
    }
    return Workflow.load(data, "side by side")


@both_clocks
def test_a_failure_that_is_made_good_leaves_the_arm_of_another_subgraph_alone(clock):
    cell = cell_of(clock)
    result = run_fake(side_by_side(bad=BUMP, good=move(0, 2.0)), jittery_move, bump, cell=cell)
    assert result.status == "success", result.error
    assert sorted(result.exits) == [("bad", "failed"), ("good", "done"), ("mend", "done")]
    np.testing.assert_allclose(cell.arms[0].state().joints.positions, 1.0)


@both_clocks
def test_one_arm_in_two_branches_is_refused_before_either_moves(clock):
    cell = cell_of(clock)
    result, _ = run(branches([move(0, 1.0)], [move(0, 2.0)], [move(1, 1.0)]), cell)
    assert {e.code for e in result.causes} == {"lease"} and not any(arm.commands for arm in cell.arms)


@both_clocks
def test_a_run_that_is_cancelled_stops_both_arms(clock):
    cell, cancel = cell_of(clock), threading.Event()
    cell._pace = PACE
    threading.Timer(0.1, cancel.set).start()
    result, _ = run(branches([move(0, 50.0)], [move(1, 50.0)]), cell, cancel=cancel)
    assert result.status == "cancelled" and all(arm.stops for arm in cell.arms) and cell.time < 40


@both_clocks
def test_an_arm_that_hangs_does_not_keep_the_other_or_the_run(clock):
    release = threading.Event()

    @tool("test.Hang", effect="actuate", resources=("arm:1", "clock"), deadline_s=0.1)
    def hang(ctx: ToolContext) -> None:
        """Never comes back."""
        release.wait(30)

    cell = cell_of(clock)
    w = branches([move(0, 1.0)], [{"type": "tool", "tool": "test.Hang"}], recovery=[{"tool": "fake.Grip"}])
    result = run_fake(w, jittery_move, hang, cell=cell, grace_s=0.1, patience=1.0)
    release.set()
    assert result.status == "failure" and result.failed_node == "main/b0" and result.recovery_failures == []


def test_a_stepped_cell_without_a_shared_clock_is_commanded_one_node_at_a_time():
    cell = FakeCell(arms=2)
    clock = cell.clock
    del cell.clock
    cell.take = clock.run
    began = cell.time
    assert run(branches([move(0, 1.0)], [move(1, 2.0)]), cell)[0].status == "success"
    assert cell.time - began == pytest.approx(3.0, abs=0.1)
