"""Finds the next of several named objects that is not in the container yet, and the container."""

from __future__ import annotations

from typing import Annotated, Literal, NamedTuple

import numpy as np

from gap_runtime.contracts.failures import PerceptionError
from gap_runtime.contracts.scripting import cloud_gap, thinned
from gap_runtime.contracts.tool import ScriptContext
from gap_runtime.contracts.types import WORLD, CameraObservation, Mask, PointCloud, Vec3


class Next(NamedTuple):
    """The object to fetch, as lists of one, or of none when none is left; the container; and where tries failed."""

    state: Literal["found", "none_left"]
    masks: list[Mask]
    clouds: list[Annotated[PointCloud, WORLD]]
    container_mask: Mask
    container_cloud: Annotated[PointCloud, WORLD]
    failed_before: list[Annotated[Vec3, WORLD]]


class Seen(NamedTuple):
    """One object: its points (N, 3) [m] from all cameras, the mask of the camera that saw it best, and how surely."""

    name: str
    score: float
    mask: Mask
    points: np.ndarray


def run(
    ctx: ScriptContext,
    cameras: list[CameraObservation],
    object_names: list[str],
    container_name: str,
    failed_at: list[Annotated[Vec3, WORLD]] | None = None,
    box_threshold: float = 0.20,
    min_score: float = 0.30,
    min_points: int = 60,
    agree_within: float = 0.05,
    tries: int = 2,
    same_place: float = 0.04,
) -> Next:
    """Choose. Raises `PerceptionError`: `not_found` without the container, `given_up` when only what failed is left."""
    failed = list(failed_at or [])
    containers = look(ctx, cameras, container_name, box_threshold, min_score, min_points, agree_within)
    if not containers:
        raise PerceptionError("not_found", f"No camera shows the {container_name}.", detail={"names": object_names})
    container = containers[0]
    left: list[tuple[int, Seen]] = []
    for name in object_names:
        for seen in look(ctx, cameras, name, box_threshold, min_score, min_points, agree_within):
            if not over(seen.points, container.points):
                left.append((failures(seen.points, failed, same_place), seen))
    open_ = [(count, seen) for count, seen in left if count < tries]
    if left and not open_:
        names = ", ".join(sorted({seen.name for _, seen in left}))
        raise PerceptionError("given_up", f"Given up after {tries} tries: {names}.", detail={"failed": len(failed)})
    chosen = [seen for _, seen in sorted(open_, key=lambda item: (item[0], -height(item[1]), item[1].name))[:1]]
    return Next(
        "found" if chosen else "none_left",
        [seen.mask for seen in chosen],
        [PointCloud(thinned(seen.points)) for seen in chosen],
        container.mask,
        PointCloud(thinned(container.points)),
        failed,
    )


def look(
    ctx: ScriptContext, cameras: list[CameraObservation], name: str, box_threshold: float, min_score: float,
    min_points: int, agree_within: float,
) -> list[Seen]:  # fmt: skip
    """Every object of that name, best first; what touches in two cameras is one."""
    found: list[Seen] = []
    for camera in cameras:
        boxes = ctx.tool(
            "grounding_dino.Detect", image=camera.rgb, text_prompt=f"{name}.", box_threshold=box_threshold
        ).detections
        views: list[Seen] = []
        for detection in boxes:
            segmented = ctx.tool("sam3.SegmentBox", image=camera.rgb, box=detection.box).masks
            if detection.score < min_score or not segmented:
                continue
            points = ctx.tool(
                "geometry_svc.MaskToWorldPoints", mask=segmented[0], depth=camera.depth, intrinsics=camera.intrinsics,
                camera_pose=camera.pose,
            ).points  # fmt: skip
            if len(points) >= min_points:
                views.append(Seen(name, detection.score, segmented[0], points))
        found = joined(found, views, agree_within)
    return sorted(found, key=lambda seen: -seen.score)


def joined(found: list[Seen], views: list[Seen], within: float) -> list[Seen]:
    """What other cameras saw and what one camera sees; each view adds to at most one object that it touches."""
    rest = list(found)
    result: list[Seen] = []
    for new in views:
        same = next((seen for seen in rest if cloud_gap(seen.points, new.points) <= within), None)
        if same is None:
            result.append(new)
            continue
        rest = [seen for seen in rest if seen is not same]
        best = max(same, new, key=lambda seen: seen.score)
        result.append(best._replace(points=np.concatenate([same.points, new.points])))
    return [*rest, *result]


def over(points: np.ndarray, container: np.ndarray) -> bool:
    """True when the middle of the points lies within the container's bounds, seen from above."""
    middle = np.median(points[:, :2], axis=0)
    low, high = container[:, :2].min(axis=0), container[:, :2].max(axis=0)
    return bool(((middle >= low) & (middle <= high)).all())


def height(seen: Seen) -> float:
    """How high the object is, in centimetres, so that noise does not decide what comes first."""
    return round(100 * float(np.ptp(np.quantile(seen.points[:, 2], [0.02, 0.98]))))


def failures(points: np.ndarray, failed: list[Vec3], within: float) -> int:
    """How many of the failed tries were at this object's place, seen from above."""
    middle = np.median(points[:, :2], axis=0)
    return sum(float(np.linalg.norm(place.array[:2] - middle)) <= within for place in failed)
