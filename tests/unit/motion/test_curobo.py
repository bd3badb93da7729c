import time
from itertools import pairwise

import numpy as np
import pytest

from gap_catalogue.shared.robot_chain import chain
from gap_motion.planning.cartesian_constraints import directed_end, held_end
from gap_runtime.contracts.failures import BadRequestError, PlanningError
from gap_runtime.contracts.types import (
    JointState,
    Obstacle,
    OrientedBoundingBox,
    Quaternion,
    Se3Pose,
    Trajectory,
    Vec3,
    WorldConfig,
)  # fmt: skip

LEVEL, DOWN = Quaternion(1.0, 0.0, 0.0, 0.0), Quaternion(0.0, 1.0, 0.0, 0.0)


@pytest.fixture
def tcp(cell):
    return cell.arm.state().ee_pose


@pytest.fixture
def start(cell):
    return cell.arm.state().joints


def shifted(pose, x=0.0, y=0.0, z=0.0):
    p = pose.position
    return Se3Pose(Vec3(p.x + x, p.y + y, p.z + z), pose.rotation)


def block(name, pose, half):
    return Obstacle(name, OrientedBoundingBox(pose.position, Vec3(*half), LEVEL))


@pytest.fixture
def table(tcp):
    """A table at the foot of the arm, and a target on it under the TCP."""
    top = -0.005
    floor = Obstacle("table", OrientedBoundingBox(Vec3(0, 0, top - 0.05), Vec3(2, 2, 0.05), LEVEL))
    target = Se3Pose(Vec3(tcp.position.x, tcp.position.y, top + 0.041), LEVEL)
    return WorldConfig((floor, block("target", target, (0.02, 0.02, 0.04))))


@pytest.fixture
def grasp(table, tcp):
    return Se3Pose(table.obstacles[1].box.center, tcp.rotation)


def end(cell, trajectory):
    return chain(cell.arm.spec).tcp_poses(trajectory.positions, cell.arm.base_pose.matrix)[-1]


def test_grasp_poses_give_a_motion_to_one_of_them(cell, start, table, grasp):
    turned = Se3Pose(
        grasp.position, Quaternion.of(grasp.rotation.rotation * Quaternion(0.9659258, 0, 0, 0.2588190).rotation)
    )
    plan = cell.call(
        "curobo.PlanToGraspPoses", world_config=table, start_joint_position=start, grasp_poses=[grasp, turned]
    )
    assert plan.success and plan.goalset_index in (0, 1)
    np.testing.assert_allclose(end(cell, plan.trajectory), [grasp, turned][plan.goalset_index].matrix, atol=1e-3)
    np.testing.assert_array_equal(plan.trajectory.positions[0], start.positions)


def test_planning_twice_gives_the_same_bytes(cell, start, table, grasp):
    plans = [
        cell.call("curobo.PlanToGraspPoses", world_config=table, start_joint_position=start, grasp_poses=[grasp])
        for _ in range(2)
    ]
    assert plans[0].trajectory == plans[1].trajectory


def test_a_wall_is_gone_around(cell, start, tcp):
    goal = shifted(tcp, y=0.3)
    wall = WorldConfig((block("wall", shifted(tcp, y=0.15), (0.12, 0.02, 0.12)),))
    cartesian_line = cell.call(
        "curobo.PlanLinear", start_pose=tcp, end_pose=goal, start_joint_position=start, world_config=wall
    )
    assert (
        not cartesian_line.success
        and cartesian_line.failure_reason.startswith("in_collision")
        and "wall" in cartesian_line.failure_reason
    )
    around = cell.call("curobo.PlanToPose", target_pose=goal, start_joint_position=start, world_config=wall)
    verdict = cell.call("curobo.ValidateJointTrajectoryRobot", world_config=wall, trajectory=around.trajectory)
    assert verdict.success and verdict.first_collision_waypoint == -1


