"""Evaluates a bundle: rolls it out on sampled instances and returns what happened, without touching any run's folder.

Refinement calls this for many candidate bundles in one process; `gap rehearse` calls it once and writes it down.
"""

from __future__ import annotations

import tempfile
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

from gap_cli.rehearse.pool import LocalEngine
from gap_cli.rehearse.prepare import describe, prepare
from gap_cli.rehearse.rows import WORKER_LOST
from gap_cli.rehearse.stats import spread
from gap_cli.rehearse.summary import summarize
from gap_cli.workspace.canonical import json_line, write_yaml
from gap_cli.workspace.inventory import Inventory
from gap_runtime.bundle.bundle import GraphBundle
from gap_runtime.contracts.engine import Engine, EpisodeResult, RehearsalJob
from gap_runtime.errors import GapError, UnknownNameError

LOCAL = "local"
Record = Literal["failed", "all", "none"]
Progress = Callable[[EpisodeResult], None]
Say = Callable[[str], None]


@dataclass(frozen=True)
class Evaluation:
    """What the episodes of a bundle say. `rows` are their canonical rows by seed, `timings` what the machine's clock
    had a part in, row by row; `summary` is the content of summary.json, a function of rows, bundle and lock alone.
    `interrupted` is True where `stop` was set; `not_reproduced` are seeds that ended otherwise when
    they were rolled out again to be recorded."""

    rows: Sequence[Mapping[str, Any]]
    timings: Sequence[Mapping[str, Any]]
    summary: Mapping[str, Any]
    interrupted: bool = False
    not_reproduced: Sequence[int] = field(default=())

    @property
    def clock(self) -> dict[str, dict[str, float | None]]:
        """Durations that depend on this machine [s]: `cycle_s` = motion in the simulator + measured compute, and its
        parts, of successes; `wall_s` per episode, of all."""
        won = [timing for row, timing in zip(self.rows, self.timings, strict=True) if row["success"]]
        of = {"cycle_s": won, "motion_s": won, "compute_s": won, "wall_s": self.timings}
        return {key: spread(t[key] for t in timings if key in t) for key, timings in of.items()}

    @property
    def measured(self) -> bool:
        """False where no episode says anything about the graph: all crashed, hung, diverged or were never set up."""
        return any(not row["void"] for row in self.rows)


def evaluate(
    bundle: GraphBundle,
    seeds: Sequence[int],
    engine: Engine,
    inventory: Inventory,
    *,
    lock: str = "",
    output: Path | None = None,
    record: Record = "none",
    progress: Progress = lambda result: None,
    say: Say = lambda text: None,
    stop: threading.Event | None = None,
) -> Evaluation:
    """Roll out one episode per seed on `engine`, of the task that `inventory` is for. The bundle need not be on disk.

    The same bundle, seeds, task and providers give the same rows and summary, whatever the engine's number of workers.
    `output` is a folder for pictures, recordings (`record`) and the logs of workers; without it there are none of them.
    `lock` is the digest of the lock file to name in the summary. Setting `stop` ends it early with what is finished.
    Raises what would fail every episode: a bundle that does not compile (`UnknownNameError`, `DocumentError`), one
    without goals (`RunError`), a task none of whose instances can be set up (`GapError`).
    """
    stop = stop or threading.Event()
    with tempfile.TemporaryDirectory(prefix="gap-bundle-") as scratch:
        folder = Path(scratch)  # workers read this copy, so that an edit made meanwhile changes no episode
        bundle.write(folder)
        write_yaml(folder / "run.yaml", inventory.config.model_dump(by_alias=True))
        prepared = prepare(bundle, folder, inventory)
        if prepared.graph.jailed:
            nodes = ", ".join(prepared.graph.jailed)
            say(f"These scripts are not those of the installed skills, so they run in the jail: {nodes}.")
        logs = folder / "output" if output is None else output.absolute()
        job = RehearsalJob(folder, logs, record=record == "all", frames=output is not None)
        results = _collect(engine, job, seeds, progress, stop)
        _require_instances(results)
        again = record == "failed" and output is not None
        not_reproduced = _record_failed(engine, job, results, stop, say) if again else []
        rows = [results[seed].row for seed in sorted(results)]
        summary = summarize(rows, describe(prepared, lock), seed=min(seeds), asked=len(seeds))
    timings = [results[seed].timing for seed in sorted(results)]
    return Evaluation(rows, timings, summary, stop.is_set(), not_reproduced)


def make_engine(inventory: Inventory, name: str = LOCAL, workers: int = 1) -> Engine:
    """The engine of that name; `local` is ours. Raises `UnknownNameError`."""
    registered = inventory.registry.engines
    if name == LOCAL and name not in registered:
        return LocalEngine(workers)
    if name not in registered:
        raise UnknownNameError("engine", name, [LOCAL, *registered])
    made: Engine = registered[name].value(workers)
    return made


def _collect(
    engine: Engine, job: RehearsalJob, seeds: Sequence[int], progress: Progress, stop: threading.Event
) -> dict[int, EpisodeResult]:
    """Every result by seed."""
    results: dict[int, EpisodeResult] = {}

    def report(result: EpisodeResult) -> None:
        results[result.seed] = result
        progress(result)

    engine.run(job, seeds, report, stop)
    return results


def _record_failed(
    engine: Engine, job: RehearsalJob, results: Mapping[int, EpisodeResult], stop: threading.Event, say: Say
) -> list[int]:
    """Roll the failed episodes out again with a recorder; returns the seeds that ended otherwise the second time.

    A worker that was lost, the first time or the second, says nothing about whether physics is deterministic.
    """
    rows = {seed: result.row for seed, result in sorted(results.items())}
    failed = [s for s, row in rows.items() if not row["success"] and row["status"] != "infeasible"]
    if not failed or stop.is_set():
        return []
    say(f"Recording {len(failed)} failed episodes.")
    again = _collect(engine, replace(job, record=True, frames=False), failed, lambda _: None, stop)
    lost = [s for s in sorted(again) if again[s].row["status"] in WORKER_LOST]
    if lost:
        say(f"Seeds {_listed(lost)} were lost while being recorded: {again[lost[0]].row['reason']}.")
    kept = [s for s in sorted(again) if s not in lost and results[s].row["status"] not in WORKER_LOST]
    differ = [s for s in kept if json_line(again[s].row) != json_line(results[s].row)]
    if differ:
        say(f"Seeds {_listed(differ)} ended otherwise when recorded: the rehearsal is not deterministic.")
    return differ


def _listed(seeds: Sequence[int]) -> str:
    return ", ".join(map(str, seeds))


def _require_instances(results: Mapping[int, EpisodeResult]) -> None:
    """When no instance could even be set up, that is an error of the task, not a rate of zero."""
    rows = [result.row for result in results.values()]
    if rows and all(row["status"] == "infeasible" for row in rows):
        raise GapError(rows[0]["reason"], hint="Widen the belief regions of the task, or choose another variant.")
