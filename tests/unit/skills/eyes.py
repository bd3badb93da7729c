"""Cameras, detections and a stage on which perception scripts see what a test says."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

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
from tests.unit.skills.stage import ROBOTS, Stage, box, cloud

ROWS, COLUMNS = 8, 40
CAN = cloud(box((0, 0, 0.05), (0.06, 0.06, 0.1)))
AWAY = cloud(box((0.3, 0, 0.05), (0.06, 0.06, 0.1)))


def camera(index):
    """A camera whose pixels hold its own number, so that tools given an image know which it is."""
    return CameraObservation(
        f"camera{index}",
        Image(np.full((ROWS, COLUMNS, 3), index, np.uint8)),
        DepthImage(np.ones((ROWS, COLUMNS), np.float32)),
        Matrix3x3(np.eye(3)),
        Se3Pose(Vec3(0, 0, 1), Quaternion(1, 0, 0, 0)),
    )


def number(image):
    return int(image.data[0, 0, 0])


def patch(slot, rows=5):
    """A mask over the slot's five columns; its first column says which slot, its size how much was seen."""
    data = np.zeros((ROWS, COLUMNS), bool)
    data[:rows, 5 * slot : 5 * slot + 5] = True
    return Mask(data)


def seen(*scores):
    """Detections side by side, one per slot."""
    return [Detection(BoundingBox2D(5 * i, 0, 5 * i + 5, 5), "can", s) for i, s in enumerate(scores)]


class Eyes(Stage):
    """`views[i]` is what camera i shows: (detections, cloud per slot). `answer` is what the model says."""

    def __init__(self, views, answer="none", **answers):
        self.views = views
        super().__init__(
            ROBOTS[0],
            grounding_dino__Detect=lambda image, **_: SimpleNamespace(detections=views[number(image)][0]),
            sam3__SegmentBox=lambda image, box: SimpleNamespace(masks=[patch(int(box.x_min // 5))], scores=[0.9]),
            geometry_svc__MaskToWorldPoints=self.lift,
            vlm__Query=SimpleNamespace(text=answer),
            **answers,
        )
        self.cameras = [camera(i) for i in range(len(views))]
        self.lifted = iter(())

    def lift(self, mask, camera_pose, depth, intrinsics):
        """Which camera it was is known from the call before it, a detection or an opinion of that camera."""
        image = next(i["image"] for _, i in reversed(self.calls) if "image" in i)
        slot = int(np.nonzero(mask.data.any(axis=0))[0][0] // 5)
        return PointCloud(self.views[number(image)][1][slot])

    def asked(self):
        return [inputs["prompt"] for name, inputs in self.calls if name == "vlm.Query"]
