"""Runs inline skill scripts in a jail; the host serves their tool calls one by one and trusts no byte of them."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Self

from gap_cli.sandbox import exit_status as verdict
from gap_cli.sandbox.confine import Limits
from gap_cli.sandbox.failures import described, revived
from gap_cli.sandbox.framing import DeadlineError, FloodError, HangUpError, Pipes
from gap_cli.sandbox.lint import MAX_SOURCE
from gap_cli.sandbox.robots import plain
from gap_cli.sandbox.server import ForkServer
from gap_runtime.contracts.documents import read_text
from gap_runtime.contracts.encoding.framing import pack, unpack
from gap_runtime.contracts.failures import CancelledError, PrivilegedReadError, ToolError
from gap_runtime.contracts.robot import RobotSpec
from gap_runtime.errors import BadRequestError, GapError, SandboxError

MAX_MESSAGE = 64_000_000
MAX_CALLS = 10_000
MEMORY = 2 << 30
LOAD_LIMIT_S = 10.0
FOREVER = -1  # RLIM_INFINITY
CallTool = Callable[[str, dict[str, Any]], Any]


class ScriptJail:
    """A context manager around one fork server with numpy loaded. `run` may be called from several threads."""

    def __init__(self, *, unsafe: bool = False, max_calls: int = MAX_CALLS, server: ForkServer | None = None) -> None:
        self._unsafe, self._max_calls = unsafe, max_calls
        self._server = server or ForkServer("gap_cli.sandbox.script_child")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()

    def close(self) -> None:
        """Stop the server and whatever it still runs."""
        self._server.close()

    def level(self) -> str:
        """'seccomp' or 'none', probed. Starts the server, so that the first script does not wait for it."""
        return self._server.level()

    def run(
        self,
        source_path: Path,
        inputs: dict[str, Any],
        call_tool: CallTool,
        deadline_s: float,
        *,
        publish: Callable[[Any], None] | None = None,
        check: Callable[[], None] | None = None,
        robot: Callable[[int], RobotSpec] | None = None,
        seed: int = 0,
    ) -> Any:
        """Call `run(ctx, **inputs)` of the script and return its result, named results as a dict.

        `ctx.tool`, `ctx.publish` and `ctx.robot` become `call_tool(name, inputs)`, `publish(value)` and `robot(arm_id)`
        here, on this thread; every check of a call is theirs. `check` is called while waiting and may raise to give up;
        `deadline_s` [s] of wall time bounds the whole run. Raises `SandboxError`, the `ToolError` the script raised or
        let through, and whatever `check` raises; a call that fails otherwise ends the script.
        """
        what = f"The script {source_path.name}"
        session = _Session(what, call_tool, publish, robot, self._max_calls)
        order = {"source": read_text(source_path), "inputs": inputs, "seed": seed, "call": True}
        return self._execute(order, session, deadline_s, check)

    def load(self, source: str, name: str) -> None:
        """Execute the module of a script and call nothing: does it import, is there a `run`? Raises `SandboxError`."""

        def refuse(tool: str, inputs: dict[str, Any]) -> Any:
            raise SandboxError(f"The script {name} calls {tool} while it is loaded.", cause="forbidden")

        session = _Session(f"The script {name}", refuse, None, None, self._max_calls)
        self._execute({"source": source, "inputs": {}, "seed": 0, "call": False}, session, LOAD_LIMIT_S, None)

    def _execute(
        self, order: dict[str, Any], session: _Session, deadline_s: float, check: Callable[[], None] | None
    ) -> Any:
        if len(order["source"]) > MAX_SOURCE:
            raise SandboxError(f"{session.what} is longer than {MAX_SOURCE // 1000} kB.", cause="forbidden")
        message = pack(order)
        cpu = math.ceil(deadline_s) + 2 if math.isfinite(deadline_s) else FOREVER
        with self._server.job(Limits(MEMORY, cpu), deadline_s, unsafe=self._unsafe, check=check) as job:
            try:
                job.pipes.send(message)
                return session.serve(job.pipes)
            except DeadlineError:
                raise verdict.timed_out(session.what, deadline_s) from None
            except FloodError:
                raise verdict.flooded(session.what, MAX_MESSAGE) from None
            except HangUpError:
                job.end()
                raise verdict.ended(session.what, job.status) from None


class _Session:
    """One run of one script, as the host sees it."""

    def __init__(
        self,
        what: str,
        call_tool: CallTool,
        publish: Callable[[Any], None] | None,
        robot: Callable[[int], RobotSpec] | None,
        max_calls: int,
    ) -> None:
        self.what, self._call_tool, self._publish, self._calls_left = what, call_tool, publish, max_calls
        self._robot = robot
        self._raised: list[ToolError] = []

    def serve(self, pipes: Pipes) -> Any:
        """Answer calls until the script returns or fails."""
        while True:
            message = self._read(pipes)
            match message:
                case ["return", value]:
                    return value
                case ["error", dict(report)]:
                    raise self._failure(report)
                case ["call", str(name), dict(inputs)]:
                    self._count()
                    pipes.send(self._answer(self._call_tool, name, inputs))
                case ["robot", int(arm_id)] if self._robot is not None:
                    self._count()
                    pipes.send(pack(["ok", plain(self._robot(arm_id))]))
                case ["robot", _]:
                    raise SandboxError(f"{self.what} asks for a robot, and there is none here.", cause="forbidden")
                case ["publish", value] if self._publish is not None:
                    pipes.send(self._answer(self._publish, value))
                case ["publish", _]:
                    raise SandboxError(f"{self.what} publishes, but is not a streaming node.", cause="forbidden")
                case _:
                    raise SandboxError(f"{self.what} sent something that is not a message.", cause="output")

    def _read(self, pipes: Pipes) -> Any:
        if time.monotonic() > pipes.deadline:
            raise DeadlineError
        try:
            return unpack(pipes.receive(MAX_MESSAGE))
        except BadRequestError as error:
            raise SandboxError(f"{self.what} sent something that is {error.message}.", cause="output") from None

    def _count(self) -> None:
        self._calls_left -= 1
        if self._calls_left < 0:
            raise SandboxError(f"{self.what} made too many tool calls.", cause="forbidden")

    def _answer(self, work: Callable[..., Any], *arguments: Any) -> bytes:
        """What the host did, or why it did not, for the script to handle; what it may not handle is raised here."""
        try:
            return pack(["ok", work(*arguments)])
        except (CancelledError, PrivilegedReadError):
            raise
        except ToolError as error:
            self._raised.append(error)
            return pack(["error", {**described(error), "origin": len(self._raised) - 1}])

    def _failure(self, report: dict[str, Any]) -> GapError:
        """The failure the script ended with: the very one a tool raised, where it let it through."""
        origin = report.get("origin")
        if type(origin) is int and 0 <= origin < len(self._raised):
            return self._raised[origin]
        return revived(report) or verdict.reported(self.what, report)
