"""Runs a compiled graph: `run_graph(graph, setup, observers)`."""

from __future__ import annotations

import random
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from gap_runtime.contracts.cell import Cell
from gap_runtime.contracts.failures import GapError
from gap_runtime.contracts.robot import RobotSpec
from gap_runtime.contracts.task import Task
from gap_runtime.contracts.task.rendering import ObjectRenderer
from gap_runtime.errors import ExecutionError
from gap_runtime.graph.compiled import CompiledGraph
from gap_runtime.run.events import Emitter, Observer
from gap_runtime.run.graph_run import CheckpointEvaluator, GraphRun, Outcome, Status
from gap_runtime.run.pool import Pool, shared_pool
from gap_runtime.run.scheduler import Scheduler
from gap_runtime.run.services import SHARED, ScriptRunner, Services, SharedStore
from gap_runtime.run.supervise import GRACE_S, Supervisor

SIMULATED_PATIENCE = 20.0


@dataclass(frozen=True)
class RunSetup:
    """Everything a run needs beside the graph.

    robots             by arm_id; default: what the cell's arms say they are.
    renderer           renders object models, for tools that learn from them.
    script_runner      runs inline scripts (the jail); without one a graph that has any is refused.
    cancel             set it from anywhere to stop the run.
    budget_s           wall time the whole run may take; recovery_budget_s: each recovery.
    cell_budget_s     cell time the whole run may take.
    patience           how many wall seconds a node gets per second of its deadline. Cell time is always held to the
                       deadline itself. Default: 1 for a cell with `real_time` and for none, else 20, because
                       a simulator on a busy machine is slow without the robot being late.
    grace_s            how long a node that was told to stop may take before its thread is abandoned.
    lockstep           let siblings before a failed node (in order) finish, and cell time wait for streaming nodes, so
                       that neither failures nor what is published depend on timing; what rehearsals need.
    checkpoints        evaluates a subgraph's `validate` checkpoints at its exit; needed where the workflow's meta
                       says validate_checkpoints.
    heartbeat          called about 50 times a second while the run is supervised, for a watchdog outside.
    shuffle            permutes the order in which parallel branches start; a test's tool.
    """

    cell: Cell | None = None
    task: Task | None = None
    robots: tuple[RobotSpec, ...] = ()
    seed: int = 0
    script_runner: ScriptRunner | None = None
    cancel: threading.Event | None = None
    budget_s: float | None = None
    recovery_budget_s: float = 60.0
    cell_budget_s: float | None = None
    patience: float | None = None
    grace_s: float = GRACE_S
    lockstep: bool = False
    checkpoints: CheckpointEvaluator | None = None
    shared: SharedStore = SHARED
    renderer: ObjectRenderer | None = None
    pool: Pool | None = None
    heartbeat: Callable[[], None] | None = None
    shuffle: random.Random | None = None


@dataclass(frozen=True)
class RunResult:
    """How a run ended. `failure`: an end node with status failure was reached; `error`: no end could be.

    `exits` are (subgraph node, exit value) in order. `failures` are every (node path, exception) on the way, those that
    a fallback made good included; `recovery_failures` those of an end's recovery. `failed_node` and `error` say what
    ended the run, '' after a success.
    `compute_s` is wall time spent outside the cell, parallel branches counted once: what a robot would have waited.
    """

    status: Status
    end: str
    exits: list[tuple[str, str]]
    error: str
    failed_node: str
    visits: dict[str, int]
    failures: list[tuple[str, BaseException]]
    recovery_failures: list[tuple[str, BaseException]]
    compute_s: float

    @property
    def causes(self) -> tuple[BaseException, ...]:
        """The exception of every branch that failed."""
        return tuple(error for _, error in self.failures)

    def raise_for_status(self) -> None:
        """Raise `ExecutionError` with every cause unless the run was a success."""
        if self.status != "success":
            where = f" at {self.failed_node}" if self.failed_node else ""
            raise ExecutionError(f"The graph ended with {self.status}{where}: {self.error}", self.causes)


