"""Every payload of the corpus, in the jail without its lint: one typed error or a harmless value, and nothing left."""

import contextlib
import platform
import resource
import shutil
import socket
import tempfile
import textwrap
from pathlib import Path

import pytest

from gap_cli.sandbox import ScriptJail, run_builder
from gap_cli.sandbox.server import ForkServer
from gap_runtime.errors import GapError, SandboxError, UnknownNameError
from tests.unit.sandbox import corpus

SHORT_S, LONG_S = 0.5, 30.0  # for what is meant to run out of time, and for everything else on a busy machine
X86 = platform.machine() == "x86_64"
ANYWHERE = ["files", "processes", "sockets", "language", "bombs", *["kernel"] * X86]
BUILDER = [payload for name in [*ANYWHERE, "builder_output"] for payload in corpus.read(name)]
SCRIPT = [payload for name in ["numpy", "rpc"] for payload in corpus.read(name)]
HOST_GROWTH_KB = 300_000
HELP = """
import ctypes, os, msgpack, struct
libc = ctypes.CDLL(None)
def frame(data): os.write(4, struct.pack("<I", len(data)) + data)
"""
SCRIPT_HELP = """
import numpy as np
from gap_cli.sandbox.framing import write_frame
def raw(data): write_frame(4, data)
def ext(code, data): return msgpack.ExtType(code, data)
def send(value): raw(msgpack.packb(["return", value]))
"""


class Range:
    """A place to shoot at: a directory anybody may write to, a listening socket, and the servers under fire."""

    def __init__(self):
        self.folder = Path(tempfile.mkdtemp(prefix="gap-canary-"))
        self.folder.chmod(0o777)
        self.scripts = Path(tempfile.mkdtemp(prefix="gap-scripts-"))
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.listener.setblocking(False)
        self.builder = {jailed: self._server("unlinted_builder", jailed) for jailed in (True, False)}
        self.script = {jailed: self._server("unlinted_script", jailed) for jailed in (True, False)}

    @staticmethod
    def _server(worker, jailed):
        return ForkServer(worker, machine="" if jailed else "unheard-of")

    def names(self):
        port = self.listener.getsockname()[1]
        return f"CANARY = {str(self.folder / 'canary')!r}\nPORT = {port}\n{HELP}"

    def hit(self):
        """Whether anything was reached since the last call."""
        touched = bool(list(self.folder.iterdir()))
        for path in self.folder.iterdir():
            shutil.rmtree(path) if path.is_dir() and not path.is_symlink() else path.unlink()
        with contextlib.suppress(BlockingIOError):
            self.listener.accept()[0].close()
            touched = True
        return touched

    def fire_builder(self, payload, *, jailed=True):
        source, seconds = f"{self.names()}{payload.code}\nsg = Subgraph('x', skill='y')\n", wall_s(payload)
        return outcome(lambda: run_builder(source, unsafe=not jailed, wall_s=seconds, server=self.builder[jailed]))

    def fire_script(self, payload, *, jailed=True):
        path = self.scripts / f"{payload.name}.py"
        path.write_text(f"{self.names()}{SCRIPT_HELP}def run(ctx):\n{textwrap.indent(payload.code, '    ')}\n")
        jail = ScriptJail(unsafe=not jailed, max_calls=50, server=self.script[jailed])
        return outcome(lambda: jail.run(path, {}, echo, wall_s(payload)))

    def close(self):
        for server in [*self.builder.values(), *self.script.values()]:
            server.close()
        self.listener.close()
        shutil.rmtree(self.folder)
        shutil.rmtree(self.scripts)


def echo(name, inputs):
    if name != "a.Echo":
        raise UnknownNameError("tool", name, ["a.Echo"])
    return inputs["x"]


def wall_s(payload):
    return SHORT_S if "timeout" in payload.ends else LONG_S


def outcome(work):
    """'value', the cause of a `SandboxError`, or the name of another error of ours."""
    try:
        work()
    except SandboxError as error:
        assert str(error).isprintable() and len(str(error)) < 5000
        return error.cause
    except GapError as error:
        return type(error).__name__
    return "value"


def children(server):
    pid = server._process.pid
    return Path(f"/proc/{pid}/task/{pid}/children").read_text().split()


def descriptors(pid):
    return len(list(Path(f"/proc/{pid}/fd").iterdir()))


@pytest.fixture(scope="module")
def target():
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(Path(__file__).parent / "workers"))
        place = Range()
        if place.builder[True].level() == "none":
            pytest.skip("this kernel has no seccomp: nothing would run")
        yield place
        place.close()


@pytest.mark.parametrize("payload", BUILDER, ids=lambda p: p.name)
def test_builder_code_cannot(payload, target):
    assert target.fire_builder(payload) in payload.ends
    assert not target.hit()


@pytest.mark.parametrize("payload", SCRIPT, ids=lambda p: p.name)
def test_a_script_cannot(payload, target):
    assert target.fire_script(payload) in payload.ends
    assert not target.hit()


@pytest.mark.parametrize("payload", [p for p in BUILDER if p.fires], ids=lambda p: p.name)
def test_the_payload_is_live_without_the_filter(payload, target):
    target.fire_builder(payload, jailed=False)
    assert target.hit()


@pytest.mark.parametrize("payload", [p for p in SCRIPT if p.fires], ids=lambda p: p.name)
def test_the_script_payload_is_live_without_the_filter(payload, target):
    target.fire_script(payload, jailed=False)
    assert target.hit()


def test_the_host_leaves_nothing_and_keeps_nothing(target):
    """Runs last over everything at once: no child, no descriptor, no memory stays behind."""
    quiet = corpus.Payload("quiet", "pass", ("value",))
    assert target.fire_builder(quiet) == target.fire_script(quiet) == "value"
    before = descriptors("self")
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for payload in [p for p in SCRIPT if "megabytes" in p.name or "items" in p.name]:
        target.fire_script(payload)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - peak < HOST_GROWTH_KB
    assert descriptors("self") == before
    for server in [*target.builder.values(), *target.script.values()]:
        if server._process is not None:
            assert children(server) == []
            assert descriptors(server._process.pid) <= 8
