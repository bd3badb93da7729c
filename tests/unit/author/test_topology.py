"""The topology of a graph: what runs side by side, what follows a failure, loops, and names that never clash."""

from __future__ import annotations

import pytest

from gap_cli.analysis.catalog import contract_names
from gap_cli.author.naming import name_uses
from gap_cli.author.operators import OperatorLibrary
from gap_cli.author.topology import Topology
from gap_cli.skills.facts import Fact
from gap_runtime.contracts.task.goals import EACH, ForEach, Group, Predicate
from tests.unit.author.contract_library import OBB, POSE, SPINE, library, tools

SOLID = frozenset(Fact("solid", (name,)) for name in ("milk", "ketchup", "butter"))


def put(target, container="basket"):
    return Predicate(predicate="in", roles={"target": target, "container": container})


def uses_for(lib, *goals):
    goals = [put(*g) if isinstance(g, tuple) else g for g in goals]
    return Topology(OperatorLibrary.of(lib, tools()), SOLID).build(Group(goals=goals))


def layered(lib, *goals):
    """What is used on the way on which nothing fails, by layer."""
    found = {}
    for use in uses_for(lib, *goals):
        if use.layer is not None:
            found.setdefault(use.layer, []).append(f"{use.step.skill} {use.step.binding[0][1]}")
    return [sorted(layer) for layer in found.values()]


def test_looks_run_side_by_side_and_first():
    assert layered(library(), ("milk", "basket")) == [["look basket", "look milk"], ["seize milk"], ["drop-in milk"]]


def test_a_look_that_needs_the_hand_waits_for_it():
    wave = {"effects": ["lit"], "tools": ["hand.Open"]}
    found = layered(
        library(look={**SPINE["look"], "needs": ["lit"]}, wave={**wave, "roles": ["target"]}), ("milk", "basket")
    )
    assert found[0][0].startswith("wave")
    assert found[1] == ["look basket", "look milk"]


def test_a_look_that_reads_another_look_follows_it():
    zoom = {
        **SPINE["look"],
        "inputs": {"name_obb": OBB},
        "outputs": {"<name>_fine": OBB},
        "effects": [],
        "tools": ["camera.Wide"],
    }
    seize = {**SPINE["seize"], "inputs": {"target_fine": OBB}}
    found = layered(library(zoom=zoom, seize=seize), ("milk", "basket"))
    assert found[:2] == [["look basket", "look milk"], ["zoom milk"]]


def test_a_container_that_may_have_moved_is_looked_at_again():
    found = layered(library(), ("milk", "basket"), ("ketchup", "basket"))
    assert found[3] == ["look basket", "look ketchup"]


def test_a_container_that_stays_put_is_looked_at_once():
    still = {**SPINE["drop-in"], "effects": [e for e in SPINE["drop-in"]["effects"] if "located" not in e]}
    found = layered(library(drop_in=still), ("milk", "basket"), ("ketchup", "basket"))
    assert sum("look basket" in layer for layer in found) == 1


def test_two_goals_never_produce_one_name_twice():
    lib = library()
    named = name_uses(uses_for(lib, ("milk", "basket"), ("ketchup", "basket"), ("butter", "tray")), lib.contracts)
    produced = [name for n in named for name in n.outputs.values()]
    assert len(produced) == len(set(produced))
    assert len({n.segment for n in named}) == len(named)


def test_inputs_are_outputs_of_earlier_steps_as_names_spell_them():
    lib = library()
    uses = uses_for(lib, ("milk", "basket"), ("ketchup", "basket"))
    produced: set[str] = set()
    for use, named in zip(uses, name_uses(uses, lib.contracts), strict=True):
        inputs, outputs = contract_names(lib.contracts[use.step.skill], named.names)
        assert list(inputs) == list(named.inputs.values())
        assert set(outputs) == set(named.outputs.values())
        assert set(inputs) <= produced
        produced |= set(outputs)


