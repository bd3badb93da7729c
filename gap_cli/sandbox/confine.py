"""What a freshly forked child does to itself before it runs a line of anyone's code."""

from __future__ import annotations

import fcntl
import os
import resource
import signal
from dataclasses import asdict, dataclass
from typing import Any

from gap_cli.sandbox import seccomp
from gap_cli.sandbox.syscalls import Architecture

REQUEST_FD, REPLY_FD = 3, 4
NOBODY = 65534
MOST_FILES = 256  # the fork server keeps itself below this, so that a child can close them all


@dataclass(frozen=True)
class Limits:
    """What the kernel holds a child to: `memory` of address space [bytes] and `cpu` time [s].

    Wall-clock time is the parent's business.
    """

    memory: int = 512 << 20
    cpu: int = 11

    def as_dict(self) -> dict[str, Any]:
        """Plain data, for the fork server."""
        return asdict(self)


def confine(request: int, reply: int, null: int, limits: Limits, parent: int) -> None:
    """Own session, no files but two pipes, bounded resources, no identity. Raises OSError where any of it fails."""
    os.setsid()
    _keep_only(request, reply, null)
    for kind, value in (
        (resource.RLIMIT_AS, limits.memory),
        (resource.RLIMIT_CPU, limits.cpu),
        (resource.RLIMIT_FSIZE, 0),
        (resource.RLIMIT_CORE, 0),
        (resource.RLIMIT_NOFILE, 16),
    ):
        resource.setrlimit(kind, (value, value))
    _become_nobody()
    resource.setrlimit(resource.RLIMIT_NPROC, (0, 0))
    seccomp.die_with_parent(signal.SIGKILL)
    if os.getppid() != parent:  # it died before we could ask to be told
        os._exit(0)


def _keep_only(request: int, reply: int, null: int) -> None:
    """Arrange descriptors: 0-2 /dev/null, 3 request, 4 reply, nothing else."""
    request, reply, null = (fcntl.fcntl(fd, fcntl.F_DUPFD_CLOEXEC, REPLY_FD + 1) for fd in (request, reply, null))
    for target, fd in ((0, null), (1, null), (2, null), (REQUEST_FD, request), (REPLY_FD, reply)):
        os.dup2(fd, target, inheritable=False)
    os.closerange(REPLY_FD + 1, MOST_FILES)


def _become_nobody() -> None:
    """Drop root, where we have it. One more wall, not the wall: inside some containers `nobody` does not exist."""
    if os.geteuid() != 0:
        return
    try:
        os.setgroups([])
        os.setgid(NOBODY)
        os.setuid(NOBODY)
    except OSError:
        return


def lock(arch: Architecture | None) -> bool:
    """Install the filter and ask the kernel whether it holds. False where it does not."""
    if arch is None:
        return False
    try:
        seccomp.install(arch)
    except OSError:
        return False
    return seccomp.enforced()
