"""The verbs as functions: each reads what the one before wrote, writes its own folder whole, and returns data."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

from gap_cli.sandbox import level
from gap_cli.workspace.canonical import json_text, write_json
from gap_cli.workspace.inventory import Inventory
from gap_cli.workspace.metadata import note
from gap_cli.workspace.run import Run
from gap_cli.workspace.run_config import Asked
from gap_cli.workspace.stages import digest, product, write_stage
from gap_runtime.contracts.documents import read_json, read_text
from gap_runtime.errors import Finding, WorkflowError

FINDINGS = "gap/findings/v1"


def write_lock(run: Run, inventory: Inventory) -> None:
    """Record what the run depends on. Raises `StorageError`."""
    write_json(run.path / "lock.json", inventory.lock(level()))


def plan_run(root: Path, asked: Asked) -> Run:
    """Plan the graph's topology; the run comes to be only when that worked. Raises `InstructionError`, ..."""
    from gap_cli.author import plan

    started = time.monotonic()
    inventory = Inventory.of(asked)
    asked = asked.model_copy(update={"variant": inventory.task.variant})
    made = plan(
        inventory.task, asked.instruction, inventory.library, inventory.tools, inventory.registry.authors, asked.author
    )
    run = Run.create(root, asked)
    with run.held():
        files = {"spec.py": made.source, "plan.md": made.markdown, "plan.json": json_text(made.data)}
        write_stage(run, "plan", files)
        write_lock(run, inventory)
        note(run, "plan", started)
    return run


def generate_run(run: Run, *, unsafe: bool = False) -> dict[str, Any]:
    """Write the graph the plan describes; returns what it holds. Raises `WorkflowError`, `SandboxError`, `RunError`."""
    from gap_cli.author import generate
    from gap_cli.author.plans import Plan
    from gap_runtime.graph.dump import dump_workflow

    started = time.monotonic()
    with run.held():
        file = product(run, "plan")
        plan = Plan.load(read_json(file), str(file), read_text(file.with_name("spec.py")))
        inventory = Inventory.of(run.asked)
        authors = inventory.registry.authors
        made = generate(plan, inventory.task, inventory.library, inventory.tools, authors, unsafe=unsafe)
        workflow = dump_workflow(made.workflow)
        files = {"workflow.json": json_text(workflow)}
        files |= {f"subgraphs/{name}.py": text for name, text in made.sources.items()}
        files |= {f"checkpoints/{name}.py": text for name, text in made.checkpoints.items()}
        files |= made.scripts
        write_stage(run, "generate", files)
        write_lock(run, inventory)
        note(run, "generate", started)
    subgraphs = made.workflow.subgraphs
    counts = {"subgraphs": len(subgraphs), "nodes": sum(len(s.nodes) for s in subgraphs.values())}
    return {**counts, "findings": [f.as_dict() for f in made.findings]}


def validate_run(run: Run) -> list[Finding]:
    """Check the graph by every rule and write findings.json. Raises `RunError`, `DocumentError`."""
    started = time.monotonic()
    with run.held():
        file = product(run, "generate")
        findings = _findings(file, run.folder("plan") / "spec.py", Inventory.of(run.asked))
        content = {"schema": FINDINGS, "workflow": digest(file), "findings": [f.as_dict() for f in findings]}
        write_stage(run, "validate", {"findings.json": json_text(content)})
        note(run, "validate", started)
    return findings


def _findings(file: Path, spec: Path, inventory: Inventory) -> list[Finding]:
    from gap_cli.analysis.catalog import read_catalog
    from gap_cli.builder.source import folder_lines
    from gap_cli.validate.validator import validate
    from gap_runtime.graph.load import load_workflow

    try:
        workflow = load_workflow(file)
    except WorkflowError as error:  # not of the right shape: the other rules have nothing to look at
        return list(error.findings)
    task = inventory.task
    names = {*task.objects, *(model.label for model in task.objects.values())}
    catalog = read_catalog(
        workflow, file.parent, inventory.tools, inventory.library.contracts, names, joints=task.joints
    )
    return validate(workflow, catalog, lines=folder_lines(workflow, file.parent / "subgraphs", spec))
