"""The verbs as functions: each reads what the one before wrote, writes its own folder whole, and returns data."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

from gap_cli.sandbox import level
from gap_cli.workspace.canonical import json_text, write_json
from gap_cli.workspace.inventory import Inventory
from gap_cli.workspace.metadata import record_stage
from gap_cli.workspace.run import Run, RunConfig
from gap_cli.workspace.stages import digest, product, write_stage
from gap_cli.workspace.validation import LOCK, validation_data
from gap_runtime.bundle.bundle import GOALS, WORKFLOW, GraphBundle
from gap_runtime.bundle.digest import BundleDigest
from gap_runtime.contracts.documents import read_json, read_text
from gap_runtime.errors import Finding, WorkflowError
from gap_runtime.graph.model import Workflow


def write_lock(run: Run, inventory: Inventory) -> None:
    """Record what the run depends on. Raises `StorageError`."""
    write_json(run.path / LOCK, inventory.lock(level()))


def plan_run(root: Path, config: RunConfig) -> Run:
    """Plan the graph's topology; the run comes to be only when that worked. Raises `InstructionError`, ..."""
    from gap_cli.author import plan

    started = time.monotonic()
    inventory = Inventory.of(config)
    config = config.model_copy(update={"variant": inventory.task.variant})
    made = plan(
        inventory.task,
        config.instruction,
        inventory.library,
        inventory.tools,
        inventory.registry.authors,
        config.author,
    )
    run = Run.create(root, config)
    with run.held():
        files = {"spec.py": made.source, "plan.md": made.markdown, "plan.json": json_text(made.data)}
        write_stage(run, "plan", files)
        write_lock(run, inventory)
        record_stage(run, "plan", started)
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
        inventory = Inventory.of(run.config)
        authors = inventory.registry.authors
        made = generate(plan, inventory.task, inventory.library, inventory.tools, authors, unsafe=unsafe)
        workflow = dump_workflow(made.workflow)
        files = {"workflow.json": json_text(workflow)}
        files |= {f"subgraphs/{name}.py": text for name, text in made.sources.items()}
        files |= {f"checkpoints/{name}.py": text for name, text in made.checkpoints.items()}
        files |= made.scripts
        goals = [goal.model_dump() for goal in plan.content.goals]
        files[GOALS] = json_text({"schema": "gap/goals/v1", "scene": plan.content.scene, "goals": goals})
        write_stage(run, "generate", files)
        write_lock(run, inventory)
        record_stage(run, "generate", started)
    subgraphs = made.workflow.subgraphs
    counts = {"subgraphs": len(subgraphs), "nodes": sum(len(s.nodes) for s in subgraphs.values())}
    return {**counts, "findings": [f.as_dict() for f in made.findings]}


def validate_run(run: Run) -> list[Finding]:
    """Check the graph by every rule and write findings.json. Raises `RunError`, `DocumentError`."""
    started = time.monotonic()
    with run.held():
        file = product(run, "generate")
        inventory = Inventory.of(run.config)
        try:
            bundle = GraphBundle.load(file.parent)
        except WorkflowError as error:  # not of the right shape: the other rules have nothing to look at
            findings = list(error.findings)
            checked = BundleDigest(files={WORKFLOW: digest(file)}, parameters={}, tools={}, skills={})
        else:
            findings = _findings(bundle.workflow, file.parent, run.folder("plan") / "spec.py", inventory)
            checked = inventory.digest(bundle)
        write_lock(run, inventory)
        write_stage(run, "validate", {"findings.json": json_text(validation_data(run, checked, findings))})
        record_stage(run, "validate", started)
    return findings


def _findings(workflow: Workflow, folder: Path, spec: Path, inventory: Inventory) -> list[Finding]:
    from gap_cli.analysis.catalog import read_catalog
    from gap_cli.builder.source import folder_lines
    from gap_cli.validate.validator import validate

    task = inventory.task
    names = {*task.objects, *(model.label for model in task.objects.values())}
    catalog = read_catalog(
        workflow, folder, inventory.tools, inventory.library.contracts, names,
        joints=task.joints, descriptions=inventory.library.descriptions,
    )  # fmt: skip
    return validate(workflow, catalog, lines=folder_lines(workflow, folder / "subgraphs", spec))