def test_a_held_object_is_carried_around_what_it_would_hit(cell, start, tcp):
    held = block("bottle", shifted(tcp, z=-0.05), (0.015, 0.015, 0.08))
    wall = block("wall", shifted(tcp, y=0.15, z=-0.2), (0.2, 0.02, 0.12))
    config, goal = WorldConfig((held, wall)), shifted(tcp, y=0.3)
    empty_handed = cell.call(
        "curobo.PlanLinear",
        start_pose=tcp,
        end_pose=goal,
        start_joint_position=start,
        world_config=WorldConfig((wall,)),
    )
    assert empty_handed.success
    name = "curobo.ValidateJointTrajectoryGrasped"
    verdict = cell.call(name, world_config=config, trajectory=empty_handed.trajectory, object_name="bottle")
    assert not verdict.success and verdict.first_collision_waypoint > 0
    assert "bottle" in verdict.collision_status_detail and "wall" in verdict.collision_status_detail
    plan = cell.call(
        "curobo.PlanWithGraspedObject",
        world_config=config,
        start_joint_position=start,
        target_pose=goal,
        object_name="bottle",
    )
    assert cell.call(name, world_config=config, trajectory=plan.trajectory, object_name="bottle").success


def test_a_grasp_motion_has_three_phases_that_join(cell, start, table, grasp):
    plan = cell.call("curobo.PlanGraspMotion", start_joint_position=start, grasp_pose=grasp, world_config=table)
    assert plan.success and plan.failure_reason == ""
    phases = (plan.approach_trajectory, plan.grasp_trajectory, plan.lift_trajectory)
    for before, after in pairwise(phases):
        np.testing.assert_allclose(before.positions[-1], after.positions[0], atol=1e-9)
    heights = [end(cell, phase)[2, 3] for phase in phases]
    assert heights[0] - heights[1] == pytest.approx(0.12, abs=2e-3)
    assert heights[2] - heights[1] == pytest.approx(0.20, abs=2e-3)


def test_a_grasp_inside_the_table_says_so(cell, start, table, grasp):
    deep = shifted(grasp, x=0.2, z=-0.08)
    plan = cell.call("curobo.PlanGraspMotion", start_joint_position=start, grasp_pose=deep, world_config=table)
    assert not plan.success and plan.failure_reason.startswith("in_collision") and "table" in plan.failure_reason
    with pytest.raises(PlanningError) as error:
        cell.call("curobo.PlanToGraspPoses", world_config=table, start_joint_position=start, grasp_poses=[deep])
    assert error.value.code == "in_collision"


def test_feasibility_tells_free_blocked_and_far_grasps_apart(cell, start, table, grasp):
    grasp = Se3Pose(grasp.position, DOWN)
    walls = [block(f"wall_{s}", shifted(grasp, y=0.055 * s), (0.15, 0.01, 0.06)) for s in (-1, 1)]
    crowded = WorldConfig((*table.obstacles, *walls))
    far = shifted(grasp, x=3.0)
    across = Se3Pose(
        grasp.position, Quaternion.of(Quaternion(0.7071068, 0, 0, 0.7071068).rotation * grasp.rotation.rotation)
    )
    free = cell.call("curobo.BatchGraspFeasibility", world_config=table, start_state=start, grasp_poses=[grasp, far])
    assert free.feasible == [True, False] and free.grasp_ik_ok == [True, False]
    assert free.corridor_collision_fraction == [0.0, 1.0]
    tight = cell.call(
        "curobo.BatchGraspFeasibility", world_config=crowded, start_state=start, grasp_poses=[grasp, across]
    )
    assert sorted(tight.feasible) == [False, True]
    open_again = cell.call(
        "curobo.BatchGraspFeasibility", world_config=crowded, start_state=start, grasp_poses=[grasp, across],
        ignore_obstacle_names=["wall_-1", "wall_1"],
    )  # fmt: skip
    assert open_again.feasible == [True, True]


def test_ik_reaches_and_prefers_its_seed(cell, start, tcp):
    goal = shifted(tcp, 0.05, 0.05, -0.1)
    solution = cell.call("curobo.SolveIK", target_pose=goal, seed_config=start)
    assert solution.success
    again = cell.call("curobo.SolveIK", target_pose=goal, seed_config=solution.joint_config)
    np.testing.assert_allclose(again.joint_config.positions, solution.joint_config.positions, atol=0.05)


