"""In the child: run an inline skill script; its only way out is to ask the host for a tool."""

from __future__ import annotations

import collections
import sys
import types
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, nullcontext
from functools import cache
from typing import Any

from gap_cli.sandbox import preload as warm
from gap_cli.sandbox import robots
from gap_cli.sandbox.confine import REPLY_FD, REQUEST_FD
from gap_cli.sandbox.error_report import blame, remember
from gap_cli.sandbox.failures import described, revived
from gap_cli.sandbox.framing import read_frame, write_frame
from gap_cli.sandbox.lint import NO_IMPORT, SCRIPT, report
from gap_runtime.contracts.encoding.framing import pack, unpack
from gap_runtime.contracts.failures import BadRequestError, ToolError
from gap_runtime.contracts.robot import RobotSpec

FILENAME = "<script>"
MODULE = "inline_script"
WHY = "this script is not, byte for byte, one of its skill's, so it runs in the jail, where few modules are"
warm.up()


class Context:
    """What a script sees as `ctx`. `seed` is the episode's."""

    def __init__(self, seed: int) -> None:
        self.seed = seed

    def tool(self, name: str, /, **inputs: Any) -> Any:
        """Call a tool; returns its bare value or a NamedTuple. Raises what the tool raised."""
        return _ask("call", name, inputs)

    def robot(self, arm_id: int = 0) -> RobotSpec:
        """The spec of one arm."""
        return robots.spec_of(_ask("robot", arm_id))

    def publish(self, value: Any) -> None:
        """Make `value` the latest of this streaming node."""
        _ask("publish", value)

    def raise_if_cancelled(self) -> None:
        """Nothing to do: a jailed script that must stop is stopped from outside."""

    def closing(self) -> AbstractContextManager[None]:
        """Nothing to allow, for the same reason."""
        return nullcontext()


def _ask(*message: Any) -> Any:
    write_frame(REPLY_FD, pack(list(message)))
    answer = unpack(read_frame(REQUEST_FD), record=_named)
    if answer[0] == "ok":
        return answer[1]
    raise _failed(answer[1])


def _failed(report: dict[str, Any]) -> ToolError:
    error = revived(report) or ToolError("tool", "the tool failed")
    error.origin = report["origin"]  # type: ignore[attr-defined]
    return error


def _named(fields: dict[str, Any]) -> Any:
    return _class_of(tuple(fields))(**fields)


@cache
def _class_of(names: tuple[str, ...]) -> Callable[..., Any]:
    made: Callable[..., Any] = collections.namedtuple("Result", names)  # type: ignore[misc]
    return made


def main() -> None:
    """Read one job and run it; the last message is `return` or `error`."""
    job = unpack(read_frame(REQUEST_FD), record=_named)
    ballast = [bytes(8 << 20)]  # given back when memory runs out, so that we can still say so
    try:
        problem = report(job["source"], SCRIPT, FILENAME)
        if problem and NO_IMPORT in problem["message"]:
            problem["message"] += f": {WHY}"
        payload = pack(["error", problem]) if problem else pack(["return", run(job)])
    except BaseException as error:
        ballast.clear()
        payload = pack(["error", _explained(blame(error, FILENAME), error) | _failure(error)])
    write_frame(REPLY_FD, payload)


def _failure(error: BaseException) -> dict[str, Any]:
    """What lets the host raise the same failure again, where it is one of the contract's."""
    if not isinstance(error, ToolError):
        return {}
    return {**described(error), "origin": getattr(error, "origin", None)}


def _explained(report: dict[str, Any], error: BaseException) -> dict[str, Any]:
    """The report, with why and what there is instead for a script that wanted to import what is not there."""
    if not isinstance(error, ImportError):
        return report
    ours = sorted(m for m in sys.modules if m.startswith("gap_runtime.contracts."))
    return report | {"message": f"{report['message']}: {WHY}", "hint": f"Of the contracts: {', '.join(ours)}."}


def run(job: dict[str, Any]) -> Any:
    """Execute the script's module and, where the job says `call`, its `run`; what a generator yields is published."""
    warm.seed(job["seed"])
    remember(job["source"], FILENAME)
    module = types.ModuleType(MODULE)
    sys.modules[MODULE] = module  # where dataclasses look for the names in annotations
    exec(compile(job["source"], FILENAME, "exec", dont_inherit=True), module.__dict__)
    function = module.__dict__.get("run")
    if not callable(function):
        raise BadRequestError("script", "the script has no function run")
    if not job["call"]:
        return None
    context = Context(job["seed"])
    result = function(context, **job["inputs"])
    if isinstance(result, Iterator):
        for value in result:
            context.publish(value)
        return None
    return result
