"""What a worker process runs: build the world once, then one episode per seed it is handed, until its pipe closes."""

from __future__ import annotations

import contextlib
import ctypes
import os
import queue
import signal
import sys
import threading
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any

from gap_cli.rehearse.process import OUT_OF_MEMORY, Reader, decode_job, send
from gap_runtime.contracts.engine import EpisodeResult, RehearsalJob
from gap_runtime.contracts.failures import GapError

PR_SET_PDEATHSIG = 1
Roll = Callable[[int], EpisodeResult]


def main() -> None:
    """`python -m gap_cli.rehearse.worker TASKS_FD RESULTS_FD PARENT_PID JOB`."""
    tasks, results, parent = (int(a) for a in sys.argv[1:4])
    serve(tasks, results, parent, decode_job(sys.argv[4]), prepare)


def serve(tasks: int, results: int, parent: int, job: RehearsalJob, make: Callable[[RehearsalJob], Roll]) -> None:
    """Answer every seed with a row. Ends the process when the parent does."""
    _die_with(parent)
    _die_first()
    seeds = _listen(tasks)
    try:
        roll = make(job)
        send(results, {"ready": True})
        while True:
            result = roll(seeds.get())
            send(results, {"row": dict(result.row), "timing": dict(result.timing)})
    except GapError as error:
        send(results, {"error": error.message, "hint": error.hint})
    except MemoryError:
        os._exit(OUT_OF_MEMORY)
    except BaseException:
        traceback.print_exc()
        sys.stderr.flush()
        os._exit(3)  # whatever threads the episode left behind must not keep the process


def prepare(job: RehearsalJob) -> Roll:
    """The function that rolls out one seed of `job`."""
    from gap_cli.rehearse.episode_runner import EpisodeRunner

    return EpisodeRunner.build(job).roll


def _listen(tasks: int) -> queue.SimpleQueue[int]:
    """Seeds as they come; the process ends with the pipe, whatever it is doing."""
    seeds: queue.SimpleQueue[int] = queue.SimpleQueue()

    def read() -> None:
        reader = Reader(tasks)
        while (message := reader.wait()) is not None:
            seeds.put(int(message["seed"]))
        os._exit(0)

    threading.Thread(target=read, daemon=True, name="tasks").start()
    return seeds


def _die_with(parent: int) -> None:
    """Have the kernel end this process with its parent, and end now if that has happened already."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with contextlib.suppress(OSError, AttributeError):
        libc: Any = ctypes.CDLL(None, use_errno=True)
        libc.prctl(PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
    if os.getppid() != parent:
        os._exit(0)


def _die_first() -> None:
    """When memory runs out, let the kernel take a worker, not the rehearsal that counts them."""
    with contextlib.suppress(OSError):
        Path("/proc/self/oom_score_adj").write_text("800", encoding="ascii")


if __name__ == "__main__":
    main()
