"""Where errors leave the program: one clear line for the user, a log file for a bug, an exit code for the shell."""

from __future__ import annotations

import contextlib
import errno
import logging
import os
import platform
import sys
import tempfile
import traceback
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from gap_runtime.errors import DocumentError, GapError, StorageError, WorkflowError

BUG, INTERRUPTED, BROKEN_PIPE = 3, 130, 141
SHOWN_PROBLEMS = 20
_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)


def report(error: BaseException, argv: list[str]) -> int:
    """Tell the user about `error` on stderr; returns the exit code."""
    if isinstance(error, KeyboardInterrupt):
        say("Interrupted.")
        return INTERRUPTED
    if isinstance(error, BrokenPipeError):  # `gap tools | head`
        with contextlib.suppress(OSError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return BROKEN_PIPE
    if isinstance(error, OSError) and error.errno in _FULL:  # `gap tools list > /dev/full`
        error = StorageError(f"The output cannot be written: {error.strerror}.")
    if isinstance(error, GapError) and error.exit_code != BUG:
        if isinstance(error, DocumentError) and len(error.problems) > 1:
            say(f"error: {error.where}: {len(error.problems)} problems")
            _say_lines(error.problems)
            return error.exit_code
        say(f"error: {_one_line(error.message)}")
        if isinstance(error, WorkflowError):
            _say_lines([f"{f.code} {f.path}: {f.message} {f.hint}" for f in error.findings])
        elif error.hint:
            say(f"  {_one_line(error.hint)}")
        return error.exit_code
    say(f"error: this is a bug in GaP: {type(error).__name__}: {_one_line(str(error))}")
    log = write_log(error, argv)
    if log is None:
        traceback.print_exception(error)
    else:
        say(f"  The details are in {log}")
    return BUG


def say(text: str) -> None:
    """A line on stderr, whatever the terminal can show; silent where stderr is gone."""
    with contextlib.suppress(OSError, ValueError):
        print(text, file=sys.stderr, flush=True)  # noqa: T201


def require_working_directory() -> None:
    """Raise `StorageError` where the working directory was deleted: no relative path leads anywhere."""
    try:
        Path.cwd()
    except FileNotFoundError:
        raise StorageError("The working directory no longer exists.", hint="cd to a folder that does.") from None


def finish(ended: SystemExit) -> None:
    """Raise `ended` once stdout has taken everything; report it where it cannot (a full disk)."""
    try:
        sys.stdout.flush()
    except OSError as error:
        code = report(error, sys.argv)
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # the interpreter flushes again at exit
        sys.exit(code)
    raise ended


class _Warnings(logging.Handler):
    """Says each warning once, however often its cause is met."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.said: set[str] = set()

    def emit(self, record: logging.LogRecord) -> None:
        text = _one_line(record.getMessage())
        if text not in self.said:
            self.said.add(text)
            say(f"warning: {text}")


def show_warnings() -> None:
    """Print what the engine warns about (a plugin or a skill left out) on stderr."""
    for name in ("gap_runtime", "gap_cli"):
        logger = logging.getLogger(name)
        logger.handlers = [*(h for h in logger.handlers if not isinstance(h, _Warnings)), _Warnings()]


def flush() -> None:
    """Flush both streams without complaint."""
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError, ValueError):
            stream.flush()


def tolerate_any_terminal() -> None:
    """Print `?` rather than crash where the terminal's encoding lacks a character, and nothing where it is closed."""
    while (fd := os.open(os.devnull, os.O_RDWR)) <= 2:  # `gap ... >&-`: else the next file opened would be stdout
        os.set_inheritable(fd, True)
    os.close(fd)
    sys.stdout, sys.stderr = sys.stdout or os.fdopen(1, "w"), sys.stderr or os.fdopen(2, "w")
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")


def write_log(error: BaseException, argv: list[str]) -> Path | None:
    """Write the traceback to a log file and return where it is; None where no folder can be written."""
    from gap_cli import __version__

    now = datetime.now(UTC)
    head = (
        f"gap {__version__} | python {platform.python_version()} | {platform.platform()}\n{now.isoformat()}\n{argv}\n"
    )
    text = head + "\n" + "".join(traceback.format_exception(error)) + _causes(error)
    for folder in state_folders():
        path = folder / f"bug-{now:%Y%m%dT%H%M%S}-{os.getpid()}.log"
        with contextlib.suppress(OSError):
            folder.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8", errors="backslashreplace")
            return path
    return None


def state_folders() -> list[Path]:
    """Where logs may go, best first."""
    found = [Path(os.environ["XDG_STATE_HOME"]) / "gap"] if os.environ.get("XDG_STATE_HOME") else []
    with contextlib.suppress(RuntimeError):
        found.append(Path.home() / ".local" / "state" / "gap")
    with contextlib.suppress(OSError):
        found.append(Path(tempfile.gettempdir()) / "gap")
    return found


def _say_lines(lines: Sequence[str]) -> None:
    for line in lines[:SHOWN_PROBLEMS]:
        say(f"  {_one_line(line)}")
    if len(lines) > SHOWN_PROBLEMS:
        say(f"  ... and {len(lines) - SHOWN_PROBLEMS} more")


def _causes(error: BaseException) -> str:
    causes: Any = getattr(error, "causes", ())
    return "".join("\ncause:\n" + "".join(traceback.format_exception(cause)) for cause in causes)


def _one_line(text: str) -> str:
    return " ".join(text.split())
