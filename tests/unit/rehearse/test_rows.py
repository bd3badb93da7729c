"""Who is blamed for a failed episode."""

from types import SimpleNamespace

import pytest

from gap_cli.rehearse.judge import Verdict
from gap_cli.rehearse.rows import attribute_failure

GOOD = Verdict({"contained": True}, True)


def visit(node, end="done", ok=True, kept=True):
    points = {"held": {"passed": kept, "validate": True, "values": {}}}
    return {"node": node, "exit": end, "ok": ok, "passed": ok and kept, "checkpoints": points}


def watch(*visits, nodes=(), failed=()):
    return SimpleNamespace(subgraphs=list(visits), nodes=list(nodes), failed=dict(failed))


def result(status="success", end="done", error="", node=""):
    return SimpleNamespace(status=status, end=end, error=error, failed_node=node)


@pytest.mark.parametrize(
    ("seen", "ended", "verdict", "stage", "cause"),
    [
        pytest.param(
            watch(visit("look"), visit("grasp", "failed", ok=False),
                  nodes=[{"node": "grasp/close", "ok": False, "error": "empty"}], failed={"grasp/close": "slipped"}),
            result("failure", "abort"), GOOD, "grasp", "slipped", id="the node that failed",
        ),
        pytest.param(
            watch(visit("look"), visit("grasp", kept=False), visit("place", "failed", ok=False)),
            result("failure", "abort"), GOOD, "grasp", "held", id="the first broken promise, not its consequence",
        ),
        pytest.param(
            watch(visit("look", "not_found", ok=False)), result("failure", "abort"), GOOD, "look", "not_found",
            id="an exit that no node failed for",
        ),
        pytest.param(
            watch(visit("grasp", "failed", ok=False), visit("grasp"), visit("place", kept=False)),
            result("success"), GOOD, "place", "held", id="what was made good is forgiven",
        ),
        pytest.param(
            watch(visit("look"), visit("place")), result("success"), Verdict({"contained": False}, True),
            "place", "contained", id="the judge's condition",
        ),
        pytest.param(
            watch(visit("place")), result("success"), Verdict({"contained": True}, False), "place", "not_at_rest",
            id="objects that never rest",
        ),
        pytest.param(
            watch(visit("place")), result("failure", "abort"), GOOD, "place", "not_claimed",
            id="a job done and given up",
        ),
        pytest.param(
            watch(visit("look"), visit("place", "failed", ok=False)), result("error", error="time is up"), GOOD,
            "place", "stopped", id="what stopped the run, not the exit it forced",
        ),
        pytest.param(
            watch(visit("look")), result("error", error="time is up", node="place/move"), GOOD, "place", "error",
            id="a run that could not go on",
        ),
    ],
)  # fmt: skip
def test_the_blame_goes_to(seen, ended, verdict, stage, cause):
    found = attribute_failure(ended, seen, verdict)
    assert (found["stage"], found["cause"]) == (stage, cause)
    assert found["reason"]
