"""Provider `vamp`, with a module of its interface in its place: what it is given, and what is made of its answers."""

from __future__ import annotations

import os
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest

from gap_catalogue.shared.robot_chain import chain, sphere_centers
from gap_motion.bench.problems import checker_among
from gap_motion.bench.verify import ObstacleShape
from gap_motion.planning.motion_validator import MotionValidator
from gap_motion.planning.planner import plan
from gap_motion.vamp import arm as arms
from gap_motion.vamp import tools as vamp_tools
from gap_motion.vamp.arm import vamp_arm
from gap_motion.vamp.search import TRIES, VampSearch
from gap_runtime.contracts.failures import PlanningError, ToolError
from gap_runtime.contracts.types import (
    JointState,
    Obstacle,
    OrientedBoundingBox,
    Quaternion,
    Se3Pose,
    Vec3,
    WorldConfig,
)
from tests.unit.motion.conftest import BASE, REGISTRY, IdealArm, random_joints
from tests.unit.motion.vamp_like import straight, vamp_like

PANDA = REGISTRY.robot("panda")
HOME = np.array(PANDA.home)
LEVEL = Quaternion(1.0, 0.0, 0.0, 0.0)
WALL = ObstacleShape((0.45, 0.0, 0.5), (0.02, 0.02, 0.3))
FLOOR = ObstacleShape((0.0, 0.0, -0.51), (1.2, 1.2, 0.5))
SERVED = ["curobo.PlanToGraspPoses", "curobo.PlanToPose", "curobo.PlanWithGraspedObject"]


@pytest.fixture
def vamp(monkeypatch):
    module = vamp_like(PANDA)
    monkeypatch.setitem(sys.modules, "vamp", module)
    vamp_arm.cache_clear()
    yield module
    vamp_arm.cache_clear()


@pytest.fixture
def sideways():
    """Start and goal on two sides of where `WALL` may stand."""
    return HOME + np.eye(7)[0] * 0.5, (HOME - np.eye(7)[0] * 0.5)[None]


def context(spec):
    """What planning asks of a tool's context: one arm, at home."""
    environment = SimpleNamespace(workspace=((-1.5, -1.5, -0.2), (1.5, 1.5, 1.5)))
    return SimpleNamespace(cell=SimpleNamespace(arms=[IdealArm(spec)]), task=SimpleNamespace(environment=environment))


@pytest.mark.parametrize("folder, served", [("_core", SERVED), ("host", [])])
def test_it_registers_where_it_is_installed_and_loads_nothing(tmp_path, folder, served):
    (tmp_path / "vamp" / folder).mkdir(parents=True)
    (tmp_path / "vamp" / "__init__.py").write_text("raise RuntimeError('loaded')")
    code = (
        "import sys\nfrom gap_runtime.plugins import load_registry\n"
        "registry = load_registry(('gap_motion',), entry_points=False)\n"
        "served = sorted(n for n, by in registry.providers.items() if 'vamp' in by)\n"
        "print(registry.broken, served, 'vamp' in sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True,
        env=os.environ | {"PYTHONPATH": str(tmp_path)},
    )  # fmt: skip
    assert done.stdout.strip() == f"{{}} {served} False"


def test_a_package_that_does_not_load_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "vamp", None)
    with pytest.raises(ToolError, match="pip install vamp-planner"):
        arms.library()


def test_an_arm_it_has_no_model_of_is_refused_with_the_models_there_are(vamp):
    ctx = context(REGISTRY.robot("ur5e"))
    here = ctx.cell.arms[0].state()
    with pytest.raises(ToolError, match=r"no model of ur5e: none of panda .*curobo\.\*=embedded") as refused:
        vamp_tools.plan_to_pose(ctx, target_pose=here.ee_pose, start_joint_position=here.joints)
    assert refused.value.code == "unsupported" and not isinstance(refused.value, PlanningError)


def test_a_model_counts_as_the_same_arm_to_a_millimetre(vamp):
    vamp.panda.bend = 0.0004
    assert vamp_arm(chain(PANDA)).name == "panda"
    vamp_arm.cache_clear()
    vamp.panda.bend = 0.002
    with pytest.raises(ToolError, match="moves and ends like it"):
        vamp_arm(chain(PANDA))


def test_a_model_with_another_hand_is_not_the_same_arm(vamp):
    vamp.panda.tip = vamp.panda.tip @ np.diag([-1.0, -1.0, 1.0, 1.0])
    with pytest.raises(ToolError, match="moves and ends like it"):
        vamp_arm(chain(PANDA))


def test_the_spheres_of_the_base_are_told_from_those_that_move(vamp):
    places = np.array([sphere_centers(PANDA, q) for q in random_joints(PANDA, 5)])
    still = np.ptp(places, axis=0).max(axis=1) < 1e-6
    assert 0 < still.sum() < len(still)
    np.testing.assert_array_equal(vamp_arm(chain(PANDA)).fixed, still)


