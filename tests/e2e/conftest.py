"""An empty virtual environment outside the checkout, with the engine installed from its own wheel."""

from __future__ import annotations

import os
import subprocess
import sys
import sysconfig
import venv
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@dataclass(frozen=True)
class Cell:
    """A virtual environment: what a user who installed the wheel has."""

    home: Path

    @property
    def python(self) -> str:
        return str(self.home / "bin" / "python")

    def install(self, *what):
        """Into this environment, without dependencies: those are lent by the one the tests run in."""
        pip = [sys.executable, "-m", "pip", "--python", self.python, "install", "--quiet", "--no-deps"]
        subprocess.run([*pip, "--no-build-isolation", *map(str, what)], check=True, capture_output=True, timeout=120)

    def run(self, *command, cwd, check=True):
        env = {k: v for k, v in os.environ.items() if not k.startswith(("PYTHON", "VIRTUAL_ENV"))}
        env |= {"PATH": f"{self.home / 'bin'}:{env['PATH']}", "NO_COLOR": "1", "COLUMNS": "200"}
        done = subprocess.run(command, cwd=cwd, env=env, capture_output=True, text=True, timeout=400, check=False)
        assert not check or done.returncode == 0, done.stdout + done.stderr
        return done


@pytest.fixture(scope="session")
def wheels(tmp_path_factory):
    """Of the run time and of the toolchain."""
    out = tmp_path_factory.mktemp("wheel")
    build = [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", str(out)]
    for project in (ROOT / "gap_runtime", ROOT):
        subprocess.run([*build, str(project)], check=True, capture_output=True, timeout=120)
    return sorted(out.glob("*.whl"))


@pytest.fixture
def cell(tmp_path, wheels):
    """Fresh each time; the checkout is not on its path."""
    home = tmp_path / "venv"
    venv.create(home, with_pip=False, symlinks=True)
    packages = next(home.glob("lib/python*/site-packages"))
    (packages / "lent-dependencies.pth").write_text(sysconfig.get_path("purelib") + "\n")
    cell = Cell(home)
    cell.install(*wheels)
    return cell
