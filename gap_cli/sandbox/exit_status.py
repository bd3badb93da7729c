"""How a jailed run ended, said as one `SandboxError`."""

from __future__ import annotations

import os
import signal
from collections.abc import Mapping
from typing import Any

from gap_cli.sandbox.zygote import NOT_LOCKED
from gap_runtime.errors import SandboxError

MAX_TEXT = 2000
_SIGNALS = {
    signal.SIGSYS: ("syscall", "asked the system for something outside the jail and was stopped"),
    signal.SIGXCPU: ("timeout", "used up its processor time"),
    signal.SIGXFSZ: ("syscall", "tried to write a file"),
}


def timed_out(what: str, wall_s: float) -> SandboxError:
    """It ran past its wall-clock limit."""
    return SandboxError(f"{what} ran longer than {wall_s:g} s.", hint="Look for an endless loop.", cause="timeout")


def flooded(what: str, limit: int) -> SandboxError:
    """It wrote more than it may."""
    return SandboxError(f"{what} wrote more than {limit / 1e6:g} MB.", cause="output")


def ended(what: str, status: int | None) -> SandboxError:
    """It was gone before it gave a result; `status` is its wait status."""
    if status is not None and status >= 0 and os.WIFEXITED(status) and os.WEXITSTATUS(status) == NOT_LOCKED:
        return SandboxError("The kernel refused the system-call filter; nothing was run.", cause="unavailable")
    if status is not None and status >= 0 and os.WIFSIGNALED(status):
        number = os.WTERMSIG(status)
        if number in _SIGNALS:
            cause, text = _SIGNALS[signal.Signals(number)]
            return SandboxError(f"{what} {text}.", hint="It has no files, processes or network.", cause=cause)
        if number != signal.SIGKILL:
            return SandboxError(f"{what} crashed the interpreter ({signal.Signals(number).name}).", cause="crash")
    return SandboxError(f"{what} ended without a result.", cause="crash")


def reported(what: str, report: Mapping[str, Any]) -> SandboxError:
    """It said itself what went wrong; every field of `report` is the child's word, so only its shape is relied on."""
    cause = report.get("cause")
    line = report.get("line")
    known = cause if cause in ("memory", "output", "syscall", "forbidden", "error") else "error"
    line = line if isinstance(line, int) and not isinstance(line, bool) and 0 < line < 10**7 else None
    at = f", line {line}" if line else ""
    message = clean(report.get("message")) or "failed"
    stop = "" if message[-1] in ".!?" else "."
    return SandboxError(f"{what}{at}: {message}{stop}", hint=clean(report.get("hint")), cause=known, line=line)


def clean(text: Any) -> str:
    """Text of the child made safe to print: bounded, no control characters, no lone surrogates."""
    if not isinstance(text, str):
        return ""
    short = text[:MAX_TEXT].encode("utf-8", "replace").decode("utf-8")
    return "".join(c if c.isprintable() or c == "\n" else "\ufffd" for c in short)
