"""A run: one folder `runs/<task>-<NNN>` that the verbs of the pipeline read and write in turn."""

from __future__ import annotations

import fcntl
import os
import re
import shlex
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Literal

from pydantic import Field

from gap_cli.workspace.atomic import storage_error
from gap_cli.workspace.canonical import write_yaml
from gap_cli.workspace.tasks import open_task
from gap_runtime.contracts.documents import read_yaml
from gap_runtime.contracts.models import Document
from gap_runtime.contracts.names import KebabName
from gap_runtime.errors import RunError, did_you_mean
from gap_runtime.plugins import load_registry

ROOT = Path("runs")
_NAME = re.compile(r"^[a-z][a-z0-9-]*-(?P<number>\d{3,})$")


class RunConfig(Document):
    """run.yaml: what was asked of a run, and nothing that depends on when or where. `seed` is the base seed of its
    rehearsals; `providers` maps a tool name or `service.*` to the provider that must serve it; `skills` are folders of
    skills beside those that are installed, absolute here and relative to the run in run.yaml."""

    schema_: Literal["gap/run/v1"] = Field(default="gap/run/v1", alias="schema")
    task: KebabName | Literal[""]  # '' where it is not known
    variant: str = ""
    instruction: str = Field(min_length=1)
    author: str = "symbolic"
    seed: int = 0
    providers: dict[str, str] = {}
    skills: list[str] = []


