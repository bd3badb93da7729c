"""Leases: granted whole or refused at once."""

from __future__ import annotations

import pytest

from gap_runtime.contracts.failures import ToolError
from gap_runtime.run.leases import Leases


class Node:
    def __init__(self, path):
        self.path = path


A, B = Node("a"), Node("b")


def test_a_second_holder_is_refused_and_told_who_holds_it():
    leases = Leases()
    leases.claim(A, ["arm:0"], moves=True)
    with pytest.raises(ToolError, match="b wants arm:0, which a holds"):
        leases.claim(B, ["arm:0"], moves=True)


def test_a_refused_claim_takes_nothing():
    leases = Leases()
    leases.claim(A, ["gripper:0"], moves=True)
    with pytest.raises(ToolError):
        leases.claim(B, ["arm:0", "gripper:0"], moves=True)
    assert leases.held() == ("gripper:0", "clock") and not leases.holds(B, "clock")


def test_claims_in_opposite_orders_never_wait_for_each_other():
    leases = Leases()
    leases.claim(A, ["arm:0"], moves=True)
    leases.claim(B, ["camera"], moves=True)
    for who, wanted in ((A, "camera"), (B, "arm:0")):
        with pytest.raises(ToolError) as caught:
            leases.claim(who, [wanted], moves=True)
        assert caught.value.code == "lease"


def test_one_holder_may_claim_again_and_more():
    leases = Leases()
    leases.claim(A, ["arm:0"], moves=True)
    leases.claim(A, ["arm:0", "gripper:0"], moves=True)
    assert leases.holds(A, "arm:0") and leases.holds(A, "gripper:0")


def test_all_that_move_share_the_clock_and_those_that_look_do_not_hold_it():
    leases = Leases()
    leases.claim(A, ["arm:0", "clock"], moves=True)
    leases.claim(B, ["arm:1", "clock"], moves=True)
    assert leases.holds(A, "clock") and leases.holds(B, "clock")
    leases.release(A)
    leases.claim(A, [], moves=False)
    assert leases.holds(B, "clock") and not leases.holds(A, "clock")


def test_the_arms_of_a_holder_are_those_whose_arm_or_gripper_it_holds():
    leases = Leases()
    leases.claim(A, ["arm:0", "gripper:2", "camera"], moves=True)
    assert leases.arms_of(A) == {0, 2} and leases.arms_of(B) == set()


def test_release_gives_everything_back():
    leases = Leases()
    leases.claim(A, ["arm:0", "gripper:0"], moves=True)
    leases.release(A)
    assert leases.held() == ()
    leases.claim(B, ["arm:0"], moves=True)
