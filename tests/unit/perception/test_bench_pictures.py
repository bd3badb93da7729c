"""The sheet of worst cases: worst first, only so many, small enough to be kept."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from gap_perception.bench.perception import Search
from gap_perception.bench.pictures import BYTES, FOUND, SHOWN, TILE, TRUE, severity, sheet, worst
from gap_runtime.contracts.types import (
    CameraObservation,
    DepthImage,
    Image,
    Mask,
    Matrix3x3,
    OrientedBoundingBox,
    Quaternion,
    Se3Pose,
    Vec3,
)

H, W = 240, 320
K = np.array([[200.0, 0, W / 2], [0, 200, H / 2], [0, 0, 1]])
FRAME = CameraObservation(
    "eye", Image(np.full((H, W, 3), 128, np.uint8)), DepthImage(np.ones((H, W), np.float32)), Matrix3x3(K),
    Se3Pose(Vec3(0, 0, 0), Quaternion(1, 0, 0, 0)),
)  # fmt: skip


def search(mm=1.0, seed=0, x=0.0, **more):
    """A can in the middle of the picture, and a box found `x` [m] beside it, a metre away."""
    mask = np.zeros((H, W), bool)
    mask[H // 2 - 10 : H // 2 + 10, W // 2 - 10 : W // 2 + 10] = True
    row = {
        "seed": seed, "clutter": "usual", "object": "can", "present": True, "found": True, "wrong": False,
        "pixels": 400, "center_mm": mm,
    }  # fmt: skip
    box = OrientedBoundingBox(Vec3(x, 0, 1), Vec3(0.05, 0.05, 0.05), Quaternion(1, 0, 0, 0))
    found = (box, Mask(mask)) if (row | more)["found"] else None
    return Search(row | more, (FRAME,), {"eye": {"can": Mask(mask)}}, found)


def has(picture, colour):
    return (np.abs(picture.astype(int) - colour).max(axis=2) < 60).any()


WRONG = search(wrong=True, instead="tin")
MISSED = search(found=False)


def test_wrong_is_worse_than_missed_is_worse_than_misplaced():
    rows = [severity(s.row) for s in (WRONG, MISSED, search(29.0), search(1.0))]
    assert rows == sorted(rows, reverse=True) and rows[-1] == 1.0
    assert severity(search(found=False, present=False, pixels=0).row) == 0
    assert severity(search(found=False, pixels=5).row) == 0


def test_only_the_worst_are_kept_worst_first():
    rows, cases = worst([search(float(i), seed=i) for i in range(3 * SHOWN)] + [MISSED, WRONG])
    assert len(rows) == 3 * SHOWN + 2 and len(cases) == SHOWN
    assert cases[0].lines == ("can: wrong object (tin)", "seed 0, usual")
    assert cases[1].lines[0] == "can: not found"
    assert [c.severity for c in cases[2:]] == [3 * SHOWN - 1 - i for i in range(SHOWN - 2)]


@pytest.mark.parametrize("x", [0.0, 0.3])
def test_a_picture_shows_both_outlines(x):
    (case,) = worst([search(x=x)])[1]
    assert case.picture.shape == (TILE[1], TILE[0], 3)
    assert has(case.picture, TRUE) and has(case.picture, FOUND)


def test_what_was_not_there_or_not_found_has_one_outline():
    (missed,), (ghost,) = (worst([s])[1] for s in (MISSED, search(wrong=True, instead="nothing", present=False)))
    assert has(missed.picture, TRUE) and not has(missed.picture, FOUND)
    assert has(ghost.picture, FOUND) and not has(ghost.picture, TRUE)


def test_a_box_beyond_the_picture_is_not_drawn():
    (case,) = worst([search(x=5.0)])[1]
    assert has(case.picture, TRUE) and not has(case.picture, FOUND)


def test_the_sheet_is_one_small_picture_and_the_same_every_time():
    cases = {"clean": worst([search(2.0)])[1], "realistic": worst([search(float(i)) for i in range(1, 9)])[1]}
    data = sheet(cases, {"clean": 1, "realistic": 8})
    picture = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    assert len(data) <= BYTES and picture.shape[1] == 6 * TILE[0]
    assert data == sheet(cases, {"clean": 1, "realistic": 8})
    assert sheet({"clean": []}, {"clean": 0})
