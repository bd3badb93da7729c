"""In the child: what an exception of jailed code was, where in its source, as plain data for the host."""

from __future__ import annotations

import errno
import linecache
from types import TracebackType
from typing import Any

from gap_runtime.contracts.failures import GapError

NO_IO = "Jailed code has no files, processes, network or entropy; seed random generators."


def remember(source: str, filename: str) -> None:
    """Let tracebacks and `inspect` find the source, which is in no file."""
    linecache.cache[filename] = (len(source), None, source.splitlines(keepends=True), filename)


def blame(error: BaseException, filename: str) -> dict[str, Any]:
    """Cause, message, hint and line. Never raises, whatever `str(error)` does."""
    report: dict[str, Any] = {"cause": "error", "line": _line(error, filename), "hint": ""}
    if isinstance(error, MemoryError):
        return report | {"cause": "memory", "message": "ran out of memory"}
    if isinstance(error, OSError) and error.errno in (errno.EPERM, errno.EACCES, errno.EMFILE, errno.EFBIG):
        return report | {"cause": "syscall", "message": _text(error), "hint": NO_IO}
    if isinstance(error, ImportError):
        return report | {"cause": "forbidden", "message": _text(error), "hint": ""}
    if isinstance(error, SyntaxError) and error.filename == filename:
        return report | {"message": f"{error.msg}"}
    if isinstance(error, GapError):  # it says it best itself
        return report | {"message": error.message, "hint": error.hint}
    return report | {"message": _text(error)}


def _text(error: BaseException) -> str:
    name = type(error).__name__
    try:
        text = str(error)[:2000].encode("utf-8", "replace").decode()
    except BaseException:
        return name
    return f"{name}: {text}" if text else name


def _line(error: BaseException, filename: str) -> int | None:
    """The deepest line of the jailed source that the exception passed through."""
    if isinstance(error, SyntaxError) and error.filename == filename:
        return error.lineno
    line, trace = None, error.__traceback__
    while isinstance(trace, TracebackType):
        if trace.tb_frame.f_code.co_filename == filename:
            line = trace.tb_lineno
        trace = trace.tb_next
    return line
