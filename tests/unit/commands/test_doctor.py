import json
import subprocess
import sys

import pytest

from gap_cli.commands import doctor as checks
from gap_runtime.plugins import load_registry

PLUGIN = """
import os, time
from gap_runtime.contracts.failures import GapError
from gap_runtime.hookspecs import hookimpl

def fine(): return "all is well"
def lacks(): raise GapError("No paint here.", hint="apt install paint")
def crashes(): os.abort()
def hangs(): time.sleep(600)

@hookimpl
def gap_register_checks(register):
    for check in (fine, lacks, crashes, hangs): register(check.__name__, check)
"""


@pytest.fixture
def painter(install, monkeypatch):
    monkeypatch.setattr(checks, "LIMIT_S", 8.0)
    return install("painter", PLUGIN)


def test_a_check_of_a_plugin_may_fail_crash_or_hang(painter):
    found = {name: checks._ask(name) for name in ("fine", "lacks", "crashes", "hangs")}
    assert found["fine"].ok and found["fine"].found == "all is well"
    assert (found["lacks"].ok, found["lacks"].hint) == (False, "apt install paint")
    assert not found["crashes"].ok and not found["hangs"].ok
    assert "no answer" in found["hangs"].found


def test_what_is_needed_and_missing_exits_1(gap, monkeypatch):
    monkeypatch.setattr(checks, "_torch", lambda: checks.Finding("torch", False, "not installed", "make setup"))
    monkeypatch.setattr(checks, "_ask", lambda name: checks.Finding(name, True, "asked"))
    done = gap("doctor")
    assert done.code == 1 and "MISSING" in done.out and "make setup" in done.out


def test_what_is_optional_and_missing_does_not(gap, monkeypatch):
    monkeypatch.setattr(checks, "_extras", lambda: [checks.Finding("gold", False, "shiny", "dig", needed=False)])
    monkeypatch.setattr(checks, "_ask", lambda name: checks.Finding(name, True, "asked"))
    monkeypatch.setattr(checks, "_sandbox", lambda: checks.Finding("sandbox", True, "seccomp"))
    done = gap("doctor", "--json")
    data = json.loads(done.out)
    assert done.code == 0 and data["ok"]
    assert {"check": "gold", "ok": False, "found": "shiny", "hint": "dig", "needed": False} in data["checks"]


def test_every_registered_check_is_asked(monkeypatch, tmp_path):
    asked = []
    monkeypatch.setattr(checks, "_ask", lambda name: asked.append(name) or checks.Finding(name, True, ""))
    checks.run_checks(tmp_path)
    assert asked == sorted(load_registry().checks) != []


def test_torch_is_recognised_without_being_imported():
    code = (
        "import sys; from gap_cli.commands import doctor as checks\n"
        "found = checks._torch(); print(found.ok, found.found, 'torch' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout.startswith("True ") and "CPU build" in done.stdout and done.stdout.endswith(" False\n")


def test_a_folder_not_made_yet_is_fine(tmp_path):
    assert checks._disk(tmp_path / "not" / "yet" / "there").ok


def test_a_folder_that_cannot_be_used_is_named(tmp_path, monkeypatch):
    monkeypatch.setattr(checks.os, "access", lambda path, mode: False)
    finding = checks._disk(tmp_path / "runs")
    assert not finding.ok and str(tmp_path) in finding.found and "--root" in finding.hint


def test_a_full_disk_is_told_with_what_is_needed(tmp_path, monkeypatch):
    monkeypatch.setattr(checks, "NEEDED_MB", 10**12)
    assert not checks._disk(tmp_path).ok and "10" in checks._disk(tmp_path).hint
