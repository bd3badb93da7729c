"""The goals of the motion benchmark beside what a run reached."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from gap_runtime.contracts.bench import Table

COLUMNS = ("robot", "what", "goal", "reached", "met")
MEDIAN, P95, RESULT = 3, 4, 5  # columns of the benchmark's rows
Row = tuple[Any, ...]


class Bound(NamedTuple):
    """A bound on one column of the rows about `what`."""

    what: str
    column: int
    bound: float
    unit: str
    at_least: bool = False


GOALS = (
    Bound("free space: whole", MEDIAN, 20.0, "ms, median"),
    Bound("free space: whole", P95, 100.0, "ms, p95"),
    Bound("free space: solved", RESULT, 0.99, "solved", at_least=True),
    Bound("grasps: from request to timed motion", MEDIAN, 20.0, "ms, median"),
    Bound("grasps: from request to timed motion", P95, 100.0, "ms, p95"),
    Bound("grasps: solved", RESULT, 0.99, "solved", at_least=True),
    Bound("IK, one pose", MEDIAN, 2.0, "ms, median"),
    Bound("feasibility of 50 grasps", MEDIAN, 60.0, "ms, median"),
    Bound("retiming", MEDIAN, 5.0, "ms, median"),
    Bound("collision check, bare", RESULT, 5.0, "us"),
    Bound("planned: beyond a limit or in collision", RESULT, 0.0, "motions"),
    Bound("executed: in collision", RESULT, 0.0, "motions"),
)


def goals(rows: Sequence[Row]) -> Table:
    """One row per robot and goal; met or not by the numbers of the run."""
    found = []
    for row in rows:
        for goal in GOALS:
            if row[1] == goal.what:
                reached = float(str(row[goal.column]).split()[0])
                met = reached >= goal.bound if goal.at_least else reached <= goal.bound
                sign = ">=" if goal.at_least else "<="
                wanted = f"{sign} {goal.bound:g} {goal.unit}"
                found.append((row[0], goal.what, wanted, f"{reached:g}", "yes" if met else "no"))
    return Table("Goals", COLUMNS, tuple(found))
