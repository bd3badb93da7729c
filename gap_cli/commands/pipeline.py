"""The verbs as functions: each reads what the one before wrote, writes its own folder whole, and returns data."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

from gap_cli.sandbox import level
from gap_cli.validate.sources import RECORD, Side, generation_record, refresh, require_unedited
from gap_cli.workspace.canonical import json_text, write_json
from gap_cli.workspace.inventory import Inventory
from gap_cli.workspace.metadata import record_stage
from gap_cli.workspace.run import Run, RunConfig
from gap_cli.workspace.stages import digest, product, write_stage
from gap_cli.workspace.validation import LOCK, validation_data
from gap_runtime.bundle.bundle import GOALS, WORKFLOW, GraphBundle
from gap_runtime.bundle.digest import BundleDigest
from gap_runtime.contracts.documents import read_json, read_text
from gap_runtime.errors import Finding, InstructionError, WorkflowError


def write_lock(run: Run, inventory: Inventory) -> None:
    """Record what the run depends on. Raises `StorageError`."""
    write_json(run.path / LOCK, inventory.lock(level()))


def serving_task(instruction: str) -> str:
    """The only installed task, or the only one with a scene that serves the instruction. Raises `InstructionError`."""
    from gap_cli.author import serves
    from gap_cli.workspace.tasks import find_tasks, open_task
    from gap_runtime.plugins import load_registry

    registry = load_registry()
    names = list(find_tasks(registry))
    fitting = names if len(names) == 1 else [name for name in names if serves(open_task(registry, name), instruction)]
    if len(fitting) != 1:
        problem = "Several tasks serve this instruction" if fitting else "No task serves this instruction"
        known = ", ".join(fitting or names) or "none"
        raise InstructionError(f"{problem}.", hint=f"Say which with --task, and hear what is wrong with it: {known}.")
    return fitting[0]


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
        files |= {GOALS: json_text(made.goals.data)} if made.goals else {}
        write_stage(run, "plan", files)
        write_lock(run, inventory)
        record_stage(run, "plan", started)
    return run


def generate_run(run: Run, *, unsafe: bool = False, overwrite: bool = False) -> dict[str, Any]:
    """Write the graph the plan describes; returns what it holds. What a person edited is lost only with `overwrite`.

    Raises `WorkflowError`, `SandboxError`, `RunError`.
    """
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
        files |= {GOALS: json_text(plan.goals.data)} if plan.goals else {}
        if not overwrite:
            require_unedited(run, files)
        files[RECORD] = generation_record(run, files)
        write_stage(run, "generate", files)
        write_lock(run, inventory)
        record_stage(run, "generate", started)
    subgraphs = made.workflow.subgraphs
    counts = {"subgraphs": len(subgraphs), "nodes": sum(len(s.nodes) for s in subgraphs.values())}
    return {**counts, "findings": [f.as_dict() for f in made.findings]}


def validate_run(run: Run, prefer: Side | None = None) -> list[Finding]:
    """Assemble the workflow again where its builder code was edited, check the graph by every rule and write
    findings.json; `prefer` decides where builder code and workflow.json were both edited.

    Raises `RunError`, `DocumentError`, `SandboxError`.
    """
    from gap_cli.validate.bundle import check_bundle
    from gap_cli.validate.validator import with_source

    started = time.monotonic()
    with run.held():
        if not (run.graph_folder / RECORD).is_file():
            product(run, "generate")
        inventory = Inventory.of(run.config)
        lines, findings = refresh(run, prefer)
        file = run.graph_folder / WORKFLOW
        checked = BundleDigest(files={WORKFLOW: digest(file)} if file.is_file() else {})
        try:
            if file.is_file():
                bundle = GraphBundle.load(run.graph_folder)
                checked = inventory.digest(bundle)
                findings = findings or check_bundle(bundle, inventory, lines, run.graph_prefix)
        except WorkflowError as error:  # not of the right shape: the other rules have nothing to look at
            findings = findings or [with_source(f, lines) for f in error.findings]
        write_lock(run, inventory)
        write_stage(run, "validate", {"findings.json": json_text(validation_data(run, checked, findings))})
        record_stage(run, "validate", started)
    return findings
