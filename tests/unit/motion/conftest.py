"""Robots by name, and a cell whose arm goes exactly where it is told."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from gap_catalogue.shared.robot_chain import chain
from gap_runtime.contracts.arm import Setpoint
from gap_runtime.contracts.types import (
    ArmState,
    GripperState,
    JointState,
    Quaternion,
    Se3Pose,
    Vec3,
)  # fmt: skip
from gap_runtime.plugins import load_registry

REGISTRY = load_registry(("gap_robots", "gap_motion"), entry_points=False)
ALONE = SimpleNamespace(arm_id=0, world_config=None, collision_margin=0.005)  # a request about the arm and nothing else
BASE = Se3Pose(Vec3(-0.6, 0.1, 0.0), Quaternion(0.9553364891256060, 0.0, 0.0, 0.2955202066613396))


class IdealGripper:
    """Jaws that are where they are told to be."""

    def __init__(self, spec):
        self.spec, self.width = spec, spec.max_width

    def state(self):
        return GripperState(self.width, self.width / self.spec.max_width)

    def open(self, *, settle=0.5, wait=True):
        return self.set_width(self.spec.max_width)

    def close(self, *, force=None, settle=0.5, wait=True):
        return self.set_width(0.0)

    def set_width(self, width, *, force=None, settle=0.5, wait=True):
        self.width = width
        return self.state()


class IdealArm:
    """An arm that tracks perfectly."""

    def __init__(self, spec, base=BASE):
        self.spec, self.base_pose = spec, base
        self.q, self.gripper, self.executed = np.array(spec.home), IdealGripper(spec.gripper), []

    def state(self):
        pose = Se3Pose.of(chain(self.spec).tcp_poses(self.q, self.base_pose.matrix)[0])
        return ArmState(0, JointState(self.q.copy()), self.gripper.state(), pose)

    def execute(self, trajectory, *, tolerance=0.01):
        assert np.abs(trajectory.positions[0] - self.q).max() < 0.02
        self.executed.append(trajectory)
        self.q = np.array(trajectory.positions[-1])

    def start(self, trajectory, *, tolerance=0.01, replace=False):
        self.execute(trajectory, tolerance=tolerance)

    def finish(self):
        pass

    def setpoint(self):
        still = np.zeros(self.spec.dof)
        return Setpoint(self.q, still, still, self.q)

    def stop(self):
        pass


@pytest.fixture
def robot():
    return REGISTRY.robot


@pytest.fixture(params=["panda", "ur5e"])
def spec(request):
    return REGISTRY.robot(request.param)


@pytest.fixture
def arm(spec):
    return chain(spec)


@pytest.fixture
def cell(spec):
    """A context with one arm, and `call(name, **inputs)`."""
    ideal = IdealArm(spec)
    environment = SimpleNamespace(workspace=((-1.5, -1.5, -0.2), (1.5, 1.5, 1.5)))
    task = SimpleNamespace(environment=environment, robots=[SimpleNamespace(home=None)])
    context = SimpleNamespace(
        cell=SimpleNamespace(arms=[ideal], wait=lambda seconds: None), task=task, state={}, seed=0,
        robot=lambda arm_id=0: spec, shared=lambda key, make: make(), raise_if_cancelled=lambda: None,
    )  # fmt: skip
    return SimpleNamespace(
        context=context, arm=ideal, call=lambda name, **inputs: REGISTRY.tool(name)(context, **inputs)
    )


def random_joints(spec, count, seed=0, margin=0.1):
    low, high = (np.array([getattr(x, k) for x in spec.limits]) for k in ("lower", "upper"))
    return np.random.default_rng(seed).uniform(low + margin, high - margin, (count, spec.dof))
