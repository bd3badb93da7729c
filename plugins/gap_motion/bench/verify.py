"""Verifies motions independently: MuJoCo's own collision detection and finite differences, nothing of the planner's.

It loads the robot's MJCF beside plain boxes and spheres, looks at every few milliseconds of a trajectory, and can let
the robot's own servos follow it in physics.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from gap_runtime.contracts.robot import RobotSpec
from gap_runtime.contracts.types import Array, Trajectory

LOOK = 0.004  # s between looks at a trajectory
RATES = ("velocity", "acceleration", "jerk")
TOUCHING = 1e-4  # m of overlap that counts as contact


@dataclass(frozen=True)
class ObstacleShape:
    """A box of half-extents `half` [m] at `center`, or, with a `radius`, a sphere; aligned with the base's axes."""

    center: tuple[float, float, float]
    half: tuple[float, float, float] = (0.0, 0.0, 0.0)
    radius: float = 0.0


@dataclass(frozen=True)
class TrajectoryReport:
    """Shares of the limits used, largest over joints and time, the largest joint step [rad], and what touched."""

    velocity: float
    acceleration: float
    jerk: float
    tcp_speed: float
    step: float
    contacts: tuple[str, ...]

    @property
    def clean(self) -> bool:
        """No contact and no limit passed."""
        return not self.contacts and max(self.velocity, self.acceleration, self.jerk, self.tcp_speed) <= 1.0


@dataclass(frozen=True)
class TrackingReport:
    """What the servos made of a trajectory: largest lag [rad], shares of velocity and torque limits, error at rest."""

    lag: float
    velocity: float
    torque: float
    rest_error: float
    contacts: tuple[str, ...]


