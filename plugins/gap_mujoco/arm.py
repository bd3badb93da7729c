"""One simulated arm and its gripper, moved by its position actuators alone."""

from __future__ import annotations

import threading
from typing import Any

import numpy as np

from gap_cli.contracts.failures import MotionError
from gap_cli.contracts.robot import RobotSpec
from gap_cli.contracts.task import RobotPlacement
from gap_cli.contracts.types import (
    ArmState,
    Array,
    GripperState,
    JointState,
    Quaternion,
    Se3Pose,
    Trajectory,
    Vec3,
)
from gap_mujoco.compiled import TIMESTEP
from gap_mujoco.jaws import Jaws
from gap_mujoco.physics import Physics
from gap_mujoco.setpoints import Setpoints, refused, setpoints
from gap_mujoco.thread import WorldThread

TRACKING_LIMIT = 0.1  # [rad] a joint may lag behind its set-point
TORQUE_SHARE = 0.3  # of a joint's torque limit: more than that from outside is a collision
_LOOK_EVERY = 5  # steps between looks at tracking and outside torque
_LOOKS_IN_CONTACT = 2  # looks in a row before it counts, so that a tap does not
_REST_SPEED = 0.03  # [rad/s]
_SETTLE_TIME = 1.0  # [s] granted after the last set-point


