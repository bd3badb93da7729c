"""Reads a RobotSpec off an adapted Menagerie model: joints and jaw from the file, the rest on the safe side."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from itertools import combinations
from typing import Any

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from gap_robots.menagerie.adapt import JAW_FORCE, Adapted, box_of
from gap_robots.spheres import cover_model
from gap_runtime.contracts.robot import CameraSpec, CollisionSphere, GripperSpec, JointLimits, RobotSpec
from gap_runtime.contracts.types import Array

# Neither MJCF nor Menagerie states rates; these are slower than any arm of the collection.
VELOCITY, ACCELERATION, JERK, TCP_VELOCITY, JAW_SPEED = 1.0, 4.0, 2000.0, 0.8, 0.05
TIP = 0.01  # m from the fingertips' ends to the TCP
# Of a home: TCP ahead of the base, as a share of the arm's length, and above it [m]; joints' distance from their ends,
# as a share of their ranges; how many configurations its search begins from.
READY_AHEAD, READY_ABOVE, READY_MARGIN, STARTS = 0.5, 0.45, 0.05, 24
SAMPLES, ALWAYS = 1000, 0.6  # configurations looked at; links that touch in more of them than this are neighbours
CHOSEN = "not in the model: chosen below every arm of the collection"


def describe(adapted: Adapted, name: str) -> RobotSpec:
    """The spec of an adapted model."""
    import mujoco

    model = mujoco.MjModel.from_xml_path(str(adapted.file))
    data = mujoco.MjData(model)
    middle = np.array([np.mean(model.joint(j).range) for j in adapted.joints])
    _place(model, data, adapted, middle if adapted.home is None else np.array(adapted.home))
    T_flange_tcp, finger = _tcp(model, data, adapted)
    if adapted.home is None:
        adapted = replace(adapted, home=_ready(model, data, adapted, T_flange_tcp, middle))
    home = adapted.home or ()
    spheres = cover_model(adapted.file)
    x, y, z, w = Rotation.from_matrix(T_flange_tcp[:3, :3]).as_quat(canonical=True)
    return RobotSpec(
        name=name,
        model_file=adapted.file,
        base_link=adapted.base,
        flange_link=adapted.flange,
        joints=adapted.joints,
        limits=tuple(_limits(model, j, t) for j, t in zip(adapted.joints, adapted.torques, strict=True)),
        home=home,
        tcp_offset_position=_triple(T_flange_tcp[:3, 3]),
        tcp_offset_quaternion=(float(w), float(x), float(y), float(z)),
        gripper=GripperSpec(
            max_width=float(sum(model.joint(f).range[1] for f in adapted.fingers)),
            max_force=JAW_FORCE,
            max_speed=JAW_SPEED,
            finger_depth=max(0.01, float(finger[2]) - 2 * TIP),
            finger_size=(max(0.002, float(finger[1]) / 2), float(finger[0]) / 2, TIP),
            joints=adapted.fingers,
        ),
        tcp_velocity=TCP_VELOCITY,
        reach=0.8 * _length(model, data, adapted),
        spheres=tuple(CollisionSphere(b, (r[0], r[1], r[2]), r[3]) for b, rows in spheres.items() for r in rows),
        self_collision_ignore=_neighbours(model, data, adapted, spheres),
        cameras=(_wrist(adapted, T_flange_tcp),),
        sources={"limits": f"ranges and torques from the model; rates {CHOSEN}", "tcp_velocity": CHOSEN,
                 "gripper.max_force": CHOSEN, "home": "the model's keyframe, else found by inverse kinematics",
                 "tcp_offset_position": f"{TIP} m short of the fingertips in the model"},
    )  # fmt: skip


def _limits(model: Any, joint: str, torque: float) -> JointLimits:
    limited = bool(model.jnt_limited[model.joint(joint).id])
    low, high = (float(v) for v in model.joint(joint).range) if limited else (-2 * np.pi, 2 * np.pi)
    return JointLimits(low, high, VELOCITY, ACCELERATION, JERK, torque)


def _ready(model: Any, data: Any, adapted: Adapted, T_flange_tcp: Array, middle: Array) -> tuple[float, ...]:
    """A home for a model that names none: the TCP before the base and above its foot, pointing straight down, joints as
    near to the middle of their ranges as that allows. The middle itself where no such pose is found."""
    ranges = np.array([model.joint(j).range for j in adapted.joints])
    low, high = np.maximum(ranges[:, 0], -np.pi), np.minimum(ranges[:, 1], np.pi)
    base, flange = model.body(adapted.base).id, model.body(adapted.flange).id
    ahead = READY_AHEAD * min(1.0, _length(model, data, adapted))

    def residual(q: Array) -> Array:
        _place(model, data, adapted, q)
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = data.xmat[flange].reshape(3, 3), data.xpos[flange]
        T = T @ T_flange_tcp
        place = (T[:3, 3] - data.xpos[base] - [ahead, 0.0, READY_ABOVE]) * 5
        return np.concatenate([place, T[:3, 2] - [0.0, 0.0, -1.0], 0.7 * T[:1, 1], 0.02 * (q - middle) / (high - low)])

    rng, margin = np.random.default_rng(0), READY_MARGIN * (high - low)
    starts = [
        np.clip(middle, low + margin, high - margin),
        *rng.uniform(low + margin, high - margin, (STARTS, len(low))),
    ]
    found = [least_squares(residual, q, bounds=(low, high), max_nfev=60) for q in starts]
    fitting = [s for s in found if np.abs(s.fun[:7]).max() < 0.02]
    return tuple(float(v) for v in (min(fitting, key=lambda s: s.cost).x if fitting else middle))


def _place(model: Any, data: Any, adapted: Adapted, q: Array) -> None:
    import mujoco

    for name, value in zip(adapted.joints, q, strict=True):
        data.qpos[model.joint(name).qposadr[0]] = value
    for name in adapted.fingers:
        data.qpos[model.joint(name).qposadr[0]] = model.joint(name).range[1]
    mujoco.mj_forward(model, data)


def _tcp(model: Any, data: Any, adapted: Adapted) -> tuple[Array, Array]:
    """T_flange_tcp, and the size of a finger along (width, closing, approach): z runs to the tips, y across them."""
    flange = model.body(adapted.flange).id
    R, origin = data.xmat[flange].reshape(3, 3), data.xpos[flange]
    bodies = [int(model.joint(f).bodyid[0]) for f in adapted.fingers]
    closing = R.T @ data.xmat[bodies[0]].reshape(3, 3) @ model.joint(adapted.fingers[0]).axis
    boxes = [_in_flange(model, data, body, R, origin) for body in bodies]
    middle = np.mean([b.mean(axis=0) for b in boxes], axis=0)
    approach = middle - closing * (middle @ closing)
    approach /= np.linalg.norm(approach)
    frame = np.stack([np.cross(closing, approach), closing, approach], axis=1)
    spans = np.concatenate(boxes) @ frame
    T = np.eye(4)
    T[:3, :3] = frame
    T[:3, 3] = frame @ [0.0, 0.0, float(spans[:, 2].max()) - TIP]
    one = boxes[0] @ frame
    return T, one.max(axis=0) - one.min(axis=0)


def _in_flange(model: Any, data: Any, body: int, R: Array, origin: Array) -> Array:
    low, high = box_of(model, body)
    corners = np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])
    return np.asarray((corners @ data.xmat[body].reshape(3, 3).T + data.xpos[body] - origin) @ R)


def _neighbours(
    model: Any, data: Any, adapted: Adapted, spheres: Mapping[str, list[list[float]]]
) -> tuple[tuple[str, str], ...]:
    """Links that touch in most configurations, since their shapes overlap where they are joined, and links that never
    touched though the coarser spheres around them do so at home."""
    rng = np.random.default_rng(0)
    ranges = np.array([model.joint(j).range for j in adapted.joints])
    seen: dict[tuple[str, str], int] = {}
    for q in rng.uniform(ranges[:, 0], ranges[:, 1], (SAMPLES, len(ranges))):
        _place(model, data, adapted, q)
        pairs = {tuple(sorted(_body(model, g) for g in (c.geom1, c.geom2))) for c in data.contact[: data.ncon]}
        for pair in pairs:
            seen[pair] = seen.get(pair, 0) + 1  # type: ignore[index,arg-type]
    joined = {pair for pair, count in seen.items() if count > ALWAYS * SAMPLES}
    _place(model, data, adapted, np.array(adapted.home or ranges.mean(axis=1)))
    coarse = {pair for pair in combinations(sorted(spheres), 2) if pair not in seen and _overlap(data, spheres, *pair)}
    return tuple(sorted(joined | coarse))


def _overlap(data: Any, spheres: Mapping[str, list[list[float]]], a: str, b: str) -> bool:
    """Whether any sphere of one link overlaps one of the other, where they are now."""
    sides = []
    for link in (a, b):
        rows, body = np.array(spheres[link]), data.body(link)
        sides.append((rows[:, :3] @ body.xmat.reshape(3, 3).T + body.xpos, rows[:, 3]))
    (p, r), (q, s) = sides
    return bool((np.linalg.norm(p[:, None] - q, axis=2) < r[:, None] + s).any())


def _body(model: Any, geom: int) -> str:
    return str(model.body(model.geom_bodyid[geom]).name)


def _length(model: Any, data: Any, adapted: Adapted) -> float:
    """From the second joint to the flange along the links [m]."""
    bodies = [int(model.joint(j).bodyid[0]) for j in adapted.joints[1:]] + [model.body(adapted.flange).id]
    return float(np.linalg.norm(np.diff(data.xpos[bodies], axis=0), axis=1).sum())


def _wrist(adapted: Adapted, T: Array) -> CameraSpec:
    """A camera beside the hand, looking along the approach; the top of its picture is the TCP's +x."""
    turn = Rotation.from_matrix(T[:3, :3]) * Rotation.from_euler("z", 90, degrees=True)
    x, y, z, w = turn.as_quat(canonical=True)
    place = T[:3, 3] + T[:3, :3] @ [0.07, 0.0, -0.07]
    return CameraSpec("wrist", adapted.flange, _triple(place), (float(w), float(x), float(y), float(z)), 75.0)


def _triple(v: Array) -> tuple[float, float, float]:
    return (float(v[0]), float(v[1]), float(v[2]))
