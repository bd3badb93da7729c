from __future__ import annotations

import os
import sys
from dataclasses import dataclass

import pytest

from gap_cli import main as main_module
from gap_cli.commands import error_handler


@dataclass(frozen=True)
class Done:
    code: int
    out: str
    err: str

    @property
    def lines(self):
        return self.err.splitlines()


class HardExit(BaseException):
    """Stands for os._exit, which would end the tests."""


@pytest.fixture
def gap(monkeypatch, capsys, tmp_path):
    """Run the command line in this process, in an empty folder: exit code, stdout, stderr."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")

    def hard_exit(code):
        raise HardExit(code)

    monkeypatch.setattr(main_module.os, "_exit", hard_exit)

    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["gap", *map(str, arguments)])
        capsys.readouterr()
        code = 0
        try:
            main_module.main()
        except (SystemExit, HardExit) as ended:
            code = int(ended.args[0] or 0) if ended.args else 0
        out, err = capsys.readouterr()
        return Done(code, out, err)

    return run


@pytest.fixture
def logs(monkeypatch, tmp_path):
    """Where bugs are written down."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    assert error_handler.state_folders()[0] == tmp_path / "state" / "gap"
    return tmp_path / "state" / "gap"


@pytest.fixture
def install(tmp_path_factory, monkeypatch):
    """`install(name, source)`: a plugin of one module, installed here and in every process started from here."""
    site = tmp_path_factory.mktemp("site")
    inherited = [p for p in os.environ.get("PYTHONPATH", "").split(os.pathsep) if p]
    monkeypatch.syspath_prepend(str(site))
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(site), *inherited]))
    installed = []

    def make(name, source):
        installed.append(name)
        sys.modules.pop(name, None)
        files = {
            f"{name}.py": source,
            f"{name}-1.dist-info/METADATA": f"Metadata-Version: 2.1\nName: {name}\nVersion: 1\n",
            f"{name}-1.dist-info/entry_points.txt": f"[gap]\n{name} = {name}\n",
        }
        for file, text in files.items():
            (site / file).parent.mkdir(parents=True, exist_ok=True)
            (site / file).write_text(text)
        return site

    yield make
    for name in installed:
        sys.modules.pop(name, None)
