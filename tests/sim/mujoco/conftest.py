"""One small cell for all tests of the world, and just enough inverse kinematics to move its arm."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gap_control.point_to_point import point_to_point
from gap_mujoco.simulator import MujocoSimulator
from gap_robots.panda import panda
from gap_runtime.contracts.task import load_task

TASK = load_task(Path(__file__).parents[3] / "tasks" / "fulfill-grocery", "object")
DOWN = np.diag([1.0, -1.0, -1.0])  # TCP pointing down, jaws along world y


@pytest.fixture(scope="session")
def task():
    return TASK


@pytest.fixture(scope="session")
def robots():
    return {"panda": panda()}


@pytest.fixture(scope="session")
def make_world(robots):
    """World of a scene, made once per session."""
    made = {}

    def make(scene="alphabet_soup"):
        if scene not in made:
            made[scene] = MujocoSimulator(TASK, scene, robots)
        return made[scene]

    yield make
    for world in made.values():
        world.close()


@pytest.fixture
def world(make_world):
    """A world whose episode has just begun."""
    world = make_world()
    world.reset(world.sample(1))
    return world


@pytest.fixture(scope="session")
def cells():
    """World of one robot model, made once per session."""
    from gap_robots.ur5e import ur5e

    specs, made = {"panda": panda(), "ur5e": ur5e()}, {}

    def make(robot):
        if robot not in made:
            task = TASK.model_copy(
                update={"robots": [TASK.robots[0].model_copy(update={"model": robot, "home": None})]}
            )
            made[robot] = MujocoSimulator(task, "milk", specs)
            made[robot].task = task
        return made[robot]

    yield make
    for world in made.values():
        world.close()


@pytest.fixture
def cell_of(cells):
    """cell_of(robot): a world of that robot whose episode has just begun."""

    def fresh(robot):
        world = cells(robot)
        world.reset(world.sample(1))
        return world

    return fresh


@pytest.fixture(scope="session")
def reach_to(make_world):
    """reach_to(world, position, rotation): joints that put the TCP there, by damped least squares from where it is."""

    def reach(world, position, rotation=DOWN):
        model, controller = world._scene.model, world.arms[0].controller
        data, spec, q = mujoco.MjData(model), controller.spec, controller.positions.copy()
        low, high = (np.array([getattr(j, k) for j in spec.limits]) for k in ("lower", "upper"))
        for _ in range(200):
            data.qpos[controller._q] = q
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            R = data.xmat[controller._flange].reshape(3, 3)
            p = data.xpos[controller._flange] + R @ spec.tcp_offset_position
            error = np.concatenate([position - p, Rotation.from_matrix(rotation @ R.T).as_rotvec()])
            if np.abs(error).max() < 1e-4:
                return q
            jacobian = np.zeros((6, model.nv))
            mujoco.mj_jac(model, data, jacobian[:3], jacobian[3:], p, controller._flange)
            J = jacobian[:, controller._v]
            q = np.clip(q + J.T @ np.linalg.solve(J @ J.T + 1e-4 * np.eye(6), error), low + 0.01, high - 0.01)
        raise AssertionError(f"no joints for {position}")

    return reach


@pytest.fixture(scope="session")
def move_to(reach_to):
    """move_to(world, position, rotation): go there in a straight line in joint space."""

    def move(world, position, rotation=DOWN):
        arm = world.arms[0]
        goal = reach_to(world, np.asarray(position), rotation)
        arm.execute(point_to_point(arm.spec, arm.state().joints.positions, goal))

    return move
