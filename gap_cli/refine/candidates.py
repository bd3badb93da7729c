"""Makes bundles of changed plans, and rolls them out once per instance: what was rolled out before is read back."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gap_cli.author.build import build
from gap_cli.author.plans import Plan, PlanData
from gap_cli.refine.statistics import Row
from gap_cli.rehearse.evaluate import evaluate
from gap_cli.workspace.atomic import replace_files
from gap_cli.workspace.canonical import json_text, jsonl_text, text_bytes
from gap_cli.workspace.inventory import Inventory
from gap_runtime.bundle.bundle import GOALS, WORKFLOW, GraphBundle
from gap_runtime.contracts.engine import Engine, EpisodeResult
from gap_runtime.graph.dump import dump_workflow

LEAK = 0.02  # m: a constant this near to a true pose of a tuning instance was read off the simulator


@dataclass
class Candidates:
    """Bundles of plans and their rows. `memory` keeps every finished episode by bundle and seed, so that a refinement
    that was killed goes on where it was, with the same rows."""

    inventory: Inventory
    engine: Engine
    memory: Path
    goals: str
    progress: Callable[[EpisodeResult], None] = lambda result: None
    used: int = 0  # episodes asked for, those that were remembered included

    def bundle(self, plan: PlanData) -> GraphBundle:
        """The graph of a plan, generated and validated. Raises `WorkflowError`, `SandboxError`, `DocumentError`."""
        inventory = self.inventory
        made = build(Plan.of(plan), inventory.task, inventory.library, inventory.tools)
        checkpoints = {f"checkpoints/{name}.py": text for name, text in made.checkpoints.items()}
        return GraphBundle(
            {WORKFLOW: json_text(dump_workflow(made.workflow)), GOALS: self.goals, **made.scripts, **checkpoints}
        )

    def rows(self, bundle: GraphBundle, seeds: Sequence[int]) -> dict[int, Row]:
        """The row of each seed. Raises what `evaluate` raises."""
        self.used += len(seeds)
        file = self.memory / f"{self.inventory.digest(bundle).sha256[:24]}.jsonl"
        known: dict[int, Row] = {}
        if file.is_file():
            known = {row["seed"]: row for row in map(json.loads, file.read_text(encoding="utf-8").splitlines())}
        missing = [seed for seed in seeds if seed not in known]
        if missing:
            found = evaluate(bundle, missing, self.engine, self.inventory, progress=self.progress)
            known |= {row["seed"]: row for row in found.rows}
            replace_files({file: text_bytes(jsonl_text([known[seed] for seed in sorted(known)]))})
        return {seed: known[seed] for seed in seeds}


def leaks(bundle: GraphBundle, incumbent: GraphBundle, rows: Iterable[Row]) -> list[str]:
    """Constants of `bundle`, not of the incumbent, that are where an object truly stood in one of `rows`: read off the
    simulator, they say nothing about another instance."""
    stood = np.array([pose[:3] for row in rows for pose in row.get("instance", {}).values() if isinstance(pose, list)])
    old = {value for _, value in _positions(incumbent)}
    new = [(where, value) for where, value in _positions(bundle) if value not in old]
    return [w for w, v in new if len(stood) and np.linalg.norm(stood - np.array(v), axis=1).min() < LEAK]


def _positions(bundle: GraphBundle) -> Iterator[tuple[str, tuple[float, ...]]]:
    """Every constant that could be a position [m]: three numbers in a row, or x, y and z, by where it is."""
    for name, definition in bundle.workflow.subgraphs.items():
        yield from _triples(f"{name}.parameters", definition.parameters)
        for node, content in definition.nodes.items():
            yield from _triples(f"{name}.{node}", content.inputs)


def _triples(where: str, data: Any) -> Iterator[tuple[str, tuple[float, ...]]]:
    if isinstance(data, Mapping):
        if {"x", "y", "z"} <= data.keys():
            yield where, tuple(float(data[k]) for k in "xyz")
        for key, value in data.items():
            yield from _triples(f"{where}.{key}", value)
    elif isinstance(data, list):
        if len(data) >= 3 and all(isinstance(v, int | float) for v in data):
            yield where, tuple(map(float, data[:3]))
        for i, value in enumerate(data):
            yield from _triples(f"{where}.{i}", value)
