"""Joins the planner's topology and the authors' subgraphs into one workflow, and refuses where the two disagree."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from gap_runtime.contracts.models import Document
from gap_runtime.errors import Finding, WorkflowError, did_you_mean
from gap_runtime.graph.load import check_values, parse_workflow
from gap_runtime.graph.model import SubgraphDef, Workflow
from gap_runtime.graph.references import STREAM

DISAGREE = "W4"
SPEC_FILE = "plan/spec.py"
Lines = dict[str, tuple[str, int]]  # path in a workflow -> file and line that wrote it


class DeclaredSubgraph(Document):
    """What `declare_subgraph` says of one subgraph."""

    skill: str
    description: str = ""
    stage: str | None = None
    inputs: dict[str, str] = {}
    outputs: dict[str, str] = {}
    exit_success_values: list[str]
    on_error: str = ""
    names: dict[str, str] = {}
    parameters: dict[str, Any] = {}


class DeclaredWorkflow(Document):
    """What `WorkflowSpec` says: the top level of a workflow, with declarations for definitions."""

    version: int
    meta: Any = {}
    nodes: Any
    edges: Any = []
    conditional_edges: Any = {}
    subgraphs: dict[str, DeclaredSubgraph]


class BuilderOutput(Document):
    """What `to_dict()` of either builder gives; `def` is read on its own."""

    kind: str
    name: str
    checkpoints: list[dict[str, Any]] = []
    lines: dict[str, int] = {}


def assemble(spec: Mapping[str, Any], subgraphs: Mapping[str, Mapping[str, Any]]) -> Workflow:
    """The workflow of `WorkflowSpec.to_dict()` and, by definition name, `Subgraph.to_dict()` of each.

    Raises `WorkflowError` with every disagreement: a subgraph not written, an input, exit or skill spelled otherwise
    than declared; `DocumentError` where a part is not what a builder gives. The meaning of the whole is still the
    validator's to check.
    """
    topology = DeclaredWorkflow.load(_definition(spec, "spec"), "spec")
    written = {
        name: SubgraphDef.load(_definition(subgraphs[name], name), f"subgraph {name}")
        for name in topology.subgraphs
        if name in subgraphs
    }
    declared = topology.subgraphs
    findings = [f for name, d in declared.items() for f in _disagreements(name, d, written.get(name))]
    findings += [_stray(name, declared) for name in subgraphs if name not in declared]
    if findings:
        raise WorkflowError(sorted(findings))
    joined = {name: _joined(declared[name], subgraphs[name]["def"]) for name in declared}
    return parse_workflow({**spec["def"], "subgraphs": joined}, "the assembled workflow")


def assembled_lines(spec: Mapping[str, Any], subgraphs: Mapping[str, Mapping[str, Any]]) -> Lines:
    """Path in the assembled workflow -> file and line of the builder code that wrote it, for `validate(..., lines)`."""
    lines = {path: (SPEC_FILE, line) for path, line in spec.get("lines", {}).items()}
    for name, subgraph in subgraphs.items():
        for path, line in subgraph.get("lines", {}).items():
            lines[f"subgraphs.{name}.{path}"] = (subgraph_file(name), line)
    return lines


def subgraph_file(name: str) -> str:
    """Where a run keeps the builder code of a subgraph definition."""
    return f"generate/subgraphs/{name}.py"


def _definition(data: Any, where: str) -> Any:
    """The `def` of what a builder gives. Raises `DocumentError`."""
    check_values(data, where)
    rest = {k: v for k, v in data.items() if k != "def"} if isinstance(data, Mapping) else data
    BuilderOutput.load(rest, where)
    return data.get("def")


def _joined(declared: DeclaredSubgraph, written: Mapping[str, Any]) -> dict[str, Any]:
    return {
        **written,
        "description": declared.description or written.get("description", ""),
        "stage": declared.stage,
        "names": declared.names,
        "parameters": declared.parameters,
        "inputs": declared.inputs,
        "exit": {**written["exit"], "success_values": declared.exit_success_values},
        "on_error": declared.on_error or written.get("on_error", ""),
    }


def _disagreements(name: str, declared: DeclaredSubgraph, written: SubgraphDef | None) -> Iterator[Finding]:
    path = f"subgraphs.{name}"
    if written is None:
        yield Finding(path, DISAGREE, "is declared and was not written", "Write its subgraph, or drop the declaration.")
        return
    if _kebab(written.skill) != _kebab(declared.skill):
        yield _differ(f"{path}.skill", "skill", declared.skill, written.skill)
    if declared.on_error and written.on_error and written.on_error != declared.on_error:
        yield _differ(f"{path}.on_error", "on_error", declared.on_error, written.on_error)
    if sorted(written.exit.success_values) != sorted(declared.exit_success_values):
        yield _differ(f"{path}.exit", "success exits", declared.exit_success_values, written.exit.success_values)
    if _bound(written.inputs) != _bound(declared.inputs):
        yield _differ(f"{path}.inputs", "inputs", declared.inputs, written.inputs)
    for output in declared.outputs:
        if output not in written.outputs:
            hint = did_you_mean(output, written.outputs) if written.outputs else "Call sg.set_outputs."
            yield Finding(f"{path}.outputs", DISAGREE, f"output {output!r} is declared and not set", hint)


def _differ(path: str, what: str, declared: Any, written: Any) -> Finding:
    hint = "The planner's declaration decides; write the subgraph to it, or declare it anew."
    return Finding(path, DISAGREE, f"{what}: declared {_shown(declared)}, written {_shown(written)}", hint)


def _stray(name: str, declared: Mapping[str, Any]) -> Finding:
    hint = did_you_mean(name, declared) if declared else "Declare it with spec.declare_subgraph."
    return Finding(f"subgraphs.{name}", DISAGREE, "was written and is not declared", hint)


def _bound(inputs: Mapping[str, str]) -> dict[str, str]:
    """Without the stream of observations, which is always there, declared or not."""
    return {name: type_ for name, type_ in inputs.items() if name != STREAM}


def _kebab(name: str) -> str:
    return name.replace("_", "-")


def _shown(value: Any) -> str:
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{k}: {v}" for k, v in sorted(value.items())) + "}"
    return ", ".join(value) if isinstance(value, list) else repr(value)
