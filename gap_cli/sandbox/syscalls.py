"""The system calls jailed code may make, by number, for the two architectures the jail knows."""

from __future__ import annotations

from dataclasses import dataclass

# name: (x86_64, aarch64); None where the architecture has no such call. Sources: asm/unistd_64.h, asm-generic/unistd.h.
ALLOWED: dict[str, tuple[int | None, int | None]] = {
    "read": (0, 63),
    "readv": (19, 65),
    "write": (1, 64),
    "futex": (202, 98),
    "brk": (12, 214),
    "munmap": (11, 215),
    "mremap": (25, 216),
    "madvise": (28, 233),
    "close": (3, 57),
    "clock_gettime": (228, 113),
    "clock_getres": (229, 114),
    "clock_nanosleep": (230, 115),
    "nanosleep": (35, 101),
    "gettimeofday": (96, 169),
    "time": (201, None),
    "rt_sigreturn": (15, 139),
    "rt_sigprocmask": (14, 135),
    "restart_syscall": (219, 128),
    "getpid": (39, 172),
    "gettid": (186, 178),
    "sched_yield": (24, 124),
    "sched_getaffinity": (204, 123),
    "exit": (60, 93),
    "exit_group": (231, 94),
}

# Allowed unless they ask for executable memory: the protection is their third argument.
NO_EXEC: dict[str, tuple[int | None, int | None]] = {"mmap": (9, 222), "mprotect": (10, 226)}

# Refused with EPERM instead of death, because libraries ask innocently (a lazy import looks for its file).
# getrandom is among them so that a result cannot depend on entropy: seed every generator.
REFUSED: dict[str, tuple[int | None, int | None]] = {
    "open": (2, None),
    "openat": (257, 56),
    "openat2": (437, 437),
    "stat": (4, None),
    "lstat": (6, None),
    "fstat": (5, 80),
    "newfstatat": (262, 79),
    "statx": (332, 291),
    "access": (21, None),
    "faccessat": (269, 48),
    "faccessat2": (439, 439),
    "readlink": (89, None),
    "readlinkat": (267, 78),
    "getcwd": (79, 17),
    "getdents64": (217, 61),
    "lseek": (8, 62),
    "ioctl": (16, 29),
    "fcntl": (72, 25),
    "uname": (63, 160),
    "getuid": (102, 174),
    "geteuid": (107, 175),
    "getgid": (104, 176),
    "getegid": (108, 177),
    "getppid": (110, 173),
    "getrusage": (98, 165),
    "sysinfo": (99, 179),
    "getrandom": (318, 278),
}


@dataclass(frozen=True)
class Architecture:
    """A machine as the kernel's filter sees it. `audit` is its AUDIT_ARCH; numbers from `foreign_from` up belong to
    another ABI of the same machine (x32) and are never let through."""

    audit: int
    allowed: tuple[int, ...]
    no_exec: tuple[int, ...]
    refused: tuple[int, ...]
    foreign_from: int | None = None


def architecture(machine: str) -> Architecture | None:
    """The table of `platform.machine()`, or None where the jail knows none."""
    column = {"x86_64": 0, "amd64": 0, "aarch64": 1, "arm64": 1}.get(machine.lower())
    if column is None:
        return None

    def numbers(table: dict[str, tuple[int | None, int | None]]) -> tuple[int, ...]:
        return tuple(n for row in table.values() if (n := row[column]) is not None)

    audit, foreign = ((0xC000003E, 0x40000000), (0xC00000B7, None))[column]
    return Architecture(audit, numbers(ALLOWED), numbers(NO_EXEC), numbers(REFUSED), foreign)
