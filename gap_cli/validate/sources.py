"""The files a graph is generated into: which of them a person edited, and the workflow assembled again from its code.

`gap generate` notes what it wrote in generated.json. Builder files are the sources of workflow.json; whichever side was
edited counts, and where both were, a person decides.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

from pydantic import Field

from gap_cli.builder.assemble import SPEC_FILE, Lines, assemble, assembled_lines
from gap_cli.builder.source import builder_lines, workflow_lines
from gap_cli.sandbox import run_builder
from gap_cli.validate.validator import with_source
from gap_cli.workspace.atomic import replace_files
from gap_cli.workspace.canonical import json_text, text_bytes
from gap_cli.workspace.run import Run
from gap_cli.workspace.stages import digest
from gap_runtime.bundle.bundle import WORKFLOW
from gap_runtime.bundle.digest import text_sha256
from gap_runtime.contracts.documents import read_json, read_text
from gap_runtime.contracts.models import Document
from gap_runtime.errors import Finding, RunError, SandboxError, WorkflowError
from gap_runtime.graph.checkpoints import Checkpoint, render_checkpoints
from gap_runtime.graph.dump import dump_workflow
from gap_runtime.graph.load import load_workflow

RECORD = "generated.json"
PLAN_FILE = "plan/plan.json"
BUILDER_RULE = "W4"
Side = Literal["builder", "workflow"]


class GenerationRecord(Document):
    """The content of generated.json: sha256 by path, `plan/...` in the run and the rest in the graph's folder.

    `files` are as `gap generate` wrote them; `assembled` are builder code and what was last assembled from it.
    """

    schema_: Literal["gap/generated/v1"] = Field(default="gap/generated/v1", alias="schema")
    files: dict[str, str]
    assembled: dict[str, str]

    @classmethod
    def read(cls, run: Run) -> GenerationRecord | None:
        """The run's record; None where the graph was not generated here. Raises `DocumentError`."""
        file = run.graph_folder / RECORD
        return cls.load(read_json(file), str(file)) if file.is_file() else None


def generation_record(run: Run, files: Mapping[str, str]) -> str:
    """generated.json for `files` that are about to be written into the graph's folder, made from the run's plan."""
    digests = {name: text_sha256(text_bytes(text).decode()) for name, text in sorted(files.items())}
    made_from = {name: digest(run.path / name) for name in (PLAN_FILE, SPEC_FILE)}
    both = {name: value for name, value in digests.items() if name == WORKFLOW or _is_builder(name)}
    return json_text(GenerationRecord(files=digests, assembled={**made_from, **both}).model_dump(by_alias=True))


def require_unedited(run: Run, files: Mapping[str, str]) -> None:
    """Raise `RunError` where writing `files` into the graph's folder would lose what a person wrote there."""
    record = GenerationRecord.read(run)
    there = {p.relative_to(run.graph_folder).as_posix(): p for p in run.graph_folder.rglob("*") if p.is_file()}
    lost = []
    for name, path in sorted(there.items()):
        known = {record.files.get(name), None if _is_builder(name) else record.assembled.get(name)} if record else set()
        same = name in files and text_bytes(files[name]) == path.read_bytes()
        if not (same or name == RECORD or "__pycache__" in path.parts or digest(path) in known):
            lost.append(_shown(run, name))
    if lost:
        raise RunError(
            f"Edited since {run.name} was generated: {', '.join(lost)}.",
            hint=f"To keep that: gap validate {run.argument}. To lose it: gap generate {run.argument} --overwrite",
        )


