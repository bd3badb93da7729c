"""The local engine against real worker processes that misbehave in every way a worker can."""

import os
import signal
import sys
import textwrap
import threading
import time
from pathlib import Path

import pytest

from gap_cli.rehearse.pool import LocalEngine
from gap_runtime.contracts.engine import RehearsalJob
from gap_runtime.errors import GapError, RunError

WORKER = """
import ctypes, os, signal, sys, time
from gap_runtime.contracts.engine import EpisodeResult
from gap_runtime.errors import GapError
from gap_cli.rehearse.process import decode_job
from gap_cli.rehearse.worker import serve

def roll(seed):
    {roll}
    return EpisodeResult(seed, {{"seed": seed, "pid": os.getpid()}}, {{"seed": seed}})

def make(job):
    {make}
    return roll

serve(*(int(a) for a in sys.argv[1:4]), decode_job(sys.argv[4]), make)
"""


@pytest.fixture
def job(tmp_path):
    return RehearsalJob(tmp_path, tmp_path / "out", wall_limit_s=3.0)


@pytest.fixture
def rehearse(tmp_path, job):
    def run(seeds, roll="pass", make="pass", workers=2, stop=None, on_result=lambda r: None):
        script = tmp_path / "worker.py"
        script.write_text(WORKER.format(roll=textwrap.indent(roll, "    ").strip(), make=make))
        got = {}

        def report(result):
            assert result.seed not in got
            got[result.seed] = result.row
            on_result(result)

        engine = LocalEngine(workers, (sys.executable, str(script)))
        engine.run(job, seeds, report, stop or threading.Event())
        return got

    return run


def test_every_seed_is_rolled_out_once(rehearse):
    assert sorted(rehearse(range(7))) == list(range(7))


def test_one_worker_does_the_work_of_two(rehearse):
    rows = rehearse(range(4), workers=1)
    assert len({row["pid"] for row in rows.values()}) == 1


@pytest.mark.parametrize(
    ("death", "reason"),
    [
        ("ctypes.string_at(0)", "SIGSEGV"),
        ("os.kill(os.getpid(), signal.SIGKILL)", "out of memory"),
        ("raise MemoryError", "out of memory"),
        ("raise ValueError('the model has no such body')", "ValueError: the model has no such body"),
        ("os._exit(7)", "exited with code 7"),
    ],
)
def test_a_dead_worker_costs_one_episode_and_says_why(rehearse, death, reason):
    rows = rehearse(range(4), roll=f"if seed == 1: {death}")
    assert sorted(rows) == [0, 1, 2, 3]
    assert rows[1]["status"] == "crashed" and reason in rows[1]["reason"]
    assert rows[1]["void"] and not rows[1]["success"]
    assert all("pid" in rows[seed] for seed in (0, 2, 3))


def test_a_hung_worker_is_killed_even_when_deaf(rehearse):
    rows = rehearse(
        range(3), roll="if seed == 1:\n    signal.signal(signal.SIGTERM, signal.SIG_IGN)\n    time.sleep(600)"
    )
    assert rows[1]["status"] == "hung" and "pid" in rows[0] and "pid" in rows[2]


def test_what_is_wrong_for_every_episode_ends_the_rehearsal(rehearse):
    with pytest.raises(GapError, match="no such camera") as caught:
        rehearse(range(3), make="raise GapError('no such camera', hint='There is agentview.')")
    assert caught.value.hint == "There is agentview."


def test_workers_that_cannot_start_end_the_rehearsal(rehearse):
    with pytest.raises(RunError, match="cannot start"):
        rehearse(range(3), make="os._exit(9)")


def test_once_stopped_no_new_episode_starts_and_those_under_way_are_kept(rehearse):
    stop = threading.Event()
    rows = rehearse(range(50), roll="time.sleep(0.2)", stop=stop, on_result=lambda _: stop.set())
    assert 1 <= len(rows) <= 3


def test_no_worker_outlives_a_rehearsal_that_was_cut_off(rehearse, tmp_path):
    pids = []

    def interrupt(result):
        pids.append(result.row["pid"])
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        rehearse(range(6), roll="time.sleep(0.1)", on_result=interrupt)
    for pid in pids:
        with pytest.raises(ProcessLookupError):
            os.kill(pid, 0)


PARENT = """
import sys, threading
from pathlib import Path
from gap_runtime.contracts.engine import RehearsalJob
from gap_cli.rehearse.pool import LocalEngine
folder = Path(sys.argv[1])
job = RehearsalJob(folder, folder / "out")
LocalEngine(1, (sys.executable, str(folder / "worker.py"))).run(job, range(9), print, threading.Event())
"""


def test_workers_die_with_a_rehearsal_that_was_killed(tmp_path):
    import subprocess

    roll = f"open({str(tmp_path / 'pid')!r}, 'w').write(str(os.getpid())); time.sleep(600)"
    (tmp_path / "worker.py").write_text(WORKER.format(roll=roll, make="pass"))
    with subprocess.Popen([sys.executable, "-c", PARENT, str(tmp_path)]) as parent:
        until(lambda: (tmp_path / "pid").is_file() and (tmp_path / "pid").read_text())
        parent.send_signal(signal.SIGKILL)
    pid = int((tmp_path / "pid").read_text())
    until(lambda: gone(pid))


def gone(pid):
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return True
    return Path(f"/proc/{pid}/stat").read_text().split(")")[1].split()[0] == "Z"


def until(condition, limit=20.0):
    end = time.monotonic() + limit
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.02)
