"""What changed in the world between two instants: poses, contacts, jaws, the TCP. Ground truth, for feedback only."""

from __future__ import annotations

from typing import Any

import numpy as np

from gap_runtime.contracts.snapshot import BodyState, WorldSnapshot

MOVED = 0.001  # m: smaller shifts are not worth a reader's attention
TURNED = 1.0  # deg
OPENED = 0.001  # m
JOINT = 0.001  # rad or m


def changes(before: WorldSnapshot, after: WorldSnapshot) -> dict[str, Any]:
    """Per body what moved [m], turned [deg], and which contacts came (+) and went (-); jaws [m]; TCP [m]. Only what
    changed appears, in sorted order."""
    found: dict[str, Any] = {}
    for name in sorted(before.bodies.keys() & after.bodies.keys()):
        body = _body(before.bodies[name], after.bodies[name])
        if body:
            found[name] = body
    for name in sorted(before.joints.keys() & after.joints.keys()):
        if abs(after.joints[name] - before.joints[name]) > JOINT:
            found[name] = {"position": [before.joints[name], after.joints[name]]}
    for i, (old, new) in enumerate(zip(before.arms, after.arms, strict=True)):
        arm: dict[str, Any] = {}
        if abs(new.gripper_width - old.gripper_width) > OPENED:
            arm["gripper"] = [old.gripper_width, new.gripper_width]
        shift = new.tcp.position.array - old.tcp.position.array
        if np.linalg.norm(shift) > MOVED:
            arm["tcp_moved"] = shift
        if arm:
            found[f"arm:{i}"] = arm
    return found


def _body(before: BodyState, after: BodyState) -> dict[str, Any]:
    found: dict[str, Any] = {}
    shift = after.pose.position.array - before.pose.position.array
    if np.linalg.norm(shift) > MOVED:
        found["moved"] = shift
    turn = np.degrees((after.pose.rotation.rotation * before.pose.rotation.rotation.inv()).magnitude())
    if turn > TURNED:
        found["turned_deg"] = float(turn)
    came, went = sorted(after.contacts - before.contacts), sorted(before.contacts - after.contacts)
    if came or went:
        found["contacts"] = [f"+{c}" for c in came] + [f"-{c}" for c in went]
    return found
