"""perception-subpart in physics: handles and rims, judged by where the object's shape has them."""

from __future__ import annotations

import numpy as np
import pytest

from tests.sim.skills_perception.cell import MUG, PAN, inside, miss, perceive, see_part

pytestmark = pytest.mark.sim
SLACK = 0.004  # m


def local(points, truth):
    """World points (N, 3) in the body's frame."""
    return (points - truth.box.center.array) @ truth.box.orientation.rotation.as_matrix()


def handle_of(data):
    """Where along x a vessel's handle begins and ends [m], and its half width."""
    length, width, _ = data["shape"]["size"]
    return width - length / 2, length / 2, data["shape"]["handle"][0] / 2


@pytest.mark.parametrize("yaw", [20, 135, 250])
def test_the_handle_of_the_frypan(kitchen, yaw):
    world = kitchen.cell("kitchen", frypan=(-0.05, -0.12, yaw), mug=(-0.15, 0.15, yaw + 70))
    ran = kitchen.run(world, see_part("frypan", "frying pan", "handle of the frying pan"))
    assert ran.exits == {"see_target": "found"}, ran.result.error
    truth = world.snapshot().bodies["frypan"]
    start, end, half = handle_of(PAN)
    points = local(ran.outputs["target_cloud"].points, truth)
    assert points[:, 0].min() > start - 0.01 and np.abs(points[:, 1]).max() < half + SLACK
    box = ran.outputs["target_obb"]
    middle = local(box.center.array[None], truth)[0]
    assert middle == pytest.approx([(start + end) / 2, 0, PAN["shape"]["size"][2] / 2 - 0.006], abs=0.012)
    along = truth.box.orientation.rotation.apply([1.0, 0.0, 0.0])
    assert box.extent_along(along) == pytest.approx(end - start, abs=0.02)


@pytest.mark.parametrize(("yaw", "part"), [(40, "handle of the mug"), (130, "handle"), (200, "mug's handle")])
def test_the_handle_of_the_mug(kitchen, yaw, part):
    world = kitchen.cell("kitchen", mug=(-0.15, 0.15, yaw), frypan=(-0.05, -0.15, 60))
    ran = kitchen.run(world, see_part("mug", "mug", part))
    assert ran.exits == {"see_target": "found"}, ran.result.error
    points = local(ran.outputs["target_cloud"].points, world.snapshot().bodies["mug"])
    start, end, half = handle_of(MUG)
    assert points[:, 0].min() > start - 0.012 and points[:, 0].max() < end + SLACK
    assert np.abs(points[:, 1]).max() < half + SLACK


def test_the_rim_of_the_mug(kitchen):
    world = kitchen.cell("kitchen", mug=(-0.1, 0.05, 100))
    ran = kitchen.run(world, see_part("mug", "mug", "rim of the mug"))
    assert ran.exits == {"see_target": "found"}, ran.result.error
    points = local(ran.outputs["target_cloud"].points, world.snapshot().bodies["mug"])
    length, width, height = MUG["shape"]["size"]
    assert points[:, 2].min() > height / 2 - 0.016
    radius = np.hypot(points[:, 0] - (width - length) / 2, points[:, 1])
    wall = MUG["shape"]["wall"]
    assert (np.abs(radius - (width - wall) / 2) < wall / 2 + SLACK).mean() > 0.95


@pytest.mark.parametrize(
    ("parent", "part", "says"),
    [
        ("mug", "lid of the mug", "not its part"),
        ("milk", "handle of the milk", "not its part"),
        ("frying pan", "handle", "No camera shows"),
    ],
)
def test_a_part_or_a_parent_that_is_not_there_is_said_to_be_missing(kitchen, parent, part, says):
    world = kitchen.cell("kitchen", mug=(-0.1, 0.05, 100), milk=(-0.05, -0.15, 0))
    ran = kitchen.run(world, see_part("mug", parent, part))
    assert ran.exits == {"see_target": "not_found"} and says in ran.result.error


def test_the_whole_mug_and_pan_are_found_by_perception_single(kitchen):
    world = kitchen.cell("kitchen", mug=(-0.15, 0.15, 130), frypan=(-0.05, -0.12, 60))
    ran = kitchen.run(
        world,
        perceive("perception-single", "mug", "mug"),
        perceive("perception-single", "frypan", "frying pan", slot="base"),
    )
    truth = world.snapshot().bodies
    assert inside(ran.outputs["target_cloud"].points, truth["mug"]) > 0.95
    assert inside(ran.outputs["base_cloud"].points, truth["frypan"]) > 0.95
    assert miss(ran.outputs["target_obb"], truth["mug"]) < 0.010
