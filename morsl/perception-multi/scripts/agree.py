"""Counts the opinions of three detectors on each camera, asks a model about lone ones, and merges the cameras in 3D."""

from __future__ import annotations

import re
from typing import Annotated, NamedTuple

import numpy as np

from gap_cli.contracts.failures import PerceptionError
from gap_cli.contracts.tool import ScriptContext
from gap_cli.contracts.types import WORLD, CameraObservation, Mask, ObjectMask, PointCloud

AGREEMENT_POINTS = 400  # per cloud; enough to tell clouds centimetres apart, few enough for all pairs
GRID = 0.002  # m: one point is kept per cell; finer than the depth, coarse enough for the noise filter to be quick


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
    rows = [f"{number}: {corners(o.mask)}" for number, o in enumerate(opinions, 1)]
    question = prompt.replace("{object_name}", object_name).replace("{boxes}", "\n".join(rows))
    answer = ctx.tool("vlm.Query", prompt=question, image=camera.rgb).text.strip().lower()
    number = re.fullmatch(r"(?:box |number )?(\d+)\W*", answer)
    return opinions[int(number[1]) - 1] if number is not None and 1 <= int(number[1]) <= len(opinions) else None


def overlap(a: Mask, b: Mask) -> float:
    """Intersection over union."""
    union = int((a.data | b.data).sum())
    return float((a.data & b.data).sum()) / union if union else 0.0


def corners(mask: Mask) -> str:
    """The mask's pixel rectangle, [x_min, y_min, x_max, y_max]."""
    rows, columns = np.nonzero(mask.data)
    if not len(rows):
        return "[0, 0, 0, 0]"
    return f"[{columns.min()}, {rows.min()}, {columns.max() + 1}, {rows.max() + 1}]"


def merge(views: list[View], agree_within: float) -> Agreed:
    """The view with most votes, joined by every other whose cloud touches it."""
    first = max(views, key=lambda v: (v.opinion.votes, v.opinion.score))
    together = [first, *(v for v in views if v is not first and gap(v.points, first.points) <= agree_within)]
    most = max(together, key=lambda v: len(v.points))
    cloud = thinned(np.concatenate([v.points for v in together]))
    return Agreed(PointCloud(cloud), most.opinion.mask, first.opinion.score)


def gap(a: np.ndarray, b: np.ndarray) -> float:
    """Smallest distance [m] between two clouds, on an even sample of each."""
    a, b = (points[:: len(points) // AGREEMENT_POINTS + 1] for points in (a, b))
    return float(np.linalg.norm(a[:, None] - b[None], axis=2).min())


def thinned(points: np.ndarray) -> np.ndarray:
    """The first point of every occupied grid cell."""
    _, first = np.unique(np.floor(points / GRID).astype(np.int64), axis=0, return_index=True)
    return points[np.sort(first)]
