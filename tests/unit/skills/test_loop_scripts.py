"""Scripts of the skills that loops are made of, with made-up cameras: what comes next, what is left, what is noted."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import morsl
from gap_runtime.contracts.failures import PerceptionError
from gap_runtime.contracts.types import OrientedBoundingBox, Quaternion, Se3Pose, Vec3

MORSL = Path(morsl.__file__).parent
UPRIGHT = Quaternion(1.0, 0.0, 0.0, 0.0)
BASKET = [("basket", 0.0, 0.3, 0.1)]


def script(path):
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


NEXT = script(MORSL / "perception-next/scripts/choose_next.py")
RISE = script(MORSL / "retreat/scripts/plan_rise.py")
NOTE = script(MORSL / "retreat/scripts/note_failure.py")


def block(x, y, height, size=0.05):
    """Points of a box standing at x, y [m]."""
    rng = np.random.default_rng(0)
    return rng.uniform([x - size / 2, y - size / 2, 0], [x + size / 2, y + size / 2, height], (400, 3))


class Cell:
    """Answers a script's tool calls from a list of (name, x, y, height) [m]; the basket is twice as wide."""

    def __init__(self, *things):
        self.things = [*BASKET, *things]

    def tool(self, name, **inputs):
        if name == "grounding_dino.Detect":
            wanted = inputs["text_prompt"].removesuffix(".")
            found = [SimpleNamespace(box=t, score=0.9) for t in self.things if t[0] == wanted]
            return SimpleNamespace(detections=found)
        if name == "sam3.SegmentBox":
            return SimpleNamespace(masks=[inputs["box"]])
        label, x, y, height = inputs["mask"]
        return SimpleNamespace(points=block(x, y, height, 0.2 if label == "basket" else 0.05))

    def robot(self):
        return SimpleNamespace(gripper=SimpleNamespace(finger_size=(0.02, 0.02, 0.01)))


CAMERA = SimpleNamespace(rgb=None, depth=None, intrinsics=None, pose=None)


def choose(*things, names=("milk", "butter"), failed=(), cameras=1):
    places = [Vec3(x, y, 0.05) for x, y in failed]
    return NEXT.run(Cell(*things), [CAMERA] * cameras, list(names), "basket", places)


def middle(found):
    return np.round(np.median(found.clouds[0].points[:, :2], axis=0), 2).tolist()


def test_the_tallest_comes_first():
    assert middle(choose(("butter", 0.1, 0.0, 0.02), ("milk", -0.1, 0.0, 0.13))) == [-0.1, 0.0]


def test_what_is_in_the_container_is_done():
    assert middle(choose(("milk", 0.0, 0.3, 0.13), ("butter", 0.1, 0.0, 0.02))) == [0.1, 0.0]
    done = choose(("milk", 0.0, 0.3, 0.13))
    assert (done.state, done.masks, done.clouds) == ("none_left", [], [])


def test_what_failed_comes_after_the_others_and_then_once_more():
    both = (("milk", -0.1, 0.0, 0.13), ("butter", 0.1, 0.0, 0.02))
    assert middle(choose(*both, failed=[(-0.1, 0.0)])) == [0.1, 0.0]
    assert middle(choose(both[0], failed=[(-0.1, 0.0)])) == [-0.1, 0.0]


def test_what_failed_too_often_is_left_and_said_in_the_end():
    failed = [(-0.1, 0.0)] * 2
    assert middle(choose(("milk", -0.1, 0.0, 0.13), ("butter", 0.1, 0.0, 0.02), failed=failed)) == [0.1, 0.0]
    with pytest.raises(PerceptionError, match="Given up after 2 tries: milk"):
        choose(("milk", -0.1, 0.0, 0.13), failed=failed)


def test_two_of_one_name_are_two_and_two_views_of_one_are_one():
    twins = (("milk", -0.1, 0.0, 0.13), ("milk", -0.04, 0.0, 0.13))
    assert len(NEXT.look(Cell(*twins), [CAMERA], "milk", 0.2, 0.3, 60, 0.05)) == 2
    assert len(NEXT.look(Cell(twins[0]), [CAMERA, CAMERA], "milk", 0.2, 0.3, 60, 0.05)) == 1


def test_without_the_container_there_is_no_next():
    cell = Cell(("milk", 0.1, 0.0, 0.13))
    cell.things = cell.things[1:]
    with pytest.raises(PerceptionError, match="No camera shows the basket"):
        NEXT.run(cell, [CAMERA], ["milk"], "basket")


BOX = OrientedBoundingBox(Vec3(0.1, 0.2, 0.05), Vec3(0.02, 0.02, 0.05), UPRIGHT)


@pytest.mark.parametrize(("z", "mode", "to"), [(0.05, "rise", 0.16), (0.4, "stay", 0.4)])
def test_a_low_hand_rises_straight_above_the_target(z, mode, to):
    rise = RISE.run(Cell(), Se3Pose(Vec3(0.1, 0.2, z), UPRIGHT), BOX, 0.05)
    assert (rise.mode, rise.rise_pose.position.z) == (mode, pytest.approx(to))
    assert (rise.rise_pose.position.x, rise.rise_pose.position.y) == (0.1, 0.2)


def test_failures_are_noted_in_order():
    first = NOTE.run(Cell(), BOX)
    assert first.failed_at == [BOX.center]
    assert NOTE.run(Cell(), BOX, first.failed_at).failed_at == [BOX.center, BOX.center]
