"""A robot as skills and planners see it: names, limits and shape, so that no skill carries a robot's constants."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

STEP_VELOCITY = 2.175  # rad/s: of the Panda, the arm of the environments that the catalogue's `max_steps` comes from


@dataclass(frozen=True)
class JointLimits:
    """Limits of one joint [rad, rad/s, rad/s^2, rad/s^3, Nm]."""

    lower: float
    upper: float
    velocity: float
    acceleration: float
    jerk: float
    torque: float


@dataclass(frozen=True)
class GripperSpec:
    """A parallel jaw. `finger_depth` is how far the pads reach above the TCP [m]; `finger_size` is a pad's
    half-extents along closing, pad width and approach axes [m]; force [N], speed [m/s]."""

    max_width: float
    max_force: float
    max_speed: float
    finger_depth: float
    finger_size: tuple[float, float, float]
    joints: tuple[str, ...]


@dataclass(frozen=True)
class CollisionSphere:
    """A sphere of the planning model: its link, its centre in the link frame [m] and its radius [m]."""

    link: str
    center: tuple[float, float, float]
    radius: float


@dataclass(frozen=True)
class CameraSpec:
    """A camera: `mount` is a link name or 'world'; pose is T_mount_camera (optical), quaternion w first; fovy [deg]."""

    name: str
    mount: str
    position: tuple[float, float, float]
    quaternion: tuple[float, float, float, float]
    fovy: float
    resolution: tuple[int, int] = (640, 480)


@dataclass(frozen=True)
class VisualMesh:
    """What a link looks like: a mesh in its frame [m] and its colour (red, green, blue, alpha), each 0 to 1."""

    link: str
    file: Path
    rgba: tuple[float, float, float, float]


@dataclass(frozen=True)
class RobotSpec:
    """One arm with its gripper.

    model_file   MJCF of the arm and hand, the one source of kinematics for physics and planning.
    tcp_offset   T_flange_tcp: translation [m] and quaternion (w first) from `flange_link` to the point between
                 the fingertips. The TCP's z axis points along the approach, its y axis along the closing direction.
    reach        farthest horizontal distance from the base at which a top-down grasp, up to 0.3 m above the base's
                 foot, is expected [m].
    visuals      what cameras see in place of the collision shapes of these links.
    sources      where each limit comes from, by field name.
    """

    name: str
    model_file: Path
    base_link: str
    flange_link: str
    joints: tuple[str, ...]
    limits: tuple[JointLimits, ...]
    home: tuple[float, ...]
    tcp_offset_position: tuple[float, float, float]
    tcp_offset_quaternion: tuple[float, float, float, float]
    gripper: GripperSpec
    tcp_velocity: float
    reach: float
    spheres: tuple[CollisionSphere, ...] = ()
    self_collision_ignore: tuple[tuple[str, str], ...] = ()
    cameras: tuple[CameraSpec, ...] = ()
    visuals: tuple[VisualMesh, ...] = ()
    sources: Mapping[str, str] | None = None

    @property
    def dof(self) -> int:
        """Number of arm joints."""
        return len(self.joints)

    @property
    def time_scale(self) -> float:
        """How much longer a motion may take than limits in control steps say: those are for joints of `STEP_VELOCITY`,
        and 1 for an arm that is as fast in every joint."""
        return max(1.0, STEP_VELOCITY / min(limit.velocity for limit in self.limits))
