"""Joins the planner's topology and the authors' subgraphs into one workflow, and refuses where the two disagree."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from gap_cli.errors import DocumentError, WorkflowError, did_you_mean
from gap_cli.graph.findings import Finding
from gap_cli.graph.load import parse_workflow
from gap_cli.graph.model import Workflow

DISAGREE = "W4"


def assemble(spec: Mapping[str, Any], subgraphs: Mapping[str, Mapping[str, Any]]) -> Workflow:
    """The workflow of `WorkflowSpec.to_dict()` and, by definition name, `Subgraph.to_dict()` of each.

    Raises `WorkflowError` with every disagreement: a subgraph not written, an input, exit or skill spelled otherwise
    than declared. The meaning of the whole is still the validator's to check.
    """
    topology = spec.get("def")
    if not isinstance(topology, Mapping) or not isinstance(topology.get("subgraphs"), Mapping):
        raise DocumentError("spec", "is not what WorkflowSpec.to_dict() gives")
    declared: Mapping[str, Any] = topology["subgraphs"]
    findings = [f for name in declared for f in _disagreements(name, declared[name], subgraphs.get(name))]
    findings += [_stray(name, declared) for name in subgraphs if name not in declared]
    if findings:
        raise WorkflowError(sorted(findings))
    joined = {name: _joined(declared[name], subgraphs[name]["def"]) for name in declared}
    return parse_workflow({**topology, "subgraphs": joined}, "the assembled workflow")


def assembled_lines(spec: Mapping[str, Any], subgraphs: Mapping[str, Mapping[str, Any]]) -> dict[str, int]:
    """Path in the assembled workflow -> line of the builder code that wrote it, for `validate(..., lines=...)`."""
    lines = dict(spec.get("lines", {}))
    for name, subgraph in subgraphs.items():
        lines |= {f"subgraphs.{name}.{path}": line for path, line in subgraph.get("lines", {}).items()}
    return lines


def _joined(declared: Mapping[str, Any], written: Mapping[str, Any]) -> dict[str, Any]:
    kept = ("stage", "names", "parameters", "inputs")
    return {
        **written,
        "description": declared["description"] or written.get("description", ""),
        **{key: declared[key] for key in kept},
        "exit": {**written["exit"], "success_values": declared["exit_success_values"]},
    }


def _disagreements(name: str, declared: Mapping[str, Any], subgraph: Any) -> Iterator[Finding]:
    path = f"subgraphs.{name}"
    if subgraph is None:
        yield Finding(path, DISAGREE, "is declared and was not written", "Write its subgraph, or drop the declaration.")
        return
    written = subgraph.get("def") if isinstance(subgraph, Mapping) else None
    if not isinstance(written, Mapping) or not isinstance(written.get("exit"), Mapping):
        yield Finding(path, DISAGREE, "is not what Subgraph.to_dict() gives")
        return
    if _kebab(written.get("skill")) != _kebab(declared["skill"]):
        yield _differ(f"{path}.skill", "skill", declared["skill"], written.get("skill"))
    if written.get("on_error") != declared["on_error"]:
        yield _differ(f"{path}.on_error", "on_error", declared["on_error"], written.get("on_error"))
    exits = written["exit"].get("success_values")
    if sorted(exits or ()) != sorted(declared["exit_success_values"]):
        yield _differ(f"{path}.exit", "success exits", declared["exit_success_values"], exits)
    if written.get("inputs") != declared["inputs"]:
        yield _differ(f"{path}.inputs", "inputs", declared["inputs"], written.get("inputs"))
    missing = [n for n in declared["outputs"] if n not in (written.get("outputs") or {})]
    for output in missing:
        hint = did_you_mean(output, written.get("outputs") or {}) if written.get("outputs") else "Call sg.set_outputs."
        yield Finding(f"{path}.outputs", DISAGREE, f"output {output!r} is declared and not set", hint)


def _differ(path: str, what: str, declared: Any, written: Any) -> Finding:
    hint = "The planner's declaration decides; write the subgraph to it, or declare it anew."
    return Finding(path, DISAGREE, f"{what}: declared {_shown(declared)}, written {_shown(written)}", hint)


def _stray(name: str, declared: Mapping[str, Any]) -> Finding:
    hint = did_you_mean(name, declared) if declared else "Declare it with spec.declare_subgraph."
    return Finding(f"subgraphs.{name}", DISAGREE, "was written and is not declared", hint)


def _kebab(name: Any) -> str:
    return str(name).replace("_", "-")


def _shown(value: Any) -> str:
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{k}: {v}" for k, v in sorted(value.items())) + "}"
    return ", ".join(map(str, value)) if isinstance(value, (list, tuple)) else repr(value)
