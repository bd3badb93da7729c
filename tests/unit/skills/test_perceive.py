"""perception-single: which detection is believed, and what several cameras together say."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from gap_runtime.contracts.types import (
    BoundingBox2D,
    CameraObservation,
    DepthImage,
    Detection,
    Image,
    Mask,
    Matrix3x3,
    PointCloud,
    Quaternion,
    Se3Pose,
    Vec3,
)
from gap_runtime.errors import PerceptionError
from tests.unit.skills.stage import LIBRARY, ROBOTS, Stage, box, cloud, script

run = script("perception-single", "perceive_dino_vlm")
PROMPT = LIBRARY["perception-single"].prompts["select_box"].read_text().strip()
CAN = cloud(box((0, 0, 0.05), (0.06, 0.06, 0.1)))
AWAY = cloud(box((0.3, 0, 0.05), (0.06, 0.06, 0.1)))


def camera(name):
    shade = len(name)
    return CameraObservation(
        name,
        Image(np.full((4, 6, 3), shade, np.uint8)),
        DepthImage(np.ones((4, 6), np.float32)),
        Matrix3x3(np.eye(3)),
        Se3Pose(Vec3(0, 0, 1), Quaternion(1, 0, 0, 0)),
    )


def seen(*scores):
    return [Detection(BoundingBox2D(10 * i, 0, 10 * i + 5, 5), "can", s) for i, s in enumerate(scores)]


def perceive(views, answer="none", **parameters):
    """Perceive with, per camera, (detections, points of each detection's cloud)."""
    cameras = [camera("c" * (i + 1)) for i in range(len(views))]
    masks = []

    def segment(image, box):
        index = int(image.data[0, 0, 0]) - 1
        masks.append((index, box))
        data = np.zeros((4, 6), bool)
        data[: index + 1] = True
        return SimpleNamespace(masks=[Mask(data)])

    def lift(mask, **_):
        index, area = masks[-1]
        return PointCloud(views[index][1][int(area.x_min // 10)])

    stage = Stage(
        ROBOTS[0],
        grounding_dino__Detect=lambda image, **_: SimpleNamespace(detections=views[int(image.data[0, 0, 0]) - 1][0]),
        sam3__SegmentBox=segment,
        geometry_svc__MaskToWorldPoints=lift,
        vlm__Query=SimpleNamespace(text=answer),
    )
    return run(stage, cameras, "can", PROMPT, **parameters), stage


def test_one_detection_is_believed_without_a_question():
    found, stage = perceive([(seen(0.8), [CAN])])
    assert found.found
    assert found.score == 0.8
    assert len(found.cloud.points) == len(CAN)
    assert "vlm.Query" not in [name for name, _ in stage.calls]


@pytest.mark.parametrize("answer", ["2", "2.", "Box 2", " number 2 \n"])
def test_of_several_the_model_decides(answer):
    found, stage = perceive([(seen(0.8, 0.7), [CAN, AWAY])], answer)
    assert found.cloud.points[:, 0].mean() == pytest.approx(0.3)
    question = next(inputs["prompt"] for name, inputs in stage.calls if name == "vlm.Query")
    assert question.startswith("Which numbered box shows the can?")
    assert "2: [10, 0, 15, 5]" in question


def test_none_of_several_skips_the_camera():
    with pytest.raises(PerceptionError):
        perceive([(seen(0.8, 0.7), [CAN, CAN])], "None.")


@pytest.mark.parametrize("answer", ["cannot answer: 2 boxes look alike", "7", "0", ""])
def test_an_answer_that_is_none_leaves_the_detectors_order(answer):
    found, _ = perceive([(seen(0.8, 0.7), [CAN, AWAY])], answer)
    assert found.score == 0.8


def test_cameras_that_agree_are_merged():
    half = CAN[:, 0] > 0
    found, _ = perceive([(seen(0.6), [CAN[half]]), (seen(0.9), [CAN[~half]])])
    assert len(found.cloud.points) == len(CAN)
    assert found.score == 0.9


def test_the_mask_is_of_the_camera_that_saw_most():
    found, _ = perceive([(seen(0.6), [CAN]), (seen(0.9), [CAN[:80]])])
    assert found.mask.data.sum() == 6  # the first camera's


def test_cameras_that_see_different_things_are_not_merged():
    found, _ = perceive([(seen(0.6), [CAN]), (seen(0.9), [AWAY])], agree_within=0.05)
    assert found.cloud.points[:, 0].min() > 0.2


def test_one_point_is_kept_per_cell():
    found, _ = perceive([(seen(0.9), [np.concatenate([CAN] * 3)])])
    assert len(found.cloud.points) == len(CAN)


@pytest.mark.parametrize(
    "views",
    [[([], [])], [(seen(0.29), [CAN])], [(seen(0.9), [CAN[:20]])]],
    ids=["nothing", "too unsure", "too few points"],
)
def test_an_object_no_camera_shows_is_not_found(views):
    with pytest.raises(PerceptionError, match="No camera shows the can") as caught:
        perceive(views)
    assert caught.value.code == "not_found"
