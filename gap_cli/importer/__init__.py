"""Graphs and skills of the public peer's dialect, translated as far as they can be, with a record of every step."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from gap_cli.importer.graphs import translate_workflow
from gap_cli.importer.names import Record, Row
from gap_cli.importer.python import read_checkpoints, run_builder_code, translate_script
from gap_cli.importer.skills import translate_skill
from gap_cli.skills import SkillLibrary
from gap_cli.skills.library import find_skills
from gap_cli.workspace.atomic import replace_files
from gap_cli.workspace.canonical import json_text, text_bytes
from gap_runtime.contracts.documents import read_json, read_text
from gap_runtime.contracts.tool import ToolSpec
from gap_runtime.errors import Finding, StorageError, WorkflowError
from gap_runtime.graph.checkpoints import Checkpoint, render_checkpoints

__all__ = ["Imported", "Row", "import_path"]
WORKFLOW = "workflow.json"


@dataclass(frozen=True)
class Imported:
    """What was written where, how each part was translated, and what is still wrong with the result."""

    kind: str
    path: Path
    rows: tuple[Row, ...]
    findings: list[Finding] = field(repr=False)


def import_path(path: Path, out: Path, tools: Mapping[str, ToolSpec], library: SkillLibrary) -> list[Imported]:
    """Translate a graph (its folder, workflow.json or builder script) or the skills below a folder into `out`/<name>.

    Foreign builder code runs in the sandbox, nothing else of it is run. Raises `DocumentError`, `SandboxError`,
    `StorageError`.
    """
    if path.suffix in (".json", ".py") or (path / WORKFLOW).is_file():
        return [_graph(path, out, tools, library)]
    found = []
    for folder in find_skills(path):
        record = Record(tools, library)
        files = translate_skill(folder, record)
        written = _write(out / record.name, files)
        found.append(Imported("skill", written, tuple(record.rows), _check_skill(written, tools)))
    return found


def _graph(path: Path, out: Path, tools: Mapping[str, ToolSpec], library: SkillLibrary) -> Imported:
    file = path / WORKFLOW if path.is_dir() else path
    record = Record(tools, library, name=path.stem if path.suffix == ".py" else file.parent.resolve().name)
    points: dict[str, list[Checkpoint]] = {}
    if file.suffix == ".py":
        data, points = run_builder_code(read_text(file), str(file), record)
    else:
        data = read_json(file)
    workflow = translate_workflow(data, str(file), record)
    files = {WORKFLOW: json_text(workflow)}
    for name, definition in workflow["subgraphs"].items():
        sidecar = file.parent / "checkpoints" / f"{name}.py"
        if sidecar.is_file():
            points[name] = read_checkpoints(read_text(sidecar), str(sidecar), record)
        for script in {str(n["script"]) for n in definition["nodes"].values() if n.get("script")}:
            source = file.parent / script
            if source.resolve().is_relative_to(file.parent.resolve()) and source.is_file():
                files[script] = translate_script(read_text(source), script, record)
            else:
                record.note("left", f"subgraphs.{name}", script, note="no such file beside the graph")
    files |= {f"checkpoints/{name}.py": render_checkpoints(given) for name, given in points.items() if given}
    written = _write(out / record.name, files)
    return Imported("graph", written, tuple(record.rows), _check_graph(written, tools, library))


def _write(folder: Path, files: Mapping[str, str]) -> Path:
    if folder.exists():
        raise StorageError(f"{folder} exists already.", hint="Choose another folder with --out, or remove it.")
    replace_files({folder / name: text_bytes(text) for name, text in files.items()})
    return folder


def _check_skill(folder: Path, tools: Mapping[str, ToolSpec]) -> list[Finding]:
    from gap_cli.author.skill_check import check_folder

    return check_folder(folder, tools)


def _check_graph(folder: Path, tools: Mapping[str, ToolSpec], library: SkillLibrary) -> list[Finding]:
    from gap_cli.analysis.catalog import read_catalog
    from gap_cli.validate.validator import validate
    from gap_runtime.bundle.bundle import GraphBundle

    try:
        bundle = GraphBundle.load(folder)
    except WorkflowError as error:
        return list(error.findings)
    return validate(bundle.workflow, read_catalog(bundle, tools, library.contracts))
