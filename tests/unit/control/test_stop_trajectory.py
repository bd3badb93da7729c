"""Stop trajectories: inside every limit, and inside the bounds that are stated for them."""

from __future__ import annotations

import numpy as np
import pytest

from gap_control.joint_controller import JointCommand
from gap_control.stop_trajectory import stop_bounds, stop_trajectory
from gap_robots import arms

PERIOD = 0.002


@pytest.mark.parametrize("spec", arms(), ids=lambda s: s.name)
def test_every_limit_and_the_stated_bounds_are_kept(spec):
    low, high, v, a, j = (
        np.array([getattr(x, k) for x in spec.limits]) for k in ("lower", "upper", "velocity", "acceleration", "jerk")
    )
    rng, bound, q = np.random.default_rng(0), stop_bounds(spec), (low + high) / 2
    for _ in range(50):
        dq, ddq = v * rng.uniform(-1, 1, spec.dof), a * rng.uniform(-1, 1, spec.dof)
        rows = stop_trajectory(spec, PERIOD, JointCommand(q, dq, ddq))
        assert len(rows.positions) * PERIOD <= bound.time + PERIOD and np.abs(rows.velocities[-1]).max() < 1e-9
        assert (np.abs(rows.positions - q).max(axis=0) <= bound.travel).all()
        speeds = np.concatenate([[dq], rows.velocities])
        assert (np.abs(np.diff(speeds, axis=0)).max(axis=0) / PERIOD <= a * 1.001).all()
        assert (np.abs(np.diff(speeds, 2, axis=0)).max(axis=0) / PERIOD**2 <= j * 1.001).all()


@pytest.mark.parametrize("spec", arms(), ids=lambda s: s.name)
def test_a_joint_about_to_meet_its_limit_stops_before_it(spec):
    first, second = spec.limits[0], spec.limits[1]
    q, dq = np.array(spec.home), np.zeros(spec.dof)
    dq[0], dq[1] = 1.0, second.velocity  # the second joint takes longer to stop
    q[0] = first.upper - 1.1 * (1.0 / (2 * first.acceleration))
    rows = stop_trajectory(spec, PERIOD, JointCommand(q, dq, np.zeros(spec.dof)))
    assert rows.positions[:, 0].max() <= first.upper


def test_an_arm_at_rest_need_not_stop():
    spec = arms()[0]
    still = np.zeros(spec.dof)
    assert len(stop_trajectory(spec, PERIOD, JointCommand(np.array(spec.home), still, still)).positions) == 0
