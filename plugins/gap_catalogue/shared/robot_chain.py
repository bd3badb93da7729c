"""Forward kinematics of an arm, vectorised over configurations, from its MJCF alone.

Every link is fixed to the frame behind one arm joint, so a pose costs one product per joint. Poses are homogeneous
matrices in the arm's base frame unless a T_world_base is given. Finger joints stay where the jaw width puts them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from gap_runtime.contracts.failures import BadRequestError, did_you_mean
from gap_runtime.contracts.robot import RobotSpec
from gap_runtime.contracts.types import Array


@dataclass(frozen=True, eq=False)
class Link:
    """A body: the arm joint it moves with (-1: none), its transform in the frame behind that joint, and, for a
    finger, how far it moves per metre of jaw width, in the same frame."""

    frame: int
    transform: Array
    slide: Array


@dataclass(frozen=True, eq=False)
class Chain:
    """An arm's kinematics. `before[i]` is the fixed transform from the frame behind joint i-1 to joint i, turned so
    that every joint rotates about its own z axis. `tcp` is T_flange_tcp behind the last joint."""

    spec: RobotSpec
    before: Array
    links: dict[str, Link]
    tcp: Array

    @property
    def dof(self) -> int:
        """Number of arm joints."""
        return len(self.before)

    @cached_property
    def low(self) -> Array:
        """Lower joint limits [rad], shape (n,); this and the next are read-only, since everyone shares them."""
        return self._limits("lower")

    @cached_property
    def high(self) -> Array:
        """Upper joint limits [rad], shape (n,)."""
        return self._limits("upper")

    @cached_property
    def velocity(self) -> Array:
        """Velocity limits [rad/s], shape (n,)."""
        return self._limits("velocity")

    @cached_property
    def acceleration(self) -> Array:
        """Acceleration limits [rad/s^2], shape (n,)."""
        return self._limits("acceleration")

    def _limits(self, kind: str) -> Array:
        values = np.array([getattr(limit, kind) for limit in self.spec.limits])
        values.flags.writeable = False
        return values

    def frames(self, q: Array, base: Array | None = None) -> Array:
        """Frames behind every joint for configurations (N, n): homogeneous (n, N, 4, 4), of the dtype of `q`."""
        q = np.atleast_2d(q)
        fixed = self.before.astype(q.dtype, copy=False)[:, None]
        cos, sin = np.cos(q).T[:, :, None], np.sin(q).T[:, :, None]
        step = np.empty((self.dof, len(q), 4, 4), dtype=q.dtype)
        step[..., 0] = cos * fixed[..., 0] + sin * fixed[..., 1]
        step[..., 1] = cos * fixed[..., 1] - sin * fixed[..., 0]
        step[..., 2:] = fixed[..., 2:]
        out = np.empty_like(step)
        out[0] = step[0] if base is None else base.astype(q.dtype, copy=False) @ step[0]
        for i in range(1, self.dof):
            np.matmul(out[i - 1], step[i], out=out[i])
        return out

    def tcp_poses(self, q: Array, base: Array | None = None) -> Array:
        """Homogeneous T_base_tcp (or T_world_tcp), shape (N, 4, 4)."""
        return self.poses(q, self.tcp, base)

    def poses(self, q: Array, offset: Array, base: Array | None = None) -> Array:
        """Poses of a frame fixed behind the last joint by `offset` (4, 4); shape (N, 4, 4)."""
        return np.asarray(self.frames(q, base)[-1] @ offset)

    def link_offset(self, name: str) -> Array:
        """Transform of a link behind the last joint, shape (4, 4). Raises `BadRequestError` (`unknown_link`)."""
        last = {n: link for n, link in self.links.items() if link.frame == self.dof - 1}
        if name not in last:
            known = sorted(last)
            raise BadRequestError(
                "unknown_link",
                f"{self.spec.name} has no link {name!r} beyond its last joint.",
                hint=did_you_mean(name, known),
            )
        return last[name].transform

    def jacobian(self, q: Array, offset: Array) -> tuple[Array, Array]:
        """Pose (4, 4) and geometric Jacobian (6, n), linear rows first, of a frame behind the last joint, for one q."""
        frames = self.frames(q)[:, 0]
        T = frames[-1] @ offset
        axes = frames[:, :3, 2]
        return T, np.concatenate([np.cross(axes, T[:3, 3] - frames[:, :3, 3]), axes], axis=1).T


_CHAINS: dict[int, Chain] = {}  # by id of the spec, which the chain keeps alive


def chain(spec: RobotSpec) -> Chain:
    """The chain of a robot, read once per process."""
    if id(spec) not in _CHAINS:
        import mujoco

        _CHAINS[id(spec)] = read_chain(spec, mujoco.MjModel.from_xml_path(str(spec.model_file)))
    return _CHAINS[id(spec)]


def read_chain(spec: RobotSpec, model: Any) -> Chain:
    """Walk the model's bodies from the base link outwards. Raises ValueError where an arm joint is not a hinge."""
    import mujoco

    base = model.body(spec.base_link).id
    frame_of: dict[int, Link] = {base: Link(-1, _in_root(model, base), np.zeros(3))}
    before: list[Array] = []
    for body in range(base + 1, model.nbody):
        parent = frame_of.get(int(model.body_parentid[body]))
        if parent is None:
            continue
        T = parent.transform @ _transform(model.body_pos[body], model.body_quat[body])
        frame, slide = parent.frame, parent.slide
        for joint in range(model.body_jntadr[body], model.body_jntadr[body] + model.body_jntnum[body]):
            name = model.joint(joint).name
            if name in spec.joints:
                if model.jnt_type[joint] != mujoco.mjtJoint.mjJNT_HINGE:
                    raise ValueError(f"{spec.name}: joint {name!r} is not a hinge")
                align = _align(model.jnt_pos[joint], model.jnt_axis[joint])
                before.append(T @ align)
                T, frame = np.linalg.inv(align), len(before) - 1
            elif name in spec.gripper.joints:
                slide = slide + T[:3, :3] @ model.jnt_axis[joint] / len(spec.gripper.joints)
        frame_of[body] = Link(frame, T, slide)
    links = {model.body(body).name: link for body, link in frame_of.items()}
    tcp = links[spec.flange_link].transform @ tcp_matrix(spec)
    return Chain(spec, np.array(before), links, tcp)


