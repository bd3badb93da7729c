"""An arm whose servos are perfect, until something holds it: what trajectory following needs, and nothing else."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from gap_control.joint_controller import JointCommand
from gap_control.motion_executor import MotionExecutor
from gap_robots.panda import panda
from gap_runtime.contracts.types import Quaternion, Se3Pose, Vec3

PERIOD = 0.002


class Clock:
    """Moves every arm on by one period."""

    period = PERIOD

    def __init__(self):
        self.time, self.arms = 0.0, []

    def run(self, process):
        for _ in process:
            self.step()

    def step(self):
        self.time += PERIOD
        for controller, executor in self.arms:
            controller.move()
            executor.update()


class IdealController:
    """Joints are where they are told to be; from `wall` [rad] on the first one is held, and pushed back at `stiffness`
    [Nm/rad] by how much farther its set-point is."""

    def __init__(self, clock, wall=np.inf, stiffness=1e4):
        self.spec, self.clock, self.wall, self.stiffness = panda(), clock, wall, stiffness
        self.positions = np.array(self.spec.home)
        self.velocities = self.external_torque = still = np.zeros(self.spec.dof)
        self.contact_torque = np.full(self.spec.dof, 20.0)
        self.target, self.speed = self.positions, still
        self.applied = JointCommand(self.positions, still, still)

    def set_target(self, positions, velocities):
        self.target, self.speed = positions, velocities

    def tcp(self):
        return Se3Pose(Vec3(*self.positions[:3]), Quaternion(1.0, 0.0, 0.0, 0.0))

    def move(self):
        beyond = max(0.0, self.target[0] - self.wall) * np.eye(self.spec.dof)[0]
        before, self.positions = self.positions, self.target - beyond
        self.velocities = (self.positions - before) / PERIOD
        self.external_torque = self.stiffness * beyond
        self.applied = JointCommand(self.target, self.speed, (self.speed - self.applied.velocities) / PERIOD)


@pytest.fixture
def clock():
    return Clock()


@pytest.fixture
def make_arm(clock):
    """make_arm(**how): an arm on the clock, as its `controller` and its `executor`."""

    def make(**how):
        controller = IdealController(clock, **how)
        executor = MotionExecutor(controller)
        clock.arms.append((controller, executor))
        return SimpleNamespace(controller=controller, executor=executor)

    return make
