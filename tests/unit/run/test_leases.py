"""Leases: granted whole or refused at once."""

from __future__ import annotations

import pytest

from gap_runtime.contracts.failures import ToolError
from gap_runtime.run.leases import Leases


def holder(name):
    return SimpleAttempt(name)


class SimpleAttempt:
    def __init__(self, name):
        self.path = self.id = name


A, B = holder("a"), holder("b")


def test_a_second_holder_is_refused_and_told_who_holds_it():
    leases = Leases()
    leases.claim(A, ["arm:0"], moves=True)
    with pytest.raises(ToolError, match="b wants arm:0, which a holds"):
        leases.claim(B, ["arm:0"], moves=True)


def test_a_refused_claim_takes_nothing():
    leases = Leases()
    leases.claim(A, ["gripper:0"], moves=True)
    leases.yield_clock(A)
    with pytest.raises(ToolError):
        leases.claim(B, ["arm:0", "gripper:0"], moves=True)
    assert leases.held() == ("gripper:0",)


def test_claims_in_opposite_orders_never_wait_for_each_other():
    leases = Leases()
    leases.claim(A, ["arm:0"], moves=True)
    leases.yield_clock(A)
    leases.claim(B, ["camera"], moves=True)
    leases.yield_clock(B)
    for who, wanted in ((A, "camera"), (B, "arm:0")):
        with pytest.raises(ToolError) as caught:
            leases.claim(who, [wanted], moves=True)
        assert caught.value.code == "lease"


def test_one_holder_may_claim_again_and_more():
    leases = Leases()
    leases.claim(A, ["arm:0"], moves=True)
    leases.claim(A, ["arm:0", "gripper:0"], moves=True)
    assert leases.holds(A, "arm:0") and leases.holds(A, "gripper:0")


def test_many_look_at_once_but_nobody_moves_meanwhile():
    leases = Leases()
    leases.claim(A, [], moves=False)
    leases.claim(B, [], moves=False)
    with pytest.raises(ToolError, match="clock"):
        leases.claim(B, ["arm:0"], moves=True)
    leases.release(A)
    leases.claim(B, ["arm:0"], moves=True)


def test_release_gives_everything_back():
    leases = Leases()
    leases.claim(A, ["arm:0", "gripper:0"], moves=True)
    leases.release(A)
    assert leases.held() == ()
    leases.claim(B, ["arm:0"], moves=True)


def test_a_yielded_clock_keeps_the_arm():
    leases = Leases()
    leases.claim(A, ["arm:0"], moves=True)
    leases.yield_clock(A)
    leases.claim(B, ["arm:1"], moves=True)
    assert leases.holds(A, "arm:0")
