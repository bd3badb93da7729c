"""Runs builder code in a jail and hands back the graph it describes as plain data."""

from __future__ import annotations

import json
from functools import cache
from typing import Any, Literal

from gap_cli.sandbox import exit_status as verdict
from gap_cli.sandbox.confine import Limits
from gap_cli.sandbox.framing import DeadlineError, FloodError, HangUpError
from gap_cli.sandbox.lint import MAX_SOURCE
from gap_cli.sandbox.server import ForkServer
from gap_runtime.contracts.documents import parse_json
from gap_runtime.errors import DocumentError, SandboxError

MAX_OUTPUT = 5_000_000
MAX_DEPTH = 64
WHAT = "The builder code"


@cache
def builder_server() -> ForkServer:
    """The one fork server for builder code of this process."""
    return ForkServer("gap_cli.sandbox.builder_child")


def level() -> str:
    """'seccomp' where a child really ended up behind the filter, else 'none'. A probe, not a version check."""
    try:
        return builder_server().level()
    except SandboxError:  # it cannot even start; who runs something is told why
        return "none"


def run_builder(
    source: str,
    *,
    unsafe: bool = False,
    wall_s: float = 10,
    expect: Literal["spec", "sg"] | None = None,
    server: ForkServer | None = None,
) -> dict[str, Any]:
    """Execute builder code and return `to_dict()` of the `spec` or `sg` it binds (`expect`: which one it must be).

    The code runs in a child without files, network or processes, for at most `wall_s` [s]. Only JSON comes back, parsed
    again from scratch; its meaning is still the validator's to check. Raises `SandboxError`; where the kernel has no
    system-call filter nothing runs unless `unsafe`.
    """
    if not isinstance(source, str) or len(source) > MAX_SOURCE:
        raise SandboxError(f"{WHAT} is limited to {MAX_SOURCE // 1000} kB of text.", cause="forbidden")
    job_data = json.dumps({"source": source, "expect": expect}).encode("ascii")
    with (server or builder_server()).job(Limits(cpu=int(wall_s) + 2), wall_s, unsafe=unsafe) as job:
        try:
            job.pipes.send(job_data)
            reply = job.pipes.receive(MAX_OUTPUT)
        except DeadlineError:
            raise verdict.timed_out(WHAT, wall_s) from None
        except FloodError:
            raise verdict.flooded(WHAT, MAX_OUTPUT) from None
        except HangUpError:
            job.end()
            raise verdict.ended(WHAT, job.status) from None
    return _result(bytes(reply))


def _result(reply: bytes) -> dict[str, Any]:
    """Read the child's reply as the hostile bytes it may be."""
    try:
        data = parse_json(reply.decode("ascii"), "output")
    except (DocumentError, UnicodeDecodeError):
        raise SandboxError(f"{WHAT} gave something that is not JSON.", cause="output") from None
    if isinstance(data, dict) and isinstance(data.get("error"), dict):
        raise verdict.reported(WHAT, data["error"])
    result = data.get("result") if isinstance(data, dict) else None
    if not isinstance(result, dict):
        raise SandboxError(f"{WHAT} gave no graph.", cause="output")
    return result
