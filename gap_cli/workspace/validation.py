"""validate/findings.json: what was checked, by digest, and what was found; and the gate that reads it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

from pydantic import ConfigDict, Field

from gap_cli.workspace.inventory import Inventory
from gap_cli.workspace.lock import lock_changes
from gap_cli.workspace.run import Run
from gap_cli.workspace.stages import digest, product
from gap_runtime.bundle.bundle import GraphBundle
from gap_runtime.bundle.digest import BundleDigest, differences
from gap_runtime.contracts.documents import read_json
from gap_runtime.contracts.models import Document
from gap_runtime.errors import Finding, RunError

LOCK = "lock.json"
SHOWN_CHANGES = 6


class FindingPart(Document):
    """What the gate needs of a finding."""

    model_config = ConfigDict(extra="ignore", frozen=True)
    code: str
    path: str
    message: str
    severity: str = "error"


class Validation(Document):
    """The content of findings.json. `digest` is the one hash over `bundle`; `sources` maps what the graph was made
    from (builder files, plan) to sha256, by path in the run."""

    model_config = ConfigDict(extra="ignore", frozen=True)
    schema_: Literal["gap/findings/v1"] = Field(alias="schema")
    digest: str
    bundle: BundleDigest
    sources: dict[str, str]
    findings: list[FindingPart]


def validation_data(run: Run, checked: BundleDigest, findings: Sequence[Finding]) -> dict[str, Any]:
    """The content of findings.json for what was checked."""
    return {
        "schema": "gap/findings/v1", "digest": checked.sha256, "bundle": checked.model_dump(),
        "sources": source_digests(run), "findings": [f.as_dict() for f in findings],
    }  # fmt: skip


def source_digests(run: Run) -> dict[str, str]:
    """sha256 of each file that the graph was made from, by path in the run."""
    files = [run.path / "plan/plan.json", run.path / "plan/spec.py", *run.graph_folder.glob("subgraphs/*.py")]
    return {file.relative_to(run.path).as_posix(): digest(file) for file in sorted(files) if file.is_file()}


def require_valid(run: Run, inventory: Inventory, lock: dict[str, Any]) -> GraphBundle:
    """The run's bundle, which `gap validate` accepted as it is now, with the tools, skills and providers there are now
    (`lock`: what lock.json would say now). Raises `RunError` naming what changed and what to type."""
    product(run, "generate")
    where = product(run, "validate")
    again = f"Type: gap validate {run.argument}"
    found = Validation.load(read_json(where), str(where))
    bundle = GraphBundle.load(run.graph_folder)
    changed = [*_changes(run, found, inventory.digest(bundle)), *_lock_changes(run, lock, found.bundle)]
    if changed:
        more = f", and {len(changed) - SHOWN_CHANGES} more" if len(changed) > SHOWN_CHANGES else ""
        listed = ", ".join(changed[:SHOWN_CHANGES]) + more
        raise RunError(f"{run.name} is not what was validated: {listed}.", hint=again)
    errors = [f for f in found.findings if f.severity == "error"]
    if errors:
        first = errors[0]
        raise RunError(
            f"The graph of {run.name} has {len(errors)} errors: {first.code} {first.path}: {first.message}",
            hint=f"Fix it. {again}",
        )
    return bundle


def _changes(run: Run, found: Validation, now: BundleDigest) -> list[str]:
    return [*found.bundle.changes(now, run.graph_prefix), *differences(found.sources, source_digests(run))]


def _lock_changes(run: Run, lock: dict[str, Any], used: BundleDigest) -> list[str]:
    file = run.path / LOCK
    if not file.is_file():
        return [f"{LOCK} is gone"]
    before = read_json(file)
    return lock_changes(before if isinstance(before, dict) else {}, lock, used)