class TrajectoryVerifier:
    """One robot, at its base, among shapes."""

    def __init__(self, spec: RobotSpec, shapes: Sequence[ObstacleShape] = (), width: float | None = None) -> None:
        import mujoco

        self._spec, self._mujoco = spec, mujoco
        made = mujoco.MjSpec.from_file(str(spec.model_file))
        for i, shape in enumerate(shapes):
            kind = mujoco.mjtGeom.mjGEOM_SPHERE if shape.radius else mujoco.mjtGeom.mjGEOM_BOX
            size = [shape.radius, 0, 0] if shape.radius else list(shape.half)
            made.worldbody.add_geom(name=f"shape_{i}", type=kind, size=size, pos=list(shape.center))
        self._model: Any = made.compile()
        self._data: Any = mujoco.MjData(self._model)
        self._q = np.array([self._model.joint(j).qposadr[0] for j in spec.joints])
        self._v = np.array([self._model.joint(j).dofadr[0] for j in spec.joints])
        self._u = np.array([self._model.actuator(j).id for j in spec.joints])
        self._jaw = np.array([self._model.joint(j).qposadr[0] for j in spec.gripper.joints])
        self._width = spec.gripper.max_width if width is None else width

    def judge(self, trajectory: Trajectory) -> TrajectoryReport:
        """Look at a trajectory whose samples are evenly spaced in time."""
        q, dt = trajectory.positions, float(trajectory.times[1] - trajectory.times[0])
        shares = [self._share(q, dt, order, name) for order, name in enumerate(RATES, start=1)]
        tcp, contacts = self._sweep(trajectory)
        speed = np.linalg.norm(np.diff(tcp, axis=0), axis=1).max() / LOOK / self._spec.tcp_velocity
        step = float(np.abs(np.diff(q, axis=0)).max())
        return TrajectoryReport(shares[0], shares[1], shares[2], float(speed), step, tuple(sorted(contacts)))

    def _share(self, q: Array, dt: float, order: int, name: str) -> float:
        bound = np.array([getattr(limit, name) for limit in self._spec.limits])
        rows = np.abs(np.diff(q, order, axis=0)) / dt**order / bound
        return float(rows.max()) if rows.size else 0.0

    def free(self, q: Array) -> bool:
        """True when nothing touches at a configuration (n,): for planners that want a plain checker."""
        return not self._contacts_at(q)

    def follow(self, trajectory: Trajectory) -> TrackingReport:
        """Let the servos follow the trajectory in physics, then hold for a quarter of a second."""
        from scipy.interpolate import CubicSpline

        data, dt = self._data, float(self._model.opt.timestep)
        self._place(trajectory.positions[0])
        data.qvel[:] = 0.0
        data.ctrl[self._model.actuator("gripper").id] = self._width
        bounds = [np.array([getattr(x, k) for x in self._spec.limits]) for k in ("velocity", "torque")]
        lag = speed = torque = 0.0
        contacts: set[str] = set()
        course = CubicSpline(trajectory.times, trajectory.positions, bc_type="clamped")
        ends = np.minimum(np.arange(dt, trajectory.duration + 0.25, dt), trajectory.duration)
        targets, velocities = course(ends), course(ends, 1)
        accelerations = np.diff(velocities, axis=0, prepend=0.0) / dt
        for target, velocity, acceleration in zip(targets, velocities, accelerations, strict=True):
            self._serve(target, velocity, acceleration)
            self._mujoco.mj_step(self._model, data)
            lag = max(lag, float(np.abs(data.qpos[self._q] - target).max()))
            speed = max(speed, float((np.abs(data.qvel[self._v]) / bounds[0]).max()))
            torque = max(torque, float((np.abs(data.qfrc_actuator[self._v]) / bounds[1]).max()))
            contacts |= self._touching()
        rest = float(np.abs(data.qpos[self._q] - trajectory.positions[-1]).max())
        return TrackingReport(lag, speed, torque, rest, tuple(sorted(contacts)))

    def _serve(self, target: Array, velocity: Array, acceleration: Array) -> None:
        """Write the servos' set-points for the end of this step, with the torque that the motion itself takes.

        A servo sees positions as the step begins and, as it is integrated implicitly, velocities as it ends.
        """
        data, model = self._data, self._model
        stiffness, damping = model.actuator_gainprm[self._u, 0], -model.actuator_biasprm[self._u, 2]
        moving, inertia = np.zeros(model.nv), np.zeros(model.nv)
        moving[self._v] = acceleration
        self._mujoco.mj_mulM(model, data, inertia, moving)
        torque = inertia[self._v] + data.qfrc_bias[self._v] - data.qfrc_gravcomp[self._v]
        torque += (damping + model.dof_damping[self._v]) * velocity
        data.ctrl[self._u] = target - velocity * float(model.opt.timestep) + torque / stiffness

    def _sweep(self, trajectory: Trajectory) -> tuple[Array, set[str]]:
        times = np.arange(0.0, trajectory.duration + LOOK, LOOK).clip(max=trajectory.duration)
        rows = np.column_stack([np.interp(times, trajectory.times, row) for row in trajectory.positions.T])
        tcp, contacts = np.empty((len(rows), 3)), set()
        offset = np.array(self._spec.tcp_offset_position)
        for k, q in enumerate(rows):
            contacts |= self._contacts_at(q)
            flange = self._data.body(self._spec.flange_link)
            tcp[k] = flange.xpos + flange.xmat.reshape(3, 3) @ offset
        return tcp, contacts

    def _contacts_at(self, q: Array) -> set[str]:
        self._place(q)
        self._mujoco.mj_kinematics(self._model, self._data)
        self._mujoco.mj_comPos(self._model, self._data)
        self._mujoco.mj_collision(self._model, self._data)
        return self._touching()

    def _place(self, q: Array) -> None:
        self._data.qpos[self._q] = q
        self._data.qpos[self._jaw] = self._width / len(self._jaw)

    def _touching(self) -> set[str]:
        found = set()
        for contact in self._data.contact[: self._data.ncon]:
            if contact.dist < -TOUCHING:
                pair = (self._model.geom(g).name for g in (contact.geom1, contact.geom2))
                found.add(" with ".join(sorted(pair)))
        return found
