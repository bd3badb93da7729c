import mujoco
import numpy as np
import pytest

from gap_catalogue.shared.robot_chain import chain, sphere_centers
from gap_runtime.contracts.failures import BadRequestError
from tests.unit.motion.conftest import random_joints


@pytest.fixture
def simulated(spec):
    model = mujoco.MjModel.from_xml_path(str(spec.model_file))
    data = mujoco.MjData(model)

    def at(q, width=0.0):
        for name, value in zip(spec.joints, q, strict=True):
            data.qpos[model.joint(name).qposadr[0]] = value
        for name in spec.gripper.joints:
            data.qpos[model.joint(name).qposadr[0]] = width / len(spec.gripper.joints)
        mujoco.mj_forward(model, data)
        return model, data

    return at


def pose_of(data, body):
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = data.body(body).xmat.reshape(3, 3), data.body(body).xpos
    return T


def test_forward_kinematics_are_the_models(spec, arm, simulated):
    for q in random_joints(spec, 20):
        _, data = simulated(q)
        base = pose_of(data, spec.base_link)
        flange = arm.poses(q, arm.link_offset(spec.flange_link))[0]
        np.testing.assert_allclose(base @ flange, pose_of(data, spec.flange_link), atol=1e-9)


def test_the_jacobian_is_the_derivative_of_the_pose(spec, arm):
    q = random_joints(spec, 1)[0]
    _, jacobian = arm.jacobian(q, arm.tcp)
    step = 1e-6
    for i in range(spec.dof):
        d = np.eye(spec.dof)[i] * step
        moved = arm.tcp_poses(q + d)[0] - arm.tcp_poses(q - d)[0]
        np.testing.assert_allclose(jacobian[:3, i], moved[:3, 3] / (2 * step), atol=1e-6)


def test_a_batch_is_its_configurations_one_by_one(spec, arm):
    q = random_joints(spec, 5)
    np.testing.assert_allclose(arm.tcp_poses(q), np.concatenate([arm.tcp_poses(row) for row in q]), atol=1e-12)


def test_a_base_pose_moves_everything_with_it(spec, arm, cell):
    q, base = random_joints(spec, 3), cell.arm.base_pose.matrix
    np.testing.assert_allclose(arm.tcp_poses(q, base), base @ arm.tcp_poses(q), atol=1e-12)


def test_spheres_ride_on_their_links_and_fingers_on_the_jaw(spec, simulated):
    q, width = random_joints(spec, 1)[0], spec.gripper.max_width / 2
    _, data = simulated(q, width)
    base = np.linalg.inv(pose_of(data, spec.base_link))
    for sphere, center in zip(spec.spheres, sphere_centers(spec, q, width), strict=True):
        expected = base @ pose_of(data, sphere.link) @ [*sphere.center, 1.0]
        np.testing.assert_allclose(center, expected[:3], atol=1e-6)


def test_an_unknown_link_is_named_with_what_exists(arm):
    with pytest.raises(BadRequestError) as error:
        arm.link_offset("no_such_link")
    assert error.value.code == "unknown_link" and error.value.hint


def test_a_chain_is_read_once(spec):
    assert chain(spec) is chain(spec)