def refresh(run: Run, prefer: Side | None = None) -> tuple[Lines, list[Finding]]:
    """Assemble the workflow again where its builder code was edited. Returns the lines that findings about the workflow
    point to, and what is wrong with the builder code; then nothing was written.

    `prefer` decides where both sides were edited. Raises `RunError` where it has to and does not, or where the plan was
    edited; `SandboxError` where builder code cannot be run here.
    """
    record, workflow = GenerationRecord.read(run), run.graph_folder / WORKFLOW
    if record is None:
        return _workflow_lines(run), []
    if (plan := run.path / PLAN_FILE).is_file() and digest(plan) != record.assembled.get(PLAN_FILE):
        raise RunError(
            f"{PLAN_FILE} was edited since the graph was generated.", hint=f"Type: gap generate {run.argument}"
        )
    sources = builder_files(run)
    now = {name: text_sha256(text) for name, text in sources.items()}
    edited = [name for name, value in now.items() if record.assembled.get(name) != value]
    by_hand = workflow.is_file() and digest(workflow) != record.assembled.get(WORKFLOW)
    if prefer == "workflow" or not (edited or (by_hand and prefer) or not workflow.is_file()):
        if edited:  # what it says is in the workflow already, or unwanted
            _write(run, record.model_copy(update={"assembled": {**record.assembled, **now}}), {})
        return _workflow_lines(run) if by_hand or SPEC_FILE not in sources else _builder_lines(run, sources), []
    made, findings = _assemble(run, sources)
    if findings:
        return {}, findings
    lost = [] if prefer else [name for name, text in made.items() if _is_by_hand(run, record, name, text)]
    if lost:
        raise RunError(
            "The builder code and what is assembled from it were both edited: "
            f"{', '.join(_shown(run, name) for name in [*edited, *lost])}.",
            hint=f"Keep one, lose the other: gap validate {run.argument} --source builder, or --source workflow",
        )
    assembled = {**record.assembled, **now, **{name: text_sha256(text) for name, text in made.items()}}
    _write(run, record.model_copy(update={"assembled": assembled}), made)
    return _builder_lines(run, sources), []


def builder_files(run: Run) -> dict[str, str]:
    """The builder code of a run by its name in the record: `plan/spec.py` and `subgraphs/<name>.py`."""
    spec = run.path / SPEC_FILE
    found = {SPEC_FILE: read_text(spec)} if spec.is_file() else {}
    return found | {f"subgraphs/{p.name}": read_text(p) for p in sorted(run.graph_folder.glob("subgraphs/*.py"))}


def _assemble(run: Run, sources: Mapping[str, str]) -> tuple[dict[str, str], list[Finding]]:
    """Run all builder code; the texts it makes by name in the graph's folder, or what is wrong. Raises `RunError`."""
    if SPEC_FILE not in sources:
        raise RunError(
            f"Builder code in {run.graph_folder}/subgraphs was edited, and {SPEC_FILE}, which joins it, is not there.",
            hint="Edit workflow.json instead and add --source workflow, or validate the run it was generated in.",
        )
    built: dict[str, dict[str, Any]] = {}
    findings = []
    for name, source in sources.items():
        try:
            built[name] = run_builder(source, expect="spec" if name == SPEC_FILE else "sg")
        except SandboxError as error:
            if error.cause == "unavailable":
                raise
            path = "nodes" if name == SPEC_FILE else f"subgraphs.{Path(name).stem}"
            file = _shown(run, name)
            findings.append(Finding(path, BUILDER_RULE, error.message, error.hint, file=file, line=error.line))
    if findings:
        return {}, findings
    spec = built.pop(SPEC_FILE)
    subgraphs = {Path(name).stem: data for name, data in built.items()}
    try:
        workflow = assemble(spec, subgraphs)
    except WorkflowError as error:
        lines = assembled_lines(spec, subgraphs)
        return {}, [with_source(finding, lines) for finding in error.findings]
    points = {n: [Checkpoint.of(p, f"checkpoints of {n}") for p in d["checkpoints"]] for n, d in subgraphs.items()}
    files = {f"checkpoints/{name}.py": render_checkpoints(given) for name, given in points.items() if given}
    return {WORKFLOW: json_text(dump_workflow(workflow)), **files}, []


def _is_by_hand(run: Run, record: GenerationRecord, name: str, text: str) -> bool:
    """Whether a person wrote what is in this file, and would lose it to `text`."""
    file = run.graph_folder / name
    known = (text_sha256(text), record.files.get(name), record.assembled.get(name))
    return file.is_file() and digest(file) not in known


def _write(run: Run, record: GenerationRecord, texts: Mapping[str, str]) -> None:
    all_of_it = {**texts, RECORD: json_text(record.model_dump(by_alias=True))}
    replace_files({run.graph_folder / name: text_bytes(text) for name, text in all_of_it.items()})


def _builder_lines(run: Run, sources: Mapping[str, str]) -> Lines:
    workflow = load_workflow(run.graph_folder / WORKFLOW)
    return builder_lines(workflow, {_shown(run, name): text for name, text in sources.items()})


def _workflow_lines(run: Run) -> Lines:
    file = run.graph_folder / WORKFLOW
    return workflow_lines(read_text(file), _shown(run, WORKFLOW))


def _is_builder(name: str) -> bool:
    return name.startswith("subgraphs/")


def _shown(run: Run, name: str) -> str:
    """The name of a file as a person finds it in the run."""
    return name if name.startswith("plan/") else run.graph_prefix + name
