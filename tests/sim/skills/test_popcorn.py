"""The skills of make-popcorn in physics: a knob turned on and off, a pan set on the burner and taken off again."""

from __future__ import annotations

from pathlib import Path

import pytest

from gap_cli.rehearse.judge import SequenceMonitor
from gap_mujoco.simulator import MujocoSimulator
from gap_runtime.contracts.standalone import StandaloneContext
from gap_runtime.contracts.task import load_task
from gap_runtime.plugins import load_registry
from tests.unit.skills.stage import LIBRARY

pytestmark = [pytest.mark.sim, pytest.mark.slow]
REGISTRY = load_registry()
SEED = 2


def script(skill, name):
    namespace = {"__name__": name}
    exec(compile(LIBRARY[skill].scripts[name].read_text(), name, "exec"), namespace)
    return namespace["run"]


class Cook:
    """Carries the skills out step by step, as their templates do."""

    def __init__(self, ctx):
        self.ctx, self.tool = ctx, ctx.tool

    def see(self, whole, part):
        frames = list(self.tool("observation.GetObservation").cameras)
        found = script("perception-subpart", "perceive_part")(self.ctx, frames, whole, part)
        return self.tool("geometry_svc.FilterAndComputeOBB", point_cloud=found.cloud)

    def world(self, box):
        seen = self.tool("observation.GetObservation")
        joints = seen.arm_states[0].joints
        return self.tool(
            "geometry_svc.BuildWorldConfig", cameras=list(seen.cameras), object_masks=[], robot_joint_state=joints,
            target_obb=box,
        ).config  # fmt: skip

    def go(self, *poses):
        for pose in poses:
            self.tool("robot_control.GoToPoseCartesian", pose=pose)

    def turn(self, state):
        plan = script("turn-knob", "plan_turn")(self.ctx, self.see("stove", "knob of the stove"), state)
        self.tool("gripper.Open")
        self.tool("robot_control.GoToPose", pose=plan.hover_pose)
        self.go(plan.grip_pose)
        self.tool("gripper.Close")
        self.go(plan.turned_pose)
        self.tool("gripper.Open")
        self.go(plan.clear_pose)
        self.tool("robot_control.GoHome")

    def pick(self):
        handle = self.see("popcorn pan", "handle of the popcorn pan")
        plan = script("grasp-direct-ik", "plan_grasp")(self.ctx, handle, self.world(handle))
        self.tool("gripper.Open")
        self.tool("robot_control.GoToPose", pose=plan.hover_pose)
        self.go(plan.grasp_pose)
        self.tool("gripper.Close")
        return self.tool("robot_control.GetEEPose").pose

    def place(self, plan):
        self.go(plan.lift_pose)
        self.tool("robot_control.GoToPose", pose=plan.carry_pose)
        self.go(plan.release_pose)
        self.tool("gripper.Open")
        self.go(plan.rise_pose)
        self.tool("robot_control.GoHome")


@pytest.fixture
def cook():
    task = load_task(Path(__file__).parents[3] / "tasks" / "make-popcorn")
    robots = {p.model: REGISTRY.robot(p.model) for p in task.robots}
    simulator = MujocoSimulator(task, "kitchen", robots)
    simulator.reset(simulator.sample(SEED))
    yield Cook(StandaloneContext(simulator, task, robots, REGISTRY.tools, object_renderer=REGISTRY.renderer))
    simulator.close()


def test_the_popcorn_is_made_in_order(cook):
    simulator, task = cook.ctx.cell, cook.ctx.task
    monitor = SequenceMonitor(simulator, task.sequence)
    cook.turn("on")
    assert simulator.snapshot().joint("stove_knob") > 0.9
    burner, body = cook.see("stove", "burner of the stove"), cook.see("popcorn pan", "body of the popcorn pan")
    cook.place(script("place-on", "plan_place")(cook.ctx, burner, body, cook.pick()))
    now = simulator.snapshot()
    assert now.body("frypan").coverage(now.body("stove"), "burner") > 0.95
    cook.tool("clock.Wait", seconds=3.2)
    body = cook.see("popcorn pan", "body of the popcorn pan")
    held = cook.pick()
    cook.place(script("place-aside", "plan_aside")(cook.ctx, body, held, cook.world(body)))
    cook.turn("off")
    monitor.stop()
    assert all(monitor.conditions.values()), monitor.conditions
    now = simulator.snapshot()
    assert now.joint("stove_knob") < 0 and not now.body("frypan").touches("stove")


def test_a_sequence_out_of_order_does_not_count(cook):
    simulator = cook.ctx.cell
    monitor = SequenceMonitor(simulator, cook.ctx.task.sequence[1:])
    simulator.wait(0.5)
    monitor.stop()
    assert not any(monitor.conditions.values())
