"""What the jail costs: from the order to a script's first tool call, per tool call, and per builder block."""

from __future__ import annotations

import itertools
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from gap_cli.sandbox.builder import builder_server, run_builder
from gap_cli.sandbox.scripts import ScriptJail

BUILDER = "sg = Subgraph('a', skill='b')\nsg.add_exit('done')\n"
SCRIPT = "def run(ctx, calls):\n    for i in range(calls): ctx.tool('bench.Echo', x=1.0, name='soup')\n"


class Row(NamedTuple):
    """One measurement: median, 95th percentile and goal in `unit`, over `samples` repetitions."""

    name: str
    median: float
    p95: float
    goal: float | None
    unit: str
    samples: int


def sandbox_rows(repeats: int = 50, calls: int = 2000) -> list[Row]:
    """Measure on this machine. Servers are started first: a session pays for them once."""
    builder_server().level()
    with tempfile.TemporaryDirectory() as folder, ScriptJail(max_calls=calls + 1) as jail:
        jail.level()
        script = Path(folder) / "bench.py"
        script.write_text(SCRIPT)
        start = [_until_first_call(jail, script) for _ in range(repeats)]
        whole = [_seconds(lambda: jail.run(script, {"calls": 1}, _echo, 60)) for _ in range(repeats)]
        builder = [_seconds(lambda: run_builder(BUILDER)) for _ in range(repeats)]
        rpc = _between_calls(jail, script, calls)
    return [
        _row("jail start to first tool call", start, 1e3, 25.0, "ms"),
        _row("jailed script, one tool call", whole, 1e3, None, "ms"),
        _row("builder block", builder, 1e3, None, "ms"),
        _row("tool call over RPC", rpc, 1e6, 100.0, "us"),
    ]


def _echo(name: str, inputs: dict[str, Any]) -> Any:
    return inputs["x"]


def _seconds(work: Callable[[], Any]) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def _until_first_call(jail: ScriptJail, script: Path) -> float:
    arrived: list[float] = []
    start = time.perf_counter()
    jail.run(script, {"calls": 1}, lambda name, inputs: arrived.append(time.perf_counter()), 60)
    return arrived[0] - start


def _between_calls(jail: ScriptJail, script: Path, calls: int) -> list[float]:
    times: list[float] = []
    jail.run(script, {"calls": calls + 1}, lambda name, inputs: times.append(time.perf_counter()), 60)
    return [b - a for a, b in itertools.pairwise(times)]


def _row(name: str, seconds: list[float], scale: float, goal: float | None, unit: str) -> Row:
    ordered = sorted(s * scale for s in seconds)
    p95 = ordered[min(len(ordered) - 1, int(0.95 * len(ordered)))]
    return Row(name, round(statistics.median(ordered), 2), round(p95, 2), goal, unit, len(ordered))
