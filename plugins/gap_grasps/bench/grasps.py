"""Measures grasp generation: grasps on things alone on the floor, executed in physics, by generator and by object."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from gap_grasps.bench.execution import GENERATORS, VOID, Ranked, SeenObject, attempt, execute, in_reach
from gap_grasps.bench.objects import Subject, place, rest, subjects
from gap_grasps.bench.perception import cloud_of, handle_of, pixels
from gap_grasps.bench.sampling import drawn_evenly, pool_of
from gap_grasps.pose_error import DECLARED
from gap_runtime.contracts.access import node_scope
from gap_runtime.contracts.bench import BenchContext, standalone
from gap_runtime.contracts.simulator import Instance
from gap_runtime.contracts.standalone import StandaloneContext
from gap_runtime.contracts.task import Task
from gap_runtime.contracts.types import Mask

LIFTED = 0.10  # m a held object must have risen
WRIST = "wrist"
Rank = Callable[[StandaloneContext, SeenObject], Ranked]


def grasp_rows(
    bench: BenchContext,
    task: Task,
    name: str,
    seeds: Iterable[int],
    *,
    generators: Iterable[str] = tuple(GENERATORS),
    draws: int = 0,
    pool: Rank = pool_of,
) -> Iterator[dict[str, Any]]:
    """Of one subject of a `bench_task`, per seed: a row per generator, its best grasp executed, then `draws` at most.

    Drawn grasps come from `pool`, evenly over the range of its scores, and the hand misses them by the declared error;
    their rows have "generator" `DRAWN`.
    """
    subject = next(s for s in subjects(task) if s.name == name)
    cell = standalone(bench, task, subject.model)
    try:
        for seed in seeds:
            scene = _SubjectScene(replace(cell, seed=seed, state={}, made={}), subject)
            yield from scene.best(generators)
            yield from scene.drawn(draws, pool)
    finally:
        cell.cell.close()


DRAWN = "drawn"


class _SubjectScene:
    """One object in one place: seen once, tried many times, each time from the same start."""

    def __init__(self, cell: StandaloneContext, subject: Subject) -> None:
        self._cell, self._subject = cell, subject
        self._start: Instance = place(cell.task, subject.model, cell.seed)
        self._about = {"object": subject.name, "seed": cell.seed, "rest": rest(cell.task, subject.model, cell.seed)}
        cell.cell.reset(self._start)
        with node_scope("bench/look"):
            self._seen = look(cell, handle_only=subject.handle_only)

    def best(self, generators: Iterable[str]) -> Iterator[dict[str, Any]]:
        """What each generator thinks best."""
        for generator in generators:
            self._cell.cell.reset(self._start)
            with node_scope("bench/grasp"):
                row = attempt(self._cell, self._seen, GENERATORS[generator])
            yield {**self._about, "generator": generator, **row, **self._judged(row)}

    def drawn(self, count: int, pool: Rank) -> Iterator[dict[str, Any]]:
        """Grasps of any score, by a hand that misses its place."""
        if not count:
            return
        rng = np.random.default_rng([self._cell.seed, 1])
        with node_scope("bench/grasp"):
            ranked = pool(self._cell, self._seen)
            reachable = drawn_evenly(ranked, count, rng, lambda pose: in_reach(self._cell, pose, self._seen.scene))
        for pose, score in reachable:
            self._cell.cell.reset(self._start)
            with node_scope("bench/grasp"):
                reason = execute(self._cell, DECLARED.drawn(pose, rng))
            row = {"score": score, "pose": pose, "reason": reason, "ms": None}
            row |= {"cell": self._cell, "seen": self._seen}
            yield {**self._about, "generator": DRAWN, **row, **self._judged(row)}

    def _judged(self, row: Mapping[str, Any]) -> dict[str, Any]:
        if row["reason"] == VOID:
            return {"lifted": None, "success": False}
        truth = self._cell.cell.snapshot().body(self._subject.model)
        return {"lifted": truth.lifted(), "success": truth.lifted() > LIFTED and truth.is_grasped()}


def look(cell: StandaloneContext, *, handle_only: bool = False) -> SeenObject:
    """Observe and segment, by depth alone."""
    observed = cell.tool("observation.GetObservation")
    masks = [pixels(cell, camera, observed.arm_states) for camera in observed.cameras]
    clouds = [cloud_of(c, m) for c, m in zip(observed.cameras, masks, strict=True)]
    target = scene = np.concatenate(clouds)
    wrist = next(i for i, camera in enumerate(observed.cameras) if camera.name == WRIST)
    mask = masks[wrist].data.copy()
    if handle_only:
        part = handle_of(scene)
        target = scene[part]
        mask[mask] = np.split(part, np.cumsum([len(c) for c in clouds])[:-1])[wrist]
    return SeenObject(target, scene, observed.cameras[wrist], Mask(mask))