def test_one_goal_keeps_the_names_of_the_contracts():
    lib = library()
    named = name_uses(uses_for(lib, ("milk", "basket")), lib.contracts)
    by_segment = {n.segment: n for n in named}
    assert by_segment["perceive_milk"].names == {"name": "target"}
    assert by_segment["perceive_basket"].names == {"name": "container"}
    assert by_segment["grasp_milk"].names == by_segment["place_milk"].names == {}


def test_a_value_nobody_reads_is_called_after_its_object():
    lib = library(drop_in={**SPINE["drop-in"], "inputs": {}})
    named = name_uses(uses_for(lib, ("milk", "basket")), lib.contracts)
    assert {n.segment: n.names for n in named}["perceive_basket"] == {"name": "basket"}


SEIZE = {**SPINE["seize"], "swaps": ["clamp", "scoop", "strange"]}
RETREAT = {
    "roles": ["target"],
    "inputs": {"target_obb": f"{OBB}?", "failed_before": "Vec3[]?"},
    "outputs": {"failed_at": "Vec3[]"},
    "needs": ["in_doubt(target)"],
    "effects": ["hand_empty", "view_clear", "-in_doubt(target)"],
    "tools": ["hand.Open"],
}
LOOK = {**SPINE["look"], "needs": ["view_clear"]}
OTHERS = {
    "look": LOOK,
    "seize": SEIZE,
    "clamp": {**SPINE["seize"], "cost": 3.0},
    "scoop": {**SPINE["seize"], "cost": 2.0, "inputs": {"target_obb": OBB, "target_mask": "Mask"}},
    "strange": {**SPINE["seize"], "inputs": {"target_obb": OBB, "target_hum": "float"}, "cost": 9.0},
    "retreat": RETREAT,
}


def way(uses, start, exit_):
    """Skills from an exit of a use along success, with what their failures lead to."""
    names = [u.step.skill for u in uses]
    found, todo = [], list(uses[start].after[exit_])
    while todo and todo[0] != "done":
        use = uses[todo[0]]
        found += [" ".join(sorted({names[i] for i in todo}))]
        todo = use.after["done"]
    return found


def test_a_failed_step_leads_to_an_empty_hand_another_look_and_a_swap():
    uses = uses_for(library(**OTHERS), ("milk", "basket"))
    seize, drop = (next(i for i, u in enumerate(uses) if u.step.skill == skill) for skill in ("seize", "drop-in"))
    for failing in (seize, drop):
        assert way(uses, failing, "failed") == ["retreat", "look", "clamp", "drop-in"]
    assert way(uses, seize, "done") == ["drop-in"]


def test_swaps_are_tried_in_their_order_and_the_skill_itself_last():
    uses = uses_for(library(**OTHERS), ("milk", "basket"))
    tried = next(u for u in uses if u.step.skill == "clamp")
    found = [tried.step.skill]
    while tried.after["failed"] != ["abort"]:
        tried = uses[tried.after["failed"][0]]
        found.append(tried.step.skill)
    assert found == ["clamp", "scoop", "seize"]  # nothing gives the strange one its hum


def test_swaps_give_their_values_the_same_names_and_nothing_else_shares_one():
    lib = library(**OTHERS)
    uses = uses_for(lib, ("milk", "basket"), ("ketchup", "basket"))
    named = name_uses(uses, lib.contracts)
    by_name = {}
    for use, given in zip(uses, named, strict=True):
        for name in given.outputs.values():
            by_name.setdefault(name, []).append(use)
    shared = [users for users in by_name.values() if len(users) > 1]
    assert shared and all(u.twin is not None or u.step.skill == "clamp" for users in shared for u in users)


