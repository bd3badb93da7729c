"""A Menagerie checkout of our own making: the first-party models under foreign names."""

import re
from dataclasses import replace

import mujoco
import numpy as np
import pytest

from gap_catalogue.shared.robot_chain import chain
from gap_motion.kinematics import ik
from gap_motion.planning.moves import within_steps
from gap_robots import menagerie
from gap_robots.menagerie.adapt import DEFAULT_TORQUE
from gap_robots.panda import FOLDER as PANDA
from gap_robots.ur5e import FOLDER as UR5E
from gap_runtime.contracts.failures import DocumentError, PlanningError, UnknownNameError
from gap_runtime.contracts.types import Trajectory
from gap_runtime.plugins import load_registry


@pytest.fixture
def checkout(tmp_path, monkeypatch):
    """With a jaw and other actuators; without a jaw, but a site for one; and a folder that is no arm."""
    arm = tmp_path / "maker_arm"
    arm.mkdir()
    text = (PANDA / "panda.xml").read_text()
    text = re.sub(
        r"<actuator>.*</actuator>", '<actuator><motor name="m1" joint="panda_joint1"/></actuator>', text, flags=re.S
    )
    (arm / "arm.xml").write_text(text)
    (arm / "scene.xml").write_text('<mujoco><include file="arm.xml"/></mujoco>')
    bare = tmp_path / "bare_arm"
    bare.mkdir()
    spec = mujoco.MjSpec.from_file(str(UR5E / "ur5e.xml"))
    for item in [*spec.actuators, *spec.tendons, *spec.equalities, *spec.excludes]:
        spec.delete(item)
    spec.delete(spec.body("tool0"))
    spec.body("wrist_3_link").add_site(name="attachment_site", pos=[0, 0, 0.0996])
    (bare / "arm.xml").write_text(spec.to_xml())
    odd = tmp_path / "lamp"
    odd.mkdir()
    (odd / "lamp.xml").write_text('<mujoco><worldbody><body name="b"><geom size="0.1"/></body></worldbody></mujoco>')
    monkeypatch.setenv("MENAGERIE_ROOT", str(tmp_path))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    menagerie.menagerie.cache_clear()
    yield tmp_path
    menagerie.menagerie.cache_clear()


def test_folders_are_registered_under_their_names(checkout):
    robots = load_registry(("gap_robots",), entry_points=False).robots
    assert {"menagerie:maker_arm", "menagerie:bare_arm", "menagerie:lamp"} <= set(robots)
    assert "menagerie:cache" not in robots


@pytest.mark.parametrize("name", ["maker_arm", "bare_arm"])
def test_an_adapted_arm_keeps_every_promise_of_a_robot(checkout, name):
    spec = menagerie.menagerie(name)
    model = mujoco.MjModel.from_xml_path(str(spec.model_file))
    assert {model.actuator(i).name for i in range(model.nu)} == {*spec.joints, "gripper"}
    assert all(limit.lower < q < limit.upper for q, limit in zip(spec.home, spec.limits, strict=True))
    assert spec.gripper.max_width > 0.05 and len(spec.gripper.joints) == 2 and spec.spheres
    data = mujoco.MjData(model)
    for joint, q in zip(spec.joints, spec.home, strict=True):
        data.qpos[model.joint(joint).qposadr[0]] = data.ctrl[model.actuator(joint).id] = q
    for _ in range(100):
        mujoco.mj_step(model, data)
    held = [data.qpos[model.joint(joint).qposadr[0]] for joint in spec.joints]
    np.testing.assert_allclose(held, spec.home, atol=2e-3)


def test_the_tcp_found_is_the_tcp_known(checkout, robot):
    known, found = robot("panda"), menagerie.menagerie("maker_arm")
    q = np.array(known.home)
    here, there = (chain(spec).tcp_poses(q)[0] for spec in (known, found))
    np.testing.assert_allclose(here[:3, 3], there[:3, 3], atol=2e-3)
    np.testing.assert_allclose(here[:3, 2], there[:3, 2], atol=1e-6)
    assert abs(here[:3, 1] @ there[:3, 1]) == pytest.approx(1.0)
    assert ik.closed_form(chain(found)) is not None, "the closed form goes by geometry, not by name"


def test_building_twice_gives_one_file(checkout):
    first = menagerie.menagerie("maker_arm").model_file
    menagerie.menagerie.cache_clear()
    assert menagerie.menagerie("maker_arm").model_file == first


def test_what_is_no_arm_is_refused_by_name(checkout):
    with pytest.raises(DocumentError, match="lamp"):
        menagerie.menagerie("lamp")
    with pytest.raises(UnknownNameError):
        menagerie.menagerie("nobody")


def _write(checkout, name, text, **files):
    (checkout / name).mkdir()
    for file, content in {"arm": text, **files}.items():
        (checkout / name / f"{file}.xml").write_text(content)


