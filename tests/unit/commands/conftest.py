from __future__ import annotations

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