def test_its_path_is_taken_from_the_very_start_to_the_very_goal(vamp, sideways):
    start, goals = sideways
    checker = checker_among(PANDA, [FLOOR])
    path = plan(checker, start, np.concatenate([goals + 0.1, goals]), search=VampSearch())
    np.testing.assert_array_equal(path.waypoints[0], start)
    np.testing.assert_array_equal(path.waypoints[-1], (goals + 0.1)[0] if path.goal == 0 else goals[0])
    world = vamp.panda.asked[0].cell
    assert vamp.panda.validate(start.tolist(), world), "the base stands in the floor, and the scene gave way"
    assert len(world.cuboids) > 1


def test_a_path_through_a_wall_is_found_out(vamp, sideways):
    start, goals = sideways
    checker = checker_among(PANDA, [WALL])
    with pytest.raises(PlanningError, match="VAMP found no path") as refused:
        plan(checker, start, goals, search=VampSearch())
    assert refused.value.code == "no_path" and refused.value.detail["tries"] == TRIES == len(vamp.panda.asked)
    heights = [asked.cell.cuboids[0].half[2] for asked in vamp.panda.asked]
    assert heights == sorted(heights) and heights[-1] > heights[0], "each try keeps farther away"


def test_a_later_try_may_find_what_an_earlier_one_did_not(vamp, sideways):
    start, goals = sideways
    checker = checker_among(PANDA, [WALL])
    around = plan(checker, start, goals).waypoints
    vamp.panda.answer = lambda *request: around if len(vamp.panda.asked) == 3 else straight(*request)
    path = plan(checker, start, goals, search=VampSearch())
    assert MotionValidator(checker).path_free(path.waypoints) and len(vamp.panda.asked) == 3


def test_no_path_at_all_is_said_at_once(vamp, sideways):
    vamp.panda.answer = lambda *request: None
    with pytest.raises(PlanningError) as refused:
        plan(checker_among(PANDA, [WALL]), *sideways, search=VampSearch())
    assert refused.value.code == "no_path" and len(vamp.panda.asked) == 1


def test_a_path_outside_our_joint_limits_is_moved_inside(vamp, sideways):
    start, goals = sideways
    upper = np.array([limit.upper for limit in PANDA.limits])
    beyond = HOME.copy()
    beyond[6] = upper[6] + 0.07
    vamp.panda.answer = lambda start, goals, world, rng: [start, beyond, goals[0]]
    path = plan(checker_among(PANDA, []), start, goals, search=VampSearch())
    assert len(path.waypoints) == 3 and (path.waypoints <= upper).all()
    assert path.waypoints[1, 6] == pytest.approx(upper[6])


def test_a_path_moved_inside_our_limits_must_be_free_there(vamp, sideways):
    start, goals = sideways
    upper = PANDA.limits[6].upper
    vamp.panda.answer = lambda start, goals, world, rng: [start, np.append(HOME[:6], upper + 0.07), goals[0]]
    vamp.panda.touching_itself = lambda q: abs(q[6] - upper) < 1e-3
    with pytest.raises(PlanningError, match="VAMP found no path"):
        plan(checker_among(PANDA, []), start, goals, search=VampSearch())
    assert len(vamp.panda.asked) == TRIES


def test_what_only_its_fatter_model_touches_gives_way(vamp, sideways):
    start, goals = sideways
    places = sphere_centers(PANDA, start) - np.array([[0, 0, s.radius] for s in PANDA.spheres])
    x, y, z = places[[s.link == "panda_leftfinger" for s in PANDA.spheres]].min(axis=0)
    checker = checker_among(PANDA, [ObstacleShape((x, y, z - 0.06), (0.05, 0.05, 0.05))])
    vamp.panda.fat = 0.02
    plan(checker, start, goals, search=VampSearch())
    world = vamp.panda.asked[0].cell
    assert all(vamp.panda.validate(q.tolist(), world) for q in (start, goals[0]))


def test_a_seed_is_a_place_in_the_sequence_of_samples(vamp, sideways):
    for seed in (3, 3, 4):
        plan(checker_among(PANDA, []), *sideways, seed=seed, search=VampSearch())
    first, again, other = (asked.rng.skipped for asked in vamp.panda.asked)
    assert first == again != other


@pytest.mark.parametrize("where, said", [("start", "The start is"), ("goal", "All goals are")])
def test_what_its_model_cannot_stand_in_is_refused(vamp, sideways, where, said):
    start, goals = sideways
    vamp.panda.touching_itself = lambda q: (q[0] > 0) == (where == "start")
    with pytest.raises(PlanningError, match=f"{said} in collision with the arm itself in VAMP's") as refused:
        plan(checker_among(PANDA, []), start, goals, search=VampSearch())
    assert refused.value.code == "in_collision" and not vamp.panda.asked


