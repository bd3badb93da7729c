"""The perception skills' canonical subgraphs in physics, judged by the truth afterwards."""

from __future__ import annotations

import numpy as np
import pytest

from tests.sim.skills_perception.cell import inside, miss, perceive

pytestmark = pytest.mark.sim
SKILLS = ["perception-single", "perception-multi", "perception-any"]
CLOSE = 0.010  # m
every_skill = pytest.mark.parametrize("skill", SKILLS)


@pytest.fixture
def groceries(kitchen):
    return kitchen.cell(
        "groceries", alphabet_soup=(-0.12, -0.2, 0), milk=(0.1, -0.15, 30), butter=(-0.15, 0.05, 70), basket=(0, 0.26)
    )


@every_skill
@pytest.mark.parametrize(("name", "text"), [("alphabet_soup", "alphabet soup"), ("butter", "stick of butter")])
def test_a_named_object_is_found_where_it_is(kitchen, groceries, skill, name, text):
    ran = kitchen.run(groceries, perceive(skill, name, text))
    assert ran.exits == {"see_target": "found"}, ran.result.error
    truth = groceries.snapshot().bodies[name]
    assert miss(ran.outputs["target_obb"], truth) < CLOSE
    assert inside(ran.outputs["target_cloud"].points, truth) > 0.95
    assert ran.outputs["target_mask"].data.any()


@every_skill
def test_target_and_container_are_perceived_side_by_side(kitchen, groceries, skill):
    ran = kitchen.run(groceries, perceive(skill, "milk", "milk"), perceive(skill, "basket", "basket", slot="container"))
    assert ran.exits == {"see_target": "found", "see_container": "found"}, ran.result.error
    truth = groceries.snapshot().bodies
    assert miss(ran.outputs["target_obb"], truth["milk"]) < CLOSE
    assert miss(ran.outputs["container_obb"], truth["basket"]) < CLOSE


@every_skill
@pytest.mark.parametrize("text", ["bbq sauce", "unicorn"])
def test_what_is_not_there_leaves_by_not_found(kitchen, groceries, skill, text):
    ran = kitchen.run(groceries, perceive(skill, "bbq_sauce", text))
    assert ran.exits == {"see_target": "not_found"} and ran.result.status == "failure"
    assert text in ran.result.error


@every_skill
def test_nothing_is_made_of_an_empty_floor(kitchen, skill):
    ran = kitchen.run(kitchen.cell("groceries"), perceive(skill, "milk", "milk"))
    assert ran.exits == {"see_target": "not_found"}


def test_any_takes_one_whole_object_of_a_kind_until_none_is_left(kitchen, groceries):
    ran = kitchen.run(groceries, perceive("perception-any", "milk", "grocery"))
    bodies = groceries.snapshot().bodies
    assert min(miss(ran.outputs["target_obb"], bodies[n]) for n in ("alphabet_soup", "milk", "butter")) < CLOSE
    only_the_basket = kitchen.cell("groceries", basket=(0, 0.26))
    assert kitchen.run(only_the_basket, perceive("perception-any", "milk", "grocery")).exits == {
        "see_target": "not_found"
    }


@every_skill
def test_of_two_look_alikes_one_is_taken_and_never_a_mixture(kitchen, skill):
    world = kitchen.cell("twins", twin_a=(-0.1, -0.15, 0), twin_b=(0.0, -0.05, 0), milk=(-0.15, 0.15, 0))
    ran = kitchen.run(world, perceive(skill, "twin_a", "tin"))
    bodies = world.snapshot().bodies
    assert ran.exits == {"see_target": "found"}, ran.result.error
    nearest = min(("twin_a", "twin_b"), key=lambda n: miss(ran.outputs["target_obb"], bodies[n]))
    assert miss(ran.outputs["target_obb"], bodies[nearest]) < CLOSE
    assert inside(ran.outputs["target_cloud"].points, bodies[nearest]) > 0.95


@every_skill
@pytest.mark.parametrize(
    ("text", "name"), [("tin next to the milk", "twin_b"), ("tin farthest from the milk", "twin_a")]
)
def test_words_tell_look_alikes_apart(kitchen, skill, text, name):
    world = kitchen.cell("twins", twin_a=(-0.1, -0.25, 0), twin_b=(0.0, 0.10, 0), milk=(-0.08, 0.16, 0))
    ran = kitchen.run(world, perceive(skill, name, text))
    assert ran.exits == {"see_target": "found"}, ran.result.error
    assert miss(ran.outputs["target_obb"], world.snapshot().bodies[name]) < CLOSE


def test_the_same_frames_give_the_same_bytes(kitchen, groceries):
    runs = [kitchen.run(groceries, perceive("perception-multi", "milk", "milk")).outputs for _ in range(2)]
    for name in runs[0]:
        assert runs[0][name] == runs[1][name]
    assert np.isfinite(runs[0]["target_obb"].corners).all()
