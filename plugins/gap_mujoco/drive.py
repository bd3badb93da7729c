"""Drives one arm's position actuators, and reads what its own sensors report."""

from __future__ import annotations

import numpy as np

from gap_cli.contracts.robot import RobotSpec
from gap_cli.contracts.task import RobotPlacement
from gap_cli.contracts.types import ArmState, Array, JointState, Quaternion, Se3Pose, Vec3
from gap_mujoco.jaws import Jaws
from gap_mujoco.physics import Physics


class Drive:
    """Servos of one arm: they hold `target` [rad] moving at `velocity` [rad/s]. Lives on the world's thread."""

    def __init__(self, index: int, spec: RobotSpec, placement: RobotPlacement, physics: Physics) -> None:
        model = physics.model
        self.index, self.spec, self.physics = index, spec, physics
        self._home = np.array(placement.home or spec.home)
        joints = [model.joint(f"arm{index}/{name}") for name in spec.joints]
        self._q = np.array([j.qposadr[0] for j in joints])
        self._v = np.array([j.dofadr[0] for j in joints])
        self._u = np.array([model.actuator(f"arm{index}/{name}").id for name in spec.joints])
        self._kp, self._kv = model.actuator_gainprm[self._u, 0], -model.actuator_biasprm[self._u, 2]
        self._flange = model.body(f"arm{index}/{spec.flange_link}").id
        w, x, y, z = spec.tcp_offset_quaternion
        self._T_flange_tcp = Se3Pose(Vec3.of(spec.tcp_offset_position), Quaternion(w, x, y, z)).matrix
        self.jaws = Jaws(index, spec, physics)
        self.target, self.velocity = self._home, np.zeros(spec.dof)

    @property
    def positions(self) -> Array:
        """Measured joint positions [rad], shape (dof,)."""
        return np.asarray(self.physics.data.qpos[self._q])

    @property
    def velocities(self) -> Array:
        """Measured joint velocities [rad/s], shape (dof,)."""
        return np.asarray(self.physics.data.qvel[self._v])

    @property
    def outside_torque(self) -> Array:
        """Size of what contacts exert on the joints [Nm], as an arm's joint torque sensors reveal it; shape (dof,)."""
        return np.asarray(np.abs(self.physics.data.qfrc_constraint[self._v]))

    def tcp(self) -> Se3Pose:
        """T_world_tcp by forward kinematics."""
        data, T = self.physics.data, np.eye(4)
        T[:3, :3], T[:3, 3] = data.xmat[self._flange].reshape(3, 3), data.xpos[self._flange]
        return Se3Pose.of(T @ self._T_flange_tcp)

    def state(self) -> ArmState:
        """Joints, gripper and forward kinematics."""
        joints = JointState(self.positions, self.velocities, self.physics.data.qfrc_actuator[self._v])
        return ArmState(self.index, joints, self.jaws.state(), self.tcp())

    def place_home(self) -> None:
        """Write the home configuration, jaws open, and hold it. Only a reset may."""
        self.physics.data.qpos[self._q] = self._home
        self.jaws.place_open()
        self.target, self.velocity = self._home, np.zeros(self.spec.dof)

    def drive(self) -> None:
        """Write this step's controls: the set-point plus what makes the servo arrive there without lag or sag."""
        data = self.physics.data
        bias = data.qfrc_bias[self._v] - data.qfrc_gravcomp[self._v]
        data.ctrl[self._u] = self.target + (self._kv * self.velocity + bias) / self._kp
        self.jaws.drive()
