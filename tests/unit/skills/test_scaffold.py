"""`gap skills new`: what it writes is a plugin that registers, keeps its contract and runs."""

from __future__ import annotations

import subprocess
import sys

import pytest

from gap_cli.author.skill_check import check_skill, run_alone
from gap_cli.skills import load_library
from gap_cli.skills.scaffold import new_plugin
from gap_runtime.errors import BadRequestError, StorageError
from gap_runtime.plugins import load_registry
from gap_runtime.testing import FakeCell


@pytest.fixture
def registry(tmp_path, monkeypatch):
    new_plugin("wave-hello", tmp_path)
    monkeypatch.syspath_prepend(tmp_path / "wave-hello")
    yield load_registry(("gap_wave_hello",), entry_points=False)
    for name in [m for m in sys.modules if m.startswith("gap_wave_hello")]:
        del sys.modules[name]


def test_the_plugin_registers_and_keeps_its_contract(registry):
    assert registry.broken == {}
    skill = load_library(registry.skill_paths)["wave-hello"]
    assert check_skill(skill, {n: t.spec for n, t in registry.tools.items()}) == []


def test_a_graph_of_its_skill_calls_its_tool(registry, tmp_path):
    world = FakeCell()
    skill = load_library(registry.skill_paths)["wave-hello"]
    result = run_alone(skill, registry.tools, world, tmp_path)
    assert (result.status, result.exits) == ("success", [("sample", "ready")])
    assert world.arms[0].commands == ["set_width"]


def test_a_hand_that_does_not_open_fails_the_skill(registry, tmp_path, monkeypatch):
    world = FakeCell()
    jaws = world.arms[0].gripper
    jaws.close()
    monkeypatch.setattr(jaws, "set_width", lambda width, **_: jaws.state())
    result = run_alone(load_library(registry.skill_paths)["wave-hello"], registry.tools, world, tmp_path)
    assert result.exits == [("sample", "failed")]
    assert "0% open instead of 100%" in result.error


def test_what_it_writes_is_tidy(tmp_path):
    new_plugin("a-b-c", tmp_path)
    files = [str(p) for p in (tmp_path / "a-b-c").rglob("*.py")]
    for arguments in (["check", "--select", "E,F,W,B,UP,SIM,RUF"], ["format", "--check"]):
        command = [sys.executable, "-m", "ruff", *arguments, "--line-length", "120", "--no-cache", *files]
        done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
        assert done.returncode == 0, done.stdout
    assert not [p for p in (tmp_path / "a-b-c").rglob("*") if p.is_file() and "[[" in p.read_text()]


@pytest.mark.parametrize("name", ["", "Wave", "wave_hello", "-a", "a--b", "../x", "a" * 51, "3d", "wave hello"])
def test_a_name_no_skill_can_have_is_refused(tmp_path, name):
    with pytest.raises(BadRequestError, match="wave-hello"):
        new_plugin(name, tmp_path)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("name", "words"),
    [("cli", "gap-cli"), ("runtime", "gap-runtime"), ("mujoco", "gap_mujoco"), ("pour", "a skill")],
)
def test_a_name_that_is_taken_is_refused(tmp_path, name, words):
    with pytest.raises(BadRequestError, match=words):
        new_plugin(name, tmp_path, {"pour"})
    assert list(tmp_path.iterdir()) == []


def test_nothing_is_overwritten(tmp_path):
    (tmp_path / "wave-hello").mkdir()
    with pytest.raises(StorageError, match="exists already"):
        new_plugin("wave-hello", tmp_path)
    assert list((tmp_path / "wave-hello").iterdir()) == []


def test_a_disk_that_refuses_is_one_error(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(StorageError, match=r"cannot be written|exists already"):
        new_plugin("wave-hello", tmp_path / "file")
