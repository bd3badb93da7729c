"""The filter as the kernel would run it, for both architectures, on any machine."""

import re
from pathlib import Path

import pytest

from gap_cli.sandbox import seccomp, syscalls
from gap_cli.sandbox.seccomp import ALLOW, KILL, PROT_EXEC, REFUSE, program

MACHINES = {"x86_64": 0, "aarch64": 1}
HEADERS = {
    "x86_64": (Path("/usr/include/x86_64-linux-gnu/asm/unistd_64.h"), r"#define __NR_(\w+)\s+(\d+)"),
    "aarch64": (Path("/usr/include/asm-generic/unistd.h"), r"#define __NR(?:3264)?_(\w+)\s+(\d+)"),
}
GENERIC_NAMES = {"newfstatat": "fstatat"}  # asm-generic/unistd.h gives the 64-bit names by macro


def verdict(arch, number, *, audit=None, third=0):
    """A small interpreter of the instructions the filter is made of."""
    data = {seccomp.AT_NUMBER: number, seccomp.AT_ARCHITECTURE: audit or arch.audit, seccomp.AT_THIRD_ARGUMENT: third}
    code, at, register = program(arch), 0, 0
    while True:
        operation, if_true, if_false, operand = code[at]
        at += 1
        if operation == seccomp.RETURN:
            return operand
        if operation == seccomp.LD_WORD:
            register = data[operand]
            continue
        holds = {
            seccomp.JUMP_EQUAL: register == operand,
            seccomp.JUMP_GREATER_EQUAL: register >= operand,
            seccomp.JUMP_BITS: bool(register & operand),
        }[operation]
        at += if_true if holds else if_false


@pytest.fixture(params=MACHINES)
def machine(request):
    return request.param


def numbers(table, machine):
    return {row[MACHINES[machine]] for row in table.values()} - {None}


def test_every_number_gets_the_verdict_of_the_table(machine):
    arch = syscalls.architecture(machine)
    allowed = numbers(syscalls.ALLOWED, machine) | numbers(syscalls.NO_EXEC, machine)
    refused = numbers(syscalls.REFUSED, machine)
    assert not allowed & refused
    for number in range(1024):
        expected = ALLOW if number in allowed else REFUSE if number in refused else KILL
        assert verdict(arch, number) == expected, number


def test_memory_may_not_become_executable(machine):
    arch = syscalls.architecture(machine)
    for number in arch.no_exec:
        assert verdict(arch, number, third=3) == ALLOW
        assert verdict(arch, number, third=PROT_EXEC) == verdict(arch, number, third=7) == KILL


def test_another_abi_is_killed_whatever_it_asks(machine):
    arch = syscalls.architecture(machine)
    i386 = 0x40000003
    assert verdict(arch, arch.allowed[0], audit=i386) == KILL
    assert verdict(arch, arch.allowed[0] | 0x40000000) == KILL
    assert verdict(arch, 0xFFFFFFFF) == KILL


@pytest.mark.parametrize("name", ["execve", "socket", "clone", "clone3", "kill", "ptrace", "prctl", "io_uring_setup"])
def test_nothing_that_reaches_out_is_in_any_table(name):
    assert name not in {**syscalls.ALLOWED, **syscalls.NO_EXEC, **syscalls.REFUSED}


def test_the_numbers_are_the_kernels(machine):
    header, pattern = HEADERS[machine]
    if not header.exists():
        pytest.skip(f"{header} is not installed")
    known = {name: int(number) for name, number in re.findall(pattern, header.read_text())}
    for name, row in {**syscalls.ALLOWED, **syscalls.NO_EXEC, **syscalls.REFUSED}.items():
        ours = row[MACHINES[machine]]
        theirs = known.get(name, known.get(GENERIC_NAMES.get(name, "")))
        assert ours == theirs, name


def test_an_unknown_machine_has_no_table():
    assert syscalls.architecture("riscv64") is None
    assert syscalls.architecture("AMD64") == syscalls.architecture("x86_64")
    assert syscalls.architecture("arm64") == syscalls.architecture("aarch64")
