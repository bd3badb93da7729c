"""The host's handle on a fork server: started on first use, shared by threads, replaced when it dies."""

from __future__ import annotations

import atexit
import contextlib
import json
import os
import socket
import subprocess
import sys
import threading
import time
import weakref
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from gap_cli.sandbox.confine import Limits
from gap_cli.sandbox.framing import Pipes
from gap_runtime.errors import SandboxError

START_S = 60.0
ANSWER_S = 20.0
UNSAFE = "--unsafe-no-sandbox"
_BOOT = "import sys; sys.path[:] = {path!r}; from gap_cli.sandbox.zygote import main; main({arguments})"
# Single-threaded BLAS: a forked child has no other threads and may make none. A fixed hash seed: sets iterate alike.
_ENVIRONMENT = {
    "LC_ALL": "C.UTF-8",
    "PYTHONHASHSEED": "0",
    "PYTHONUTF8": "1",
    **dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1"),
}
_alive: weakref.WeakSet[ForkServer] = weakref.WeakSet()


class Job:
    """A running child: its two pipes and its pid. `status` is its wait status once it was ended."""

    def __init__(self, server: ForkServer, pid: int, pipes: Pipes) -> None:
        self.pid, self.pipes = pid, pipes
        self.status: int | None = None
        self._server, self._generation = server, server.generation

    def end(self) -> None:
        """Kill whatever is left of it and learn how it ended."""
        if self.status is None:
            self.status = self._server.finish(self.pid, self._generation)
        self.pipes.close()


class ForkServer:
    """Forks jailed children that run the `main()` of the module `worker`.

    `machine` overrides `platform.machine()`: on one without a system-call table nothing is filtered.
    """

    def __init__(self, worker: str, *, machine: str = "") -> None:
        self._worker, self._machine = worker, machine
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._control: socket.socket | None = None
        self._level = "none"
        self.generation = 0  # how many servers were started
        _alive.add(self)

    def level(self) -> str:
        """'seccomp' where a probe child really ended up behind the filter, else 'none'."""
        with self._lock:
            self._ensure()
            return self._level

    @contextmanager
    def job(
        self, limits: Limits, wall_s: float, *, unsafe: bool, check: Callable[[], None] | None = None
    ) -> Iterator[Job]:
        """A fresh child, ended when the block is left, whose pipes wait for at most `wall_s` [s] from now (starting the
        server does not count). Raises `SandboxError` where it cannot be jailed."""
        if self.level() == "none" and not unsafe:
            raise SandboxError(
                "This machine cannot jail untrusted code: its kernel refused the system-call filter.",
                hint=f"Run where seccomp works, or accept the risk with {UNSAFE}.",
                cause="unavailable",
            )
        pipes = Pipes(time.monotonic() + wall_s, check)
        try:
            answer = self.ask({"op": "spawn", "limits": limits.as_dict()}, (pipes.child_reads, pipes.child_writes))
            if "pid" not in answer:
                raise SandboxError(f"The sandbox {answer['error']}.", cause="unavailable")
            pipes.give_away()
            job = Job(self, answer["pid"], pipes)
        except BaseException:
            pipes.close()
            raise
        try:
            yield job
        finally:
            job.end()

    def ask(self, request: dict[str, Any], fds: tuple[int, ...] = ()) -> dict[str, Any]:
        """One request, one answer. Raises `SandboxError` when the server is gone; the next call starts another."""
        with self._lock:
            control = self._ensure()
            try:
                socket.send_fds(control, [json.dumps(request).encode()], fds)
                return _answer(control)
            except (OSError, EOFError) as error:
                self._stop()
                raise SandboxError(f"The sandbox server died ({error}).", cause="unavailable") from None

    def finish(self, pid: int, generation: int) -> int:
        """Kill and reap a child; its wait status, or -1 where its server is gone and so is the child."""
        with contextlib.suppress(SandboxError):
            if generation == self.generation and self._control is not None:
                return int(self.ask({"op": "finish", "pid": pid}).get("status", -1))
        return -1

    def close(self) -> None:
        """Stop the server and every child it still has. Idempotent; a later call starts it again."""
        with self._lock:
            self._stop()

    def _ensure(self) -> socket.socket:
        if self._control is not None:
            return self._control
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        arguments = f"{theirs.fileno()}, {self._worker!r}, {self._machine!r}"
        code = _BOOT.format(path=sys.path, arguments=arguments)
        self._process = subprocess.Popen(
            [sys.executable, "-s", "-P", "-W", "ignore", "-c", code],
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            env=_ENVIRONMENT, pass_fds=(theirs.fileno(),), start_new_session=True,
        )  # fmt: skip
        theirs.close()
        ours.settimeout(START_S)
        self._control = ours
        try:
            greeting = _answer(ours)
        except (OSError, EOFError):
            greeting = {"error": f"it exited with {self._process.poll()}"}
        if "error" in greeting:
            self._stop()
            raise SandboxError(f"The sandbox cannot start: {greeting['error']}.", cause="unavailable")
        ours.settimeout(ANSWER_S)
        self._level = greeting["level"]
        self.generation += 1
        return ours

    def _stop(self) -> None:
        if self._control is not None:
            self._control.close()
        if self._process is not None:
            self._process.kill()  # the kernel then kills its children
            self._process.wait()
        self._control = self._process = None

    def forget(self) -> None:
        """In a forked copy of the host: the server belongs to the parent."""
        if self._control is not None:
            self._control.close()
        if self._process is not None:
            self._process.returncode = 0  # not our child: nothing to wait for, nothing to warn about
        self._control = self._process = None
        self._lock = threading.Lock()


def _answer(control: socket.socket) -> dict[str, Any]:
    message = control.recv(8192)
    if not message:
        raise EOFError("it hung up")
    answer: dict[str, Any] = json.loads(message)
    return answer


def _close_all() -> None:
    for server in list(_alive):
        server.close()


def _forget_all() -> None:
    for server in list(_alive):
        server.forget()


atexit.register(_close_all)
os.register_at_fork(after_in_child=_forget_all)
