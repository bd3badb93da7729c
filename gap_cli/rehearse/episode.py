"""One episode: a world reset to an instance, the graph run to its end, the outcome judged, everything in one row."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

from gap_cli.rehearse.episode_monitor import EpisodeMonitor
from gap_cli.rehearse.judge import SequenceMonitor, judge
from gap_cli.rehearse.prepare import Prepared
from gap_cli.rehearse.rows import episode_row, void_episode
from gap_runtime.contracts.engine import EpisodeResult
from gap_runtime.contracts.failures import GapError, SimulationDivergedError, TaskInfeasibleError
from gap_runtime.contracts.simulator import Simulator
from gap_runtime.run.events import Observer
from gap_runtime.run.execute import RunResult, RunSetup, run_graph


def run_episode(
    prepared: Prepared,
    simulator: Simulator,
    setup: RunSetup,
    observers: Sequence[Observer] = (),
    on_reset: Callable[[], None] = lambda: None,
) -> tuple[EpisodeResult, bool]:
    """Roll out the seed of `setup`; the world is left at the episode's last instant.

    `on_reset` is called once the instance stands. The second value is whether the world can be trusted with another
    episode. A bug in the engine raises.
    """
    start = time.perf_counter()
    seed = setup.seed
    try:
        instance = simulator.sample(seed)
        simulator.reset(instance)
    except TaskInfeasibleError as error:
        return _lost(seed, "infeasible", error), True
    except SimulationDivergedError as error:
        return _lost(seed, "diverged", error), False
    began, reset_s = simulator.time, time.perf_counter() - start
    on_reset()
    monitor = EpisodeMonitor(simulator, prepared.graph, prepared.bundle.checkpoints, prepared.conditions.objects)
    sequence = SequenceMonitor(simulator, prepared.inventory.task.sequence)
    try:
        result = run_graph(prepared.graph, setup, [monitor, *observers])
        motion = simulator.time - began
        verdict = judge(simulator, prepared.conditions, sequence)
        diverged = _divergence(result)
    except SimulationDivergedError as error:
        diverged = error
    finally:
        sequence.stop()
    if diverged is not None:
        return _lost(seed, "diverged", diverged), False
    row = episode_row(instance, result, monitor, verdict, motion)
    timing = {
        "seed": seed, "wall_s": time.perf_counter() - start, "reset_s": reset_s, "motion_s": motion,
        "compute_s": result.compute_s, "cycle_s": motion + result.compute_s, "nodes": monitor.computed,
    }  # fmt: skip
    return EpisodeResult(seed, row, timing), True


def _divergence(result: RunResult) -> SimulationDivergedError | None:
    return next((e for _, e in result.failures if isinstance(e, SimulationDivergedError)), None)


def _lost(seed: int, status: str, error: GapError) -> EpisodeResult:
    return EpisodeResult(seed, void_episode(seed, status, str(error)), {"seed": seed})
