import pytest

from gap_cli.rehearse.rows import void_episode
from gap_cli.rehearse.stats import wilson
from gap_cli.rehearse.summary import rate_of, summarize


def row(seed, success=True, stage="", cause="", passed=(True, True), **more):
    visits = [
        {"node": node, "exit": "done" if ok else "failed", "ok": ok, "passed": ok, "motion_s": 1.0,
         "checkpoints": {"held": {"passed": ok, "validate": True, "values": {"z": 0.1}}}}
        for node, ok in zip(("look", "grasp"), passed, strict=False)
    ]  # fmt: skip
    base = {"seed": seed, "status": "success" if success else "failure", "success": success, "void": False,
            "stage": stage, "cause": cause, "reason": cause, "claimed": success, "judged_success": success,
            "motion_s": 10.0 + seed, "subgraphs": visits, "nodes": []}  # fmt: skip
    return {**base, **more}


GRAPH = {
    "task": "t",
    "subgraphs": [{"node": "look", "ref": "l", "skill": "s"}, {"node": "grasp", "ref": "g", "skill": "s"}],
}
FAILED = {"success": False, "stage": "grasp", "cause": "held", "passed": (True, False)}
ROWS = [row(0), row(1, **FAILED), row(2), row(3, False, "look", "not_found", (False,)), row(4, **FAILED)]


@pytest.fixture
def summary():
    return summarize(ROWS, GRAPH, seed=0, asked=5)


def test_the_rate_and_its_interval_are_of_all_episodes(summary):
    assert rate_of(summary) == wilson(2, 5)
    assert summary["success"]["wilson95"] == [wilson(2, 5).low, wilson(2, 5).high]


def test_a_subgraph_never_reached_has_not_passed(summary):
    look, grasp = summary["subgraphs"]
    assert (look["validation"]["passed"], look["validation"]["of"], look["reached"]) == (4, 5, 5)
    assert (grasp["validation"]["passed"], grasp["validation"]["of"], grasp["reached"]) == (2, 5, 4)
    assert grasp["exits"] == {"done": 2, "failed": 2}
    assert grasp["checkpoints"]["held"] == {"passed": 2, "of": 4}


def test_a_subgraph_that_success_does_not_need_is_judged_where_it_was_reached():
    rows = [row(0, passed=(True,)), row(1), row(2, **FAILED)]
    _, again = summarize(rows, GRAPH, seed=0, asked=3)["subgraphs"]
    assert (again["validation"]["passed"], again["validation"]["of"]) == (1, 2)


def test_failures_are_grouped_the_most_frequent_first(summary):
    assert [(f["stage"], f["cause"], f["count"], f["seeds"]) for f in summary["failures"]] == [
        ("grasp", "held", 2, [1, 4]),
        ("look", "not_found", 1, [3]),
    ]


def test_the_order_of_rows_within_a_group_is_that_of_seeds_and_motion_counts_successes_alone(summary):
    assert summary["motion_s"] == {"median": 11.0, "p90": pytest.approx(11.8), "max": 12.0}


def test_a_void_episode_counts_against_the_rate_and_is_named():
    summary = summarize([row(0), void_episode(1, "crashed", "died")], GRAPH, seed=0, asked=2)
    assert (summary["success"]["passed"], summary["success"]["of"]) == (1, 2)
    assert summary["void"] == {"crashed": 1}
    assert summary["failures"][0]["status"] == "crashed"


def test_graph_and_judge_may_disagree_and_that_is_shown():
    lie = row(7, False, claimed=True)
    modest = row(8, False, claimed=False, judged_success=True)
    summary = summarize([lie, modest], GRAPH, seed=7, asked=2)
    assert summary["disagreements"] == {"claimed_but_not": [7], "done_but_not_claimed": [8]}


def test_a_repeated_subgraph_is_judged_by_its_last_visit():
    again = row(0)
    again["subgraphs"] = [{**again["subgraphs"][1], "passed": False}, again["subgraphs"][1]]
    (_, grasp) = summarize([again], GRAPH, seed=0, asked=1)["subgraphs"]
    assert grasp["validation"]["passed"] == 1


def test_missing_episodes_make_it_partial():
    assert summarize(ROWS, GRAPH, seed=0, asked=6)["partial"]
    assert not summarize(ROWS, GRAPH, seed=0, asked=5)["partial"]
