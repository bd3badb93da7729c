"""Judges a workflow: every finding of every rule at once, each with its place, and nothing raised."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from gap_cli.analysis.catalog import Catalog
from gap_cli.analysis.context import WorkflowContext
from gap_cli.validate.rules import (
    checkpoints,
    data,
    dataflow,
    exits,
    node_keys,
    privilege,
    resources,
    skills,
    structure,
    topology,
)
from gap_runtime.contracts.failures import KNOWN
from gap_runtime.errors import Finding, WorkflowError
from gap_runtime.graph.model import Workflow

_FAMILIES = (structure, exits, node_keys, dataflow, data, resources, privilege, skills, checkpoints)
_TOP_FAMILIES = (node_keys, topology, dataflow, resources, privilege, skills)


def validate(workflow: Workflow, catalog: Catalog, lines: Mapping[str, tuple[str, int]] | None = None) -> list[Finding]:
    """All findings, sorted by path; empty when the workflow is sound.

    `lines` maps paths to the file and line that wrote them (see `assemble.assembled_lines`); a finding takes those of
    the nearest path above it.
    """
    findings = node_keys.w6_size(workflow)
    if findings:
        return findings
    context = WorkflowContext(workflow, catalog)
    found = {f for family in _TOP_FAMILIES for rule in family.TOP_RULES for f in rule(context)}
    for sg in context.subgraphs.values():
        found.update(f for family in _FAMILIES for rule in family.RULES for f in rule(sg))
    placed = (with_source(f, lines) for f in found) if lines else found
    return _listed_once(sorted(placed, key=lambda f: (f.path, f.code, f.message)))


def _listed_once(findings: list[Finding]) -> list[Finding]:
    """What exists is listed where it is first asked for, and not again."""
    lists: set[str] = set()
    kept = []
    for finding in findings:
        again = finding.hint.startswith(KNOWN) and finding.hint in lists
        lists.add(finding.hint)
        kept.append(replace(finding, hint="") if again else finding)
    return kept


def require_valid(workflow: Workflow, catalog: Catalog, lines: Mapping[str, tuple[str, int]] | None = None) -> None:
    """Raise `WorkflowError` with every finding that is an error."""
    errors = [f for f in validate(workflow, catalog, lines) if f.severity == "error"]
    if errors:
        raise WorkflowError(errors)


def with_source(finding: Finding, lines: Mapping[str, tuple[str, int]]) -> Finding:
    """The finding with the file and line that wrote the nearest path above it, where `lines` knows one."""
    path = finding.path
    while path and path not in lines:
        path = path.rpartition(".")[0]
    return replace(finding, file=lines[path][0], line=lines[path][1]) if path else finding
