"""The worst searches of a benchmark as one sheet of pictures: what was there, what was found, and how far off."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from gap_perception.bench.perception import Search
from gap_perception.bench.summary import is_visible
from gap_perception.scene.points import project
from gap_runtime.contracts.types import Array, CameraObservation, OrientedBoundingBox

TILE = (200, 150)  # px
CAPTION, HEADING = 30, 26  # px
COLUMNS, SHOWN = 6, 12
MARGIN = 1.6  # of a crop, in sizes of what it shows
TRUE, FOUND = (0, 170, 0), (225, 30, 30)
BYTES = 480_000
WRONG, MISSED = 1e6, 1e5  # severity in mm of what has no error in mm


@dataclass(frozen=True)
class Case:
    """One search as a picture, (H, W, 3) RGB of the size of `TILE`; cases are sorted by `order`, worst first."""

    severity: float
    seed: int
    name: str
    lines: tuple[str, str]
    picture: Array

    @property
    def order(self) -> tuple[float, int, str]:
        """Worst first, then by seed and name."""
        return (-self.severity, self.seed, self.name)


def severity(row: Mapping[str, Any]) -> float:
    """How bad a search went [mm]; wrong objects before missed ones before misplaced ones, 0 when it was right."""
    if row["wrong"]:
        return WRONG
    if not row["found"]:
        return MISSED + row["pixels"] if is_visible(row) else 0.0
    return float(row["center_mm"])


def worst(searches: Iterable[Search]) -> tuple[list[dict[str, Any]], list[Case]]:
    """All rows, and pictures of the worst cases, worst first; only those are ever drawn."""
    rows: list[dict[str, Any]] = []
    cases: list[Case] = []
    for search in searches:
        rows.append(search.row)
        bad = severity(search.row)
        if bad > 0 and (len(cases) < SHOWN or bad > cases[-1].severity):
            cases = sorted([*cases, _case(search, bad)], key=lambda c: c.order)[:SHOWN]
    return rows, cases


def sheet(cases: Mapping[str, Sequence[Case]], searches: Mapping[str, int]) -> bytes:
    """A JPEG of the worst cases of each sensor under a heading that says of how many searches they are the worst."""
    parts: list[Array] = []
    for sensor, found in cases.items():
        text = f"{sensor}: the worst of {searches[sensor]} searches. Green: true outline. Red: found box."
        parts.append(_lettered((text,), COLUMNS * TILE[0], HEADING, 0.5))
        tiles = [_tile(case) for case in sorted(found, key=lambda c: c.order)[:SHOWN]]
        blank = np.full((TILE[1] + CAPTION, TILE[0], 3), 255, np.uint8)
        tiles += [blank] * (-len(tiles) % COLUMNS)
        parts += [np.hstack(tiles[i : i + COLUMNS]) for i in range(0, len(tiles), COLUMNS)]
    picture = cv2.cvtColor(np.vstack(parts), cv2.COLOR_RGB2BGR)
    for quality in (90, 80, 70, 55, 40):
        data = cv2.imencode(".jpg", picture, (cv2.IMWRITE_JPEG_QUALITY, quality))[1].tobytes()
        if len(data) <= BYTES:
            break
    return data


def _case(search: Search, bad: float) -> Case:
    row = search.row
    label = str(row["object"]).replace("_", " ")
    if row["wrong"]:
        what = f"wrong object ({str(row['instead']).replace('_', ' ')})"
    else:
        what = f"{row['center_mm']:.1f} mm" if row["found"] else "not found"
    lines = (f"{label}: {what}", f"seed {row['seed']}, {row['clutter']}")
    return Case(bad, row["seed"], row["object"], lines, _picture(search))


def _picture(search: Search) -> Array:
    """A crop of the camera that shows most of it, with both outlines."""
    name, present = search.row["object"], search.row["present"]
    views = []
    for frame in search.frames:
        mask = search.visible[frame.name][name].data & present
        true = [c[:, 0] for c in cv2.findContours(mask.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)[0]]
        hull = [] if search.found is None else _outline(search.found[0], frame)
        views.append((sum(len(c) for c in true), sum(len(c) for c in hull), frame, true, hull))
    *_, frame, true, hull = max(views, key=lambda view: view[:2])
    low, size = _window(np.concatenate([*true, *hull] or [np.zeros((1, 2), int)]), frame.rgb.data.shape)
    crop = frame.rgb.data[low[1] : low[1] + size[1], low[0] : low[0] + size[0]]
    picture = cv2.resize(crop, TILE, interpolation=cv2.INTER_CUBIC)
    scale = np.array(TILE) / size
    for contours, colour in ((true, TRUE), (hull, FOUND)):
        lines = [np.rint((c - low + 0.5) * scale).astype(np.int32) for c in contours]
        cv2.polylines(picture, lines, True, colour, 1, cv2.LINE_AA)
    return np.asarray(picture)


def _outline(box: OrientedBoundingBox, frame: CameraObservation) -> list[Array]:
    """The found box in the picture, by the calibration that the robot has: its convex outline, (n, 2) columns, rows."""
    signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T
    corners = (signs * box.extent.array) @ box.orientation.rotation.as_matrix().T + box.center.array
    columns, rows, depth = project(corners, frame)
    if depth.min() <= 0:
        return []
    hull = cv2.convexHull(np.column_stack([columns, rows]).astype(np.int32))[:, 0]
    height, width = frame.rgb.data.shape[:2]
    inside = (hull >= 0).all() and (hull < (width, height)).all()
    return [hull] if inside else []


def _window(points: Array, shape: tuple[int, ...]) -> tuple[Array, Array]:
    """Corner and size (x, y) of the crop around pixels (n, 2), in the tile's shape and inside the picture."""
    low, high = points.min(axis=0), points.max(axis=0)
    scale = max((MARGIN * (high - low) / TILE).max(), 0.5)
    limits = np.array([shape[1], shape[0]])
    size = np.minimum(np.rint(scale * np.array(TILE)).astype(int), limits)
    return np.clip((low + high - size) // 2, 0, limits - size), size


def _tile(case: Case) -> Array:
    return np.vstack([case.picture, _lettered(case.lines, TILE[0], CAPTION, 0.36)])


def _lettered(lines: Sequence[str], width: int, height: int, size: float) -> Array:
    """Black text on white, (height, width, 3)."""
    image = np.full((height, width, 3), 255, np.uint8)
    step = height // len(lines)
    for i, line in enumerate(lines):
        cv2.putText(image, line, (4, (i + 1) * step - 4), cv2.FONT_HERSHEY_SIMPLEX, size, (0, 0, 0), 1, cv2.LINE_AA)
    return image
