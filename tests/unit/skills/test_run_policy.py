"""run-policy: a policy is asked again until something says that it is done, or its windows are used up."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from gap_motion.hold import HoldStill
from gap_runtime.contracts.types import ActionChunk, ArmState, GripperState, JointState, Quaternion, Se3Pose, Vec3
from tests.unit.skills.stage import ROBOTS, Stage, script

run = script("run-policy", "run_policy")
POSE = Se3Pose(Vec3(0, 0, 0), Quaternion(1, 0, 0, 0))
ARM = ArmState(0, JointState(np.arange(7.0)), GripperState(0.08, 1.0), POSE)
SEEN = SimpleNamespace(cameras=[SimpleNamespace(stamp=2.0)], arm_states=[ARM])


def stage(done_at=0, yes_at=0):
    asked = {"policy.Act": 0, "vlm.QueryYesNo": 0}

    def act(observation, instruction):
        asked["policy.Act"] += 1
        assert instruction == "wipe" and observation.arm_states == (ARM,) and observation.stamp == 2.0
        return ActionChunk(20.0, joints=np.zeros((1, 7)), done=asked["policy.Act"] == done_at)

    def answer(prompt):
        asked["vlm.QueryYesNo"] += 1
        return SimpleNamespace(answer=asked["vlm.QueryYesNo"] == yes_at)

    return Stage(
        ROBOTS[0],
        observation__GetObservation=lambda: SEEN,
        policy__Act=act,
        robot_control__ExecuteActionChunk=lambda chunk: SimpleNamespace(),
        vlm__QueryYesNo=answer,
    )


@pytest.mark.parametrize(
    ("given", "question", "outcome", "windows", "questions"),
    [
        ({}, "", "out_of_windows", 7, 0),
        ({}, "Is it clean?", "out_of_windows", 7, 3),
        ({"done_at": 4}, "", "finished", 4, 0),
        ({"yes_at": 2}, "Is it clean?", "finished", 4, 2),
    ],
)
def test_it_ends_when_something_says_so(given, question, outcome, windows, questions):
    ctx = stage(**given)
    ended = run(ctx, "wipe", question, max_windows=7, ask_every=2)
    called = [name for name, _ in ctx.calls]
    assert ended == (outcome, windows)
    assert called.count("robot_control.ExecuteActionChunk") == windows
    assert called.count("vlm.QueryYesNo") == questions


def test_the_embedded_policy_stays_where_it_is():
    chunk = HoldStill().act(SimpleNamespace(arm_states=(ARM,)), "wipe")
    assert (chunk.joints == ARM.joints.positions).all() and len(chunk.joints) > 1
