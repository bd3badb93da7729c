"""From one observation to its instances and their masks in every camera; worked out once per observation."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from gap_catalogue.shared.frames import SeenObservation
from gap_perception.language.vocabulary import Vocabulary, build_vocabulary
from gap_perception.scene.colours import colour_words, perceptual
from gap_perception.scene.instance_assignment import ObjectInstance, assign_instances
from gap_perception.scene.library import SurfaceModel, build_library
from gap_perception.scene.observed_points import GRID_TOLERANCE, ObservedPoints, surface_tolerance
from gap_perception.scene.points import CameraPoints, lift
from gap_perception.scene.selfmask import MARGIN, link_shapes, on_robot, robot_model
from gap_perception.scene.visibility import depth_view
from gap_perception.scene.voxel_clusters import Voxels, voxelise
from gap_runtime.contracts.task import Task
from gap_runtime.contracts.tool import ToolContext
from gap_runtime.contracts.types import ArmState, Array

MIN_PIXELS = 25  # an instance with fewer in a picture is not visible there


class Region(NamedTuple):
    """An instance in one picture: its boolean mask (H, W), its box (x_min, y_min, x_max, y_max; max exclusive) and its
    median depth [m]."""

    mask: Array
    box: tuple[int, int, int, int]
    depth: float


@dataclass(frozen=True)
class Analysis:
    """What an observation shows: `instances`, largest first, the `centers` and `sizes` (n, 3) of their points
    along the world's axes [m], and one label image (H, W) per camera with the instance's index, -1 elsewhere."""

    instances: tuple[ObjectInstance, ...]
    centers: Array
    sizes: Array
    labels: tuple[Array, ...]
    regions: tuple[tuple[Region | None, ...], ...]
    library: Mapping[str, SurfaceModel]

    def region(self, instance: int, camera: int) -> Region | None:
        """Where an instance shows in a camera's picture; None where it does not."""
        return self.regions[camera][instance]


def has_depth(scene: SeenObservation, camera: int) -> bool:
    """True when a remembered frame measured any distance at all."""
    with scene.lock:
        key = f"has_depth:{camera}"
        if key not in scene.derived:
            depth = scene.observation.cameras[camera].depth.data
            scene.derived[key] = bool((np.isfinite(depth) & (depth > 0)).any())
        return bool(scene.derived[key])


def library_of(ctx: ToolContext) -> Mapping[str, SurfaceModel]:
    """The looks of the task's object models, learned once per process."""
    library: Mapping[str, SurfaceModel] = ctx.shared(
        f"gap_perception.library:{_models_key(ctx.task)}", lambda: build_library(ctx.task, ctx.renderer)
    )
    return library


def vocabulary_of(ctx: ToolContext) -> Vocabulary:
    """The words for the task's object models, colours included, gathered once per process."""

    def make() -> Vocabulary:
        colours = {name: colour_words(surface.colours) for name, surface in library_of(ctx).items()}
        return build_vocabulary(ctx.task.objects, colours)

    vocabulary: Vocabulary = ctx.shared(f"gap_perception.language.vocabulary:{_models_key(ctx.task)}", make)
    return vocabulary


def _models_key(task: Task) -> str:
    described = repr([(name, model.model_dump_json()) for name, model in sorted(task.objects.items())])
    return hashlib.sha256(described.encode()).hexdigest()[:16]


def analyse(ctx: ToolContext, scene: SeenObservation) -> Analysis:
    """The analysis of a remembered observation; a second call returns the first one's result."""
    with scene.lock:
        if "analysis" not in scene.derived:
            scene.derived["analysis"] = _analyse(ctx, scene)
        result: Analysis = scene.derived["analysis"]
        return result


def _analyse(ctx: ToolContext, scene: SeenObservation) -> Analysis:
    library = library_of(ctx)
    cameras = scene.observation.cameras
    lifted = [lift(camera, ctx.task.environment) for camera in cameras]
    voxels = voxelise(np.concatenate([p.xyz for p in lifted]))
    measured = _measure(lifted, voxels)
    blur = measured.tolerance - GRID_TOLERANCE
    kept = np.flatnonzero(~_on_any_robot(ctx, scene.observation.arm_states, voxels.centers, MARGIN + blur))
    ctx.raise_if_cancelled()
    found = assign_instances(library, measured.select(kept), [depth_view(p.camera, blur) for p in lifted])
    label_of = np.full(len(voxels.centers), -1, dtype=np.int16)
    for index, instance in enumerate(found):
        label_of[kept[instance.voxels]] = index
    labels = _label_images(lifted, label_of[voxels.of_point])
    low, high = _extents(measured.points[kept], found)
    regions = tuple(_regions(image, c.depth.data, len(found)) for image, c in zip(labels, cameras, strict=True))
    return Analysis(tuple(found), (low + high) / 2, high - low, labels, regions, library)


def _extents(points: Array, found: Sequence[ObjectInstance]) -> tuple[Array, Array]:
    """Lowest and highest coordinates of each instance's points, each (n, 3) [m]."""
    low = np.array([points[i.voxels].min(axis=0) for i in found]).reshape(-1, 3)
    high = np.array([points[i.voxels].max(axis=0) for i in found]).reshape(-1, 3)
    return low, high


def _measure(lifted: Sequence[CameraPoints], voxels: Voxels) -> ObservedPoints:
    colours = np.concatenate([perceptual(p.camera.rgb.data[p.rows, p.columns]) for p in lifted])
    support = np.concatenate([p.support for p in lifted])

    def mean(values: Array) -> Array:
        return np.bincount(voxels.of_point, weights=values, minlength=len(voxels.counts)) / voxels.counts

    tolerance = max(surface_tolerance(p.noise, p.tilt) for p in lifted)
    return ObservedPoints(
        voxels.centers, np.column_stack([mean(colours[:, i]) for i in range(3)]), mean(support), tolerance
    )


def _label_images(lifted: Sequence[CameraPoints], labels: Array) -> tuple[Array, ...]:
    """Scatter the labels of all cameras' points, one after the other, back to their pixels."""
    images, start = [], 0
    for points in lifted:
        image = np.full(points.camera.depth.data.shape, -1, dtype=np.int16)
        stop = start + len(points.rows)
        image[points.rows, points.columns] = labels[start:stop]
        images.append(image)
        start = stop
    return tuple(images)


def _regions(labels: Array, depth: Array, count: int) -> tuple[Region | None, ...]:
    """Where each of `count` instances shows in a picture."""
    from scipy.ndimage import find_objects

    found: list[Region | None] = []
    for index, window in enumerate(find_objects(labels + 1, max_label=count)):
        inside = None if window is None else labels[window] == index
        if window is None or inside is None or np.count_nonzero(inside) < MIN_PIXELS:
            found.append(None)
            continue
        mask = np.zeros(labels.shape, dtype=bool)
        mask[window] = inside
        rows, columns = window
        box = (columns.start, rows.start, columns.stop, rows.stop)
        found.append(Region(mask, box, float(np.median(depth[window][inside]))))
    return tuple(found)


def _on_any_robot(ctx: ToolContext, states: Sequence[ArmState], points: Array, margin: float) -> Array:
    hit = np.zeros(len(points), dtype=bool)
    for state in states:
        spec = ctx.robot(state.arm_id)
        model = ctx.shared(f"gap_perception.robot:{spec.model_file}", robot_model(spec))
        hit |= on_robot(points, link_shapes(model, spec, state, ctx.task.robots[state.arm_id]), margin)
    return hit
