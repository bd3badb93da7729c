"""grasp-moe in physics, after the perception that gives it a cloud: groceries, a handle and a rim come up."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from gap_runtime.contracts.types import Se3Pose, Vec3
from tests.sim.skills_perception.cell import REGISTRY, perceive, see_part, segment

pytestmark = pytest.mark.sim
HANDLE = ("frying pan", "handle of the frying pan")


def lifted(kitchen, world, name, height=0.12):
    """Lift by motion, as whoever comes after the skill would; how far the object came up [m], in the hand."""
    ctx = SimpleNamespace(cell=world, task=kitchen.task, state={}, robot=lambda arm_id=0: world.arms[arm_id].spec,
                          shared=lambda key, make: make(), raise_if_cancelled=lambda: None)  # fmt: skip
    at = world.arms[0].state().ee_pose
    goal = Se3Pose(Vec3(at.position.x, at.position.y, at.position.z + height), at.rotation)
    REGISTRY.tool("robot_control.GoToPoseCartesian")(ctx, pose=goal, lin_vel_norm=0.3)
    body = world.snapshot().body(name)
    return body.lifted() if body.is_grasped() else 0.0


@pytest.mark.parametrize(
    ("scene", "name", "seen", "spot"),
    [
        ("groceries", "milk", perceive("perception-single", "milk", "milk"), (-0.07, 0.0, 85)),
        ("groceries", "butter", perceive("perception-single", "butter", "butter"), (0.08, -0.1, 53)),
        ("groceries", "bbq_sauce", perceive("perception-single", "bbq_sauce", "bbq sauce"), (0.0, 0.1, -140)),
        ("kitchen", "frypan", see_part("frypan", *HANDLE), (0.05, -0.06, 18)),
        ("kitchen", "frypan", see_part("frypan", *HANDLE), (-0.06, -0.15, -35)),
        ("kitchen", "mug", see_part("mug", "mug", "rim of the mug"), (-0.12, -0.1, 113)),
    ],
    ids=lambda value: value if isinstance(value, str) else None,
)
def test_it_is_held_where_it_stood_and_comes_up(kitchen, scene, name, seen, spot):
    world = kitchen.cell(scene, **{name: spot})
    grasp = segment("grasp", "grasp-moe", 1, roles={"target": name})
    ran = kitchen.run(world, seen, grasp)
    assert ran.exits == {"see_target": "found", "grasp": "grasped"}, ran.result.error
    truth = world.snapshot().body(name)
    assert truth.is_grasped() and truth.moved() < 0.02
    assert lifted(kitchen, world, name) > 0.09


def test_the_frypan_is_held_by_its_handle(kitchen):
    world = kitchen.cell("kitchen", frypan=(-0.19, 0.06, 14))
    ran = kitchen.run(world, see_part("frypan", *HANDLE), segment("grasp", "grasp-moe", 1, roles={"target": "frypan"}))
    truth = world.snapshot()
    pan = truth.bodies["frypan"].pose
    reach = pan.rotation.rotation.inv().apply(truth.arms[0].tcp.position.array - pan.position.array)
    length, width, _ = kitchen.task.objects["frypan"].shape.size
    assert width - length / 2 < reach[0] < length / 2 and abs(reach[1]) < 0.01
    assert ran.outputs["ee_pose_at_grasp"].position.array == pytest.approx(truth.arms[0].tcp.position.array, abs=0.005)


def test_what_is_out_of_reach_fails_and_is_not_touched(kitchen):
    world = kitchen.cell("groceries", milk=(0.38, 0.1, 20))
    grasp = segment("grasp", "grasp-moe", 1, roles={"target": "milk"})
    ran = kitchen.run(world, perceive("perception-single", "milk", "milk"), grasp)
    assert ran.exits == {"see_target": "found", "grasp": "failed"} and "in reach" in ran.result.error
    assert world.snapshot().body("milk").moved() < 0.002