def test_directed_lines_hold_the_other_axes(cell, start, tcp):
    target = shifted(tcp, 0.1, 0.1, -0.2)
    base = {"start_joint_position": start, "start_pose": tcp, "target_pose": target}
    down = cell.call("curobo.PlanDirectedLinear", **base, allowed_axes=["z"])
    np.testing.assert_allclose(end(cell, down.trajectory), shifted(tcp, z=-0.2).matrix, atol=1e-3)
    way = chain(cell.arm.spec).tcp_poses(down.trajectory.positions, cell.arm.base_pose.matrix)
    np.testing.assert_allclose(way[:, :2, 3], np.tile(tcp.position.array[:2], (len(way), 1)), atol=1e-3)
    np.testing.assert_allclose(way[:, :3, :3], np.tile(tcp.matrix[:3, :3], (len(way), 1, 1)), atol=1e-2)
    fixed = cell.call(
        "curobo.PlanDirectedLinear", **base, allowed_axes=["z"], endpoint_mode="fixed_distance", distance=0.05
    )
    np.testing.assert_allclose(end(cell, fixed.trajectory), shifted(tcp, z=-0.05).matrix, atol=1e-3)


def test_ends_of_constrained_lines():
    start, target = np.eye(4), np.eye(4)
    target[:3, :3] = Quaternion(0.9659258, 0, 0, 0.2588190).rotation.as_matrix()
    target[:3, 3] = [0.3, 0.4, 0.0]
    turned = directed_end(start, target, [], "orient_in_place", "hold", 0.0)
    np.testing.assert_allclose(turned[:3, 3], 0)
    np.testing.assert_allclose(turned[:3, :3], target[:3, :3])
    moved = directed_end(start, target, ["x", "y"], "fixed_distance", "target", 1.0)
    np.testing.assert_allclose(moved[:3, 3], [0.6, 0.8, 0.0])
    np.testing.assert_allclose(held_end(start, target, [1] * 6), start, atol=1e-9)
    np.testing.assert_allclose(held_end(start, target, [0] * 6), target, atol=1e-9)
    with pytest.raises(BadRequestError):
        directed_end(start, target, ["w"], "project_to_target", "hold", 0.0)


def test_bad_requests_are_named_within_a_second(cell, spec, start, tcp, table, grasp):
    empty, nan = WorldConfig(), Se3Pose(Vec3(float("nan"), 0, 0), tcp.rotation)
    short = JointState(np.zeros(spec.dof - 1))
    cloud = Obstacle(
        "cloud", table.obstacles[0].box, np.random.default_rng(0).uniform(-0.4, 0.4, (1_000_000, 3)) - [0, 0, 5]
    )
    inside = WorldConfig((block("crate", tcp, (0.1, 0.1, 0.1)),))
    cases = [
        ("joint_count", "curobo.PlanToPose", {"target_pose": tcp, "start_joint_position": short}),
        ("not_finite", "curobo.PlanToPose", {"target_pose": nan, "start_joint_position": start}),
        ("empty", "curobo.PlanToGraspPoses", {"world_config": empty, "start_joint_position": start, "grasp_poses": []}),
        ("in_collision", "curobo.PlanToPose",
         {"target_pose": shifted(tcp, z=0.1), "start_joint_position": start, "world_config": inside}),
        ("in_collision", "curobo.PlanToPose",
         {"target_pose": shifted(grasp, x=0.1, z=-0.1), "start_joint_position": start, "world_config": table}),
        ("unknown_obstacle", "curobo.PlanWithGraspedObject",
         {"target_pose": tcp, "start_joint_position": start, "world_config": table, "object_name": "cup"}),
        ("range", "curobo.PlanToPose", {"target_pose": tcp, "start_joint_position": start, "collision_margin": -1.0}),
        ("unreachable", "curobo.PlanToPose",
         {"target_pose": shifted(tcp, 2.0), "start_joint_position": start, "world_config": WorldConfig((cloud,))}),
    ]  # fmt: skip
    for code, name, inputs in cases:
        began = time.process_time()
        with pytest.raises((BadRequestError, PlanningError)) as error:
            cell.call(name, **inputs)
        assert error.value.code == code, (name, error.value)
        assert time.process_time() - began < 1.0


def test_a_verdict_names_the_joint_that_leaves_its_range(cell, spec, start):
    q = np.tile(start.positions, (3, 1))
    q[1, 1] = spec.limits[1].upper + 0.1
    verdict = cell.call(
        "curobo.ValidateJointTrajectoryRobot", world_config=WorldConfig(), trajectory=Trajectory([0, 1, 2], q)
    )
    assert (
        not verdict.success and verdict.failure_reason.startswith("limits") and spec.joints[1] in verdict.failure_reason
    )
