"""From a plan to a workflow: every segment's builder code, run in the sandbox, assembled, validated, or refused."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from gap_cli.analysis.catalog import Catalog
from gap_cli.author.plans import Plan, Segment
from gap_cli.author.segment import render_checkpoint_file, render_subgraph, script_path
from gap_cli.builder.assemble import assemble, assembled_lines
from gap_cli.sandbox import run_builder
from gap_cli.skills import SkillLibrary
from gap_cli.validate.validator import validate
from gap_runtime.contracts.documents import read_text
from gap_runtime.contracts.task import Task
from gap_runtime.contracts.tool import ToolSpec
from gap_runtime.errors import Finding, RunError, WorkflowError
from gap_runtime.graph.checkpoints import Checkpoint, parse_checkpoints, render_checkpoints
from gap_runtime.graph.model import Workflow
from gap_runtime.graph.scripts import read_signature


@dataclass(frozen=True)
class Generated:
    """A workflow and what it was made of: builder code by subgraph, scripts by path, checkpoint files by subgraph.
    `findings` are what the validator has to say; after `build`, notes only."""

    workflow: Workflow
    sources: dict[str, str] = field(repr=False)
    scripts: dict[str, str] = field(repr=False)
    checkpoints: dict[str, str] = field(repr=False)
    findings: list[Finding]


def build(
    plan: Plan,
    task: Task,
    library: SkillLibrary,
    tools: Mapping[str, ToolSpec],
    *,
    written: Mapping[str, str] | None = None,
    unsafe: bool = False,
) -> Generated:
    """Write, run, join and judge the graph of a plan; `written` is an author's own builder code by segment.

    Raises `WorkflowError` with all findings when the validator refuses it, `SandboxError` when builder code breaks the
    rules, `DocumentError` for a skill's template that cannot be rendered.
    """
    labels = {name: model.label for name, model in task.objects.items()}
    made = draft(plan, labels, library, tools, joints=frozenset(task.joints), written=written, unsafe=unsafe)
    errors = [f for f in made.findings if f.severity == "error"]
    if errors:
        raise WorkflowError(errors, what="The generated workflow")
    return made


def draft(
    plan: Plan,
    labels: Mapping[str, str],
    library: SkillLibrary,
    tools: Mapping[str, ToolSpec],
    *,
    joints: frozenset[str] = frozenset(),
    written: Mapping[str, str] | None = None,
    unsafe: bool = False,
) -> Generated:
    """The graph of a plan with every finding, good or bad. `labels` names the objects checkpoints may speak of."""
    spec = run_builder(plan.source, unsafe=unsafe, expect="spec")
    segments = _segments(plan, spec)
    sources = {s.name: (written or {}).get(s.name) or render_subgraph(s, library.find(s.skill)) for s in segments}
    built = {name: run_builder(source, unsafe=unsafe, expect="sg") for name, source in sources.items()}
    workflow = assemble(spec, built)
    scripts = _scripts(segments, workflow, library)
    files = {s.name: render_checkpoint_file(s, library.find(s.skill), labels) for s in segments}
    checkpoints = {name: text for name, text in files.items() if text is not None} | _own_checkpoints(built)
    catalog = Catalog(
        tools,
        library.contracts,
        {path: read_signature(text, path) for path, text in scripts.items()},
        frozenset(labels) | frozenset(labels.values()),
        {name: parse_checkpoints(text, f"checkpoints/{name}.py") for name, text in checkpoints.items()},
        joints=joints,
    )
    findings = validate(workflow, catalog, lines=assembled_lines(spec, built))
    return Generated(workflow, sources, scripts, checkpoints, findings)


def _segments(plan: Plan, spec: Mapping[str, Any]) -> list[Segment]:
    """The segments in the order the topology declares them; both must speak of the same ones."""
    by_name = {s.name: s for s in plan.content.segments}
    declared = list(spec["def"]["subgraphs"])
    strange = sorted(set(declared) ^ set(by_name))
    if strange:
        where = "spec.py" if strange[0] in declared else "plan.json"
        raise RunError(
            f"Segment {strange[0]!r} is only in plan/{where}.", hint="Run gap plan again, or edit both files alike."
        )
    return [by_name[name] for name in declared]


def _own_checkpoints(built: Mapping[str, Mapping[str, Any]]) -> dict[str, str]:
    """The checkpoint files of subgraphs whose builder code adds checkpoints itself, instead of the skill's."""
    points = {name: [Checkpoint.of(p, f"checkpoints of {name}") for p in b["checkpoints"]] for name, b in built.items()}
    return {name: render_checkpoints(given) for name, given in points.items() if given}


def _scripts(segments: list[Segment], workflow: Workflow, library: SkillLibrary) -> dict[str, str]:
    """The canonical scripts the workflow uses, by path."""
    used = {node.script for d in workflow.subgraphs.values() for node in d.nodes.values() if node.script}
    paths = {script_path(s.name, p.name): p for s in segments for p in library.find(s.skill).scripts.values()}
    return {path: read_text(file) for path, file in paths.items() if path in used}