def test_a_goal_that_its_model_cannot_stand_in_is_left_out(vamp, sideways):
    start, goals = sideways
    vamp.panda.touching_itself = lambda q: q[1] > HOME[1] + 0.05
    path = plan(checker_among(PANDA, []), start, np.concatenate([goals + 0.1, goals]), search=VampSearch())
    assert path.goal == 1 and len(vamp.panda.asked[0].goals) == 1


@pytest.fixture
def scene():
    """A cell with a floor, a bottle in the gripper's place, and a pose to the side."""
    ctx = context(PANDA)
    here = ctx.cell.arms[0].state().ee_pose
    p = here.position
    bottle = OrientedBoundingBox(Vec3(p.x, p.y, p.z - 0.05), Vec3(0.015, 0.015, 0.08), LEVEL)
    floor = OrientedBoundingBox(Vec3(0.0, 0.0, -0.055), Vec3(2.0, 2.0, 0.05), LEVEL)
    config = WorldConfig((Obstacle("bottle", bottle), Obstacle("floor", floor)))
    return ctx, config, JointState(HOME), Se3Pose(Vec3(p.x, p.y + 0.2, p.z + 0.05), here.rotation)


def ends_at(trajectory, pose):
    np.testing.assert_allclose(chain(PANDA).tcp_poses(trajectory.positions, BASE.matrix)[-1], pose.matrix, atol=1e-4)


def test_the_tools_plan_with_it(vamp, scene):
    ctx, config, start, target = scene
    ends_at(vamp_tools.plan_to_pose(ctx, target_pose=target, start_joint_position=start).trajectory, target)
    grasp = Se3Pose(config.obstacles[0].box.center, target.rotation)
    far = Se3Pose(Vec3(5.0, 0.0, 0.5), target.rotation)
    away = JointState(HOME + np.eye(7)[0] * 0.5)
    found = vamp_tools.plan_to_grasp_poses(
        ctx, world_config=config, start_joint_position=away, grasp_poses=[far, grasp], approach_distance=0.15
    )
    assert found.goalset_index == 1 and len(vamp.panda.asked) == 2
    ends_at(found.trajectory, grasp)


def test_its_failures_are_the_embedded_ones(vamp, scene):
    ctx, config, start, _ = scene
    far = Se3Pose(Vec3(5.0, 0.0, 0.5), LEVEL)
    with pytest.raises(PlanningError, match="cannot be reached") as refused:
        vamp_tools.plan_to_pose(ctx, target_pose=far, start_joint_position=start, world_config=config)
    assert refused.value.code == "unreachable" and not vamp.panda.asked


def test_what_is_held_rides_on_its_tip(vamp, scene):
    ctx, config, start, target = scene
    box = config.obstacles[0].box
    under = Vec3(box.center.x, box.center.y, box.center.z - box.extent.z - 0.02)
    shelf = Obstacle("shelf", OrientedBoundingBox(under, Vec3(0.12, 0.12, 0.02), LEVEL))
    config = WorldConfig((*config.obstacles, shelf))
    vamp.panda.tip = vamp.panda.tip @ np.array([[1, 0, 0, 0.001], [0, 1, 0, 0], [0, 0, 1, 0.002], [0, 0, 0, 1.0]])
    planned = vamp_tools.plan_with_grasped_object(
        ctx, world_config=config, start_joint_position=start, target_pose=target, object_name="bottle"
    )
    ends_at(planned.trajectory, target)
    world = vamp.panda.asked[0].cell
    tip, spheres = vamp.panda.eefk(HOME.tolist()) @ world.attached.relative_frame, world.attached.spheres
    in_base = np.array([(s.x, s.y, s.z) for s in spheres]) @ tip[:3, :3].T + tip[:3, 3]
    centers = in_base @ BASE.matrix[:3, :3].T + BASE.matrix[:3, 3]
    assert (np.abs(centers - box.center.array) < box.extent.array).all()
    reach = np.array([s.r for s in spheres])
    assert not world.touches(np.column_stack([in_base, reach])), "what it stands on gave way"
    assert all((np.linalg.norm(centers - corner, axis=1) < reach + 1e-6).any() for corner in box.corners)


def test_improving_asks_for_its_other_planner(vamp, scene):
    ctx, _, start, target = scene
    vamp_tools.plan_to_pose(ctx, target_pose=target, start_joint_position=start, improve=True)
    assert [asked.settings.rrtc.range for asked in vamp.panda.asked] == [1.0]
    vamp.panda.improves = False
    vamp_tools.plan_to_pose(ctx, target_pose=target, start_joint_position=start, improve=True)
    assert vamp.panda.asked[-1].settings.range == 1.0, "one path is better than none"
