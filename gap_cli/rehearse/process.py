"""A worker process as its rehearsal holds it: started afresh (never forked), heard through a pipe, killed whole.

Messages are lines of JSON over file descriptors that nothing else writes to.
"""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gap_runtime.contracts.engine import RehearsalJob

OUT_OF_MEMORY = 86  # exit code of a worker that saw a MemoryError
END_LIMIT_S = 3.0
CHUNK, MAX_LINE = 1 << 16, 64 << 20
ERROR_LINES = 8  # of a library's error message
_ONE_THREAD = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMEXPR_NUM_THREADS"), "1"
)  # workers share the cores, and a sum split over threads depends on their number


class Reader:
    """Reads messages from a file descriptor that may deliver them in pieces."""

    def __init__(self, fd: int) -> None:
        self.fd = fd
        self._rest = b""

    def read(self) -> list[dict[str, Any]] | None:
        """The messages one read completes (maybe none); None once the other side is gone."""
        try:
            data = os.read(self.fd, CHUNK)
        except ConnectionError:
            data = b""
        if not data:
            return None
        *lines, self._rest = (self._rest + data).split(b"\n")
        if len(self._rest) > MAX_LINE:
            return None
        return [json.loads(line) for line in lines]

    def wait(self) -> dict[str, Any] | None:
        """Block until the next message; None once the other side is gone. For a side that gets one at a time."""
        while True:
            messages = self.read()
            if messages is None:
                return None
            if messages:
                return messages[0]


def send(fd: int, message: dict[str, Any]) -> None:
    """Write one message. Raises `BrokenPipeError` when the other side is gone."""
    data = json.dumps(message, ensure_ascii=False).encode() + b"\n"
    while data:
        data = data[os.write(fd, data) :]


@dataclass
class Worker:
    """One process. `seed` is the episode it has; `since` when it got it, or was started (monotonic seconds)."""

    slot: int
    process: subprocess.Popen[bytes]
    reader: Reader
    tasks: int
    log: Path
    since: float
    ready: bool = False
    seed: int | None = None
    dismissed: bool = False

    @classmethod
    def start(cls, slot: int, job: RehearsalJob, command: Sequence[str] = ()) -> Worker:
        """Start a worker in a session of its own, so that Ctrl-C reaches the rehearsal alone."""
        tasks_r, tasks_w = os.pipe()
        results_r, results_w = os.pipe()
        job.output.mkdir(parents=True, exist_ok=True)
        log = job.output / f"worker-{slot}.log"
        try:
            with log.open("ab") as out:
                process = subprocess.Popen(
                    [*(command or (sys.executable, "-P", "-m", "gap_cli.rehearse.worker")),
                     str(tasks_r), str(results_w), str(os.getpid()), encode_job(job)],
                    stdin=subprocess.DEVNULL, stdout=out, stderr=out, pass_fds=(tasks_r, results_w),
                    start_new_session=True, env={**os.environ, **_ONE_THREAD, "PYTHONHASHSEED": "0"},
                )  # fmt: skip
        finally:
            os.close(tasks_r)
            os.close(results_w)
        return cls(slot, process, Reader(results_r), tasks_w, log, time.monotonic())

    def give(self, seed: int) -> None:
        """Hand it an episode. Raises `BrokenPipeError` when it is gone."""
        send(self.tasks, {"seed": seed})
        self.seed, self.since = seed, time.monotonic()

    def dismiss(self) -> None:
        """Tell it that there is no more work."""
        if not self.dismissed:
            self.dismissed = True
            os.close(self.tasks)

    def kill(self) -> None:
        """End it and every process it started, now."""
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(self.process.pid, signal.SIGKILL)
        self.process.kill()

    def end(self) -> None:
        """See it off: dismiss, wait a little, kill; then close what is open. Repeatable."""
        self.dismiss()
        try:
            self.process.wait(END_LIMIT_S if self.seed is None else 0)
        except subprocess.TimeoutExpired:
            self.kill()
        self.process.wait()
        with contextlib.suppress(OSError):
            os.close(self.reader.fd)

    def exit_reason(self) -> str:
        """Why it is gone, from its exit code and what its log ends with."""
        try:
            code = self.process.wait(END_LIMIT_S)
        except subprocess.TimeoutExpired:
            return "closed its pipe but did not end"
        if code == OUT_OF_MEMORY:
            return "out of memory"
        if code == -signal.SIGKILL:
            return "killed by SIGKILL (the system was most likely out of memory)"
        if code < 0:
            return f"died of {signal.Signals(-code).name}"
        return f"exited with code {code}: {_last_error(self.log)}"


def encode_job(job: RehearsalJob) -> str:
    """The job as one JSON argument."""
    values = {k: str(v) if isinstance(v, Path) else v for k, v in vars(job).items()}
    return json.dumps(values)


def decode_job(text: str) -> RehearsalJob:
    """The job that `encode_job` wrote."""
    values = json.loads(text)
    for key in ("run", "output"):
        values[key] = Path(values[key])
    return RehearsalJob(**values)


def _last_error(log: Path) -> str:
    """What the log ends with: the whole text of an exception, which follows the indented lines of its traceback."""
    with contextlib.suppress(OSError):
        lines = [
            line.rstrip() for line in log.read_text(encoding="utf-8", errors="replace").split("\n") if line.strip()
        ]
        start = max((i + 1 for i, line in enumerate(lines) if line.startswith("  ")), default=len(lines) - 1)
        return "; ".join(lines[start : start + ERROR_LINES]) or lines[-1] if lines else "no log"
    return "no log"
