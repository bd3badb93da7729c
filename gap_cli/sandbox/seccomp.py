"""A seccomp allow-list, assembled here and installed through libc: no compiler, no library, no privilege."""

from __future__ import annotations

import ctypes
import errno
import os
import struct

from gap_cli.sandbox.syscalls import Architecture

# linux/bpf_common.h, linux/seccomp.h, linux/prctl.h
LD_WORD, JUMP_EQUAL, JUMP_GREATER_EQUAL, JUMP_BITS, RETURN = 0x20, 0x15, 0x35, 0x45, 0x06
ALLOW, KILL, REFUSE = 0x7FFF0000, 0x80000000, 0x00050000 | errno.EPERM
AT_NUMBER, AT_ARCHITECTURE, AT_THIRD_ARGUMENT = 0, 4, 32
PROT_EXEC = 4
PR_SET_PDEATHSIG, PR_SET_SECCOMP, PR_SET_NO_NEW_PRIVS = 1, 22, 38
MODE_FILTER = 2

Instruction = tuple[int, int, int, int]  # code, jump if true, jump if false, operand


def program(arch: Architecture) -> list[Instruction]:
    """The filter: kill on a foreign ABI or an unknown call, EPERM for `refused`, allow the rest of the table."""
    tests = [(n, "allow") for n in arch.allowed]
    tests += [(n, "no_exec") for n in arch.no_exec]
    tests += [(n, "refuse") for n in arch.refused]
    head: list[Instruction] = [(LD_WORD, 0, 0, AT_ARCHITECTURE), (JUMP_EQUAL, 1, 0, arch.audit), (RETURN, 0, 0, KILL)]
    head.append((LD_WORD, 0, 0, AT_NUMBER))
    if arch.foreign_from is not None:
        head += [(JUMP_GREATER_EQUAL, 0, 1, arch.foreign_from), (RETURN, 0, 0, KILL)]
    tail: list[Instruction] = [
        (RETURN, 0, 0, KILL),
        (RETURN, 0, 0, ALLOW),
        (RETURN, 0, 0, REFUSE),
        (LD_WORD, 0, 0, AT_THIRD_ARGUMENT),
        (JUMP_BITS, 0, 1, PROT_EXEC),
        (RETURN, 0, 0, KILL),
        (RETURN, 0, 0, ALLOW),
    ]
    landing = {"allow": 1, "refuse": 2, "no_exec": 3}
    body = [(JUMP_EQUAL, len(tests) - 1 - i + landing[to], 0, number) for i, (number, to) in enumerate(tests)]
    return head + body + tail


class _Program(ctypes.Structure):
    _fields_ = [("length", ctypes.c_ushort), ("filter", ctypes.c_void_p)]


def _prctl(option: int, *arguments: int) -> None:
    libc = ctypes.CDLL(None, use_errno=True)
    padded = [ctypes.c_ulong(a) for a in (*arguments, 0, 0, 0, 0)][:4]
    if libc.prctl(ctypes.c_int(option), *padded) != 0:
        code = ctypes.get_errno()
        raise OSError(code, os.strerror(code))


def die_with_parent(signal: int) -> None:
    """Have the kernel send `signal` to this process when its parent dies. Raises OSError."""
    _prctl(PR_SET_PDEATHSIG, signal)


def install(arch: Architecture) -> None:
    """Put this process under the filter, for good. Raises OSError where the kernel refuses."""
    code = b"".join(struct.pack("HBBI", *instruction) for instruction in program(arch))
    buffer = ctypes.create_string_buffer(code, len(code))
    filter_ = _Program(len(code) // 8, ctypes.addressof(buffer))
    _prctl(PR_SET_NO_NEW_PRIVS, 1)
    _prctl(PR_SET_SECCOMP, MODE_FILTER, ctypes.addressof(filter_))


def enforced() -> bool:
    """True when opening a file is refused the way the filter refuses, asked of the kernel itself."""
    try:
        fd = os.open("/", os.O_RDONLY)
    except PermissionError as error:
        return error.errno == errno.EPERM
    except OSError:
        return False
    os.close(fd)
    return False
