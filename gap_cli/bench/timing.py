"""Times several things in turns, so that what else the machine does falls on all of them alike."""

from __future__ import annotations

import gc
import statistics
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from gap_runtime.contracts.bench import BenchContext

ROUNDS = 25  # unless the context asks for another number
ROUND_S = 0.02  # s: a measurement repeats its subject until it takes about this long


@dataclass(frozen=True)
class Timing:
    """Seconds per call over the rounds. `cpu` is the median of processor time, all threads of this process together:
    what it costs however busy the machine is."""

    best: float
    median: float
    p90: float
    cpu: float


def time_in_turns(subjects: Mapping[str, Callable[[], object]], bench: BenchContext) -> dict[str, Timing]:
    """Time each subject once per round. Garbage collection runs between rounds, not in them."""
    repeats = {name: _repeats(call) for name, call in subjects.items()}
    seconds: dict[str, list[tuple[float, float]]] = {name: [] for name in subjects}
    rounds = bench.n or ROUNDS
    for round_ in range(rounds):
        for i, (name, call) in enumerate(subjects.items()):
            bench.progress((round_ + i / len(subjects)) / rounds, name)
            gc.collect()
            gc.disable()
            try:
                seconds[name].append(_timed(call, repeats[name]))
            finally:
                gc.enable()
    bench.progress(1.0, "")
    return {name: _summary(values) for name, values in seconds.items()}


def _repeats(call: Callable[[], object]) -> int:
    call()
    return max(1, round(ROUND_S / max(1e-7, _timed(call, 1)[0])))


def _timed(call: Callable[[], object], times: int) -> tuple[float, float]:
    """Wall and processor seconds per call."""
    wall, cpu = time.perf_counter(), time.process_time()
    for _ in range(times):
        call()
    return (time.perf_counter() - wall) / times, (time.process_time() - cpu) / times


def _summary(values: list[tuple[float, float]]) -> Timing:
    ordered = sorted(wall for wall, _ in values)
    cpu = statistics.median(cpu for _, cpu in values)
    return Timing(ordered[0], statistics.median(ordered), ordered[round(0.9 * (len(ordered) - 1))], cpu)