def test_what_follows_is_looked_at_anew_where_a_try_may_have_failed():
    uses = uses_for(library(**OTHERS), ("milk", "basket"), ("ketchup", "basket"))
    ends = [u for u in uses if u.step.skill == "drop-in" and u.step.roles["target"] == "milk"]
    after = {tuple(u.after["done"]) for u in ends}
    assert len(ends) == 2 and len(after) == 1
    assert {uses[i].step.skill for i in after.pop()} == {"look"}


@pytest.mark.parametrize("missing", ["retreat", "clamp"])
def test_without_another_way_a_failure_is_the_end(missing):
    others = {**OTHERS, missing: None} | ({"scoop": None} if missing == "clamp" else {})
    uses = uses_for(library(**others), ("milk", "basket"))
    assert {tuple(u.after["failed"]) for u in uses} == {("abort",)}


def test_facts_about_things_choose_among_skills():
    picky = {**SPINE["seize"], "needs": [*SPINE["seize"]["needs"], "solid(target)"], "cost": 0.1}
    lib = library(picky=picky)
    assert "picky milk" in layered(lib, ("milk", "basket"))[1]
    assert "seize melon" in layered(lib, ("melon", "basket"))[1]
    reason = next(u.why for u in uses_for(lib, ("melon", "basket")) if u.step.skill == "seize")
    assert "picky needs solid(melon)" in reason


NEXT = {
    "stage": "perceive",
    "roles": ["name", "container"],
    "inputs": {"failed_at": "Vec3[]?"},
    "outputs": {"<name>_obb": OBB, "container_obb": OBB, "container_mask": "Mask", "failed_before": "Vec3[]"},
    "literals": {"object_names": "string[]"},
    "exits": {"success": {"found": "one", "none_left": "all done"}, "failure": "failed", "exhausted": "none_left"},
    "needs": ["hand_empty"],
    "effects": ["located(name)", "located(container)"],
    "tools": ["camera.See"],
}
ALL = ForEach(each=["milk", "ketchup", "butter"], goal=put(EACH))


def test_a_goal_for_each_of_several_is_a_loop():
    uses = uses_for(library(**OTHERS, next=NEXT), ALL)
    assert [u.step.skill for u in uses] == ["next", "seize", "drop-in", "retreat"]
    head, seize, drop, retreat = uses
    assert head.after == {"found": [1], "none_left": ["done"], "failed": ["abort"]}
    assert head.max_visits > 2 * len(ALL.each)
    assert (seize.after, drop.after) == ({"done": [2], "failed": [3]}, {"done": [0], "failed": [3]})
    assert retreat.after == {"done": [0], "failed": ["abort"]}


def test_a_loop_carries_its_failures_round():
    lib = library(**OTHERS, next=NEXT)
    head, _, _, retreat = name_uses(uses_for(lib, ALL), lib.contracts)
    assert head.inputs["failed_at"] == retreat.outputs["failed_at"]
    assert retreat.inputs["failed_before"] == head.outputs["failed_before"]


def test_what_follows_a_loop_starts_with_one_look():
    uses = uses_for(library(**OTHERS, next=NEXT), ALL, ("jam", "tray"))
    after = uses[0].after["none_left"]
    assert len(after) == 1 and uses[after[0]].step.skill == "look"


@pytest.mark.parametrize(
    ("goal", "skills"),
    [
        (ForEach(each=["milk"], goal=put(EACH)), {"look", "seize", "drop-in"}),
        (ForEach(each=["milk", "butter"], count=1, goal=put(EACH)), {"look", "seize", "drop-in"}),
    ],
)
def test_what_needs_no_loop_gets_none(goal, skills):
    uses = uses_for(library(next=NEXT, retreat=RETREAT), goal)
    assert {u.step.skill for u in uses} == skills


def test_without_a_head_for_a_loop_every_object_gets_its_own_segments():
    uses = uses_for(library(), ALL)
    assert [u.step.roles["target"] for u in uses if u.step.skill == "drop-in"] == ALL.each
    assert POSE in {str(port.type) for u in uses for port in u.step.outputs}
