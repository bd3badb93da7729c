"""Reads ground truth out of the physics: poses, boxes, speeds and who touches whom."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from gap_mujoco.control.joint_controller import MujocoJointController
from gap_mujoco.model.footprint import outline
from gap_mujoco.model.props import cavity
from gap_mujoco.model.scene import Scene
from gap_mujoco.physics import Physics
from gap_runtime.contracts.failures import UnknownNameError
from gap_runtime.contracts.snapshot import ArmTruth, BodyState, WorldSnapshot
from gap_runtime.contracts.task import ObjectModel, Task
from gap_runtime.contracts.types import Array, OrientedBoundingBox, Quaternion, Se3Pose, Vec3


class GroundTruthReader:
    """Takes snapshots of one cell."""

    def __init__(
        self, task: Task, scene: Scene, physics: Physics, controllers: tuple[MujocoJointController, ...]
    ) -> None:
        self._physics, self._controllers = physics, controllers
        self._models: Mapping[str, ObjectModel] = {name: task.objects[name] for name in scene.objects}
        self._bodies = {name: physics.model.body(f"{name}/").id for name in scene.objects}
        self._outlines = {name: outline(model.shape) for name, model in self._models.items()}
        self._owners = _owners(physics.model, scene)
        self._joints = {name: _joint_address(physics.model, name) for name in task.joints}
        self._labels = {name: model.label for name, model in self._models.items()}

    def snapshot(self, start: WorldSnapshot | None) -> WorldSnapshot:
        """Everything that is true now."""
        data = self._physics.data
        contacts = self._contacts()
        bodies = {name: self._body(name, contacts.get(name, set())) for name in self._models}
        arms = tuple(ArmTruth(tuple(map(float, c.positions)), c.tcp(), c.gripper.width) for c in self._controllers)
        joints = {name: float(data.qpos[address]) for name, address in self._joints.items()}
        return WorldSnapshot(self._physics.time, bodies, joints, arms, self._labels, start)

    def joint_address(self, name: str) -> int:
        """Index into qpos of an articulated joint of the task. Raises `UnknownNameError`."""
        if name not in self._joints:
            raise UnknownNameError("joint", name, self._joints)
        return self._joints[name]

    def _body(self, name: str, contacts: set[str]) -> BodyState:
        data, shape = self._physics.data, self._models[name].shape
        body = self._bodies[name]
        position, R = data.xpos[body].copy(), data.xmat[body].reshape(3, 3)
        orientation = Quaternion.of(Rotation.from_matrix(R))
        box = OrientedBoundingBox(Vec3.of(position), Vec3.of(np.array(shape.size) / 2), orientation)
        hollow = None
        if shape.wall is not None or shape.cavity is not None:
            centre, half = cavity(shape)
            hollow = OrientedBoundingBox(Vec3.of(position + R @ centre), Vec3.of(half), orientation)
        velocity = np.zeros(6) if self._models[name].fixed else data.qvel[self._dof(body)]
        linear, angular = (float(np.linalg.norm(v)) for v in (velocity[:3], velocity[3:]))
        pose = Se3Pose(Vec3.of(position), orientation)
        parts = {
            part: OrientedBoundingBox(Vec3.of(position + R @ p.center), Vec3.of(np.array(p.size) / 2), orientation)
            for part, p in self._models[name].parts.items()
        }
        flat = self._outlines[name]
        covers = (position + np.column_stack([flat, np.zeros(len(flat))]) @ R.T)[:, :2]
        contacts = {c for c in contacts if c.partition(":")[0] != name}
        return BodyState(name, pose, box, linear, angular, frozenset(contacts), hollow, parts, covers)

    def _dof(self, body: int) -> slice:
        first = int(self._physics.model.body_dofadr[body])
        return slice(first, first + 6)

    def _contacts(self) -> dict[str, set[str]]:
        """By object: what it touches. Only contacts that carry force count."""
        contact = self._physics.data.contact
        touching: dict[str, set[str]] = {}
        active = contact.geom[contact.efc_address >= 0]
        for pair in {tuple(p) for p in active.tolist()}:
            a, b = (self._owners[g] for g in pair)
            touching.setdefault(a.partition(":")[0], set()).add(b)
            touching.setdefault(b.partition(":")[0], set()).add(a)
        return touching


def _owners(model: Any, scene: Scene) -> list[str]:
    """By geom: the name snapshots use for whatever it belongs to."""
    names = [_body_name(model, scene, i) for i in range(model.nbody)]
    return [names[body] or str(model.geom(g).name) for g, body in enumerate(model.geom_bodyid)]


def _body_name(model: Any, scene: Scene, body: int) -> str:
    """'' for the world itself, whose geoms have names of their own."""
    owner, _, link = str(model.body(body).name).partition("/")
    if owner in scene.objects:
        return f"{owner}:{link}" if link else owner
    arms = [f"arm{i}" for i in range(len(scene.robots))]
    if owner not in arms:
        return ""
    arm = arms.index(owner)
    moved_by = [model.joint(j).name.partition("/")[2] for j in range(model.njnt) if model.jnt_bodyid[j] == body]
    fingers = scene.robots[arm][0].gripper.joints
    for joint in moved_by:
        if joint in fingers:
            link = ("left_finger", "right_finger")[fingers.index(joint)]
    return f"robot:{arm}:{link}"


def _joint_address(model: Any, name: str) -> int:
    names = [model.joint(j).name for j in range(model.njnt)]
    found = [n for n in names if n == name or n.endswith("/" + name)]
    if not found:
        raise UnknownNameError("joint of the cell", name, names)
    return int(model.joint(found[0]).qposadr[0])


def pose_qpos(pose: Se3Pose) -> Array:
    """A pose as the seven numbers of a free joint."""
    q = pose.rotation
    return np.array([*pose.position.array, q.w, q.x, q.y, q.z])