class SimArm:
    """An `Arm` of the contracts. Position servos follow set-points with velocity and bias feed-forward.

    Outside torque is what contacts exert on the joints, as the torque sensors of such an arm report it.
    """

    def __init__(
        self, index: int, spec: RobotSpec, placement: RobotPlacement, physics: Physics, thread: WorldThread
    ) -> None:
        self._index, self._spec, self._physics, self._thread = index, spec, physics, thread
        model = physics.model
        self._home = np.array(placement.home or spec.home)
        joints = [model.joint(f"arm{index}/{name}") for name in spec.joints]
        self._q = np.array([j.qposadr[0] for j in joints])
        self._v = np.array([j.dofadr[0] for j in joints])
        self._u = np.array([model.actuator(f"arm{index}/{name}").id for name in spec.joints])
        self._kp, self._kv = model.actuator_gainprm[self._u, 0], -model.actuator_biasprm[self._u, 2]
        self._outside_limit = TORQUE_SHARE * np.array([j.torque for j in spec.limits])
        self._acceleration = np.array([j.acceleration for j in spec.limits])
        self._flange = model.body(f"arm{index}/{spec.flange_link}").id
        half = np.radians(placement.yaw_deg) / 2
        self._base = Se3Pose(Vec3.of(placement.position), Quaternion(float(np.cos(half)), 0, 0, float(np.sin(half))))
        w, x, y, z = spec.tcp_offset_quaternion
        self._T_flange_tcp = Se3Pose(Vec3.of(spec.tcp_offset_position), Quaternion(w, x, y, z)).matrix
        self._target, self._velocity = self._home.copy(), np.zeros(spec.dof)
        self._jaws = Jaws(index, spec, physics)
        self._stops, self._lock = 0, threading.Lock()

    @property
    def spec(self) -> RobotSpec:
        """The robot's names, limits and shape."""
        return self._spec

    @property
    def base_pose(self) -> Se3Pose:
        """T_world_base."""
        return self._base

    def state(self) -> ArmState:
        """Joints, gripper and forward kinematics."""
        return self._thread.call(self.read)

    def execute(self, trajectory: Trajectory, *, tolerance: float = 0.01) -> None:
        """Track a joint trajectory; see `gap_cli.contracts.world.Arm.execute`."""
        self._thread.call(self._execute, trajectory, tolerance, self._stops)

    def set_gripper(self, width: float, *, force: float | None = None, settle: float = 0.5) -> GripperState:
        """Drive the jaws; see `gap_cli.contracts.world.Arm.set_gripper`."""
        return self._thread.call(self._set_gripper, width, force, settle, self._stops)

    def stop(self) -> None:
        """End the motion under way, and those already asked for; later ones are not affected."""
        with self._lock:
            self._stops += 1

    def place_home(self) -> None:
        """Write the home configuration, jaws open. Only a reset may."""
        self._physics.data.qpos[self._q] = self._home
        self._jaws.place_open()
        self.rest()

    def rest(self) -> None:
        """Hold where the joints are now."""
        self._target, self._velocity = self.positions, np.zeros(self._spec.dof)
        self._jaws.rest()

    def drive(self) -> None:
        """Write this step's controls: the set-point plus what makes the servo arrive there without lag or sag."""
        data = self._physics.data
        bias = data.qfrc_bias[self._v] - data.qfrc_gravcomp[self._v]
        data.ctrl[self._u] = self._target + (self._kv * self._velocity + bias) / self._kp
        self._jaws.drive()

    @property
    def positions(self) -> Array:
        """Measured joint positions [rad], shape (dof,)."""
        return np.asarray(self._physics.data.qpos[self._q])

    @property
    def width(self) -> float:
        """Measured jaw opening [m]."""
        return self._jaws.width

    def tcp(self) -> Se3Pose:
        """T_world_tcp."""
        data, T = self._physics.data, np.eye(4)
        T[:3, :3], T[:3, 3] = data.xmat[self._flange].reshape(3, 3), data.xpos[self._flange]
        return Se3Pose.of(T @ self._T_flange_tcp)

    def read(self) -> ArmState:
        """The state, on the world's own thread."""
        data = self._physics.data
        joints = JointState(self.positions, data.qvel[self._v], data.qfrc_actuator[self._v])
        return ArmState(self._index, joints, self._jaws.state(), self.tcp())

    def _execute(self, trajectory: Trajectory, tolerance: float, stops: int) -> None:
        if not 0 < tolerance < 1:
            raise refused(f"a tolerance of {tolerance} rad cannot be held")
        if self._stops != stops:
            raise _stopped()
        points = setpoints(trajectory, self._spec, self.positions, self._target)
        try:
            self._follow(points, stops)
            self._settle(points.positions[-1], tolerance, stops)
        except MotionError as error:
            self._brake(from_measured=error.code != "stopped")
            raise

    def _follow(self, points: Setpoints, stops: int) -> None:
        pressed = 0
        for k, (self._target, self._velocity) in enumerate(zip(*points, strict=True)):
            self._physics.step()
            if self._stops != stops:
                raise _stopped()
            if k % _LOOK_EVERY == 0:
                pressed = self._look(pressed)
        self._velocity = np.zeros(self._spec.dof)

    def _settle(self, end: Array, tolerance: float, stops: int) -> None:
        pressed = 0
        for k in range(round(_SETTLE_TIME / TIMESTEP)):
            speed = np.abs(self._physics.data.qvel[self._v]).max()
            if np.abs(self.positions - end).max() < tolerance and speed < _REST_SPEED:
                return
            self._physics.step()
            if self._stops != stops:
                raise _stopped()
            if k % _LOOK_EVERY == 0:
                pressed = self._look(pressed)
        self._raise("stalled", "rad short of the end", np.abs(self.positions - end), tolerance)

    def _look(self, pressed: int) -> int:
        """How many looks in a row found outside torque. Raises `MotionError` code `contact` or `tracking`."""
        outside = np.abs(self._physics.data.qfrc_constraint[self._v])
        pressed = pressed + 1 if (outside > self._outside_limit).any() else 0
        if pressed >= _LOOKS_IN_CONTACT:
            self._raise("contact", "Nm from outside", outside, self._outside_limit)
        lag = np.abs(self.positions - self._target)
        if lag.max() > TRACKING_LIMIT:
            self._raise("tracking", "rad behind its set-point", lag, TRACKING_LIMIT)
        return pressed

    def _raise(self, code: str, what: str, values: Array, limits: Any) -> None:
        limits = np.broadcast_to(limits, values.shape)
        worst = int((values / limits).argmax())
        detail = {"joint": self._spec.joints[worst], "value": float(values[worst]), "limit": float(limits[worst])}
        message = f"The arm stopped ({code}): {detail['joint']} {values[worst]:.3f} {what}, limit {limits[worst]:.3f}."
        raise MotionError(code, message, detail=detail)

    def _brake(self, *, from_measured: bool) -> None:
        """Slow all joints down together within their acceleration limits, then hold."""
        if from_measured:
            self._target, self._velocity = self.positions, self._physics.data.qvel[self._v].copy()
        start = self._velocity
        steps = int(np.ceil((np.abs(start) / self._acceleration).max() / TIMESTEP))
        for k in range(steps):
            self._velocity = start * (1 - (k + 1) / steps)
            self._target = self._target + self._velocity * TIMESTEP
            self._physics.step()
        self._velocity = np.zeros(self._spec.dof)

    def _set_gripper(self, width: float, force: float | None, settle: float, stops: int) -> GripperState:
        self._jaws.aim(width, force)
        if not 0 <= settle <= 10:
            raise refused(f"a settle time of {settle} s is outside 0 to 10 s")
        while not self._jaws.done():
            self._physics.step()
            if self._stops != stops:
                self._jaws.halt()
                raise _stopped()
        self._physics.run(settle)
        return self._jaws.state()


def _stopped() -> MotionError:
    return MotionError("stopped", "The arm was told to stop.")
