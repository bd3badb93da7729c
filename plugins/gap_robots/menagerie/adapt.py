"""Gives a Menagerie arm GaP's conventions: servos named after their joints, a jaw on one actuator, and a `tcp` site."""

from __future__ import annotations

import hashlib
import logging
import os
import tempfile
import xml.etree.ElementTree as ET
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from gap_runtime.contracts.failures import DocumentError
from gap_runtime.contracts.types import Array

log = logging.getLogger(__name__)
MOUNTS = ("attachment_site", "attachment", "ee_site", "end_effector", "tool0")
HANDS = ("right_hand",)  # bodies that robosuite mounts grippers on, at their origin
STIFFNESS_PER_TORQUE, DAMPING_PER_STIFFNESS = 45.0, 0.04  # of a servo: 1/rad, s
CONTINUOUS = 2 * np.pi  # rad, either way: the range of a joint without one, since a servo's target has bounds
DEFAULT_TORQUE = 30.0  # Nm, for a joint whose model names none
JAW_FORCE, JAW_STIFFNESS, JAW_DAMPING = 60.0, 3500.0, 30.0


@dataclass(frozen=True)
class Adapted:
    """The adapted model: its file, the arm's joints from base to tip, the jaw's joints, base and flange bodies."""

    file: Path
    joints: tuple[str, ...]
    fingers: tuple[str, str]
    base: str
    flange: str
    torques: tuple[float, ...]
    home: tuple[float, ...] | None


def adapt(source: Path, name: str) -> Adapted:
    """Adapt a model and write it beside others of its kind in the user's cache.

    Raises `DocumentError` when it is not one arm, or has neither two sliding fingers nor a site to mount a jaw on.
    """
    import mujoco

    mujoco.set_mju_user_warning(log.info)
    spec = mujoco.MjSpec.from_file(str(source))
    for joint in spec.joints:
        if joint.type == mujoco.mjtJoint.mjJNT_HINGE and joint.range[0] >= joint.range[1]:
            joint.limited, joint.range = mujoco.mjtLimited.mjLIMITED_TRUE, [-CONTINUOUS, CONTINUOUS]
    home = _home(spec.compile())
    if len(_slides(spec.compile())) != 2:
        _mount_jaw(spec, source)
    model = spec.compile()
    joints, fingers = _arm(model, source), _slides(model)
    torques = tuple(_torque(model, joint) for joint in joints)
    flange = model.body(model.body_parentid[model.joint(fingers[0]).bodyid[0]]).name
    base = model.body(model.body_parentid[model.joint(joints[0]).bodyid[0]]).name
    _set_servos(spec, joints, torques)
    _set_jaw(spec, fingers, float(sum(model.joint(f).range[1] for f in fingers)))
    for body in spec.bodies:
        body.gravcomp = 1.0
    spec.compiler.meshdir = spec.compiler.texturedir = str((source.parent / (spec.meshdir or ".")).resolve())
    spec.compile()
    file = _write(spec.to_xml(), source, name)
    return Adapted(file, joints, fingers, base, flange, torques, home[: len(joints)] if home else None)


def _arm(model: Any, source: Path) -> tuple[str, ...]:
    """Hinges in series from the base: each on a body below the one before."""
    import mujoco

    chain: list[int] = []
    for joint in range(model.njnt):
        if model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_HINGE and (not chain or _below(model, joint, chain[-1])):
            chain.append(joint)
    if len(chain) < 5 or model.body(model.body_parentid[model.jnt_bodyid[chain[0]]]).id == 0:
        raise DocumentError(str(source), f"is not one arm on a base: it has {len(chain)} hinges in series")
    return tuple(model.joint(j).name for j in chain)


def _below(model: Any, joint: int, above: int) -> bool:
    body, target = int(model.jnt_bodyid[joint]), int(model.jnt_bodyid[above])
    while body not in (0, target):
        body = int(model.body_parentid[body])
    return body == target


def _slides(model: Any) -> Any:
    import mujoco

    return tuple(model.joint(j).name for j in range(model.njnt) if model.jnt_type[j] == mujoco.mjtJoint.mjJNT_SLIDE)


def _torque(model: Any, joint: str) -> float:
    """What the model says a joint can do: its force range, that of its actuator, or a motor's control range."""
    import mujoco

    index = model.joint(joint).id
    if model.jnt_actfrclimited[index]:
        return float(model.jnt_actfrcrange[index, 1])
    for actuator in range(model.nu):
        if model.actuator_trnid[actuator, 0] != index:
            continue
        gear = abs(float(model.actuator_gear[actuator, 0]))
        if model.actuator_forcelimited[actuator]:
            return gear * float(model.actuator_forcerange[actuator, 1])
        motor = model.actuator_biastype[actuator] == mujoco.mjtBias.mjBIAS_NONE
        if motor and model.actuator_ctrllimited[actuator]:
            return gear * float(model.actuator_gainprm[actuator, 0] * model.actuator_ctrlrange[actuator, 1])
    return DEFAULT_TORQUE


def _home(model: Any) -> tuple[float, ...] | None:
    keys = {model.key(i).name: model.key(i).qpos for i in range(model.nkey)}
    return tuple(float(v) for v in keys["home"]) if "home" in keys else None


