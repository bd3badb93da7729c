import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from gap_cli.sandbox.confine import Limits
from gap_cli.sandbox.server import ForkServer
from gap_runtime.errors import SandboxError

WORKER = "gap_cli.sandbox.builder_child"


@pytest.fixture(scope="module")
def server():
    made = ForkServer(WORKER)
    if made.level() == "none":
        pytest.skip("this kernel has no seccomp: nothing would run")
    yield made
    made.close()


def job(server, seconds=5):
    return server.job(Limits(), seconds, unsafe=False)


def gone(pid, within=5.0):
    until = time.monotonic() + within
    while time.monotonic() < until:
        try:
            state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
        except (FileNotFoundError, ProcessLookupError):
            return True
        if state == "Z":  # dead; its reaper is the container's, not ours
            return True
        time.sleep(0.01)
    return False


def test_a_child_is_gone_when_its_block_is_left(server):
    with job(server) as running:
        assert not gone(running.pid, within=0.05)
    assert gone(running.pid)
    assert os.WTERMSIG(running.status) == signal.SIGKILL


def test_children_run_side_by_side(server):
    with job(server) as a, job(server) as b:
        assert a.pid != b.pid
        a.end()
        assert not gone(b.pid, within=0.05)


def test_a_child_sees_two_pipes_and_no_other_descriptor(server):
    with job(server) as running:
        time.sleep(0.1)
        links = {int(p.name): str(p.readlink()) for p in Path(f"/proc/{running.pid}/fd").iterdir()}
    assert sorted(links) == [0, 1, 2, 3, 4]
    assert {links[n] for n in (0, 1, 2)} == {"/dev/null"}
    assert links[3].startswith("pipe:")
    assert links[4].startswith("pipe:")


def test_a_child_has_its_own_session_no_privileges_no_environment_and_a_directory_that_is_gone(monkeypatch, server):
    server.close()
    monkeypatch.setenv("SECRET_KEY", "hunter2")
    with job(server) as running:
        time.sleep(0.1)
        assert os.getsid(running.pid) == running.pid
        status = dict(line.split(":", 1) for line in Path(f"/proc/{running.pid}/status").read_text().splitlines())
        assert status["Seccomp"].strip() == "2"
        assert status["NoNewPrivs"].strip() == "1"
        assert str(Path(f"/proc/{running.pid}/cwd").readlink()).endswith("(deleted)")
        assert b"hunter2" not in Path(f"/proc/{running.pid}/environ").read_bytes()


def test_a_killed_server_takes_its_children_along_and_is_replaced(server):
    with job(server) as running:
        os.kill(server._process.pid, signal.SIGKILL)
        assert gone(running.pid)
        with pytest.raises(SandboxError, match="died"):
            server.ask({"op": "finish", "pid": running.pid})
    with job(server) as again:
        assert not gone(again.pid, within=0.05)


def test_a_server_that_cannot_start_says_why():
    with pytest.raises(SandboxError, match="no_such_worker") as caught:
        ForkServer("no_such_worker").level()
    assert caught.value.cause == "unavailable"


def test_a_pid_that_is_not_its_child_is_never_signalled(server):
    answer = server.ask({"op": "finish", "pid": os.getpid()})
    assert "no such child" in answer["error"]


def test_threads_share_a_server(server):
    seen = []
    with job(server):
        pid = server._process.pid

    def work():
        for _ in range(5):
            with job(server) as running:
                seen.append(running.pid)

    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(seen) == 20 and server._process.pid == pid


def test_a_killed_host_leaves_no_server_and_no_child():
    code = (
        "import os, time\n"
        "from gap_cli.sandbox.confine import Limits\n"
        "from gap_cli.sandbox.server import ForkServer\n"
        f"server = ForkServer({WORKER!r})\n"
        "with server.job(Limits(), 60, unsafe=True) as job:\n"
        "    print(server._process.pid, job.pid, flush=True)\n"
        "    time.sleep(60)\n"
    )
    host = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    pids = [int(pid) for pid in host.stdout.readline().split()]
    host.kill()
    host.wait()
    host.stdout.close()
    assert len(pids) == 2
    assert all(gone(pid) for pid in pids)


def test_a_forked_host_does_not_touch_the_parents_server(server):
    server.level()
    child = os.fork()
    if child == 0:
        status = 1
        try:
            server.close()  # knows nothing of the parent's server, so stops nothing
            status = 0
        finally:
            os._exit(status)
    assert os.waitpid(child, 0)[1] == 0
    with job(server) as running:
        assert not gone(running.pid, within=0.05)
