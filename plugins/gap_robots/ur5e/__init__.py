"""The Universal Robots UR5e with a parallel jaw, as data: names, limits with their sources, shape, wrist camera."""

from __future__ import annotations

import math
from functools import cache
from pathlib import Path

from gap_robots.spheres import read_spheres
from gap_runtime.contracts.robot import CameraSpec, GripperSpec, JointLimits, RobotSpec

FOLDER = Path(__file__).parent
SHEET = "Universal Robots UR5e datasheet"
JOINTS = (
    "shoulder_pan_joint",
    "shoulder_lift_joint",
    "elbow_joint",
    "wrist_1_joint",
    "wrist_2_joint",
    "wrist_3_joint",
)
FULL = 6.2832
RANGE = (FULL, FULL, 3.1416, FULL, FULL, FULL)  # the elbow by half a turn: beyond that, upper arm and forearm meet
TORQUE = (150.0, 150.0, 150.0, 28.0, 28.0, 28.0)
# The maker publishes neither. Accelerations leave half the torque for gravity and load with the arm stretched out
# (4.6 kg m2 about the shoulder); jerk is in the Panda's proportion to acceleration.
ACCELERATION = (10.0, 10.0, 15.0, 25.0, 25.0, 25.0)
JERK_PER_ACCELERATION = 500.0

# TCP 0.45 m in front of the base and 0.45 m above its foot, pointing straight down, jaws along the base's y axis.
HOME = (-0.30073, -1.68359, 1.41309, -1.3003, -math.pi / 2, -1.87153)


@cache
def ur5e() -> RobotSpec:
    """The spec; the same object every time."""
    limits = (
        JointLimits(-r, r, math.pi, a, JERK_PER_ACCELERATION * a, t)
        for r, a, t in zip(RANGE, ACCELERATION, TORQUE, strict=True)
    )
    return RobotSpec(
        name="ur5e",
        model_file=FOLDER / "ur5e.xml",
        base_link="base_link",
        flange_link="tool0",
        joints=JOINTS,
        limits=tuple(limits),
        home=HOME,
        tcp_offset_position=(0.0, 0.0, 0.14),
        tcp_offset_quaternion=(1.0, 0.0, 0.0, 0.0),
        gripper=GripperSpec(
            max_width=0.085,
            max_force=100.0,
            max_speed=0.15,
            finger_depth=0.045,
            finger_size=(0.007, 0.011, 0.01),
            joints=("left_finger_joint", "right_finger_joint"),
        ),
        tcp_velocity=1.0,
        reach=0.80,
        spheres=read_spheres(FOLDER / "spheres.json"),
        self_collision_ignore=(
            ("base_link", "upper_arm_link"),
            ("shoulder_link", "forearm_link"),
            ("wrist_1_link", "wrist_3_link"),
            ("wrist_2_link", "tool0"),
            ("wrist_3_link", "left_finger"),
            ("wrist_3_link", "right_finger"),
            ("left_finger", "right_finger"),
        ),
        cameras=(WRIST,),
        sources=SOURCES,
    )


# Beside the palm, looking along the fingers, far enough forward that the open fingers end just below the picture;
# its top is the tool's +x.
WRIST = CameraSpec(
    name="wrist",
    mount="tool0",
    position=(0.065, 0.0, 0.075),
    quaternion=(math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)),
    fovy=75.0,
)

SOURCES = {
    "limits": f"{SHEET}: ranges, 180 deg/s, joint torques; acceleration and jerk are chosen, see the comment there",
    "tcp_velocity": f"{SHEET}: typical TCP speed 1 m/s",
    "tcp_offset_position": "this jaw's own geometry, in ur5e.xml",
    "gripper.max_width": "Robotiq 2F-85 datasheet: stroke 85 mm",
    "gripper.max_force": "within the 20 to 235 N of the Robotiq 2F-85 datasheet",
    "gripper.max_speed": "Robotiq 2F-85 datasheet: up to 150 mm/s",
    "gripper.finger_size": "this jaw's own geometry, in ur5e.xml",
    "gripper.finger_depth": "this jaw's own geometry, in ur5e.xml: distance from the TCP to the palm",
    "reach": "inverse kinematics of top-down poses of every yaw up to 0.3 m above the foot: all solved to 0.83 m",
    "home": "chosen here; see the comment beside it",
    "cameras": "as on the Panda",
    "inertias": "Universal Robots: masses and centres of mass; solid cylinders of each link's size",
}
