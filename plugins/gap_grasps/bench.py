"""Measures grasp generation: grasps on things alone on the floor, executed in physics, by generator and by object."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from gap_cli.contracts.privilege import node_scope
from gap_cli.contracts.robot import RobotSpec
from gap_cli.contracts.task import Task
from gap_cli.contracts.tool import Tool
from gap_cli.contracts.types import Mask, Quaternion, Se3Pose, Vec3
from gap_cli.contracts.world import World
from gap_grasps.bench_objects import Subject, bench_task, place, subjects
from gap_grasps.bench_sight import cloud_of, handle_of, pixels
from gap_grasps.bench_try import GENERATORS, Cell, Ranked, Seen, attempt, by_graspgen

LIFTED = 0.10  # m a held object must have risen
MISPLACED, TURNED_DEG = 0.008, 8.0  # standard deviations [m] and [deg] of the hand's error while scores are calibrated
BINS = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)  # of scores, for calibration
WRIST = "wrist"
MakeWorld = Callable[[Task, str, Mapping[str, RobotSpec]], World]


def grasp_rows(
    task: Task,
    robots: Mapping[str, RobotSpec],
    tools: Mapping[str, Tool],
    seeds: Iterable[int],
    make_world: MakeWorld,
    *,
    names: Iterable[str] | None = None,
    generators: Iterable[str] = tuple(GENERATORS),
    calibrate: bool = False,
) -> Iterator[dict[str, Any]]:
    """One row per object, seed and generator: what was chosen, and whether it came up and stayed in the hand.

    `names` (default all) and `generators` choose what is measured. With `calibrate` grasps of any score are executed
    instead of the best, drawn evenly over the range of the scores, and the hand misses its place: what a score is worth
    shows where something can go wrong (Mahler et al. 2017 call it robustness).
    """
    everything, seeds = bench_task(task), tuple(seeds)
    for subject in subjects(everything):
        if names is not None and subject.name not in set(names):
            continue
        world = make_world(everything, subject.model, robots)
        try:
            for seed in seeds:
                for generator in generators:
                    yield _episode(Cell(world, everything, robots, tools, seed), subject, generator, calibrate)
        finally:
            world.close()


def _episode(cell: Cell, subject: Subject, generator: str, calibrate: bool) -> dict[str, Any]:
    cell.world.reset(place(cell.task, subject.model, cell.seed))
    with node_scope("bench/grasp"):
        seen = look(cell, handle_only=subject.handle_only)
        if calibrate:
            row = attempt(cell, seen, GENERATORS[generator], _evenly(cell.seed), _misplaced(cell.seed))
        else:
            row = attempt(cell, seen, GENERATORS[generator], lambda ranked: ranked)
    truth = cell.world.snapshot().body(subject.model)
    row |= {"lifted": truth.lifted(), "success": truth.lifted() > LIFTED and truth.is_grasped()}
    return {"object": subject.name, "seed": cell.seed, "generator": generator, **row}


def look(cell: Cell, *, handle_only: bool = False) -> Seen:
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
    return Seen(target, scene, observed.cameras[wrist], Mask(mask))


def _evenly(seed: int) -> Callable[[Ranked], Ranked]:
    """A score is drawn first, then the grasps come in the order of their distance from it."""

    def pick(ranked: Ranked) -> Ranked:
        wanted = np.random.default_rng(seed).uniform(0, max((s for _, s in ranked), default=1.0))
        return sorted(ranked, key=lambda item: abs(item[1] - wanted))

    return pick


def _misplaced(seed: int) -> Callable[[Se3Pose], Se3Pose]:
    """What a badly calibrated cell does: the hand arrives beside where it should, and turned."""
    rng = np.random.default_rng([seed, 1])
    x, y = rng.normal(0, MISPLACED, 2)
    turn = Rotation.from_euler("z", rng.normal(0, TURNED_DEG), degrees=True)

    def displace(pose: Se3Pose) -> Se3Pose:
        return Se3Pose(
            Vec3.of(pose.position.array + np.array([x, y, 0.0])), Quaternion.of(turn * pose.rotation.rotation)
        )

    return displace


def rates(rows: Iterable[Mapping[str, Any]], *by: str) -> list[dict[str, Any]]:
    """Success rate with its Wilson 95 % interval for each combination of the columns `by`."""
    from scipy.stats import binomtest

    groups: dict[tuple[Any, ...], list[bool]] = {}
    for row in rows:
        groups.setdefault(tuple(row[key] for key in by), []).append(bool(row["success"]))
    out = []
    for key, won in groups.items():
        interval = binomtest(sum(won), len(won)).proportion_ci(method="wilson")
        rate = {"n": len(won), "success": sum(won) / len(won), "low": float(interval.low), "high": float(interval.high)}
        out.append(dict(zip(by, key, strict=True)) | rate)
    return out


def calibration(rows: Iterable[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Success by score bin, of the rows in which a grasp was executed."""
    scored = [r for r in rows if r["score"] is not None]
    inner = np.array(BINS[1:-1])
    labels = [f"{a:.1f}-{b:.1f}" for a, b in pairwise(BINS)]
    binned = [{**r, "score_bin": labels[int(np.digitize(r["score"], inner))]} for r in scored]
    return sorted(rates(binned, "score_bin"), key=lambda row: row["score_bin"])


__all__ = ["by_graspgen", "calibration", "grasp_rows", "look", "rates"]
