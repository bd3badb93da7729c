"""Each grocery can be picked by friction alone and released into the basket."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gap_mujoco.scoring import conditions
from gap_mujoco.simulator import MujocoSimulator

pytestmark = pytest.mark.sim
GROCERIES = [
    "alphabet_soup", "tomato_sauce", "cream_cheese", "butter", "chocolate_pudding", "salad_dressing", "bbq_sauce",
    "ketchup", "milk", "orange_juice",
]  # fmt: skip


def relative(world, name):
    now = world.snapshot()
    return np.linalg.inv(now.arms[0].tcp.matrix) @ now.bodies[name].pose.matrix


@pytest.fixture
def alone(task, robots, request):
    """A world with one grocery and the basket."""
    only = task.model_copy(update={"scenes": {request.param: {request.param: "slot_b", "basket": "bin"}}})
    world = MujocoSimulator(only, request.param, robots)
    world.reset(world.sample(3))
    yield world, only, request.param
    world.close()


@pytest.mark.parametrize("alone", GROCERIES, indirect=True)
def test_pick_and_place(alone, move_to):
    world, task, name = alone
    arm = world.arms[0]
    size, start = task.objects[name].shape.size, world.snapshot().bodies[name].pose.position.array
    turn = 0.0 if size[1] <= size[0] else np.pi / 2  # jaws along the thinner side
    down = Rotation.from_euler("z", turn).as_matrix() @ np.diag([1.0, -1.0, -1.0])
    depth = min(size[2] / 2, 0.03)
    grip = np.add(start, [0, 0, max(size[2] / 2 - depth, 0.0115 - start[2])])
    move_to(world, np.add(grip, [0, 0, 0.2]), down)
    move_to(world, grip, down)
    assert arm.gripper.close(settle=0.2).holding
    assert world.snapshot().body(name).is_grasped()
    held = relative(world, name)
    move_to(world, np.add(grip, [0, 0, 0.25]), down)
    basket = world.snapshot().bodies["basket"].pose.position.array
    move_to(world, [*basket[:2], 0.36], down)
    slip = np.linalg.norm(relative(world, name)[:3, 3] - held[:3, 3])
    assert slip < 0.003, "friction holds it"
    assert world.snapshot().body(name).lifted() > 0.1
    move_to(world, [*basket[:2], 0.22 + grip[2] - start[2]], down)
    assert arm.gripper.state().holding
    assert not arm.gripper.open(settle=0.2).holding
    move_to(world, [*basket[:2], 0.4], down)
    world.wait(0.5)
    assert conditions(task, name, world.snapshot()) == {"contained": True, "released": True, "settled": True}
    assert world.snapshot().body(name).touches("basket")
    assert world._physics.data.contact.dist.min() > -0.002, "nothing is pressed into anything"
