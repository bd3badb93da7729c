"""The fork server: a small process that has everything imported, and forks one jailed child per job.

It speaks one JSON message per packet over a Unix socket: `spawn` (with two descriptors) gives a pid; `finish` kills
that child's whole group and reaps it, so that no pid is ever signalled after it was reused. When the host goes away, so
do all children and the server.
"""

from __future__ import annotations

import contextlib
import gc
import importlib
import json
import os
import platform
import resource
import shutil
import signal
import socket
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from gap_cli.sandbox.confine import MOST_FILES, Limits, confine, lock
from gap_cli.sandbox.syscalls import Architecture, architecture

NOT_LOCKED = 71  # exit status of a child that could not put itself behind the filter
Work = Callable[[], None]


@dataclass
class Zygote:
    """The server's state. `work` runs in a child after it is confined; `locks` is True where the filter holds."""

    control: socket.socket
    work: Work
    null: int
    arch: Architecture | None
    locks: bool = False
    children: set[int] = field(default_factory=set)

    def serve(self) -> None:
        """Answer until the host hangs up."""
        while True:
            message, fds, _, _ = socket.recv_fds(self.control, 4096, 2)
            if not message:
                return
            request = json.loads(message)
            try:
                answer = self._spawn(request, fds) if request["op"] == "spawn" else self._finish(request["pid"])
            finally:
                for fd in fds:
                    os.close(fd)
            self.control.send(json.dumps(answer).encode())

    def _spawn(self, request: dict[str, Any], fds: list[int]) -> dict[str, Any]:
        try:
            pid = self.fork(fds[0], fds[1], Limits(**request["limits"]), filtered=self.locks)
        except OSError as error:
            return {"error": f"cannot fork ({error.strerror})"}
        self.children.add(pid)
        return {"pid": pid}

    def _finish(self, pid: int) -> dict[str, Any]:
        if pid not in self.children:
            return {"error": f"no such child {pid}"}
        self.children.discard(pid)
        return {"status": _kill(pid)}

    def fork(self, request: int, reply: int, limits: Limits, *, filtered: bool, work: Work | None = None) -> int:
        """Fork a confined child that runs `work` and exits; its pid."""
        parent = os.getpid()
        pid = os.fork()
        if pid:
            return pid
        status = 1
        try:
            confine(request, reply, self.null, limits, parent)
            if filtered and not lock(self.arch):
                status = NOT_LOCKED
            else:
                (work or self.work)()
                status = 0
        finally:
            os._exit(status)

    def probe(self) -> bool:
        """Whether a child of ours really ends up behind the filter."""
        reading, writing = os.pipe()
        try:
            pid = self.fork(reading, writing, Limits(), filtered=True, work=lambda: None)
            return os.waitpid(pid, 0)[1] == 0
        finally:
            os.close(reading)
            os.close(writing)


def _kill(pid: int) -> int:
    """Kill the group of a child not yet reaped, and reap it; its wait status."""
    for target, send in ((pid, os.killpg), (pid, os.kill)):  # the group exists only once the child called setsid
        with contextlib.suppress(ProcessLookupError):
            send(target, signal.SIGKILL)
    return os.waitpid(pid, 0)[1]


def main(control_fd: int, worker: str, machine: str) -> None:
    """Become a fork server for the module `worker`, whose `main()` is a child's work, until the host is gone."""
    control = socket.socket(fileno=control_fd)
    _settle()
    try:
        work: Work = importlib.import_module(worker).main
    except Exception as error:
        control.send(json.dumps({"error": f"{type(error).__name__}: {error}"[:2000]}).encode())
        return
    zygote = Zygote(control, work, os.open(os.devnull, os.O_RDWR), architecture(machine or platform.machine()))
    gc.collect()
    gc.freeze()  # children then copy fewer pages
    zygote.locks = zygote.probe()
    control.send(json.dumps({"level": "seccomp" if zygote.locks else "none"}).encode())
    try:
        zygote.serve()
    finally:
        for pid in zygote.children:
            _kill(pid)


def _settle() -> None:
    """An empty directory that nobody can put anything into, no secrets, a short memory for descriptors."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)
    resource.setrlimit(resource.RLIMIT_NOFILE, (MOST_FILES, MOST_FILES))
    os.umask(0o077)
    nowhere = tempfile.mkdtemp(prefix="gap-jail-")
    os.chdir(nowhere)
    shutil.rmtree(nowhere)
