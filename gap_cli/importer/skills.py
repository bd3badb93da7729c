"""A skill folder of the other dialect as a SKILL.md, a contract and the files they name."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from gap_cli.builder.source import subgraph_source
from gap_cli.importer.graphs import translate_subgraph
from gap_cli.importer.names import FAILURES, STAGES, Record
from gap_cli.importer.python import translate_script
from gap_cli.skills.bundle import SKILL_MD
from gap_cli.skills.frontmatter import split_frontmatter
from gap_cli.workspace.canonical import yaml_text
from gap_runtime.contracts.documents import parse_yaml, read_json, read_text
from gap_runtime.errors import DocumentError
from gap_runtime.graph.model import SubgraphDef

KEY = "gap"  # everything of a skill that is not Agent Skills is below it
_SPEC = ("name", "description", "license", "compatibility", "allowed-tools")
_INPUTS = "{% for name, type in inputs.items() %}\nsg.add_input({{ name }}, proto_type={{ type }})\n{% endfor %}\n"
_TEXTS = ("hard_rules", "errors", "tips")  # prose for agents: it belongs into the body
_READ = ("allowed_tools", "exit_conditions", "required_inputs", "produces_outputs", "canonical_scripts", "prompts",
         "references", "examples", "streaming", *_TEXTS)  # fmt: skip


def translate_skill(folder: Path, record: Record) -> dict[str, str]:
    """Relative path -> text of every file of the translated skill. Raises `DocumentError`."""
    where = str(folder / SKILL_MD)
    head, body = split_frontmatter(read_text(folder / SKILL_MD), where)
    data = parse_yaml(head, where, text_only=True)
    if not isinstance(data, Mapping):
        raise DocumentError(f"{where}:2", "frontmatter must be a mapping of keys")
    told = {**data, **data[KEY]} if isinstance(data.get(KEY), Mapping) else dict(data)
    for key in told:
        if key not in (*_SPEC, *_READ, "metadata", KEY):
            record.note("left", SKILL_MD, key, note="has no counterpart")
    name = record.name = re.sub(r"[^a-z0-9]+", "-", str(data.get("name", folder.name)).lower()).strip("-")
    files: dict[str, str] = {}
    contract = _contract(folder, told, record, files)
    template = _template(folder, name, told, contract, record)
    if template:
        contract["template"] = "templates/subgraph.py.j2"
        files["templates/subgraph.py.j2"] = template
    files["contract.yaml"] = yaml_text(contract)
    files[SKILL_MD] = f"---\n{yaml_text(_frontmatter(name, data))}---\n\n{body}\n{_notes(told, record)}"
    return files


def _frontmatter(name: str, data: Mapping[str, Any]) -> dict[str, Any]:
    metadata = data.get("metadata") if isinstance(data.get("metadata"), Mapping) else {}
    texts = {str(k): ", ".join(map(str, v)) if isinstance(v, list) else str(v) for k, v in (metadata or {}).items()}
    spec = {key: " ".join(str(data[key]).split()) for key in _SPEC if data.get(key)}
    return {**spec, "name": name, "metadata": {**texts, "gap-contract": "contract.yaml"}}


def _contract(folder: Path, told: Mapping[str, Any], record: Record, files: dict[str, str]) -> dict[str, Any]:
    exits = {str(k): str(v) for k, v in (told.get("exit_conditions") or {}).items()}
    failure = next((k for k in exits if k in FAILURES), next(reversed(exits), "failed"))
    record.note(
        "mapped" if failure in FAILURES else "guessed", "exit_conditions", ", ".join(exits), failure, "the failure"
    )
    words = f"{(told.get('metadata') or {}).get('category', '')} {told.get('name')}"
    stage = next((stage for start, stage in STAGES.items() if start in words), None)
    record.note("guessed", "stage", words, stage or "none")
    tools = [record.tool(str(t), "allowed_tools") for t in told.get("allowed_tools") or []]
    scripts = {k: v for item in told.get("canonical_scripts") or [] for k, v in dict(item).items()}
    references = {Path(str(r["path"])).stem: r["path"] for r in told.get("references") or [] if "path" in r}
    contract: dict[str, Any] = {
        "kind": "composite",
        "stage": stage,
        "inputs": {k: record.type(t, f"inputs.{k}") for k, t in (told.get("required_inputs") or {}).items()},
        "outputs": {k: record.type(t, f"outputs.{k}") for k, t in (told.get("produces_outputs") or {}).items()},
        "exits": {"success": {k: v for k, v in exits.items() if k != failure}, "failure": failure},
        "tools": [],
        "streaming": str(told.get("streaming", "false")).lower() == "true",
    }
    for kind, paths in (("scripts", scripts), ("prompts", told.get("prompts") or {}), ("references", references)):
        contract[kind] = _copied(folder, kind, paths, record, files)
    called = {t for p in contract["scripts"].values() for t in re.findall(r'\.tool\(\s*"([\w.]+)"', files[p])}
    for tool in sorted((called & set(record.tools)) - set(tools)):
        record.note("guessed", "allowed_tools", "not listed", tool, "a script calls it")
    contract["tools"] = [t for t in dict.fromkeys([*tools, *sorted(called)]) if t in record.tools]
    return {k: v for k, v in contract.items() if v not in (None, {}, [], False)}


def _copied(folder: Path, kind: str, paths: Mapping[str, Any], record: Record, files: dict[str, str]) -> dict[str, str]:
    """Logical name -> path of the files that are there, their texts added to `files`."""
    kept = {}
    for logical, path in paths.items():
        file = folder / str(path)
        if not file.is_file() or not file.resolve().is_relative_to(folder.resolve()):
            record.note("left", f"{kind}.{logical}", path, note="no such file in the skill")
            continue
        text = read_text(file)
        files[str(path)] = translate_script(text, str(path), record) if kind == "scripts" else text
        kept[str(logical)] = str(path)
    return kept


def _template(folder: Path, name: str, told: Mapping[str, Any], contract: Mapping[str, Any], record: Record) -> str:
    """The canonical subgraph as a template of builder code; '' where the skill shows none."""
    shown = next((e["path"] for e in told.get("examples") or [] if str(e.get("path", "")).endswith(".json")), None)
    if shown is None or not (folder / str(shown)).is_file():
        record.note("left", "template", "examples", note="no subgraph is shown: write templates/subgraph.py.j2")
        return ""
    example = {k: v for k, v in read_json(folder / str(shown)).items() if k not in ("skill", "inputs")}
    definition = translate_subgraph(example, str(shown), record)
    scripts = {Path(p).name: logical for logical, p in contract.get("scripts", {}).items()}
    slots: dict[str, str] = {"__segment__": "segment", "__skill__": "skill", "__on_error__": "on_error"}
    for node in definition["nodes"].values():
        logical = scripts.get(Path(str(node.get("script", ""))).name)
        if logical:
            node["script"] = f"__{logical}__"
            slots[node["script"]] = f"script({json.dumps(logical)})"
        constants = {k: v for k, v in node.get("inputs", {}).items() if isinstance(v, str)}
        for key, value in constants.items():
            record.note("guessed", f"template.{key}", value, note="a constant of the example is kept")
    definition |= {"skill": "__skill__", "on_error": "__on_error__"}
    text = subgraph_source("__segment__", SubgraphDef.load(definition, "the example's subgraph"))
    if any(mark in text for mark in ("{{", "{%", "{#")):
        record.note("left", "template", str(shown), note="holds what a template would run")
        return ""
    text = text.replace("\nsg.add_node", f"\n{_INPUTS}sg.add_node", 1)
    for slot, expression in slots.items():
        text = text.replace(repr(slot), f"{{{{ {expression} }}}}")
    for declared in contract.get("outputs", {}):
        ending = declared.removeprefix("<name>")
        text = re.sub(rf"(?<=[( ])\w+{re.escape(ending)}=", f"{{{{ output({json.dumps(declared)}) }}}}=", text)
    return text


def _notes(told: Mapping[str, Any], record: Record) -> str:
    """The rules and tips of the frontmatter as a section of the body."""
    lines: list[str] = []
    for key in _TEXTS:
        given = told.get(key) or []
        for text in [given] if isinstance(given, str) else given:
            lines.append(f"- {key.replace('_', ' ')}: {' '.join(str(text).split())}")
            record.note("mapped", key, str(text)[:40], "a line of SKILL.md")
    return "\n## Notes of the import\n\n" + "\n".join(lines) + "\n" if lines else ""
