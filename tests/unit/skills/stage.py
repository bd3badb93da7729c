"""A context for canonical scripts: real geometry tools, everything else as the test says."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
from scipy.spatial.transform import Rotation

from gap_cli.skills import load_library
from gap_runtime.contracts.types import JointState, OrientedBoundingBox, Quaternion, Se3Pose, Vec3
from gap_runtime.graph.callees import load_script
from gap_runtime.plugins import load_registry

REGISTRY = load_registry()
LIBRARY = load_library(REGISTRY.skill_paths)
DOWN = Quaternion(0.0, 1.0, 0.0, 0.0)
ROBOTS = [REGISTRY.robot(name) for name in sorted(REGISTRY.robots) if "bimanual" not in name]


def script(skill, name):
    return load_script(LIBRARY[skill].scripts[name])


def box(center, size, yaw=0.0):
    """A box by its full size."""
    turned = Quaternion.of(Rotation.from_euler("z", yaw))
    return OrientedBoundingBox(Vec3.of(center), Vec3.of(np.array(size) / 2), turned)


def cloud(obb, count=9):
    """Points (N, 3) on the box's surface."""
    grid = np.linspace(-1, 1, count)
    points = np.array([[x, y, z] for x in grid for y in grid for z in grid])
    points = points[np.abs(points).max(axis=1) == 1]
    return obb.orientation.rotation.apply(points * obb.extent.array) + obb.center.array


class Stage:
    """What a script sees as `ctx`. `answers` maps a tool to what it returns or a function of its inputs."""

    seed = 0

    def __init__(self, spec, **answers):
        self.spec, self.calls = spec, []
        home = Se3Pose(Vec3(-0.15, 0.0, 0.45), DOWN)
        self.answers = {
            "pyroki.SolveIK": SimpleNamespace(success=True, joint_config=JointState(np.array(spec.home))),
            "robot_control.GetEEPose": SimpleNamespace(pose=home),
            **{name.replace("__", "."): answer for name, answer in answers.items()},
        }

    def robot(self, arm_id=0):
        return self.spec

    def tool(self, name, /, **inputs):
        self.calls.append((name, inputs))
        answer = self.answers.get(name, None)
        if answer is None:
            return REGISTRY.tool(name)(None, **inputs)
        return answer(**inputs) if callable(answer) else answer
