"""What a graph may refer to: tools, skills, scripts, objects and checkpoints; every callable under one signature."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Any

from gap_runtime.bundle.bundle import GraphBundle, checkpoint_files, script_files
from gap_runtime.contracts.failures import GapError
from gap_runtime.contracts.skill import NAME_SLOT, SkillContract
from gap_runtime.contracts.tool import Param, ToolSpec
from gap_runtime.contracts.types.typeref import TypeRef
from gap_runtime.graph.checkpoints import Checkpoint, parse_checkpoints
from gap_runtime.graph.model import Node
from gap_runtime.graph.scripts import ScriptSpec, read_signature

SLOT = "name"  # the key of `names` that fills NAME_SLOT
parse_type = lru_cache(maxsize=1024)(TypeRef.parse)


@dataclass(frozen=True)
class Signature:
    """What a node calls, be it a tool, an atomic skill or a script.

    `tools` are the tools it may call in its turn (itself, for a tool): what it can hold, and whether it is privileged,
    follows from them. `choices` are the words a result field may take ('' for the bare result), `words` those
    an input may be, where known.
    """

    what: str
    inputs: Mapping[str, Param]
    output: TypeRef | None
    fields: Mapping[str, TypeRef]
    streaming: bool
    tools: tuple[ToolSpec, ...]
    choices: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    words: Mapping[str, tuple[str, ...]] = field(default_factory=dict)


@dataclass(frozen=True)
class Catalog:
    """Everything a workflow is judged against.

    scripts      by path as nodes write it (`scripts/<subgraph>/<file>.py`).
    objects      ids and labels of the task's objects; None: not known, names are not checked.
    checkpoints  by subgraph definition; None: not written yet, and not checked.
    problems     path of a script or checkpoint file -> why it could not be read.
    descriptions what each skill is for, to suggest one for a name that does not exist.
    """

    tools: Mapping[str, ToolSpec]
    skills: Mapping[str, SkillContract]
    scripts: Mapping[str, ScriptSpec] = field(default_factory=dict)
    objects: frozenset[str] | None = None
    checkpoints: Mapping[str, tuple[Checkpoint, ...]] | None = None
    problems: Mapping[str, str] = field(default_factory=dict)
    joints: frozenset[str] | None = None
    descriptions: Mapping[str, str] = field(default_factory=dict)

    def skill(self, name: str) -> SkillContract | None:
        """The contract of a skill; the paper's underscore spelling resolves."""
        return self._skills.get(name.replace("_", "-"))

    def callee(self, node: Node, contract: SkillContract | None) -> Signature | None:
        """What a node calls; None for a noop, or where it does not exist."""
        if node.type == "tool" and node.tool is not None:
            return self._tool(node.tool)
        if node.type in ("script", "router") and node.script is not None:
            return self._script(node.script, contract)
        return None

    @cached_property
    def _skills(self) -> dict[str, SkillContract]:
        return {name.replace("_", "-"): contract for name, contract in self.skills.items()}

    @cached_property
    def _callees(self) -> dict[Any, Signature]:
        return {}

    def _tool(self, name: str) -> Signature | None:
        if name not in self._callees:
            spec, skill = self.tools.get(name), self.skill(name)
            if spec is not None:
                inputs = {p.name: p for p in spec.inputs}
                found = Signature(f"tool {name}", inputs, spec.output, spec.fields, spec.streaming, (spec,))
            elif skill is not None and skill.kind == "atomic":
                found = self._atomic(name, skill)
            else:
                return None
            self._callees[name] = found
        return self._callees[name]

    def _atomic(self, name: str, skill: SkillContract) -> Signature:
        """An atomic skill: its inputs and literals are required, its parameters have defaults."""
        given = {**skill.inputs, **skill.literals}
        inputs = {n: Param(n, parse_type(t)) for n, t in given.items()}
        inputs |= {n: Param(n, parse_type(p.type), p.default) for n, p in skill.parameters.items()}
        fields = {n.replace(f"{NAME_SLOT}_", ""): parse_type(t) for n, t in skill.outputs.items()}
        return Signature(f"skill {name}", inputs, None, fields, skill.streaming, self._known(skill.tools))

    def _script(self, path: str, contract: SkillContract | None) -> Signature | None:
        spec = self.scripts.get(path)
        if spec is None:
            return None
        allowed = tuple(contract.tools) if contract is not None else ()
        key = (path, spec.any_tool, allowed)
        if key not in self._callees:
            names = sorted({*allowed, *spec.tools}) if spec.any_tool else sorted(spec.tools)
            inputs = {p.name: p for p in spec.inputs}
            self._callees[key] = Signature(
                f"script {path}", inputs, spec.output, spec.fields, spec.publishes, self._known(names), spec.choices,
                spec.words,
            )  # fmt: skip
        return self._callees[key]

    def _known(self, names: Iterable[str]) -> tuple[ToolSpec, ...]:
        return tuple(self.tools[n] for n in names if n in self.tools)


