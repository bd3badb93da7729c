"""The backward search over skill contracts: which skills, in which order, and why none."""

from __future__ import annotations

import pytest

from gap_cli.author.operators import OperatorLibrary
from gap_cli.author.regress import State, regress
from gap_cli.skills.facts import Fact
from gap_runtime.errors import InstructionError
from tests.unit.author.contract_library import OBB, POSE, SPINE, library, tools

IDLE = State(frozenset({Fact("hand_empty")}))
IN = Fact("in", ("milk", "basket"))
OBJECTS = ["milk", "basket"]


def plan(lib, goal=IN, state=IDLE, objects=OBJECTS, keep=frozenset(), served=None):
    steps = regress(goal, state, OperatorLibrary.of(lib, served or tools()), objects, keep)
    return [(s.skill, *s.roles.values()) for s in steps]


def test_a_goal_is_regressed_to_what_holds():
    found = plan(library())
    assert sorted(found[:3]) == [("look", "basket"), ("look", "milk"), ("seize", "milk")]
    assert found.index(("look", "milk")) < found.index(("seize", "milk"))
    assert found[-1] == ("drop-in", "milk", "basket")


def test_nothing_is_done_for_what_holds_already():
    assert plan(library(), goal=Fact("hand_empty")) == []


def test_a_held_object_is_not_grasped_again():
    grasped = IDLE.after(regress(Fact("holding", ("milk",)), IDLE, OperatorLibrary.of(library(), tools()), OBJECTS))
    assert ("seize", "milk") not in plan(library(drop_in={**SPINE["drop-in"], "inputs": {}}), state=grasped)


def test_the_cheaper_of_two_equal_skills_is_used():
    assert ("clamp", "milk") in plan(library(clamp={**SPINE["seize"], "cost": 0.5}))
    assert ("seize", "milk") in plan(library(clamp={**SPINE["seize"], "cost": 1.5}))


def test_a_new_skill_is_used_for_what_no_other_does():
    shelve = {**SPINE["drop-in"], "effects": ["on(target, container)", "hand_empty", "-holding(target)"]}
    assert plan(library(shelve=shelve), goal=Fact("on", ("milk", "basket")))[-1] == ("shelve", "milk", "basket")


def test_a_skill_that_does_it_all_at_once_wins_when_it_costs_less():
    carry = {
        "roles": ["target", "container"],
        "effects": ["in(target, container)"],
        "tools": ["hand.Open"],
        "cost": 2.0,
    }
    assert plan(library(carry=carry)) == [("carry", "milk", "basket")]
    assert len(plan(library(carry={**carry, "cost": 9.0}))) == 4


def test_a_value_no_fact_mentions_is_produced_for_its_type():
    scan = {"roles": ["name"], "outputs": {"<name>_cloud": "PointCloud[world]"}, "literals": {"object_name": "string"}}
    seize = {**SPINE["seize"], "inputs": {"target_obb": OBB, "target_cloud": "PointCloud[world]"}}
    found = plan(library(scan={**scan, "tools": ["camera.Wide"]}, seize=seize))
    assert ("scan", "milk") in found
    assert found.index(("scan", "milk")) < found.index(("seize", "milk"))


def test_a_producer_in_another_frame_does_not_count():
    wrong = {**SPINE["look"], "outputs": {"<name>_obb": "OrientedBoundingBox[camera]", "<name>_mask": "Mask"}}
    with pytest.raises(InstructionError, match=r"obb of (milk|basket) \(OrientedBoundingBox\[world\]\)"):
        plan(library(look=wrong))


def test_an_optional_input_needs_no_producer():
    seize = {**SPINE["seize"], "inputs": {"target_obb": OBB, "target_cloud": "PointCloud[world]?"}}
    assert len(plan(library(seize=seize))) == 4


def test_a_need_of_a_need_is_followed():
    seize = {**SPINE["seize"], "needs": [*SPINE["seize"]["needs"], "uncovered(target)"]}
    uncover = {
        "roles": ["target"],
        "effects": ["uncovered(target)"],
        "needs": ["located(target)"],
        "tools": ["hand.Open"],
    }
    found = plan(library(seize=seize, uncover=uncover))
    assert found.index(("look", "milk")) < found.index(("uncover", "milk")) < found.index(("seize", "milk"))


def test_a_step_never_ends_what_a_later_one_needs():
    seize = {**SPINE["seize"], "effects": [*SPINE["seize"]["effects"], "-lamp_on"]}
    drop = {**SPINE["drop-in"], "needs": [*SPINE["drop-in"]["needs"], "lamp_on"]}
    lamp = {"effects": ["lamp_on"], "tools": ["hand.Open"]}
    found = plan(library(seize=seize, drop_in=drop, lamp=lamp), state=State(IDLE.facts | {Fact("lamp_on")}))
    assert found.index(("seize", "milk")) < found.index(("lamp",))


def test_what_must_be_kept_is_kept():
    dirty = {**SPINE["seize"], "effects": [*SPINE["seize"]["effects"], "-in(target, target)"], "cost": 0.1}
    keep = frozenset({Fact("in", ("milk", "milk"))})
    assert ("dirty", "milk") in plan(library(dirty=dirty))
    assert ("seize", "milk") in plan(library(dirty=dirty), keep=keep)


def test_a_role_the_goal_does_not_bind_ranges_over_the_objects():
    drop = {
        **SPINE["drop-in"],
        "roles": ["target", "container", "spoon"],
        "needs": [*SPINE["drop-in"]["needs"], "clean(spoon)"],
    }
    state = State(IDLE.facts | {Fact("clean", ("ladle",))})
    assert plan(library(drop_in=drop), state=state, objects=[*OBJECTS, "ladle"])[-1] == (
        "drop-in",
        "milk",
        "basket",
        "ladle",
    )


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"look": None}, "located"),
        ({"seize": None}, r"holding\(milk\)"),
        ({"drop_in": None}, r"in\(milk, basket\)"),
        ({"seize": {**SPINE["seize"], "tools": ["hand.Close", "hand.Twist"]}}, "no plugin serves its tool hand.Twist"),
        ({"look": {**SPINE["look"], "literals": {"prompt": "string"}}}, "nothing in an instruction fills its prompt"),
        ({"seize": {**SPINE["seize"], "outputs": {}}}, "ee_pose_at_grasp of milk"),
        ({"seize": {**SPINE["seize"], "needs": ["holding(target)"]}}, r"holding\(milk\)"),
    ],
)
def test_what_is_missing_is_named(change, says):
    with pytest.raises(InstructionError, match=says):
        plan(library(**change))


def test_the_same_library_in_another_order_gives_the_same_plan():
    twins = {"clamp": SPINE["seize"], "grip": SPINE["seize"], "peek": SPINE["look"]}
    assert plan(library(**twins)) == plan(library(**dict(reversed(twins.items()))))


def test_values_go_stale_with_the_fact_they_were_established_with():
    steps = regress(IN, IDLE, OperatorLibrary.of(library(), tools()), OBJECTS)
    after = IDLE.after(steps)
    assert IN in after.facts
    assert {v.name for v in after.values} == set()  # the basket may have been pushed, the milk is inside
    assert POSE in {str(port.type) for step in steps for port in step.outputs}
