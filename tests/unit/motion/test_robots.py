import mujoco
import numpy as np
import pytest

from gap_robots.spheres import cover_model
from gap_robots.visuals import panda_visuals

KINDS = ("velocity", "acceleration", "jerk", "torque")


@pytest.fixture
def model(spec):
    return mujoco.MjModel.from_xml_path(str(spec.model_file))


def test_every_name_of_the_spec_is_in_its_model(spec, model):
    for link in (spec.base_link, spec.flange_link, *(s.link for s in spec.spheres), *(c.mount for c in spec.cameras)):
        assert model.body(link).id > 0
    for joint in (*spec.joints, *spec.gripper.joints):
        assert model.joint(joint).id >= 0
    assert {model.actuator(i).name for i in range(model.nu)} == {*spec.joints, "gripper"}


def test_ranges_and_torques_of_the_model_are_the_specs(spec, model):
    for name, limit in zip(spec.joints, spec.limits, strict=True):
        np.testing.assert_allclose(model.joint(name).range, [limit.lower, limit.upper], atol=1e-6)
        np.testing.assert_allclose(model.jnt_actfrcrange[model.joint(name).id], [-limit.torque, limit.torque])


def test_the_panda_is_as_its_maker_publishes_it(robot):
    for name in ("panda", "panda-bimanual"):
        spec = robot(name)
        limits = {kind: [getattr(limit, kind) for limit in spec.limits] for kind in KINDS}
        assert limits["velocity"] == [2.175] * 4 + [2.61] * 3
        assert limits["acceleration"] == [15, 7.5, 10, 12.5, 15, 20, 20]
        assert limits["jerk"] == [7500, 3750, 5000, 6250, 7500, 10000, 10000]
        assert limits["torque"] == [87] * 4 + [12] * 3
        assert spec.tcp_velocity == 1.7
        assert (spec.gripper.max_width, spec.gripper.max_force) == (0.08, 70.0)


def test_the_ur5e_turns_and_pulls_as_its_maker_publishes_it(robot):
    spec = robot("ur5e")
    assert [limit.velocity for limit in spec.limits] == [np.pi] * 6
    assert [limit.torque for limit in spec.limits] == [150] * 3 + [28] * 3
    assert (spec.tcp_velocity, spec.gripper.max_width) == (1.0, 0.085)


@pytest.mark.parametrize("name", ["panda", "panda-bimanual", "ur5e"])
def test_a_spec_leaves_nothing_out(robot, name):
    spec = robot(name)
    assert spec.name == name and spec.model_file.is_file()
    assert spec.dof == len(spec.joints) == len(spec.limits) == len(spec.home)
    for limit in spec.limits:
        assert limit.lower < limit.upper and all(getattr(limit, kind) > 0 for kind in KINDS)
    jaw = spec.gripper
    assert min(jaw.max_width, jaw.max_force, jaw.max_speed, jaw.finger_depth, *jaw.finger_size) > 0 and jaw.joints
    assert np.linalg.norm(spec.tcp_offset_quaternion) == pytest.approx(1.0) and spec.tcp_offset_position[2] > 0
    assert spec.cameras and spec.spheres and spec.self_collision_ignore and spec.reach > 0
    said = {"limits", "tcp_velocity", "tcp_offset_position", "reach", "home", "cameras", "inertias"}
    said |= {f"gripper.{x}" for x in ("max_width", "max_force", "max_speed", "finger_size", "finger_depth")}
    assert said <= set(spec.sources) and all(spec.sources.values())


def test_the_links_that_may_touch_are_links_with_spheres(spec):
    links = {sphere.link for sphere in spec.spheres}
    assert {link for pair in spec.self_collision_ignore for link in pair} <= links


def test_home_is_inside_the_limits_and_free_of_contact(spec, model):
    data = mujoco.MjData(model)
    for name, q, limit in zip(spec.joints, spec.home, spec.limits, strict=True):
        assert limit.lower < q < limit.upper
        data.qpos[model.joint(name).qposadr[0]] = q
    mujoco.mj_forward(model, data)
    assert data.ncon == 0