def _mount_jaw(spec: Any, source: Path) -> None:
    """Mount the UR5e's jaw where the model has a place for a tool."""
    import mujoco

    from gap_robots.ur5e import FOLDER

    site = next((s for name in MOUNTS if (s := spec.site(name)) is not None), None)
    hand = next((b for name in HANDS if (b := spec.body(name)) is not None), None)
    if site is None and hand is not None:
        site = hand.add_site(name=MOUNTS[0])
    if site is None:
        raise DocumentError(
            str(source),
            "has no pair of sliding fingers, and nothing to mount a jaw on",
            hint=f"Name a site {', '.join(MOUNTS)}, or a body {', '.join(HANDS)}.",
        )
    jaw = mujoco.MjSpec.from_file(str(FOLDER / "ur5e.xml")).body("tool0")
    jaw.pos = [0.0, 0.0, 0.0]
    site.attach_body(jaw, "jaw_", "")


def _set_servos(spec: Any, joints: tuple[str, ...], torques: tuple[float, ...]) -> None:
    """Replace every actuator by position servos named after the joints, gravity compensated within their torque."""
    import mujoco

    for item in [*spec.actuators, *spec.sensors, *spec.keys, *spec.tendons]:
        spec.delete(item)
    for name, torque in zip(joints, torques, strict=True):
        joint = spec.joint(name)
        joint.actgravcomp = True
        joint.actfrclimited, joint.actfrcrange = mujoco.mjtLimited.mjLIMITED_TRUE, [-torque, torque]
        _position(spec, name, mujoco.mjtTrn.mjTRN_JOINT, name, STIFFNESS_PER_TORQUE * torque, torque, list(joint.range))


def _set_jaw(spec: Any, fingers: tuple[str, str], width: float) -> None:
    """Both fingers on one tendon, coupled, driven by the actuator `gripper` whose target is the width."""
    import mujoco

    tendon = spec.add_tendon(name="jaw_width")
    for finger in fingers:
        tendon.wrap_joint(finger, 1.0)
    if not any(e.type == mujoco.mjtEq.mjEQ_JOINT for e in spec.equalities):
        spec.add_equality(type=mujoco.mjtEq.mjEQ_JOINT, name1=fingers[0], name2=fingers[1])
    kp, kv = JAW_STIFFNESS, JAW_DAMPING
    _position(spec, "gripper", mujoco.mjtTrn.mjTRN_TENDON, "jaw_width", kp, JAW_FORCE, [-0.02, width], kv)


def _position(
    spec: Any, name: str, kind: Any, target: str, kp: float, force: float, ctrl: list[float], kv: float | None = None
) -> None:
    made = spec.add_actuator(name=name, trntype=kind, target=target)
    made.set_to_position(kp=kp, kv=DAMPING_PER_STIFFNESS * kp if kv is None else kv)
    made.forcelimited, made.forcerange = 1, [-force, force]
    made.ctrllimited, made.ctrlrange = 1, ctrl


def _write(text: str, source: Path, name: str) -> Path:
    """Write the model, whole or not at all, under a name that changes with its content."""
    root = ET.fromstring(text)
    _dissolve_frames(root)
    data = ET.tostring(root, encoding="unicode")
    key = hashlib.sha256(f"{source.resolve()}\0{data}".encode()).hexdigest()[:12]
    folder = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "gap" / "menagerie"
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / f"{name}-{key}.xml"
    if not file.exists():
        with tempfile.NamedTemporaryFile("w", dir=folder, delete=False) as part:
            part.write(data)
        Path(part.name).replace(file)
    return file


def _dissolve_frames(element: ET.Element) -> None:
    """Give what is in each <frame> the frame's pose on top of its own: dm_control does not know frames."""
    children: list[ET.Element] = []
    for child in list(element):
        _dissolve_frames(child)
        element.remove(child)
        children += [_moved(inner, child) for inner in child] if child.tag == "frame" else [child]
    element.extend(children)


def _moved(element: ET.Element, frame: ET.Element) -> ET.Element:
    """The element at its pose in the frame; MuJoCo writes poses as `pos` and `quat`."""
    (R, p), (R_inner, p_inner) = _pose(frame), _pose(element)
    x, y, z, w = (R * R_inner).as_quat(canonical=True)
    element.set("pos", " ".join(f"{v:.9g}" for v in R.apply(p_inner) + p))
    if element.tag == "body" and "childclass" in frame.attrib:
        element.attrib.setdefault("childclass", frame.attrib["childclass"])
    element.set("quat", " ".join(f"{v:.9g}" for v in (w, x, y, z)))
    return element


def _pose(element: ET.Element) -> tuple[Rotation, Array]:
    if found := {"euler", "axisangle", "xyaxes", "zaxis", "fromto"} & element.attrib.keys():
        raise ValueError(f"a <{element.tag}> in a frame is turned by {found.pop()}; only quat is understood")
    w, x, y, z = map(float, element.get("quat", "1 0 0 0").split())
    return Rotation.from_quat([x, y, z, w]), np.array([float(v) for v in element.get("pos", "0 0 0").split()])


def box_of(model: Any, body: int) -> tuple[Array, Array]:
    """Corners (8, 3) of the collision geoms of a body in its own frame, as (low, high)."""
    import mujoco

    corners = []
    for geom in range(model.ngeom):
        if model.geom_bodyid[geom] == body and (model.geom_contype[geom] or model.geom_conaffinity[geom]):
            R = np.zeros(9)
            mujoco.mju_quat2Mat(R, model.geom_quat[geom])
            center, half = model.geom_aabb[geom, :3], model.geom_aabb[geom, 3:]
            signs = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)])
            corners.append((center + signs * half) @ R.reshape(3, 3).T + model.geom_pos[geom])
    rows = np.concatenate(corners) if corners else np.zeros((1, 3))
    return rows.min(axis=0), rows.max(axis=0)