def run_graph(graph: CompiledGraph, setup: RunSetup, observers: Sequence[Observer] = ()) -> RunResult:
    """Run a graph to its end. Never raises for what a node does; `RunResult` says it.

    Raises `ExecutionError` before anything runs where the setup lacks what the graph needs, and what an `essential`
    observer raised. Observers are called on the thread that runs the graph, never on the caller's.
    """
    _require(graph, setup)
    cell = setup.cell
    emitter = Emitter(observers, cell)
    services = Services(
        graph.callees, cell, setup.task, setup.robots or _robots(cell), setup.seed, setup.script_runner,
        setup.shared, setup.renderer, _patience(setup), record_calls=bool(observers), lockstep=setup.lockstep,
    )  # fmt: skip
    checkpoints = setup.checkpoints if _enforces_checkpoints(graph) else None
    graph_run = GraphRun(graph, services, emitter, checkpoints)
    scheduler = Scheduler(
        graph_run, setup.pool or shared_pool(), lockstep=setup.lockstep, shuffle=setup.shuffle,
        cell_deadline=None if cell is None or setup.cell_budget_s is None else cell.time + setup.cell_budget_s,
    )  # fmt: skip
    emitter.emit("run_started", "", graph=graph.name, seed=setup.seed)
    Supervisor(
        scheduler, cancel=setup.cancel, budget_s=setup.budget_s, recovery_budget_s=setup.recovery_budget_s,
        grace_s=setup.grace_s, heartbeat=setup.heartbeat,
    ).run()  # fmt: skip
    _let_arms_finish(cell, graph_run.outcome)
    result = _result(graph_run.outcome)
    emitter.emit("run_finished", "", status=result.status, end=result.end, error=result.error)
    for error in emitter.essential_errors:
        raise error
    return result


def _let_arms_finish(cell: Cell | None, outcome: Outcome) -> None:
    """A motion that no node waited for is part of the run: its time counts, and a run that it fails is no success."""
    for arm in cell.arms if cell is not None and outcome.status == "success" else ():
        try:
            arm.finish()
        except GapError as error:
            outcome.record_failure("", error)
            outcome.status, outcome.failed_node, outcome.error = "error", "", str(error)


def _result(outcome: Outcome) -> RunResult:
    success = outcome.status == "success"
    error = "" if success else outcome.error
    if outcome.status == "failure" and not error and outcome.exits:
        error = f"{outcome.exits[-1][0]} exited by {outcome.exits[-1][1]!r}."
    return RunResult(
        outcome.status, outcome.end, outcome.exits, error, "" if success else outcome.failed_node, outcome.visits,
        outcome.failures, outcome.recovery_failures, outcome.compute_s,
    )  # fmt: skip


def _require(graph: CompiledGraph, setup: RunSetup) -> None:
    if graph.jailed and setup.script_runner is None:
        raise ExecutionError(
            f"{graph.jailed[0]} runs an inline script, and this run has no jail to run it in.", (),
            hint="gap run and gap rehearse set one up.",
        )  # fmt: skip
    if _enforces_checkpoints(graph) and setup.checkpoints is None:
        raise ExecutionError(
            "The workflow asks to enforce its checkpoints, and nothing here can evaluate them.", (),
            hint='Run it in a simulator, or drop meta.validate_checkpoints.',
        )  # fmt: skip


def _enforces_checkpoints(graph: CompiledGraph) -> bool:
    return not graph.dry and graph.workflow.meta.get("validate_checkpoints", "").lower() == "true"


def _robots(cell: Cell | None) -> tuple[RobotSpec, ...]:
    return () if cell is None else tuple(arm.spec for arm in cell.arms)


def _patience(setup: RunSetup) -> float:
    if setup.patience is not None:
        return setup.patience
    return 1.0 if setup.cell is None or setup.cell.real_time else SIMULATED_PATIENCE
