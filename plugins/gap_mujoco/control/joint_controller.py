"""Drives one arm's position actuators, and reads what its own sensors report."""

from __future__ import annotations

import mujoco
import numpy as np

from gap_control.joint_controller import JointCommand
from gap_mujoco.control.parallel_gripper import ParallelGripper
from gap_mujoco.physics import Physics
from gap_runtime.contracts.robot import RobotSpec
from gap_runtime.contracts.task import RobotPlacement
from gap_runtime.contracts.types import ArmState, Array, JointState, Quaternion, Se3Pose, Vec3

CONTACT_SHARE = 0.3  # of a joint's torque limit: more than that from outside is a collision


class MujocoJointController:
    """The servos of one arm as a `gap_control` `JointController`. Lives on the simulator's thread."""

    def __init__(self, index: int, spec: RobotSpec, placement: RobotPlacement, physics: Physics) -> None:
        model = physics.model
        self.index, self.spec, self.clock, self._physics = index, spec, physics, physics
        self._home = np.array(placement.home or spec.home)
        joints = [model.joint(f"arm{index}/{name}") for name in spec.joints]
        self._q = np.array([j.qposadr[0] for j in joints])
        self._v = np.array([j.dofadr[0] for j in joints])
        self._u = np.array([model.actuator(f"arm{index}/{name}").id for name in spec.joints])
        self._damping = model.dof_damping[self._v]
        self._acceleration = np.array([j.acceleration for j in spec.limits])
        self.contact_torque = CONTACT_SHARE * np.array([j.torque for j in spec.limits])  # [Nm]
        self._kp, self._kv = model.actuator_gainprm[self._u, 0], -model.actuator_biasprm[self._u, 2]
        self._flange = model.body(f"arm{index}/{spec.flange_link}").id
        w, x, y, z = spec.tcp_offset_quaternion
        self._T_flange_tcp = Se3Pose(Vec3.of(spec.tcp_offset_position), Quaternion(w, x, y, z)).matrix
        self.gripper = ParallelGripper(index, spec, physics)
        self._hold_home()

    def _hold_home(self) -> None:
        still = np.zeros(self.spec.dof)
        self.target, self.velocity = self._home, still
        self.applied = JointCommand(self._home, still, still)

    @property
    def positions(self) -> Array:
        """Measured joint positions [rad], shape (dof,)."""
        return np.asarray(self._physics.data.qpos[self._q])

    @property
    def velocities(self) -> Array:
        """Measured joint velocities [rad/s], shape (dof,)."""
        return np.asarray(self._physics.data.qvel[self._v])

    @property
    def external_torque(self) -> Array:
        """Size of what contacts exert on the joints [Nm], as an arm's joint torque sensors reveal it; shape (dof,)."""
        return np.asarray(np.abs(self._physics.data.qfrc_constraint[self._v]))

    def tcp(self) -> Se3Pose:
        """T_world_tcp by forward kinematics."""
        data, T = self._physics.data, np.eye(4)
        T[:3, :3], T[:3, 3] = data.xmat[self._flange].reshape(3, 3), data.xpos[self._flange]
        return Se3Pose.of(T @ self._T_flange_tcp)

    def state(self) -> ArmState:
        """Joints, gripper and forward kinematics."""
        joints = JointState(self.positions, self.velocities, self._physics.data.qfrc_actuator[self._v])
        return ArmState(self.index, joints, self.gripper.state(), self.tcp())

    def place_home(self) -> None:
        """Write the home configuration, gripper open, and hold it. Only a reset may."""
        self._physics.data.qpos[self._q] = self._home
        self.gripper.place_open()
        self._hold_home()

    def set_target(self, positions: Array, velocities: Array) -> None:
        """The set-point of the next step: joints (n,) [rad] and their velocities [rad/s] at its end."""
        self.target, self.velocity = positions, velocities

    def write_controls(self) -> None:
        """Write this step's controls: the set-point, and what its motion takes by the arm's own dynamics.

        The servo sees positions as the step begins and, as it is integrated implicitly, velocities as it ends. An
        acceleration beyond the joint's limit (a set-point that jumps) is fed forward up to that limit.
        """
        data, model = self._physics.data, self._physics.model
        wanted = (self.velocity - self.applied.velocities) / self.clock.period
        acceleration = np.clip(wanted, -self._acceleration, self._acceleration)
        moving, inertia = np.zeros(model.nv), np.zeros(model.nv)
        moving[self._v] = acceleration
        mujoco.mj_mulM(model, data, inertia, moving)
        torque = inertia[self._v] + data.qfrc_bias[self._v] - data.qfrc_gravcomp[self._v]
        torque += (self._kv + self._damping) * self.velocity
        data.ctrl[self._u] = self.target - self.velocity * self.clock.period + torque / self._kp
        self.applied = JointCommand(self.target, self.velocity, acceleration)
        self.gripper.write_control()
