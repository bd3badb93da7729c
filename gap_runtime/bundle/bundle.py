"""A graph with everything it is rehearsed, run and shipped with: workflow, scripts, checkpoints and goals, as text."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from gap_runtime.bundle.digest import BundleDigest, data_sha256, text_sha256
from gap_runtime.contracts.documents import parse_json, read_text
from gap_runtime.contracts.failures import GapError
from gap_runtime.contracts.skill import SkillContract, inside
from gap_runtime.contracts.task.goals import Goals
from gap_runtime.contracts.tool import ToolSpec
from gap_runtime.errors import RunError, StorageError
from gap_runtime.graph.callees import find_skill
from gap_runtime.graph.checkpoints import Checkpoint, parse_checkpoints
from gap_runtime.graph.load import parse_workflow
from gap_runtime.graph.model import Workflow

WORKFLOW, GOALS = "workflow.json", "goals.json"


@dataclass(frozen=True)
class GraphBundle:
    """`files` maps a path inside the bundle's folder to its text: `workflow.json`, and where there are such,
    `goals.json`, every `scripts/...` a node names and `checkpoints/<definition>.py`. What is read from them is cached;
    a changed bundle is a new one (`replace`). `unreadable` maps a file that the workflow names and that is not there,
    or is no clean text, to the reason; the validator reports it."""

    files: Mapping[str, str]
    unreadable: Mapping[str, str] = field(default_factory=dict)

    @classmethod
    def load(cls, folder: Path) -> GraphBundle:
        """Read a folder that holds workflow.json. Files in it that the workflow does not name are left out.

        Raises `DocumentError` (no readable workflow.json) or `WorkflowError` (not of a workflow's shape).
        """
        text = read_text(folder / WORKFLOW)
        workflow = parse_workflow(parse_json(text, str(folder / WORKFLOW)), str(folder / WORKFLOW))
        files, unreadable = {WORKFLOW: text}, {}
        optional = [GOALS, *checkpoint_files(workflow)]
        for name in (*optional, *script_files(workflow)):
            try:
                file = inside(folder, name)
                if file.exists() or name not in optional:
                    files[name] = read_text(file)
            except GapError as error:
                unreadable[name] = str(error)
        return cls(files, unreadable)

    def replace(self, files: Mapping[str, str]) -> GraphBundle:
        """This bundle with other texts in the place of, or beside, its own."""
        return GraphBundle({**self.files, **files}, {n: why for n, why in self.unreadable.items() if n not in files})

    def write(self, folder: Path) -> None:
        """Write every file below `folder`, which `load` reads back as an equal bundle. Where a run's folder is
        written, `write_stage(run, stage, bundle.files)` does it atomically instead. Raises `StorageError`."""
        for name, text in self.files.items():
            file = inside(folder, name)
            try:
                file.parent.mkdir(parents=True, exist_ok=True)
                file.write_bytes(text.encode("utf-8"))
            except OSError as error:
                raise StorageError(f"Cannot write {file}: {error.strerror or error}.") from None

    @cached_property
    def workflow(self) -> Workflow:
        """The graph. Raises `DocumentError`, `WorkflowError`."""
        return parse_workflow(parse_json(self.files[WORKFLOW], WORKFLOW), WORKFLOW)

    @cached_property
    def goals(self) -> Goals:
        """What is to be achieved. Raises `RunError` where there is no goals.json, `DocumentError`."""
        if GOALS not in self.files:
            roles = '{"target": OBJECT, "container": OBJECT}'
            example = f'{{"scene": SCENE, "goals": [{{"predicate": "in", "roles": {roles}}}]}}'
            raise RunError(f"There is no {GOALS} beside {WORKFLOW}.", hint=f"Write one: {example}")
        return Goals.load(parse_json(self.files[GOALS], GOALS), GOALS)

    @cached_property
    def checkpoints(self) -> Mapping[str, tuple[Checkpoint, ...]]:
        """The checkpoints of every subgraph definition. Raises `DocumentError`."""
        files = dict(zip(self.workflow.subgraphs, checkpoint_files(self.workflow), strict=True))
        return {n: parse_checkpoints(self.files[f], f) if f in self.files else () for n, f in files.items()}

    @property
    def scripts(self) -> dict[str, str]:
        """The text of each script that a node names, by its path."""
        return {name: self.files[name] for name in script_files(self.workflow) if name in self.files}

    def parameters(self, skills: Mapping[str, SkillContract]) -> dict[str, dict[str, Any]]:
        """Every parameter of each subgraph definition as it will be used: the skill's default, or what the workflow
        says instead. A definition whose skill is unknown has what the workflow says."""
        found: dict[str, dict[str, Any]] = {}
        for name, definition in self.workflow.subgraphs.items():
            skill = find_skill(skills, definition.skill)
            defaults = {key: p.default for key, p in skill[1].parameters.items()} if skill else {}
            found[name] = {**defaults, **definition.parameters}
        return found

    def digest(
        self, tools: Mapping[str, ToolSpec], skills: Mapping[str, SkillContract], skill_digests: Mapping[str, str]
    ) -> BundleDigest:
        """What this bundle holds, and which tools and skills of those given it relies on, each by its hash."""
        used_skills, used_tools = dependencies(self.workflow, skills)
        return BundleDigest(
            files={name: text_sha256(text) for name, text in sorted(self.files.items())},
            parameters={name: data_sha256(values) for name, values in sorted(self.parameters(skills).items())},
            tools={name: tools[name].schema_hash for name in sorted(used_tools) if name in tools},
            skills={name: skill_digests[name] for name in sorted(used_skills) if name in skill_digests},
        )


def script_files(workflow: Workflow) -> list[str]:
    """The scripts the workflow's nodes name, sorted."""
    return sorted({node.script for d in workflow.subgraphs.values() for node in d.nodes.values() if node.script})


def checkpoint_files(workflow: Workflow) -> list[str]:
    """Where the checkpoints of each subgraph definition would be, in the workflow's order."""
    return [f"checkpoints/{name}.py" for name in workflow.subgraphs]


def dependencies(workflow: Workflow, skills: Mapping[str, SkillContract]) -> tuple[set[str], set[str]]:
    """Names of the skills the workflow is built from, and of everything its nodes may call: their own tools, those of
    their skills' contracts, and of the atomic skills among them in turn."""
    built_from = [d.skill for d in workflow.subgraphs.values()]
    called = {n.tool for d in workflow.subgraphs.values() for n in d.nodes.values() if n.tool}
    called |= {call.tool for node in workflow.nodes.values() for call in node.recovery}
    used: set[str] = set()
    waiting = [*built_from, *called]
    while waiting:
        found = find_skill(skills, waiting.pop())
        if found is not None and found[0] not in used:
            used.add(found[0])
            called |= set(found[1].tools)
            waiting += found[1].tools
    return used, called
