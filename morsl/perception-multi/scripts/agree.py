"""Counts the opinions of three detectors on each camera, asks a model about lone ones, and merges the cameras in 3D."""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np

from gap_runtime.contracts.failures import PerceptionError
from gap_runtime.contracts.scripting import cloud_gap, named_index, numbered_question, thinned
from gap_runtime.contracts.tool import ScriptContext
from gap_runtime.contracts.types import WORLD, BoundingBox2D, CameraObservation, Mask, ObjectMask, PointCloud


class Agreed(NamedTuple):
    """The object: its points from the cameras that agree, the mask of the camera that saw most, how sure."""

    cloud: Annotated[PointCloud, WORLD]
    mask: Mask
    score: float


class Opinion(NamedTuple):
    """A mask, how sure its detector is, and how many detectors share it."""

    mask: Mask
    score: float
    votes: int


class View(NamedTuple):
    """An opinion back-projected."""

    opinion: Opinion
    points: np.ndarray  # (N, 3) [m], world


def run(
    ctx: ScriptContext,
    cameras: list[CameraObservation],
    object_name: str,
    prompt: str,
    box_masks: list[ObjectMask],
    box_scores: list[float],
    text_masks: list[ObjectMask],
    text_scores: list[float],
    point_masks: list[ObjectMask],
    point_scores: list[float],
    same_iou: float = 0.5,
    min_points: int = 60,
    agree_within: float = 0.05,
) -> Agreed:
    """Join the opinions. Raises `PerceptionError` (`not_found`) where nothing is agreed on or confirmed."""
    masks = [*box_masks, *text_masks, *point_masks]
    scores = [*box_scores, *text_scores, *point_scores]
    views: list[View] = []
    for index, camera in enumerate(cameras):
        here = [(m.mask, s) for m, s in zip(masks, scores, strict=True) if m.camera_index == index]
        opinion = decide(ctx, camera, group(here, same_iou), object_name, prompt)
        if opinion is not None:
            cloud = ctx.tool(
                "geometry_svc.MaskToWorldPoints",
                mask=opinion.mask,
                depth=camera.depth,
                intrinsics=camera.intrinsics,
                camera_pose=camera.pose,
            )
            if len(cloud.points) >= min_points:
                views.append(View(opinion, cloud.points))
    if not views:
        raise PerceptionError(
            "not_found",
            f"No two detectors agree on the {object_name} in any camera.",
            detail={"masks": len(masks), "cameras": [c.name for c in cameras]},
        )
    return merge(views, agree_within)


def group(masks: list[tuple[Mask, float]], same_iou: float) -> list[Opinion]:
    """Overlapping masks as one opinion with the surest of them, most votes first."""
    groups: list[list[tuple[Mask, float]]] = []
    for mask, score in sorted(masks, key=lambda m: -m[1]):
        mine = next((g for g in groups if overlap(g[0][0], mask) >= same_iou), None)
        if mine is None:
            groups.append([(mask, score)])
        else:
            mine.append((mask, score))
    opinions = [Opinion(g[0][0], g[0][1], len(g)) for g in groups]
    return sorted(opinions, key=lambda o: (-o.votes, -o.score))


def decide(
    ctx: ScriptContext, camera: CameraObservation, opinions: list[Opinion], object_name: str, prompt: str
) -> Opinion | None:
    """The opinion two detectors share; else the one the vision-language model confirms."""
    if not opinions:
        return None
    if opinions[0].votes > 1 and (len(opinions) == 1 or opinions[1].votes < opinions[0].votes):
        return opinions[0]
    question = numbered_question(prompt, object_name, [bounds(o.mask) for o in opinions])
    named = named_index(ctx.tool("vlm.Query", prompt=question, image=camera.rgb).text, len(opinions))
    return None if named is None else opinions[named]


def overlap(a: Mask, b: Mask) -> float:
    """Intersection over union."""
    union = int((a.data | b.data).sum())
    return float((a.data & b.data).sum()) / union if union else 0.0


def bounds(mask: Mask) -> BoundingBox2D:
    """The mask's pixel rectangle; without area for an empty one."""
    rows, columns = np.nonzero(mask.data)
    if not len(rows):
        return BoundingBox2D(0.0, 0.0, 0.0, 0.0)
    return BoundingBox2D(float(columns.min()), float(rows.min()), columns.max() + 1.0, rows.max() + 1.0)


def merge(views: list[View], agree_within: float) -> Agreed:
    """The view with most votes, joined by every other whose cloud touches it."""
    first = max(views, key=lambda v: (v.opinion.votes, v.opinion.score))
    together = [first, *(v for v in views if v is not first and cloud_gap(v.points, first.points) <= agree_within)]
    most = max(together, key=lambda v: len(v.points))
    cloud = thinned(np.concatenate([v.points for v in together]))
    return Agreed(PointCloud(cloud), most.opinion.mask, first.opinion.score)
