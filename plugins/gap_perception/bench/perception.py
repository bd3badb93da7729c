"""Measures perception on random scenes: each object is looked for the way a skill does, and judged by the truth."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

from gap_catalogue.shared.frames import remember
from gap_perception.bench.scenes import LEVELS, Clutter, bench_task, sample_scene
from gap_perception.bench.truth import judge
from gap_perception.scene.analyse import library_of
from gap_runtime.contracts.access import node_scope
from gap_runtime.contracts.cell import Cell
from gap_runtime.contracts.failures import ToolError
from gap_runtime.contracts.snapshot import WorldSnapshot
from gap_runtime.contracts.standalone import StandaloneContext
from gap_runtime.contracts.task import Task
from gap_runtime.contracts.types import CameraObservation, Mask, OrientedBoundingBox

CLEAN = "clean"  # the sensor level of perfect cameras
Found = tuple[OrientedBoundingBox, Mask]
Perceive = Callable[[StandaloneContext, list[CameraObservation], str], Found]
Masks = Mapping[str, Mapping[str, Mask]]


class BenchWorld(Cell, Protocol):
    """A simulator that knows which pixels show what."""

    def true_masks(self) -> Masks:
        """By camera and object. Privileged."""


@dataclass(frozen=True)
class Search:
    """One object looked for in one scene: its `row` of the result, and what a picture of it needs."""

    row: dict[str, Any]
    frames: tuple[CameraObservation, ...]
    visible: Masks
    found: Found | None


@dataclass
class _Scene:
    """One scene as the robot sees it and as it is."""

    seed: int
    clutter: str
    present: tuple[str, ...]
    frames: tuple[CameraObservation, ...]
    truth: WorldSnapshot
    visible: Masks


def level_task(task: Task, level: str) -> Task:
    """The bench's task, with the sensors of one noise level declared in it; `CLEAN` for perfect ones."""
    sensors = task.sensors.model_copy(update={"use": {} if level == CLEAN else level})
    return bench_task(task).model_copy(update={"sensors": sensors})


def levels_of(task: Task) -> tuple[str, ...]:
    """The noise levels a task can be measured at: none, then each model it declares."""
    return (CLEAN, *task.sensors.models)


def measure(
    cell: StandaloneContext, perceive: Perceive, seeds: Iterable[int], clutters: tuple[Clutter, ...] = LEVELS
) -> Iterator[Search]:
    """Look for every object of the task in every scene, in it or not. Levels of clutter take turns; seeds name scenes.

    The cell's world is a `BenchWorld` of the bench's scene. `perceive` is a skill's way from frames to a box and a
    mask; it runs as a policy node and raises `ToolError` when it finds nothing.
    """
    library_of(cell)  # once per process, so no frame's time
    for seed in seeds:
        yield from _searches(cell, perceive, _arrange(cell, clutters[seed % len(clutters)], seed))


def _arrange(cell: StandaloneContext, clutter: Clutter, seed: int) -> _Scene:
    world: Any = cell.cell
    instance, present = sample_scene(cell.task, clutter, seed)
    world.reset(instance)
    observation = world.observe()
    cell.state.clear()
    remember(cell.state, observation)
    return _Scene(seed, clutter.name, present, observation.cameras, world.snapshot(), world.true_masks())


def _searches(cell: StandaloneContext, perceive: Perceive, scene: _Scene) -> Iterator[Search]:
    """The first search of a scene pays for looking at the frames and is the one that is timed; objects take turns."""
    names = list(cell.task.objects)
    turn = scene.seed % len(names)
    for name in names[turn:] + names[:turn]:
        with node_scope("bench/perceive"):
            started = time.process_time()
            try:
                found = perceive(cell, list(scene.frames), cell.task.objects[name].label)
            except ToolError:
                found = None
            spent = time.process_time() - started
        visible = {camera: masks for camera, masks in scene.visible.items() if name in scene.present}
        row = {
            "seed": scene.seed, "clutter": scene.clutter, "object": name, "present": name in scene.present,
            "ms": 1e3 * spent if name == names[turn] else None,
        }  # fmt: skip
        row |= judge(name, found, scene.truth, scene.present, [m[name].data for m in visible.values()])
        yield Search(row, scene.frames, scene.visible, found)
