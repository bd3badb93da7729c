"""Runs a graph a single time, in the simulator or dry, and keeps what happened for `gap view`."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from gap_cli.rehearse.prepare import Prepared, compile_bundle, prepare
from gap_cli.render.timeline import STAGE, TRACE, Tracer
from gap_cli.sandbox import level
from gap_cli.workspace.canonical import json_text, jsonl_text
from gap_cli.workspace.inventory import Inventory
from gap_cli.workspace.metadata import record_stage
from gap_cli.workspace.run import Run
from gap_cli.workspace.stages import product, write_stage
from gap_cli.workspace.validation import require_valid
from gap_runtime.bundle.bundle import GraphBundle
from gap_runtime.graph.compiled import CompiledGraph
from gap_runtime.run.dry import dry as make_dry
from gap_runtime.run.events import Observer
from gap_runtime.run.execute import RunResult, RunSetup, run_graph
from gap_runtime.run.substitute import load_substitutions, substitute

VIDEO = "video.webm"
SCHEMA = "gap/result/v1"


@dataclass(frozen=True)
class RunOutcome:
    """How the run ended. `data` is result.json; `success` what the graph claims, and, in a simulator, what is true."""

    data: dict[str, Any]
    folder: Path

    @property
    def success(self) -> bool:
        """True when the graph reached success and, where there was a simulator, the task's conditions hold."""
        return bool(self.data["success"])

    @property
    def cancelled(self) -> bool:
        """True when it was interrupted."""
        return bool(self.data["status"] == "cancelled")


def run_once(
    run: Run,
    *,
    seed: int | None = None,
    dry: bool = False,
    rules: Path | None = None,
    video: bool = False,
    observers: Sequence[Observer] = (),
) -> RunOutcome:
    """Run the graph once and write `run/` (result, trace, video). Raises `RunError`, `DocumentError`, ...

    A dry run needs no valid graph, no world and no jail. `rules` is a file of substitutions; they apply to a dry run
    too.
    """
    start = time.monotonic()
    inventory = Inventory.of(run.config)
    chosen = run.config.seed if seed is None else seed
    if dry:
        product(run, "generate")
        bundle = GraphBundle.load(run.graph_folder)
        graph = make_dry(compile_bundle(bundle, run.graph_folder, inventory), seed=chosen)
    else:
        bundle = require_valid(run, inventory, inventory.lock(level()))
        prepared = prepare(bundle, run.graph_folder, inventory)
        graph = prepared.graph
    if rules is not None:
        graph = substitute(graph, load_substitutions(rules).rules, str(rules))
    tracer = Tracer()
    folder = run.folder(STAGE)
    ended = (
        _dry(graph, chosen, [tracer, *observers])
        if dry
        else _simulated(replace(prepared, graph=graph), chosen, [tracer, *observers], folder if video else None)
    )
    film = ended.pop("film", None)
    data = {"schema": SCHEMA, "dry": dry, "seed": chosen, "substituted": rules is not None, **ended}
    header = {**tracer.rows[0], "dry": dry, "seed": chosen, **({"film": film} if film else {})}
    files = {"result.json": json_text(data), TRACE: jsonl_text([header, *tracer.rows[1:]])}
    write_stage(run, STAGE, files, keep=(VIDEO,) if film else ())
    record_stage(run, STAGE, start)
    return RunOutcome(data, folder)


def _dry(graph: CompiledGraph, seed: int, observers: Sequence[Observer]) -> dict[str, Any]:
    result = run_graph(graph, RunSetup(seed=seed), observers)
    return {"success": result.status == "success", **_ending(result)}


def _ending(result: RunResult) -> dict[str, Any]:
    return {
        "status": result.status,
        "end": result.end,
        "error": result.error,
        "failed_node": result.failed_node,
        "exits": [list(e) for e in result.exits],
        "recovery_failures": [[path, str(error)] for path, error in result.recovery_failures],
    }


def _simulated(
    prepared: Prepared, seed: int, observers: Sequence[Observer], film_folder: Path | None
) -> dict[str, Any]:
    from gap_cli.rehearse.episode import run_episode
    from gap_cli.rehearse.episode_runner import make_setup, make_simulator, open_jail
    from gap_cli.rehearse.recording.pictures import VideoRecorder

    simulator = make_simulator(prepared)
    film = None if film_folder is None else VideoRecorder(simulator, film_folder / VIDEO)
    try:
        setup = make_setup(prepared, simulator, seed, open_jail(prepared))
        episode, _ = run_episode(prepared, simulator, setup, observers, film.start if film else lambda: None)
    finally:
        made = film.stop() if film else None
        simulator.close()
    row = {key: value for key, value in episode.row.items() if key not in ("schema", "seed")}
    return {**row, "film": {"video": VIDEO, "began": film.began} if film and made else None}
