from types import SimpleNamespace

import pytest

from gap_cli.rehearse.judge import SETTLE_LIMIT_S, Conditions, judge, make_conditions, settle
from gap_runtime.errors import DocumentError

TASK = SimpleNamespace(success={"near": 'w.body("{target}").x < 1', "in": '"{container}" == "bin"'}, path=None)


class Body:
    """A body that rests from `since` on and is let go from `until` on."""

    def __init__(self, world, since=0.0, until=0.0):
        self.cell, self.since, self.until = world, since, until
        self.x = 0.0

    def is_settled(self):
        return self.cell.time >= self.since - 1e-9

    def is_released(self):
        return self.cell.time >= self.until - 1e-9


class Cell:
    def __init__(self, **times):
        self.time = 0.0
        self._body = Body(self, **times)

    def snapshot(self):
        return SimpleNamespace(body=lambda name: self._body)

    def wait(self, seconds):
        self.time += seconds


def test_slots_are_filled_from_the_goal():
    conditions = make_conditions(TASK, [{"target": "can", "container": "bin"}])
    assert conditions.expressions == {"near": 'w.body("can").x < 1', "in": '"bin" == "bin"'}
    assert conditions.objects == ("can", "bin")


def test_two_goals_are_judged_each():
    conditions = make_conditions(TASK, [{"target": "a", "container": "bin"}, {"target": "b", "container": "bin"}])
    assert list(conditions.expressions) == ["near.a", "in.a", "near.b", "in.b"]
    assert conditions.objects == ("a", "bin", "b")


def test_a_slot_no_goal_fills_is_named():
    task = SimpleNamespace(success={"x": 'w.body("{door}").x'}, path=__import__("pathlib").Path("t"))
    with pytest.raises(DocumentError, match=r"success\.x.*\{door\}"):
        make_conditions(task, [{"target": "can"}])


def test_what_rests_already_costs_hardly_any_time():
    world = Cell()
    assert settle(world, ["can"])
    assert world.time < 0.3


@pytest.mark.parametrize("late", [{"since": 1.0}, {"until": 1.0}])
def test_judging_waits_for_rest_and_for_release(late):
    world = Cell(**late)
    assert settle(world, ["can"])
    assert 1.0 <= world.time < 1.3


@pytest.mark.parametrize("late", [{"since": 60.0}, {"until": 60.0}])
def test_what_never_rests_or_is_never_let_go_is_no_success(late):
    world = Cell(**late)
    verdict = judge(world, Conditions({}, ("can",)))
    assert not verdict.at_rest and not verdict.success
    assert world.time <= SETTLE_LIMIT_S + 0.2
