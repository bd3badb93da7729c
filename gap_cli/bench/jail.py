"""What the jail costs an inline script: from the call to its result, and one tool call from inside."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

from gap_cli.bench.timing import time_in_turns
from gap_runtime.contracts.bench import BenchContext, BenchReport

CALLS = 200
START_GOAL_MS, CALL_GOAL_US = 25.0, 100.0
SCRIPT = """
def run(ctx, calls: int) -> int:
    for i in range(calls):
        ctx.tool("fake.Nothing")
    return calls
"""


def run(bench: BenchContext) -> BenchReport:
    """Milliseconds per script, microseconds per tool call."""
    from gap_cli.sandbox import ScriptJail

    with tempfile.TemporaryDirectory() as folder, ScriptJail() as jail:
        script = Path(folder) / "script.py"
        script.write_text(SCRIPT, encoding="utf-8")

        def start(calls: int) -> Any:
            return jail.run(script, {"calls": calls}, lambda name, inputs: None, 60.0)

        level = jail.level()
        timings = time_in_turns({"start": lambda: start(0), "calls": lambda: start(CALLS)}, bench)
    began, called = timings["start"], timings["calls"]
    per_call = [1e6 * max(0.0, c - s) / CALLS for c, s in ((called.median, began.median), (called.best, began.best))]
    return BenchReport(
        "An inline script in the jail",
        ("what", "median", "best", "goal"),
        (
            ("start, run and end [ms]", round(1e3 * began.median, 2), round(1e3 * began.best, 2), START_GOAL_MS),
            ("one tool call from inside [us]", round(per_call[0], 1), round(per_call[1], 1), CALL_GOAL_US),
        ),
        (f"The sandbox level here is {level!r}.", f"Per call: a script with {CALLS} calls against one with none."),
    )