def read_catalog(
    bundle: GraphBundle,
    tools: Mapping[str, ToolSpec],
    skills: Mapping[str, SkillContract],
    objects: Iterable[str] | None = None,
    *,
    joints: Iterable[str] | None = None,
    checkpoints: bool = True,
    descriptions: Mapping[str, str] | None = None,
) -> Catalog:
    """The catalog for a bundle's workflow. A file of it that cannot be read is a `problem`, which the validator
    reports, not an error."""
    scripts: dict[str, ScriptSpec] = {}
    points: dict[str, tuple[Checkpoint, ...]] = {}
    problems = dict(bundle.unreadable)
    for path in script_files(bundle.workflow):
        if path in bundle.files:
            try:
                scripts[path] = read_signature(bundle.files[path], path)
            except GapError as error:
                problems[path] = str(error)
    for name, path in zip(bundle.workflow.subgraphs, checkpoint_files(bundle.workflow), strict=True):
        if checkpoints and path in bundle.files:
            try:
                points[name] = parse_checkpoints(bundle.files[path], path)
            except GapError as error:
                problems[path] = str(error)
    return Catalog(
        tools,
        skills,
        scripts,
        None if objects is None else frozenset(objects),
        points if checkpoints else None,
        problems,
        None if joints is None else frozenset(joints),
        descriptions or {},
    )


def contract_names(contract: SkillContract, names: Mapping[str, str]) -> tuple[dict[str, TypeRef], dict[str, TypeRef]]:
    """The contract's inputs and outputs with their types, spelled as `names` says."""
    return (
        {substitute(n, names): parse_type(t) for n, t in contract.inputs.items()},
        {substitute(n, names): parse_type(t) for n, t in contract.outputs.items()},
    )


def substitute(name: str, names: Mapping[str, str]) -> str:
    """One contract name as the subgraph spells it: exact name first, then `<name>`, then the longest role prefix.

    With `{target: target_2}`, `target_obb` becomes `target_2_obb`; with `{name: basket}`, `<name>_obb` becomes
    `basket_obb`.
    """
    if name in names and name != SLOT:
        return names[name]
    if name.startswith(NAME_SLOT):
        return names.get(SLOT, NAME_SLOT) + name.removeprefix(NAME_SLOT)
    roles = [r for r in names if r != SLOT and name.startswith(r + "_")]
    role = max(roles, key=len, default=None)
    return name if role is None else names[role] + name[len(role) :]


def infer_names(contract: SkillContract, names: Mapping[str, str], declared: Iterable[str]) -> dict[str, str]:
    """`names`, with the slot filled from the declared input and output names where only one filling explains them.

    A graph written to the paper's format declares `target_obb, target_mask` and says nothing of `<name> = target`.
    """
    suffixes = [n.removeprefix(NAME_SLOT) for n in [*contract.inputs, *contract.outputs] if n.startswith(NAME_SLOT)]
    if not suffixes or SLOT in names:
        return dict(names)
    fillings = {d.removesuffix(s) for d in declared for s in suffixes if d.endswith(s) and d != s}
    return {**names, SLOT: fillings.pop()} if len(fillings) == 1 else dict(names)