@dataclass(frozen=True)
class Run:
    """An existing run folder."""

    path: Path

    @classmethod
    def create(cls, root: Path, config: RunConfig) -> Run:
        """Make the next free `<task>-NNN` below `root`, holding run.yaml. Raises `StorageError`.

        The number counts all runs of `root`, whatever their task.
        """
        number = 1 + max(map(_number, root.iterdir()), default=0) if root.is_dir() else 1
        while True:
            path = root / f"{config.task}-{number:03d}"
            try:
                root.mkdir(parents=True, exist_ok=True)
                path.mkdir()
                break
            except FileExistsError:  # another process took the number
                if not root.is_dir():
                    raise storage_error(root, NotADirectoryError(0, "is not a folder")) from None
                number += 1
            except OSError as error:
                raise storage_error(path, error) from None
        try:
            _write(path, config)
        except BaseException:
            with suppress(OSError):
                path.rmdir()
            raise
        return cls(path)

    @classmethod
    def open(cls, root: Path, name: str | None = None, task: str | None = None) -> Run:
        """The run that `name` means, or the latest: the name of a run below `root`, a run's folder, its `generate`
        folder, a bare folder that holds workflow.json, or that file.

        `task` (`NAME[:variant]`) is what a bare folder's graph is for; it is noted in a run.yaml there. Raises
        `RunError` where there is no such run, or where its run.yaml says another task; `UnknownNameError`.
        """
        run = cls.latest(root) if name is None else cls(_find(root, name))
        if task is None:
            return run
        named, _, variant = task.partition(":")
        config = run.config
        if not config.task:
            found = open_task(load_registry(), named, variant)
            _write(run.path, config.model_copy(update={"task": named, "variant": found.variant}))
            return cls(run.path)
        if (config.task, config.variant) != (named, variant or config.variant):
            says = f"{config.task}:{config.variant}".rstrip(":")
            where = run.path / "run.yaml"
            raise RunError(f"{where} says task {says}, not {task}.", hint="Edit that file, or leave out --task.")
        return run

    @classmethod
    def latest(cls, root: Path) -> Run:
        """The run created last, by number: clocks are set back. Raises `RunError` when there is none."""
        runs = cls.list(root)
        if not runs:
            raise RunError(f"There is no run in {root}/ yet.", hint='Type: gap plan "SENTENCE"')
        return max(runs, key=lambda run: (_number(run.path), (run.path / "run.yaml").stat().st_mtime_ns, run.name))

    @classmethod
    def list(cls, root: Path) -> list[Run]:
        """Every run below `root`, by name."""
        if not root.is_dir():
            return []
        return [cls(path) for path in sorted(root.iterdir()) if (path / "run.yaml").is_file()]

    @property
    def name(self) -> str:
        """The folder's name, `<task>-<NNN>`."""
        return self.path.resolve().name

    @cached_property
    def config(self) -> RunConfig:
        """What run.yaml says; nothing where a bare folder has none. Raises `DocumentError`."""
        file = self.path / "run.yaml"
        if not file.is_file() and self.graph_folder == self.path:
            return RunConfig(task="", instruction=self.name)
        config = RunConfig.load(read_yaml(file), str(file))
        return config.model_copy(update={"skills": [str((self.path / p).resolve()) for p in config.skills]})

    def with_skills(self, folders: Iterable[Path]) -> Run:
        """This run, `folders` of skills recorded in its run.yaml. Raises `RunError`, `StorageError`."""
        new = [str(f.resolve()) for f in folders if str(f.resolve()) not in self.config.skills]
        if not new:
            return self
        with self.held():
            _write(self.path, self.config.model_copy(update={"skills": [*self.config.skills, *new]}))
        return Run(self.path)

    @property
    def argument(self) -> str:
        """How to name the run on a command line: by name where the default root finds it, else by path, quoted."""
        root = Path(os.environ.get("GAP_RUNS", ROOT))
        return shlex.quote(self.name if self.path.parent.resolve() == root.resolve() else str(self.path))

    @property
    def graph_folder(self) -> Path:
        """Where the graph is: `generate/`, or in a bare folder the folder itself."""
        bare = (self.path / "workflow.json").is_file() and not (self.path / "generate").is_dir()
        return self.path if bare else self.path / "generate"

    @property
    def graph_prefix(self) -> str:
        """What comes before the name of a file of the graph to name it in the run: `generate/`, or nothing."""
        return "" if self.graph_folder == self.path else "generate/"

    def folder(self, stage: str) -> Path:
        """Where a stage writes: `plan`, `generate`, `validate`, `rehearse/00`, ..."""
        return self.path / stage

    @contextmanager
    def held(self) -> Iterator[Run]:
        """Hold the run for this process. Raises `RunError` naming the process that holds it already."""
        try:
            handle = os.open(self.path / ".lock", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
        except OSError as error:
            raise storage_error(self.path / ".lock", error) from None
        try:
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                holder = os.pread(handle, 32, 0).decode("ascii", "replace").strip() or "unknown"
                raise RunError(
                    f"Run {self.name} is in use by process {holder}.", hint="Wait until it ends, or stop it."
                ) from None
            with suppress(OSError):  # a full disk only costs the next process the number
                os.ftruncate(handle, 0)
                os.pwrite(handle, f"{os.getpid()}\n".encode(), 0)
            yield self
        finally:
            os.close(handle)


def _write(path: Path, config: RunConfig) -> None:
    skills = [os.path.relpath(folder, path.resolve()) for folder in config.skills]
    write_yaml(path / "run.yaml", config.model_copy(update={"skills": skills}).model_dump(by_alias=True))


def _find(root: Path, name: str) -> Path:
    """The folder of the run that `name` means. Raises `RunError`."""
    path = root / name if (root / name / "run.yaml").is_file() else Path(name)
    if path.name == "workflow.json" and path.is_file():
        path = path.parent
    elif path.is_file():
        raise RunError(f"{path} is not a workflow.json.", hint="Put it into a folder of its own under that name.")
    around = path.resolve().parent
    if path.resolve().name == "generate" and (around / "run.yaml").is_file():
        return path.parent if path.name == "generate" else around
    if (path / "run.yaml").is_file() or (path / "workflow.json").is_file():
        return path
    if "/" in name or name in (".", ".."):
        raise RunError(
            f"{name} is no run and holds no graph.", hint="A run's folder holds run.yaml, a graph's workflow.json."
        )
    raise RunError(f"There is no run {name!r} in {root}/.", hint=did_you_mean(name, [r.name for r in Run.list(root)]))


def _number(path: Path) -> int:
    """NNN of `<task>-<NNN>`; 0 for a folder of another name."""
    match = _NAME.match(path.name)
    return int(match["number"]) if match else 0