def _in_root(model: Any, body: int) -> Array:
    """The pose of a body that does not move in the model's root, which is what stands at T_world_base."""
    T = np.eye(4)
    while body:
        T = _transform(model.body_pos[body], model.body_quat[body]) @ T
        body = int(model.body_parentid[body])
    return T


def tcp_matrix(spec: RobotSpec) -> Array:
    """T_flange_tcp, shape (4, 4)."""
    return _transform(np.array(spec.tcp_offset_position), np.array(spec.tcp_offset_quaternion))


def sphere_centers(spec: RobotSpec, joints: Sequence[float] | Array, width: float | None = None) -> Array:
    """Centres of the spec's spheres in the arm's base frame at one configuration, shape (len(spec.spheres), 3) [m].

    `width` is the jaw opening [m], by default fully open.
    """
    arm = chain(spec)
    frames = arm.frames(np.asarray(joints, dtype=float))[:, 0]
    opening = spec.gripper.max_width if width is None else width
    out = np.empty((len(spec.spheres), 3))
    for k, sphere in enumerate(spec.spheres):
        link = arm.links[sphere.link]
        local = link.transform[:3, :3] @ sphere.center + link.transform[:3, 3] + link.slide * opening
        out[k] = local if link.frame < 0 else frames[link.frame, :3, :3] @ local + frames[link.frame, :3, 3]
    return out


def _transform(position: Array, quaternion: Array) -> Array:
    T = np.eye(4)
    T[:3, :3] = Rotation.from_quat(np.asarray(quaternion)[[1, 2, 3, 0]]).as_matrix()
    T[:3, 3] = position
    return T


def _align(position: Array, axis: Array) -> Array:
    """A frame at the joint's anchor whose z axis is the joint's."""
    T = np.eye(4)
    T[:3, 3] = position
    if axis[2] < 1 - 1e-12:
        T[:3, :3] = Rotation.align_vectors([axis], [[0.0, 0.0, 1.0]])[0].as_matrix()
    return T


def joint_range(spec: RobotSpec) -> tuple[Array, Array]:
    """Lower and upper joint limits [rad], each shape (n,)."""
    return np.array([x.lower for x in spec.limits]), np.array([x.upper for x in spec.limits])
