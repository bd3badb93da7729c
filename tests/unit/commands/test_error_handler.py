"""What the shell and the terminal see of success, mistakes, bugs and interruptions."""

import os
import subprocess
import sys

import pytest

from gap_cli.commands import error_handler
from gap_runtime.errors import Finding, GapError, PrivilegedReadError, WorkflowError

GAP = [sys.executable, "-m", "gap_cli.main"]


def said(capsys, error):
    code = error_handler.report(error, ["gap"])
    return code, capsys.readouterr().err.splitlines()


def test_a_mistake_is_one_line_and_a_hint(capsys):
    assert said(capsys, GapError("This is\nwrong.", hint="Type\nthat.")) == (
        1,
        ["error: This is wrong.", "  Type that."],
    )


def test_every_finding_is_shown_up_to_a_point(capsys):
    findings = [Finding(f"nodes.{i:02d}", "S1", "is odd", "mend it") for i in range(30)]
    code, lines = said(capsys, WorkflowError(findings))
    assert code == 1
    assert lines[1] == "  S1 nodes.00: is odd mend it"
    assert lines[-1] == "  ... and 10 more"


@pytest.mark.parametrize("bug", [ValueError("no such thing"), PrivilegedReadError("Node peeked.")])
def test_a_bug_leaves_a_log(capsys, logs, bug):
    try:
        raise bug
    except Exception as error:
        code, lines = said(capsys, error)
    (log,) = logs.iterdir()
    assert code == 3 and str(log) in lines[1]
    assert "Traceback" in log.read_text() and str(bug) in log.read_text()


def test_a_bug_is_told_even_where_no_log_can_be_written(capsys, monkeypatch, tmp_path):
    (tmp_path / "file").write_text("")
    monkeypatch.setattr(error_handler, "state_folders", lambda: [tmp_path / "file" / "below"])
    code, lines = said(capsys, KeyError("x"))
    assert code == 3 and any("KeyError" in line for line in lines)


def test_interruption_is_130(capsys):
    assert said(capsys, KeyboardInterrupt()) == (130, ["Interrupted."])


def run(*arguments, **env):
    command = [*GAP, *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=60, env={**os.environ, **env}, check=False)


def test_an_unread_pipe_is_no_error():
    command = f"{' '.join(GAP)} tools list --json | head -c 1"
    done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout == "[" and done.stderr == ""


@pytest.mark.parametrize(
    "env",
    [{"NO_COLOR": "1"}, {"COLUMNS": "20"}, {"LANG": "C", "LC_ALL": "C", "PYTHONIOENCODING": "ascii"}, {"TERM": "dumb"}],
    ids=lambda e: next(iter(e)),
)
def test_any_terminal_will_do(env):
    done = run("tasks", "show", "fulfill-grocery", **env)
    assert done.returncode == 0 and done.stderr == ""
    assert "alphabet" in done.stdout and "\x1b" not in done.stdout


@pytest.mark.parametrize(
    ("shell", "code", "err"),
    [
        ("{gap} tasks list >&-", 0, ""),
        ("{gap} tasks list 2>&-", 0, ""),
        ("{gap} tasks list >/dev/full", 1, "error: The output cannot be written: No space left on device.\n"),
        ("mkdir d; cd d; rmdir ../d; {gap} tasks list", 1, "error: The working directory no longer exists.\n"),
    ],
)
def test_what_the_shell_takes_away_is_no_crash(tmp_path, shell, code, err):
    command = ["bash", "-c", shell.format(gap=" ".join(GAP))]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, cwd=tmp_path, check=False)
    assert done.returncode == code and done.stderr.startswith(err) and "Traceback" not in done.stderr


@pytest.mark.parametrize("arguments", [("tasks", "list"), ("tools", "list"), ("skills", "list")], ids=" ".join)
def test_tables_fit_a_narrow_terminal(gap, monkeypatch, arguments):
    monkeypatch.setenv("COLUMNS", "20")
    out = gap(*arguments).out
    assert out and max(map(len, out.splitlines())) <= 20


def test_a_home_that_is_missing_is_no_error():
    done = run("tools", "list", "--json", HOME="/nowhere", TMPDIR="/nowhere")
    assert done.returncode == 0 and done.stderr == ""


def test_usage_errors_are_2():
    for arguments in (["rehearse", "-n", "0"], ["rehears"], ["plan"], ["plan", "--task"]):
        done = run(*arguments)
        assert done.returncode == 2 and "Traceback" not in done.stderr
