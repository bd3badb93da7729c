"""One segment as builder code: the skill's own template, filled with the names and objects of the plan."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from gap_cli.analysis.catalog import substitute
from gap_cli.author.plans import Segment
from gap_cli.author.render import identifier, render_file
from gap_cli.skills import SkillBundle
from gap_runtime.contracts.documents import read_text
from gap_runtime.contracts.skill import SkillContract
from gap_runtime.errors import DocumentError, GapError, UnknownNameError
from gap_runtime.graph.checkpoints import parse_checkpoints, render_checkpoints


def render_subgraph(segment: Segment, bundle: SkillBundle) -> str:
    """Builder code of the segment. Raises `DocumentError` when the skill's template cannot give it."""
    if bundle.template is None:
        raise DocumentError(str(bundle.contract_file), "has no template", hint="Name one as template: in the contract.")
    return render_file(bundle.template, **template_context(segment, bundle))


def render_checkpoint_file(segment: Segment, bundle: SkillBundle, labels: Mapping[str, str]) -> str | None:
    """The checkpoints sidecar of the segment; None for a skill without a checkpoint template.

    A checkpoint template may use segment, skill, object(role), an id to be written inside a predicate, and label(role).
    In a loop a promise is kept when it holds of one of the objects.
    """
    if bundle.checkpoints is None:
        return None
    if not segment.each:
        return _checkpoints(segment, bundle.checkpoints, labels)
    alternatives = []
    for thing in segment.each:
        roles = {role: name if name in labels else thing for role, name in segment.roles.items()}
        text = _checkpoints(segment.model_copy(update={"roles": roles}), bundle.checkpoints, labels)
        alternatives.append([p for p in parse_checkpoints(text, segment.name) if p.validate])
    joined = []
    for points in zip(*alternatives, strict=True):
        predicate = " or ".join(dict.fromkeys(f"({p.predicate})" for p in points))
        joined.append(replace(points[0], predicate=predicate, diagnostics={}))
    return render_checkpoints(joined)


def _checkpoints(segment: Segment, template: Path, labels: Mapping[str, str]) -> str:
    def object_of(role: str) -> str:
        return _lookup("role", role, segment.roles)

    return render_file(
        template, segment=segment.name, skill=segment.skill, object=lambda role: identifier(object_of(role)),
        label=lambda role: _lookup("object", object_of(role), labels),
    )  # fmt: skip


def template_context(segment: Segment, bundle: SkillBundle) -> dict[str, Any]:
    """What a subgraph template may use. Names it may join to other text; the rest is written as Python values.

    segment, skill, description    the subgraph's name, its skill, and what it is for
    inputs                         spelled name -> type, in the contract's order: declare each with add_input
    input(name), output(name)      how this segment spells a name of the contract (`<name>_obb` -> `target_obb`): a name
    has_input(name)                whether an optional input is connected
    literal(name)                  a literal of the contract
    script(name)                   the path of a canonical script
    prompt(name)                   the text of a prompt file
    exits, on_error                success exits and the failure exit
    """
    contract = bundle.contract

    def spelled(kind: str, name: str, known: dict[str, str]) -> str:
        return identifier(substitute(_lookup(kind, name, {n: n for n in known}), segment.names))

    def script(name: str) -> str:
        return script_path(segment.name, _lookup("script", name, contract.scripts))

    def prompt(name: str) -> str:
        _lookup("prompt", name, contract.prompts)
        return read_text(bundle.prompts[name]).strip()

    return {
        "segment": segment.name,
        "skill": bundle.name,
        "description": segment.description,
        "inputs": segment.inputs,
        "input": lambda name: spelled("input", name, contract.inputs),
        "output": lambda name: spelled("output", name, contract.outputs),
        "has_input": lambda name: spelled("input", name, contract.inputs) in segment.inputs,
        "literal": lambda name: _literal(segment, contract, name),
        "script": script,
        "prompt": prompt,
        "exits": segment.exits,
        "on_error": segment.on_error,
    }


def script_path(segment: str, file: str) -> str:
    """Where a canonical script lies in a run: beside the other scripts of its segment."""
    return f"scripts/{segment}/{file.rpartition('/')[2]}"


def _literal(segment: Segment, contract: SkillContract, name: str) -> Any:
    _lookup("literal", name, contract.literals)
    if name not in segment.literals:
        raise GapError(f"Segment {segment.name!r} gives no {name!r}, a literal of skill {segment.skill!r}.")
    return segment.literals[name]


def _lookup(kind: str, name: str, known: Mapping[str, str]) -> str:
    if name not in known:
        raise UnknownNameError(kind, name, known)
    return known[name]
