"""`gap rehearse` without its command line: a validated run evaluated, and everything about it written down."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

from gap_cli.rehearse.evaluate import LOCAL, Evaluation, Progress, Record, evaluate, make_engine
from gap_cli.rehearse.feedback import feedback_text
from gap_cli.sandbox import level
from gap_cli.workspace.canonical import json_text, jsonl_text
from gap_cli.workspace.inventory import Inventory
from gap_cli.workspace.metadata import record_stage
from gap_cli.workspace.run import Run
from gap_cli.workspace.stages import digest, write_stage
from gap_cli.workspace.validation import LOCK, require_valid

FOLDER = "rehearse/00"
KEEP = (".png", ".mcap", ".log", "timings.jsonl")


def rehearse(
    run: Run,
    n: int,
    seed: int | None = None,
    workers: int = 1,
    record: Record = "failed",
    *,
    engine: str = LOCAL,
    progress: Progress = lambda result: None,
    say: Callable[[str], None] = lambda text: None,
) -> Evaluation:
    """Roll out instances `seed` .. `seed + n - 1` (default: the run's base seed) and write `rehearse/00`.

    The files git sees depend on the bundle, the instances and the lock alone, not on `workers` or the clock. Call it
    with the run held. Raises `RunError` where the run is not what was validated, and what would fail every episode.
    """
    started = time.monotonic()
    inventory = Inventory.of(run.config)
    bundle = require_valid(run, inventory, inventory.lock(level()))
    first = run.config.seed if seed is None else seed
    output = run.folder(FOLDER)
    _clear(output)
    try:
        with interruptible(say) as stop:
            found = evaluate(
                bundle, range(first, first + n), make_engine(inventory, engine, workers), inventory,
                lock=digest(run.path / LOCK), output=output, record=record, progress=progress, say=say, stop=stop,
            )  # fmt: skip
    finally:
        _clear(output, ("*.mcap.part",))  # of workers that were killed while they recorded
    rationales = {name: {p.name: p.rationale for p in points} for name, points in bundle.checkpoints.items()}
    files = {
        "timings.jsonl": jsonl_text(found.timings),
        "episodes.jsonl": jsonl_text(found.rows),
        "feedback.md": feedback_text(found.summary, found.rows, rationales),
        "summary.json": json_text(found.summary),
    }
    write_stage(run, FOLDER, files, keep=KEEP)
    more = {"workers": workers, "engine": engine, "not_reproduced": found.not_reproduced}
    record_stage(run, "rehearse", started, **found.clock, **more)
    return found


def _clear(output: Path, patterns: Sequence[str] = ("frames/*.png", "*.mcap", "*.mcap.part", "worker-*.log")) -> None:
    """Pictures, recordings and logs of the rehearsal before this one would be taken for this one's."""
    for path in (p for pattern in patterns for p in output.glob(pattern)):
        path.unlink(missing_ok=True)


@contextmanager
def interruptible(say: Callable[[str], None]) -> Iterator[threading.Event]:
    """Ctrl-C in two steps: the first SIGINT sets the event, the second raises `KeyboardInterrupt`. SIGTERM and SIGHUP
    raise at once."""
    stop = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield stop
        return

    def on_interrupt(number: int, frame: FrameType | None) -> None:
        if stop.is_set():
            raise KeyboardInterrupt
        stop.set()
        say("Interrupted: finishing the episodes under way. Ctrl-C again stops now.")

    def on_terminate(number: int, frame: FrameType | None) -> None:
        raise KeyboardInterrupt

    before = {
        signal.SIGINT: signal.signal(signal.SIGINT, on_interrupt),
        signal.SIGTERM: signal.signal(signal.SIGTERM, on_terminate),
        signal.SIGHUP: signal.signal(signal.SIGHUP, on_terminate),
    }
    try:
        yield stop
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
