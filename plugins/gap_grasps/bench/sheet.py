"""A picture of grasps: what was seen of each object, the hand drawn in, its score and what became of it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from gap_grasps.bench.execution import was_tried
from gap_runtime.contracts.bench import Picture
from gap_runtime.contracts.robot import GripperSpec
from gap_runtime.contracts.types import Array

TILE, COLUMNS = 150, 7  # pixels a side, tiles a row
VIEW = np.array([[0.8, -0.6, 0.0], [0.3, 0.4, -0.866]])  # image right and down in the world: from the front, above
SPAN = 0.26  # m shown in a tile
INK, POINT = (60, 60, 60), (190, 170, 150)
OUTCOME = {True: (70, 140, 40), False: (40, 40, 200)}  # blue, green, red


def worst(rows: Iterable[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Of each object the drawn grasp that failed though its score was high; where none failed, the best scored."""
    found: dict[str, Mapping[str, Any]] = {}
    for row in rows:
        if "cloud" in row and was_tried(row):
            best = found.get(row["object"])
            if best is None or (best["success"], -best["score"]) > (row["success"], -row["score"]):
                found[row["object"]] = row
    return list(found.values())


def sheet(rows: Sequence[Mapping[str, Any]], gripper: GripperSpec) -> Picture:
    """One tile per row with "object", "score", "success", "pose" (4, 4) and "cloud" (N, 3)."""
    import cv2

    tiles = [_tile(row, gripper) for row in rows]
    tiles += [np.full((TILE, TILE, 3), 255, np.uint8)] * (-len(tiles) % COLUMNS)
    lines = [np.hstack(tiles[i : i + COLUMNS]) for i in range(0, len(tiles), COLUMNS)]
    _, data = cv2.imencode(".png", np.vstack(lines), [cv2.IMWRITE_PNG_COMPRESSION, 9])
    caption = (
        "Of each object the grasp that failed at the highest score (red), or the best (green), as it was asked for"
    )
    return Picture(caption, ".png", data.tobytes())


def _tile(row: Mapping[str, Any], gripper: GripperSpec) -> Array:
    import cv2

    image = np.full((TILE, TILE, 3), 255, np.uint8)
    cloud, T = np.asarray(row["cloud"]), np.asarray(row["pose"])
    middle = (cloud.min(axis=0) + cloud.max(axis=0)) / 2
    for u, v in _pixels(cloud, middle):
        cv2.circle(image, (int(u), int(v)), 1, POINT, -1)
    for line in _hand(gripper):
        ends = _pixels(line @ T[:3, :3].T + T[:3, 3], middle).astype(np.int32)
        cv2.polylines(image, [ends.reshape(-1, 1, 2)], False, OUTCOME[bool(row["success"])], 2, cv2.LINE_AA)
    for text, y in ((row["object"].replace("_", " "), 13), (f"{row['score']:.2f}", TILE - 6)):
        cv2.putText(image, text, (5, y), cv2.FONT_HERSHEY_SIMPLEX, 0.4, INK, 1, cv2.LINE_AA)
    return np.asarray(cv2.rectangle(image, (0, 0), (TILE - 1, TILE - 1), (225, 225, 225), 1))


def _hand(gripper: GripperSpec) -> tuple[Array, Array]:
    """Fingers and palm as a fork, and the wrist, as lines in the TCP frame (N, 3)."""
    y, tip, back = gripper.max_width / 2, gripper.finger_size[2], -gripper.finger_depth
    fork = np.array([[0, -y, tip], [0, -y, back], [0, y, back], [0, y, tip]])
    return fork, np.array([[0, 0, back], [0, 0, back - 0.06]])


def _pixels(points: Array, middle: Array) -> Array:
    return np.asarray((points - middle) @ VIEW.T * TILE / SPAN + TILE / 2)