def test_a_continuous_joint_gets_a_range(checkout):
    text = (PANDA / "panda.xml").read_text()
    _write(checkout, "endless_arm", text.replace('range="-2.8973 2.8973"', 'limited="false"', 1))
    limit = menagerie.menagerie("endless_arm").limits[0]
    assert (limit.lower, limit.upper) == pytest.approx((-2 * np.pi, 2 * np.pi))


def test_a_nested_model_loads_where_it_is_placed_without_a_warning(checkout, robot, recwarn, capfd):
    outer = (
        '<mujoco><asset><model name="inner" file="inner.xml"/></asset><worldbody><frame pos="0 0 0.1" quat="0 0 0 1">'
        '<attach model="inner" body="panda_link0" prefix="a_"/><geom size="0.01"/></frame></worldbody></mujoco>'
    )
    _write(checkout, "nested_arm", outer, inner=(PANDA / "panda.xml").read_text())
    found = menagerie.menagerie("nested_arm")
    assert found.dof == 7 and not recwarn.list and "WARNING" not in capfd.readouterr().err
    model = mujoco.MjModel.from_xml_path(str(found.model_file))
    base = model.body(found.base_link)
    np.testing.assert_allclose(base.pos, [0, 0, 0.1], atol=1e-6)
    np.testing.assert_allclose(np.abs(base.quat), [0, 0, 0, 1], atol=1e-6)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ('<mujoco><asset><mesh name="m" file="gone.stl"/></asset></mujoco>', "gone.stl"),
        ("<mujoco><worldbody>", "XML parse error"),
        ("<mujoco><worldbody><body><joint/></body></worldbody></mujoco>", "mass"),
    ],
    ids=["missing mesh", "broken file", "no mass"],
)
def test_a_model_that_cannot_be_used_is_refused_with_the_reason(checkout, text, reason):
    _write(checkout, "bad_arm", text)
    with pytest.raises(DocumentError, match=rf"bad_arm/arm.xml: cannot be used as an arm: .*{reason}"):
        menagerie.menagerie("bad_arm")


def test_an_arm_without_a_home_gets_one_that_points_down_inside_its_limits(checkout):
    spec = menagerie.menagerie("bare_arm")
    T = chain(spec).tcp_poses(np.array(spec.home))[0]
    np.testing.assert_allclose(T[:3, 2], [0, 0, -1], atol=0.05)
    assert 0.2 < T[0, 3] < spec.reach and T[2, 3] == pytest.approx(0.45, abs=0.02) and abs(T[1, 3]) < 0.02
    assert all(limit.lower < q < limit.upper for q, limit in zip(spec.home, spec.limits, strict=True))


def test_a_jaw_is_mounted_on_a_body_that_grippers_are_mounted_on(checkout):
    file = checkout / "bare_arm" / "arm.xml"
    text = file.read_text()
    site = re.search(r'<site name="attachment_site"[^>]*/>', text)[0]
    file.write_text(text.replace(site, '<body name="right_hand" pos="0 0 0.0996"/>'))
    assert menagerie.menagerie("bare_arm").gripper.max_width == pytest.approx(0.085)


@pytest.mark.parametrize(
    ("motor", "torque"),
    [
        ('<motor joint="panda_joint1" ctrllimited="true" ctrlrange="-50 50"/>', 50.0),
        ('<motor joint="panda_joint1" ctrllimited="true" ctrlrange="-1 1" gear="40"/>', 40.0),
        ('<motor joint="panda_joint1" forcerange="-20 20"/>', 20.0),
        ('<position joint="panda_joint1" kp="9" ctrlrange="-1 1"/>', DEFAULT_TORQUE),
    ],
)
def test_a_torque_is_what_the_actuator_can_give(checkout, motor, torque):
    file = checkout / "maker_arm" / "arm.xml"
    text = file.read_text().replace('<motor name="m1" joint="panda_joint1"/>', motor)
    file.write_text(text.replace('range="-2.8973 2.8973" actuatorfrcrange="-87 87"', 'range="-2.8973 2.8973"', 1))
    assert menagerie.menagerie("maker_arm").limits[0].torque == pytest.approx(torque)


@pytest.mark.parametrize("slower", [1.0, 2.0])
def test_a_step_limit_follows_the_speed_of_the_arm(robot, slower):
    fast = robot("panda")
    spec = replace(fast, limits=tuple(replace(li, velocity=li.velocity / slower) for li in fast.limits))
    assert spec.time_scale == pytest.approx(slower) and robot("ur5e").time_scale == 1.0
    motion = Trajectory(np.array([0.0, 6.0 * slower]), np.zeros((2, 7)))
    assert within_steps(motion, 120, spec) is motion
    with pytest.raises(PlanningError, match="max_steps = 119"):
        within_steps(motion, 119, spec)


def test_no_checkout_no_robots(monkeypatch, tmp_path):
    monkeypatch.delenv("MENAGERIE_ROOT", raising=False)
    assert menagerie.folders() == []
    monkeypatch.setenv("MENAGERIE_ROOT", str(tmp_path / "gone"))
    assert menagerie.folders() == []
