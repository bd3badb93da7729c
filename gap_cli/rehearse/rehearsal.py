"""A rehearsal: N instances rolled out, judged and written down, the failed ones recorded for a closer look."""

from __future__ import annotations

import shutil
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

from gap_cli.rehearse.feedback import feedback_text
from gap_cli.rehearse.interrupts import interruptible
from gap_cli.rehearse.pool import LocalEngine
from gap_cli.rehearse.prepare import Prepared, describe, prepare, require_valid
from gap_cli.rehearse.stats import quantile
from gap_cli.rehearse.summary import summarize
from gap_cli.sandbox import level
from gap_cli.workspace.canonical import json_line, json_text, jsonl_text, write_json
from gap_cli.workspace.metadata import note
from gap_cli.workspace.run import Run
from gap_cli.workspace.stages import write_stage
from gap_runtime.contracts.engine import Engine, EpisodeResult, RehearsalJob
from gap_runtime.errors import GapError, UnknownNameError

FOLDER = "rehearse/00"
LOCAL = "local"
KEEP = (".png", ".mcap", ".log", "timings.jsonl")
Record = Literal["failed", "all", "none"]
Progress = Callable[[EpisodeResult], None]


@dataclass(frozen=True)
class Summary:
    """What a rehearsal found. `data` is summary.json; `rows` the episodes by seed; `clock` what wall time had a part
    in (see `clock_summary`). `interrupted` is True where Ctrl-C cut it short."""

    folder: Path
    data: Mapping[str, Any]
    rows: Sequence[Mapping[str, Any]]
    clock: Mapping[str, Any]
    interrupted: bool = False


def rehearse(
    run: Run,
    n: int,
    seed: int | None = None,
    workers: int = 1,
    record: Record = "failed",
    *,
    engine: str = LOCAL,
    progress: Progress = lambda result: None,
    say: Callable[[str], None] = lambda text: None,
) -> Summary:
    """Roll out instances `seed` .. `seed + n - 1` (default: the run's base seed) and write `rehearse/00`.

    The files git sees depend on the graph, the instances and the lock alone, not on `workers` or the clock. Call it
    with the run held. Raises `RunError` where the graph is not validated, and what would fail every episode.
    """
    started = time.monotonic()
    prepared = prepare(run, require_valid(run))
    lock = run.path / "lock.json"
    write_json(lock, prepared.inventory.lock(level()))
    if prepared.graph.jailed:
        nodes = ", ".join(prepared.graph.jailed)
        say(f"These scripts are not those of the installed skills, so they run in the jail: {nodes}.")
    first = run.asked.seed if seed is None else seed
    output = run.folder(FOLDER)
    _clear(output)
    job = RehearsalJob(run.path.absolute(), prepared.file.absolute(), output.absolute(), record=record == "all")
    chosen = make_engine(prepared, engine, workers)
    with interruptible(say) as stop:
        results = collect(chosen, job, range(first, first + n), progress, stop)
        _raise_if_hopeless(results)
        odd = record_failed(chosen, job, results, stop, say) if record == "failed" else []
    interrupted = stop.is_set()
    rows = [results[s].row for s in sorted(results)]
    timings = [dict(results[s].timing) for s in sorted(results)]
    data = summarize(rows, describe(prepared, lock), seed=first, asked=n)
    clock = {**clock_summary(rows, timings), "workers": workers, "engine": engine, "not_reproduced": odd}
    write_stage(
        run,
        FOLDER,
        {
            "timings.jsonl": jsonl_text(timings),
            "episodes.jsonl": jsonl_text(rows),
            "feedback.md": feedback_text(data, rows, _rationales(prepared)),
            "summary.json": json_text(data),
        },
        keep=KEEP,
    )
    note(run, "rehearse", started, **clock)
    return Summary(output, data, rows, clock, interrupted)


def collect(
    engine: Engine, job: RehearsalJob, seeds: Sequence[int], progress: Progress, stop: threading.Event
) -> dict[int, EpisodeResult]:
    """Every result by seed."""
    results: dict[int, EpisodeResult] = {}

    def report(result: EpisodeResult) -> None:
        results[result.seed] = result
        progress(result)

    engine.run(job, seeds, report, stop)
    return results


def record_failed(
    engine: Engine,
    job: RehearsalJob,
    results: Mapping[int, EpisodeResult],
    stop: threading.Event,
    say: Callable[[str], None],
) -> list[int]:
    """Roll the failed episodes out again with a recorder; returns the seeds that went another way the second time."""
    failed = [seed for seed, result in sorted(results.items()) if not result.row["success"]]
    if not failed or stop.is_set():
        return []
    say(f"Recording {len(failed)} failed episodes.")
    again = collect(engine, replace(job, record=True, frames=False), failed, lambda _: None, stop)
    odd = [s for s in sorted(again) if json_line(again[s].row) != json_line(results[s].row)]
    if odd:
        say(f"Seeds {', '.join(map(str, odd))} went another way when recorded: the rehearsal is not deterministic.")
    return odd


def make_engine(prepared: Prepared, name: str, workers: int) -> Engine:
    """The engine of that name; `local` is ours. Raises `UnknownNameError`."""
    registered = prepared.inventory.registry.engines
    if name == LOCAL and name not in registered:
        return LocalEngine(workers)
    if name not in registered:
        raise UnknownNameError("engine", name, [LOCAL, *registered])
    made: Engine = registered[name].value(workers)
    return made


def clock_summary(rows: Sequence[Mapping[str, Any]], timings: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Durations that depend on this machine: cycle time = motion in the simulator + measured compute, of successes;
    wall time per episode, of all. Seconds."""
    won = [t for row, t in zip(rows, timings, strict=True) if row["success"]]

    def spread(key: str, of: Sequence[Mapping[str, Any]]) -> dict[str, float | None]:
        values = [t[key] for t in of if key in t]
        return {name: quantile(values, q) for name, q in (("median", 0.5), ("p90", 0.9), ("max", 1.0))}

    return {
        "cycle_s": spread("cycle_s", won),
        "motion_s": spread("motion_s", won),
        "compute_s": spread("compute_s", won),
        "wall_s": spread("wall_s", timings),
    }


def _raise_if_hopeless(results: Mapping[int, EpisodeResult]) -> None:
    """When no instance could even be set up, that is an error of the task, not a rate of zero."""
    rows = [result.row for result in results.values()]
    if rows and all(row["status"] == "infeasible" for row in rows):
        raise GapError(rows[0]["reason"], hint="Widen the belief regions of the task, or choose another variant.")


def _rationales(prepared: Prepared) -> dict[str, dict[str, str]]:
    return {name: {p.name: p.rationale for p in points} for name, points in prepared.checkpoints.items()}


def _clear(output: Path) -> None:
    """Pictures, recordings and logs of the rehearsal before this one would be taken for this one's."""
    shutil.rmtree(output / "frames", ignore_errors=True)
    for pattern in ("*.mcap", "*.mcap.part", "worker-*.log"):
        for path in output.glob(pattern):
            path.unlink(missing_ok=True)
