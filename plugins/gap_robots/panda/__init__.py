"""The Franka Emika Panda with its two-finger hand, as data: names, limits with their sources, shape, wrist camera."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache
from pathlib import Path

from gap_robots.spheres import read_spheres
from gap_robots.visuals import panda_visuals
from gap_runtime.contracts.robot import CameraSpec, GripperSpec, JointLimits, RobotSpec

FOLDER = Path(__file__).parent
FCI = "Franka Control Interface documentation, 'Robot and interface specifications', limits for Panda"
LOWER = (-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973)
UPPER = (2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973)
VELOCITY = (2.175, 2.175, 2.175, 2.175, 2.61, 2.61, 2.61)
ACCELERATION = (15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0)
JERK = (7500.0, 3750.0, 5000.0, 6250.0, 7500.0, 10000.0, 10000.0)
TORQUE = (87.0, 87.0, 87.0, 87.0, 12.0, 12.0, 12.0)

# TCP 0.45 m in front of the base and 0.45 m above its foot, pointing straight down, jaws along the base's y axis.
# Higher than LIBERO's start (0.25 m): from here the wrist camera sees 1.1 m x 0.8 m of the table at once, and the
# hand hides none of it from a camera across the table.
HOME = (0.0, -0.34969, 0.0, -2.12636, 0.0, 1.77667, math.pi / 4)


@cache
def panda() -> RobotSpec:
    """The spec; the same object every time."""
    limits = zip(LOWER, UPPER, VELOCITY, ACCELERATION, JERK, TORQUE, strict=True)
    return RobotSpec(
        name="panda",
        model_file=FOLDER / "panda.xml",
        base_link="panda_link0",
        flange_link="panda_hand",
        joints=tuple(f"panda_joint{i}" for i in range(1, 8)),
        limits=tuple(JointLimits(*row) for row in limits),
        home=HOME,
        tcp_offset_position=(0.0, 0.0, 0.1034),
        tcp_offset_quaternion=(1.0, 0.0, 0.0, 0.0),
        gripper=GripperSpec(
            max_width=0.08,
            max_force=70.0,
            max_speed=0.1,
            finger_depth=0.037,
            finger_size=(0.00725, 0.009, 0.0099),
            joints=("panda_finger_joint1", "panda_finger_joint2"),
        ),
        tcp_velocity=1.7,
        reach=0.77,
        spheres=read_spheres(FOLDER / "spheres.json"),
        self_collision_ignore=(
            ("panda_link0", "panda_link2"),
            ("panda_link1", "panda_link3"),
            ("panda_link2", "panda_link4"),
            ("panda_link3", "panda_link5"),
            ("panda_link4", "panda_link6"),
            ("panda_link5", "panda_link7"),
            ("panda_link6", "panda_hand"),
            ("panda_link7", "panda_leftfinger"),
            ("panda_link7", "panda_rightfinger"),
            ("panda_leftfinger", "panda_rightfinger"),
        ),
        cameras=(WRIST,),
        visuals=panda_visuals(),
        sources=SOURCES,
    )


@cache
def panda_bimanual() -> RobotSpec:
    """One of the two Pandas of a bimanual cell, which lists it twice: arm 0 first, each with its own place.

    Placed side by side they need `SIDE_BY_SIDE` between their bases: their homes and forward workspaces are then apart.
    """
    return replace(panda(), name="panda-bimanual", home=BIMANUAL_HOME)


SIDE_BY_SIDE = 0.4  # m between the bases, along their common y axis
# Nearer and higher than HOME, out of the shared middle: TCP 0.40 m in front of the base, 0.50 m above its foot.
BIMANUAL_HOME = (0.0, -0.4908, 0.0, -2.12033, 0.0, 1.62953, math.pi / 4)

# Beside the hand, looking along the fingers, far enough forward that the open fingers end just below the picture;
# its top is the hand's +x.
WRIST = CameraSpec(
    name="wrist",
    mount="panda_hand",
    position=(0.06, 0.0, 0.045),
    quaternion=(math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)),
    fovy=75.0,
)

SOURCES = {
    "limits": FCI,
    "tcp_velocity": FCI,
    "tcp_offset_position": "Franka Hand datasheet: fingertip centre 103.4 mm from the hand's flange",
    "gripper.max_width": "Franka Hand product manual: travel 80 mm",
    "gripper.max_force": "Franka Hand product manual: continuous grasping force 70 N",
    "gripper.max_speed": "Franka Hand product manual: 50 mm/s per finger",
    "gripper.finger_size": "measured on the finger's published mesh",
    "gripper.finger_depth": "distance from the TCP to the palm, from the published mesh of the hand",
    "reach": "inverse kinematics of top-down poses of every yaw up to 0.3 m above the foot: all solved to 0.78 m",
    "home": "chosen here; see the comment beside it",
    "cameras": "fovy and distance from the hand as in robosuite's eye-in-hand camera for the Panda",
    "inertias": "Gaz et al., Dynamic Identification of the Franka Emika Panda Robot, RA-L 2019",
}
