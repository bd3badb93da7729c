"""Goals as data: expanded, read back, and compared."""

from __future__ import annotations

import pytest

from gap_runtime.contracts.task.goals import EACH, ForEach, Goals, Group, Predicate, same_goals
from gap_runtime.errors import DocumentError


def inside(target, container="basket"):
    return Predicate(predicate="in", roles={"target": target, "container": container})


MILK, HAM, JAM = inside("milk"), inside("ham"), inside("jam")
ALL = ForEach(each=["milk", "ham"], goal=inside(EACH))


def test_a_goal_for_each_is_one_for_every_object():
    assert [p.fact for p in Group(goals=[ALL, JAM]).predicates()] == ["in(milk, basket)", "in(ham, basket)", JAM.fact]


def test_of_some_as_many_are_taken_as_are_asked_for():
    some = ForEach(each=["milk", "ham"], count=1, goal=inside(EACH))
    assert [p.fact for p in Group(goals=[some]).predicates()] == [MILK.fact]


def test_a_document_is_read_back_as_it_was_written():
    goals = Goals(scene="kitchen", order="sequence", goals=[Group(goals=[MILK, HAM]), ALL, JAM])
    assert Goals.load(goals.data, "goals.json") == goals
    assert list(goals.data)[:3] == ["schema", "scene", "order"]


@pytest.mark.parametrize(
    ("one", "other", "same"),
    [
        ([MILK, HAM], [HAM, MILK], True),
        ([MILK, HAM], [ALL], True),
        ([MILK, Group(goals=[HAM, JAM])], [JAM, HAM, MILK], True),
        ([MILK], [HAM], False),
        ([MILK, HAM], [MILK], False),
        ([ForEach(each=["milk", "ham"], count=1, goal=inside(EACH))], [MILK], False),
        ([Group(order="sequence", goals=[MILK, HAM])], [Group(order="sequence", goals=[HAM, MILK])], False),
        ([Group(order="sequence", goals=[MILK, HAM])], [MILK, HAM], False),
        ([Group(order="sequence", goals=[MILK])], [MILK], True),
    ],
)
def test_goals_are_the_same_when_they_ask_for_the_same(one, other, same):
    assert same_goals(Group(goals=one), Group(goals=other)) is same


@pytest.mark.parametrize("change", [{"goals": []}, {"order": "someday"}, {"schema": "gap/goals/v9"}, {"mood": "good"}])
def test_what_is_no_goals_document_is_refused(change):
    with pytest.raises(DocumentError, match=next(iter(change))):
        Goals.load({**Goals(scene="kitchen", goals=[MILK]).data, **change}, "goals.json")
