"""Layers and names of a plan: what runs side by side, and that no name is produced twice."""

from __future__ import annotations

from itertools import chain

from gap_cli.analysis.catalog import contract_names
from gap_cli.author.goals import Goal
from gap_cli.author.naming import name_steps
from gap_cli.author.solve import solve
from gap_cli.author.steps import Repertoire
from tests.unit.author.contract_library import OBB, SPINE, library, tools


def solved(lib, *goals):
    """The layers of all goals, one after the other."""
    return list(chain.from_iterable(solve([Goal(*goal) for goal in goals], Repertoire.of(lib, tools()))))


def steps_for(lib, *goals):
    return [step for layer in solved(lib, *goals) for step in layer]


def layered(lib, *goals):
    return [sorted(f"{step.skill} {step.binding[0][1]}" for step in layer) for layer in solved(lib, *goals)]


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
    steps = steps_for(lib, ("milk", "basket"), ("ketchup", "basket"), ("butter", "tray"))
    named = name_steps(steps, lib.contracts)
    produced = [name for n in named for name in n.outputs.values()]
    assert len(produced) == len(set(produced))
    assert len({n.segment for n in named}) == len(named)


def test_inputs_are_outputs_of_earlier_steps_as_names_spell_them():
    lib = library()
    steps = steps_for(lib, ("milk", "basket"), ("ketchup", "basket"))
    produced: set[str] = set()
    for step, named in zip(steps, name_steps(steps, lib.contracts), strict=True):
        inputs, outputs = contract_names(lib.contracts[step.skill], named.names)
        assert list(inputs) == list(named.inputs.values())
        assert set(outputs) == set(named.outputs.values())
        assert set(inputs) <= produced
        produced |= set(outputs)


def test_one_goal_keeps_the_names_of_the_contracts():
    lib = library()
    named = name_steps(steps_for(lib, ("milk", "basket")), lib.contracts)
    by_segment = {n.segment: n for n in named}
    assert by_segment["perceive_milk"].names == {"name": "target"}
    assert by_segment["perceive_basket"].names == {"name": "container"}
    assert by_segment["grasp_milk"].names == by_segment["place_milk"].names == {}


def test_a_value_nobody_reads_is_called_after_its_object():
    lib = library(drop_in={**SPINE["drop-in"], "inputs": {}})
    named = name_steps(steps_for(lib, ("milk", "basket")), lib.contracts)
    assert {n.segment: n.names for n in named}["perceive_basket"] == {"name": "basket"}