def test_the_servos_hold_home_against_gravity(spec, model):
    data = mujoco.MjData(model)
    for name, q in zip(spec.joints, spec.home, strict=True):
        data.qpos[model.joint(name).qposadr[0]] = q
        data.ctrl[model.actuator(name).id] = q
    for _ in range(200):
        mujoco.mj_step(model, data)
    for name, q in zip(spec.joints, spec.home, strict=True):
        assert data.qpos[model.joint(name).qposadr[0]] == pytest.approx(q, abs=1e-3)


def test_both_fingers_move_together_and_squeeze_no_harder_than_allowed(spec, model):
    data = mujoco.MjData(model)
    gripper = model.actuator("gripper").id
    data.ctrl[gripper] = model.actuator_ctrlrange[gripper, 1]
    for _ in range(500):
        mujoco.mj_step(model, data)
    fingers = [data.qpos[model.joint(name).qposadr[0]] for name in spec.gripper.joints]
    assert fingers == pytest.approx([spec.gripper.max_width / len(fingers)] * len(fingers), abs=1e-3)
    data.ctrl[gripper] = model.actuator_ctrlrange[gripper, 0]
    for _ in range(500):
        mujoco.mj_step(model, data)
        assert abs(data.actuator_force[gripper]) <= spec.gripper.max_force + 1e-9
    assert data.qpos[model.joint(spec.gripper.joints[0]).qposadr[0]] == pytest.approx(0.0, abs=1e-3)


def test_the_sphere_file_is_the_models_cover(spec):
    rows = [(s.link, *s.center, s.radius) for s in spec.spheres]
    expected = [(link, *row) for link, spheres in cover_model(spec.model_file).items() for row in spheres]
    assert rows == expected


def test_every_surface_point_of_the_model_is_inside_a_sphere(spec, model):
    rng = np.random.default_rng(0)
    for geom in range(model.ngeom):
        body = model.body(model.geom_bodyid[geom]).name
        spheres = [s for s in spec.spheres if s.link == body]
        points = surface(model, geom, rng)
        gaps = [np.linalg.norm(points - s.center, axis=1) - s.radius for s in spheres]
        assert np.min(gaps, axis=0).max() <= 1e-4, model.geom(geom).name


def surface(model, geom, rng):
    """Random surface points of a box, capsule or cylinder, in its body's frame."""
    u, size = rng.normal(size=(300, 3)), model.geom_size[geom]
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    kind = mujoco.mjtGeom(model.geom_type[geom])
    if kind == mujoco.mjtGeom.mjGEOM_CAPSULE:
        points = size[0] * u + np.column_stack([np.zeros((300, 2)), rng.uniform(-size[1], size[1], 300)])
    elif kind == mujoco.mjtGeom.mjGEOM_BOX:
        points = size * u / np.abs(u).max(axis=1, keepdims=True)
    elif kind == mujoco.mjtGeom.mjGEOM_CYLINDER:
        flat = np.abs(u[:, 2]) > 0.5
        side = u[:, :2] / np.linalg.norm(u[:, :2], axis=1, keepdims=True)
        height = np.where(flat, np.sign(u[:, 2]), u[:, 2]) * size[1]
        points = np.column_stack([size[0] * side * np.where(flat, 1 - u[:, 2] ** 2, 1.0)[:, None], height])
    else:
        raise AssertionError(f"no surface for {kind}")
    R = np.zeros(9)
    mujoco.mju_quat2Mat(R, model.geom_quat[geom])
    return points @ R.reshape(3, 3).T + model.geom_pos[geom]


def test_visual_meshes_are_of_links_that_the_model_has(robot):
    spec = robot("panda")
    model = mujoco.MjModel.from_xml_path(str(spec.model_file))
    assert {v.link for v in spec.visuals} <= {model.body(i).name for i in range(model.nbody)}
    assert all(v.file.is_file() for v in spec.visuals)


def test_without_meshes_a_robot_keeps_its_shapes(monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    assert panda_visuals() == ()
