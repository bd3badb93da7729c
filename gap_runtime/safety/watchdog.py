"""A process of its own that acts when the interpreter falls silent, however busy or dead that is.

It is the last line behind the supervisor thread: a node that holds the interpreter lock in C stops that thread too.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Sequence
from types import TracebackType

_PROGRAM = """
import os, select, signal, subprocess, sys
silence, parent, command = float(sys.argv[1]), int(sys.argv[2]), sys.argv[3:]
signal.signal(signal.SIGINT, signal.SIG_IGN)
while True:
    ready, _, _ = select.select([0], [], [], silence)
    data = os.read(0, 4096) if ready else b""
    if data.endswith(b"q"):
        sys.exit(0)
    if not data:
        break
if command:
    subprocess.run(command, stdin=subprocess.DEVNULL, timeout=10, check=False)
if os.getppid() == parent:
    os.kill(parent, signal.SIGKILL)
"""


class Watchdog:
    """Expects `beat()` at least every `silence_s`; else runs the command `on_silence`, then kills this process.

    The command is how to reach the robot without us (a driver's stop request); the driver's own timeout on stale
    commands is what stops it when nothing can. The same happens when this process dies without saying goodbye.
    """

    def __init__(self, *, silence_s: float, on_silence: Sequence[str] = ()) -> None:
        self._silence_s, self._command = silence_s, tuple(on_silence)
        self._process: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> Watchdog:
        arguments = [sys.executable, "-I", "-S", "-c", _PROGRAM, str(self._silence_s), str(os.getpid()), *self._command]
        self._process = subprocess.Popen(arguments, stdin=subprocess.PIPE)
        return self

    def beat(self) -> None:
        """Say that all is well."""
        self._say(b".")

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._say(b"q")
        if self._process is not None and self._process.stdin is not None:
            self._process.stdin.close()
            self._process.wait(timeout=5)

    def _say(self, word: bytes) -> None:
        if self._process is not None and self._process.stdin is not None:
            os.write(self._process.stdin.fileno(), word)
