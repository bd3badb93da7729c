import copy
import pickle

import pytest

from gap_runtime import errors
from gap_runtime.contracts import failures
from gap_runtime.contracts.failures import GapError, ToolError, UnknownNameError, did_you_mean, nearest
from gap_runtime.errors import Finding

FINDING = Finding("nodes.a", "S1", "is wrong", "do right")
SPECIAL = {
    "UnknownNameError": lambda cls: cls("task", "sop", ["soup"]),
    "DocumentError": lambda cls: cls("f:3", "is wrong", hint="do right"),
    "WorkflowError": lambda cls: cls([FINDING]),
    "ExecutionError": lambda cls: cls("failed", [ValueError("a")], hint="do right"),
    "SandboxError": lambda cls: cls("failed", hint="do right", cause="timeout", line=7),
}
ALL = [c for c in vars(errors).values() if isinstance(c, type) and issubclass(c, GapError)]


def make(cls):
    if issubclass(cls, ToolError):
        return cls("code", "is wrong", hint="do right", detail={"n": 1})
    return SPECIAL.get(cls.__name__, lambda c: c("is wrong", hint="do right"))(cls)


@pytest.mark.parametrize("cls", ALL)
def test_an_error_crosses_a_process_border_whole(cls):
    error = make(cls)
    for twin in (pickle.loads(pickle.dumps(error)), copy.copy(error)):
        assert type(twin) is cls
        assert str(twin) == str(error)
        assert {k: repr(v) for k, v in vars(twin).items()} == {k: repr(v) for k, v in vars(error).items()}


@pytest.mark.parametrize("cls", ALL)
def test_an_error_says_what_and_what_to_do_and_has_an_exit_code(cls):
    error = make(cls)
    assert error.message in str(error)
    assert error.hint in str(error)
    assert error.exit_code in (1, 3)


def test_every_failure_of_the_contracts_is_an_error_of_the_engine():
    names = {n for n, c in vars(failures).items() if isinstance(c, type) and issubclass(c, Exception)}
    assert names <= set(errors.__all__)
    assert all(name in errors.__doc__ for name in names)


def test_without_a_hint_the_message_stands_alone():
    assert str(GapError("is wrong")) == "is wrong"


@pytest.mark.parametrize(
    ("name", "known", "said"),
    [
        ("sop", ["soup", "milk"], "Did you mean 'soup'?"),
        ("zzz", ["soup", "milk"], "Known: milk, soup."),
        ("x", [], "None are known."),
        ("q", "abcdefghijklmn", "Known: a, b, c, d, e, f, g, h, i, j, k, l and 2 more."),
    ],
)
def test_a_name_nobody_knows_gets_the_nearest_or_the_list(name, known, said):
    assert did_you_mean(name, known) == said
    assert UnknownNameError("task", name, known).hint == said


PURPOSES = {
    "gripper.Open": "Open the jaws fully.",
    "gripper.Close": "Close the jaws until something stops them.",
    "robot_control.GoToPose": "Move the TCP to a pose by joint motion.",
    "robot_control.GoHome": "Move to the home configuration.",
    "observation.GetObservation": "Read every camera and every arm.",
    "observation.GetCameraPose": "Where one camera is.",
    "perception-single": "Finds one named object in the picture.",
    "track-object": "Follows one object from frame to frame.",
    "transport-to-drop": "Carries a held object over a container and releases it.",
}


@pytest.mark.parametrize(
    ("name", "meant"),
    [
        ("robot.open_gripper", "gripper.Open"),
        ("robot.go_to_pose", "robot_control.GoToPose"),
        ("robot.get_observation", "observation.GetObservation"),
        ("transporting-objects", "transport-to-drop"),
        ("perceiving-objects", "perception-single"),
        ("tracking-objects", "track-object"),
        ("gripper.Opne", "gripper.Open"),
        ("robot.wave", ""),
        ("speak", ""),
        ("", ""),
    ],
)
def test_the_nearest_name_shares_letters_or_meaning(name, meant):
    assert nearest(name, PURPOSES) == meant


def test_details_of_a_tool_error_are_its_own():
    detail = {"n": 1}
    error = ToolError("code", "is wrong", detail=detail)
    detail["n"] = 2
    assert error.detail == {"n": 1}
