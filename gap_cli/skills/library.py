"""All skills the plugins offer, by name; the underscore spelling of a name finds the same skill."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from gap_cli.skills.bundle import SKILL_MD, SkillBundle, load_bundle
from gap_runtime.contracts.documents import read_text
from gap_runtime.contracts.skill import SkillContract
from gap_runtime.errors import DocumentError, GapError, PluginError, UnknownNameError
from gap_runtime.plugins import LeftOut

if TYPE_CHECKING:
    from gap_runtime.graph.model import Workflow

MAX_SKILLS = 10_000
log = logging.getLogger(__name__)


class SkillLibrary(Mapping[str, SkillBundle]):
    """Skill name to bundle, sorted by name. `left_out` holds what could not be read, by folder name."""

    def __init__(self, bundles: Iterable[SkillBundle], left_out: Mapping[str, LeftOut] | None = None) -> None:
        """Raises `PluginError` when two bundles share a name."""
        self.left_out = dict(left_out or {})
        self._bundles: dict[str, SkillBundle] = {}
        for bundle in sorted(bundles, key=lambda b: (b.name, str(b.path))):
            other = self._bundles.setdefault(bundle.name, bundle)
            if other is not bundle:
                raise PluginError(
                    f"Plugins {other.plugin!r} and {bundle.plugin!r} both bring a skill {bundle.name!r} "
                    f"({other.path}, {bundle.path}).",
                    hint="Uninstall one of them or rename one.",
                )

    def __getitem__(self, name: str) -> SkillBundle:
        """The skill. Raises `KeyError`; `find` raises an error made for people."""
        return self._bundles[name.replace("_", "-")]

    def __iter__(self) -> Iterator[str]:
        return iter(self._bundles)

    def __len__(self) -> int:
        return len(self._bundles)

    def find(self, name: str) -> SkillBundle:
        """The skill called `name`. Raises `UnknownNameError` with the nearest one, `PluginError` for one left out."""
        if name in self:
            return self[name]
        if name in self.left_out:
            raise PluginError(f"Skill {name!r} cannot be read: {self.left_out[name]}")
        raise UnknownNameError("skill", name, self.descriptions)

    @property
    def contracts(self) -> dict[str, SkillContract]:
        """Skill name to contract."""
        return {name: bundle.contract for name, bundle in self._bundles.items()}

    @property
    def descriptions(self) -> dict[str, str]:
        """Skill name to what its SKILL.md says of it."""
        return {name: bundle.description for name, bundle in self._bundles.items()}

    def canonical_scripts(self, workflow: Workflow, folder: Path | None = None) -> dict[str, Path]:
        """The script paths of a workflow that are canonical scripts of its skills, with the trusted file of each.

        A node of subgraph `<sg>` built from a skill uses its canonical script as `scripts/<sg>/<file name>`. With
        `folder`, a script whose text there was edited is no longer canonical and is left out. Atomic skills the
        workflow may call are in it by their names, each with its script `run`.
        """
        found = self._atomic(workflow)
        for name, definition in workflow.subgraphs.items():
            bundle = self.get(definition.skill)
            for node in definition.nodes.values() if bundle else ():
                source = _canonical(bundle, name, node.script)
                if source and node.script and (folder is None or _same(source, folder / node.script)):
                    found[node.script] = source
        return found

    def _atomic(self, workflow: Workflow) -> dict[str, Path]:
        """Atomic skills named by a node or by the contract of a skill in use, which call them like tools."""
        definitions = workflow.subgraphs.values()
        called = {node.tool for d in definitions for node in d.nodes.values() if node.tool}
        called |= {t for d in definitions if (b := self.get(d.skill)) for t in b.contract.tools}
        bundles = [self[name] for name in sorted(called) if name in self]
        return {b.name: b.scripts["run"] for b in bundles if b.contract.kind == "atomic" and "run" in b.scripts}


def load_library(registered: Iterable[tuple[Path, str]], own: Iterable[Path] = ()) -> SkillLibrary:
    """Read every skill below the registered paths and the user's `own`; each path is a skill or a directory of skills.

    One that cannot be read is left out, with a warning that names its plugin and file; one of `own` replaces a
    registered one of its name. Raises `PluginError` for two skills of one name.
    """
    left_out: dict[str, LeftOut] = {}
    mine = _load([(path, str(path)) for path in own], left_out)
    names = {bundle.name for bundle in mine}
    theirs = _load(registered, left_out)
    for bundle in theirs:
        if bundle.name in names:
            log.warning("skill %s of plugin %r is replaced by --skills", bundle.name, bundle.plugin)
    return SkillLibrary([*mine, *(b for b in theirs if b.name not in names)], left_out)


def _load(paths: Iterable[tuple[Path, str]], left_out: dict[str, LeftOut]) -> list[SkillBundle]:
    bundles: list[SkillBundle] = []

    def leave_out(path: Path, plugin: str, error: GapError) -> None:
        left_out[path.name] = LeftOut(plugin, error)
        log.warning("skill %s left out: %s", path.name, left_out[path.name])

    for path, plugin in paths:
        try:
            folders = skill_folders(path)
        except GapError as error:
            leave_out(path, plugin, error)
            continue
        for folder in folders:
            try:
                bundles.append(load_bundle(folder, plugin))
            except GapError as error:
                leave_out(folder, plugin, error)
        if len(bundles) > MAX_SKILLS:
            raise DocumentError(str(path), f"more than {MAX_SKILLS} skills")
    return bundles


def skill_folders(path: Path) -> list[Path]:
    """`path` where it is a skill, else the skills directly below it. Raises `DocumentError` where there is none."""
    if not path.is_dir():
        raise DocumentError(str(path), "is not a directory of skills")
    if _looks_like_skill(path):
        return [path.resolve()]
    children = [p for p in sorted(path.iterdir()) if p.name[0] not in "._" and _looks_like_skill(p)]
    if not children:
        raise DocumentError(str(path), "holds no skill", hint=f"Looked for {SKILL_MD} in it and in its folders.")
    return children


def find_skills(path: Path) -> list[Path]:
    """`path` where it is a skill, else the skills at any depth below it; hidden folders are not looked into.

    Raises `DocumentError` where there is none.
    """
    found: list[Path] = []
    waiting = [path]
    while waiting:
        folder = waiting.pop()
        if _looks_like_skill(folder):
            found.append(folder)
        else:
            waiting += [p for p in folder.iterdir() if p.is_dir() and not p.is_symlink() and p.name[0] not in "._"]
    if not found:
        raise DocumentError(str(path), "holds no skill", hint=f"Looked for {SKILL_MD} at any depth.")
    return sorted(found)


def _looks_like_skill(path: Path) -> bool:
    """Has a SKILL.md in any spelling, or a contract that lost it: left out in silence, either would hide a mistake."""
    if not path.is_dir():
        return False
    return any(p.name.lower() == SKILL_MD.lower() or p.name == "contract.yaml" for p in path.iterdir())


def _canonical(bundle: SkillBundle | None, subgraph: str, script: str | None) -> Path | None:
    prefix = f"scripts/{subgraph}/"
    if bundle is None or script is None or not script.startswith(prefix):
        return None
    name = script.removeprefix(prefix)
    return next((p for p in bundle.scripts.values() if p.name == name), None)


def _same(source: Path, copy: Path) -> bool:
    try:
        return read_text(source).rstrip() == read_text(copy).rstrip()
    except GapError:
        return False
