"""One skill on disk: its SKILL.md, its contract and the files they name, every path proven to stay inside."""

from __future__ import annotations

import hashlib
import stat
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TypeVar

from gap_cli.skills.facts import preconditions_effects
from gap_cli.skills.frontmatter import parse_skill_md
from gap_runtime.contracts.documents import located, parse_yaml, read_text, yaml_lines
from gap_runtime.contracts.failures import DocumentError
from gap_runtime.contracts.skill import SkillContract, check_relative

SKILL_MD = "SKILL.md"
CONTRACT_KEY = "gap-contract"
T = TypeVar("T")


@dataclass(frozen=True)
class SkillBundle:
    """A skill as the rest of the engine sees it. `scripts`, `prompts` and `references` map logical names to files."""

    name: str
    description: str
    body: str = field(repr=False)
    path: Path
    plugin: str
    contract: SkillContract = field(repr=False)
    scripts: Mapping[str, Path] = field(repr=False)
    prompts: Mapping[str, Path] = field(repr=False)
    references: Mapping[str, Path] = field(repr=False)
    template: Path | None = field(repr=False)
    checkpoints: Path | None = field(repr=False)
    contract_file: Path = field(repr=False)

    @property
    def files(self) -> tuple[Path, ...]:
        """Every file that belongs to the skill, sorted by path."""
        named = (*self.scripts.values(), *self.prompts.values(), *self.references.values())
        single = (self.template, self.checkpoints, self.contract_file, self.path / SKILL_MD)
        return tuple(sorted({*named, *(p for p in single if p)}))

    @property
    def digest(self) -> str:
        """First 16 hex digits of the sha256 over the names and bytes of `files`, for a run's lock."""
        total = hashlib.sha256()
        for file in self.files:
            data = file.read_bytes()
            total.update(f"{file.relative_to(self.path)}\0{len(data)}\0".encode() + data)
        return total.hexdigest()[:16]


def load_bundle(path: Path, plugin: str = "") -> SkillBundle:
    """Read and check one skill directory. Raises `DocumentError` naming the file and, where it can, the line."""
    bundle, errors = read_bundle(path, plugin)
    if bundle is None or errors:
        raise errors[0]
    return bundle


def read_bundle(path: Path, plugin: str = "") -> tuple[SkillBundle | None, list[DocumentError]]:
    """The skill in a directory, as far as it can be read, and every error of its files."""
    errors = _Errors()
    where = str(path / SKILL_MD)
    if path.is_symlink():
        hint = "Copy the skill, or register its real folder."
        return None, [DocumentError(str(path), "is a symbolic link", hint=hint)]
    head, body = errors.of(lambda: parse_skill_md(read_text(_inside(path, SKILL_MD, where)), where)) or (None, "")
    if head is not None and head.name != path.name:
        errors.add(where, f"name {head.name!r} differs from its folder {path.name!r}", "Rename either.")
    file = errors.of(lambda: _contract_path(path, head.metadata if head else {CONTRACT_KEY: "contract.yaml"}, where))
    contract = errors.of(lambda: load_contract(file)) if file else None
    if contract is None or file is None:
        return None, errors.found
    at = str(file)

    def group(paths: Mapping[str, str]) -> dict[str, Path]:
        found = {name: errors.of(partial(_text_file, path, relative, at)) for name, relative in paths.items()}
        return {name: p for name, p in found.items() if p}

    singles = group({"template": contract.template or "", "checkpoints": contract.checkpoints or ""})
    bundle = SkillBundle(
        path.name, head.description if head else "", body, path, plugin, contract,
        scripts=group(contract.scripts),
        prompts=group(contract.prompts),
        references=group(contract.references),
        template=singles.get("template"),
        checkpoints=singles.get("checkpoints"),
        contract_file=file,
    )  # fmt: skip
    errors.of(lambda: _check_clashes(bundle, at))
    return bundle, errors.found


def load_contract(file: Path) -> SkillContract:
    """The contract in a file. Raises `DocumentError` with every problem and its line."""
    text = read_text(file)
    data = parse_yaml(text, str(file))
    try:
        contract = SkillContract.load(data, str(file))
    except DocumentError as error:
        raise located(error, yaml_lines(text)) from None
    try:
        preconditions_effects(contract)
    except ValueError as error:
        raise DocumentError(str(file), str(error)) from None
    return contract


class _Errors:
    """Collects what reading the parts of a skill raises."""

    def __init__(self) -> None:
        self.found: list[DocumentError] = []

    def of(self, read: Callable[[], T]) -> T | None:
        """What `read` gives; None where it raises `DocumentError`."""
        try:
            return read()
        except DocumentError as error:
            self.found.append(error)
            return None

    def add(self, where: str, problem: str, hint: str) -> None:
        """One more error."""
        self.found.append(DocumentError(where, problem, hint=hint))


def _contract_path(path: Path, metadata: Mapping[str, str], where: str) -> Path:
    relative = metadata.get(CONTRACT_KEY)
    if relative is None:
        hint = f"Add it below metadata: as `{CONTRACT_KEY}: contract.yaml`."
        raise DocumentError(where, f"metadata has no {CONTRACT_KEY}", hint=hint)
    try:
        check_relative(relative)
    except ValueError as error:
        raise DocumentError(where, f"metadata.{CONTRACT_KEY}: {error}") from None
    return _inside(path, relative, where)


def _text_file(root: Path, relative: str, where: str) -> Path | None:
    """A file of the skill, proven to be readable clean text; None where none is named."""
    if not relative:
        return None
    file = _inside(root, relative, where)
    read_text(file)
    return file


def _inside(root: Path, relative: str, where: str) -> Path:
    """The regular file at root/relative, reached through no link."""
    for step in _steps(root, relative):
        try:
            mode = step.lstat().st_mode
        except (OSError, ValueError):
            raise DocumentError(where, f"{relative} does not exist", hint=f"Looked in {root}.") from None
        if stat.S_ISLNK(mode):
            raise DocumentError(where, f"{relative} goes through a symbolic link", hint="Copy the file into the skill.")
    if not stat.S_ISREG(mode):
        raise DocumentError(where, f"{relative} is not a plain file")
    return root / relative


def _steps(root: Path, relative: str) -> Iterator[Path]:
    here = root
    for part in relative.split("/"):
        here = here / part
        yield here


def _check_clashes(bundle: SkillBundle, where: str) -> None:
    """Paths that differ only by case are one file on some disks; two scripts of one name collide in a run."""
    seen: dict[str, Path] = {}
    for file in bundle.files:
        other = seen.setdefault(str(file).casefold(), file)
        if other != file:
            raise DocumentError(where, f"{file.name} and {other.name} differ only by case")
    names: dict[str, str] = {}
    for logical, file in bundle.scripts.items():
        if names.setdefault(file.name, logical) != logical:
            raise DocumentError(where, f"scripts {names[file.name]!r} and {logical!r} are both called {file.name}")
