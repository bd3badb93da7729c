import mujoco
import numpy as np

from gap_motion.kinematics.dynamics import SHARE, plant, torque_stretch, torques
from gap_motion.timing.timing import point_to_point
from tests.unit.motion.conftest import random_joints


def test_standing_still_takes_the_torque_of_gravity(spec, arm):
    model = mujoco.MjModel.from_xml_path(str(spec.model_file))
    data = mujoco.MjData(model)
    q = random_joints(spec, 5)
    zero = np.zeros_like(q)
    for row, needed in zip(q, torques(arm, q, zero, zero), strict=True):
        data.qpos[plant(arm).q] = row
        mujoco.mj_forward(model, data)
        np.testing.assert_allclose(needed, data.qfrc_bias[plant(arm).v], atol=1e-6)


def test_timed_motions_stay_inside_the_torque_limits(spec, arm):
    for seed in range(6):
        motion = point_to_point(arm, random_joints(spec, 3, seed))
        step = motion.times[1]
        needed = torques(arm, motion.positions, motion.velocities, np.gradient(motion.velocities, step, axis=0))
        assert (np.abs(needed) <= plant(arm).torque).all()


def test_going_slower_by_the_factor_is_just_enough(spec, arm):
    motion = point_to_point(arm, random_joints(spec, 2, 1))
    fast, step = 4.0, float(motion.times[1]) / 4.0
    factor = torque_stretch(arm, motion.positions, motion.velocities * fast, step)
    assert factor > 1.0
    eased = torque_stretch(arm, motion.positions, motion.velocities * fast / factor, step * factor)
    assert eased < 1.05, "only friction, which shrinks less, may be left over"
    dq = motion.velocities * fast / factor
    needed = torques(arm, motion.positions[::2], dq[::2], np.gradient(dq, step * factor, axis=0)[::2])
    share = np.abs(needed) / plant(arm).torque
    assert 0.97 * SHARE < share.max() <= 1.05 * SHARE
