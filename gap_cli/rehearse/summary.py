"""summary.json: what N episodes say about a graph. A function of the rows and the graph alone, never of the clock."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from gap_cli.rehearse.rows import VOID
from gap_cli.rehearse.stats import Rate, spread, wilson

SCHEMA = "gap/summary/v1"
Row = Mapping[str, Any]


def summarize(rows: Sequence[Row], graph: Mapping[str, Any], *, seed: int, asked: int) -> dict[str, Any]:
    """The summary of episodes `seed` .. `seed + asked - 1`, of which `rows` were finished.

    `graph` describes what was rolled out (see `describe_graph`): its `subgraphs` in order, and what it was run with.
    """
    won = [r for r in rows if r["success"]]
    return {
        "schema": SCHEMA,
        **{k: v for k, v in graph.items() if k != "subgraphs"},
        "seed": seed,
        "asked": asked,
        "episodes": len(rows),
        "partial": len(rows) < asked,
        "success": rate_dict(wilson(len(won), len(rows))),
        "void": {status: n for status in VOID if (n := sum(r["status"] == status for r in rows))},
        "disagreements": disagreements(rows),
        "motion_s": spread(r["motion_s"] for r in won),
        "subgraphs": [subgraph_summary(about, rows) for about in graph["subgraphs"]],
        "failures": failures(rows),
    }


def rate_dict(rate: Rate) -> dict[str, Any]:
    """A rate with its count and interval, as the files hold it."""
    return {"passed": rate.passed, "of": rate.total, "rate": rate.value, "wilson95": [rate.low, rate.high]}


def rate_of(summary: Mapping[str, Any]) -> Rate:
    """The success rate of a summary."""
    return wilson(summary["success"]["passed"], summary["success"]["of"])


def disagreements(rows: Sequence[Row]) -> dict[str, list[int]]:
    """Seeds on which the graph and the judge disagree: success claimed falsely, or a finished job given up."""
    return {
        "claimed_but_not": [r["seed"] for r in rows if r.get("claimed") and not r["success"]],
        "done_but_not_claimed": [r["seed"] for r in rows if r.get("judged_success") and not r.get("claimed")],
    }


def subgraph_summary(about: Mapping[str, Any], rows: Sequence[Row]) -> dict[str, Any]:
    """How often one subgraph was reached, how it ended, and how often it kept its promises: over all episodes, or where
    an episode can succeed without it, over those that reached it."""
    visits = [last_visit(r, about["node"]) for r in rows]
    reached = [v for v in visits if v is not None]
    checkpoints: dict[str, list[int]] = {}
    for visit in reached:
        for name, point in visit["checkpoints"].items():
            tally = checkpoints.setdefault(name, [0, 0])
            tally[0] += bool(point["passed"])
            tally[1] += 1
    passed = sum(bool(v["passed"]) for v in reached)
    spared = any(v is None and r["success"] for v, r in zip(visits, rows, strict=True))
    return {
        **about,
        "reached": len(reached),
        "validation": rate_dict(wilson(passed, len(reached) if spared else len(rows))),
        "exits": dict(sorted(Counter(v["exit"] for v in reached).items())),
        "checkpoints": {name: {"passed": n, "of": total} for name, (n, total) in checkpoints.items()},
    }


def last_visit(row: Row, node: str) -> dict[str, Any] | None:
    """The last time an episode went through a subgraph; None where it never did."""
    found = [v for v in row.get("subgraphs", ()) if v["node"] == node]
    return found[-1] if found else None


def failures(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Failed episodes grouped by where and how they failed, the most frequent first."""
    groups: dict[tuple[str, str, str], list[Row]] = {}
    for row in rows:
        if not row["success"]:
            key = (row.get("stage") or "", row.get("cause") or row["status"], row["status"])
            groups.setdefault(key, []).append(row)
    ordered = sorted(groups.items(), key=lambda item: (-len(item[1]), item[0]))
    return [
        {"stage": stage, "cause": cause, "status": status, "count": len(group), "seeds": [r["seed"] for r in group],
         "reason": group[0]["reason"]}
        for (stage, cause, status), group in ordered
    ]  # fmt: skip
