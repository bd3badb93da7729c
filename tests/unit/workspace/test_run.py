import os
import subprocess
import sys

import pytest

from gap_cli.workspace import run as run_module
from gap_cli.workspace.run import Run, RunConfig
from gap_runtime.errors import DocumentError, RunError, StorageError

ASKED = RunConfig(task="fulfill-grocery", instruction="Pick the soup")


def test_runs_of_all_tasks_share_one_numbering(tmp_path):
    names = [Run.create(tmp_path, ASKED).name for _ in range(2)]
    other = Run.create(tmp_path, RunConfig(task="pack", instruction="x"))
    assert [*names, other.name] == ["fulfill-grocery-001", "fulfill-grocery-002", "pack-003"]


def test_a_number_is_never_used_twice_even_after_a_gap(tmp_path):
    (tmp_path / "fulfill-grocery-041").mkdir()
    assert Run.create(tmp_path, ASKED).name == "fulfill-grocery-042"


def test_what_was_asked_reads_back(tmp_path):
    config = RunConfig(task="pack", instruction='say "no": yes', variant="xy20", seed=7, providers={"curobo.*": "gpu"})
    assert Run.open(tmp_path, Run.create(tmp_path, config).name).config == config


def test_two_runs_of_one_question_hold_the_same_bytes(tmp_path):
    a, b = Run.create(tmp_path, ASKED), Run.create(tmp_path, ASKED)
    assert (a.path / "run.yaml").read_bytes() == (b.path / "run.yaml").read_bytes()


@pytest.mark.parametrize("task", ["fulfill-grocery", "a-task-that-sorts-first"])
def test_the_latest_run_has_the_highest_number_whatever_the_clock_says(tmp_path, task):
    first, second = Run.create(tmp_path, ASKED), Run.create(tmp_path, ASKED.model_copy(update={"task": task}))
    for age, run in ((1, first), (2, second)):
        os.utime(run.path / "run.yaml", ns=(0, 10**18 - age))
    assert Run.open(tmp_path).name == second.name == f"{task}-002"


def test_a_run_opens_by_path(tmp_path):
    run = Run.create(tmp_path, ASKED)
    assert Run.open(tmp_path / "elsewhere", str(run.path)).name == run.name


def test_an_unknown_run_names_the_nearest(tmp_path):
    Run.create(tmp_path, ASKED)
    with pytest.raises(RunError, match="fulfill-grocery-001"):
        Run.open(tmp_path, "fulfil-grocery-001")


def test_no_run_at_all_says_what_to_type(tmp_path):
    with pytest.raises(RunError, match="gap plan"):
        Run.latest(tmp_path / "nowhere")


def test_a_damaged_run_yaml_names_file_and_line(tmp_path):
    run = Run.create(tmp_path, ASKED)
    (run.path / "run.yaml").write_text("schema: gap/run/v1\ntask: no\n")
    with pytest.raises(DocumentError, match=r"run\.yaml:2"):
        _ = run.config


def test_a_run_that_cannot_be_written_leaves_no_folder(tmp_path, monkeypatch):
    def full(*_):
        raise StorageError("Cannot write run.yaml: disk full.")

    monkeypatch.setattr(run_module, "write_yaml", full)
    with pytest.raises(StorageError):
        Run.create(tmp_path, ASKED)
    assert list(tmp_path.iterdir()) == []


def test_a_root_that_is_a_file_is_named(tmp_path):
    (tmp_path / "runs").write_text("not a folder")
    with pytest.raises(StorageError, match="runs"):
        Run.create(tmp_path / "runs", ASKED)


HOLD = """
import sys
from pathlib import Path
from gap_cli.workspace.run import Run
with Run(Path(sys.argv[1])).held():
    print("held", flush=True)
    sys.stdin.read()
"""


def test_a_second_process_is_told_who_holds_the_run(tmp_path):
    run = Run.create(tmp_path, ASKED)
    command = [sys.executable, "-c", HOLD, str(run.path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as holder:
        assert holder.stdin and holder.stdout
        assert holder.stdout.readline() == "held\n"
        with pytest.raises(RunError, match=f"in use by process {holder.pid}"), run.held():
            pass
        holder.stdin.close()
    with run.held():
        pass


def test_a_run_is_free_again_after_its_holder_was_killed(tmp_path):
    run = Run.create(tmp_path, ASKED)
    command = [sys.executable, "-c", HOLD, str(run.path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as holder:
        assert holder.stdout
        holder.stdout.readline()
        holder.kill()
    with run.held():
        pass
