"""A workflow of the other dialect as workflow v3."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from gap_cli.importer.names import Record
from gap_runtime.contracts.tool import ToolSpec
from gap_runtime.errors import DocumentError
from gap_runtime.graph.load import flat_name
from gap_runtime.graph.model import VERSION, Node, SubgraphDef, Workflow
from gap_runtime.graph.references import KEY

Data = dict[str, Any]


def translate_workflow(data: Any, where: str, record: Record) -> Data:
    """Plain data of workflow v3. Raises `DocumentError` where the input is no workflow at all."""
    if not isinstance(data, Mapping) or not isinstance(data.get("subgraphs"), Mapping):
        raise DocumentError(where, "has no subgraphs", hint="Give a workflow.json or a builder script.")
    given = _known(data, Workflow, "workflow", record)
    if given.get("version") != VERSION:
        record.note("guessed", "version", given.get("version", "absent"), VERSION)
    return {
        **given,
        "version": VERSION,
        "meta": {str(k): str(v) for k, v in (given.get("meta") or {}).items()},
        "nodes": {n: _top_node(d, f"nodes.{n}", record) for n, d in (given.get("nodes") or {}).items()},
        "subgraphs": {n: translate_subgraph(d, f"subgraphs.{n}", record) for n, d in data["subgraphs"].items()},
    }


def translate_subgraph(definition: Any, where: str, record: Record) -> Data:
    """One subgraph definition, likewise."""
    given = _known(definition, SubgraphDef, where, record)
    nodes = {n: _known(d, Node, f"{where}.nodes.{n}", record) for n, d in (given.get("nodes") or {}).items()}
    for name, node in nodes.items():
        if "tool" in node:
            arm = "arm_id" in (node.get("inputs") or {})
            node["tool"] = record.tool(str(node["tool"]), f"{where}.nodes.{name}", arm=arm)
    specs = {n: record.tools.get(str(d.get("tool"))) for n, d in nodes.items()}
    for name, node in nodes.items():
        if node.get("inputs"):
            at = f"{where}.nodes.{name}.inputs"
            node["inputs"] = record.inputs(_references(node["inputs"], specs, at, record), specs[name], at)
    if not given.get("on_error"):
        record.note("guessed", f"{where}.on_error", "absent", "failed")
    return {
        "on_error": "failed",
        **given,
        **({"skill": record.skill(str(given["skill"]), f"{where}.skill")} if "skill" in given else {}),
        "inputs": {n: record.type(t, f"{where}.inputs.{n}") for n, t in (given.get("inputs") or {}).items()},
        "outputs": _references(given.get("outputs") or {}, specs, f"{where}.outputs", record),
        "nodes": nodes,
    }


def _known(data: Any, model: Any, where: str, record: Record) -> Data:
    """The keys that exist here."""
    if not isinstance(data, Mapping):
        raise DocumentError(where, "is not a mapping")
    for key in set(data) - set(model.model_fields):
        record.note("left", where, key, note="no such key")
    return {k: v for k, v in data.items() if k in model.model_fields and v is not None}


def _top_node(node: Any, where: str, record: Record) -> Data:
    kept = _known(node, Node, where, record)
    if kept.get("type") not in ("subgraph", "end"):
        record.note("left", where, kept.get("type"), note="only subgraphs and ends stand at the top level")
    calls = kept.get("recovery") or []
    kept["recovery"] = [_call(c, f"{where}.recovery", record) for c in (calls if isinstance(calls, list) else [calls])]
    return {k: v for k, v in kept.items() if v != []}


def _call(call: Any, where: str, record: Record) -> Data:
    inputs = call.get("inputs") or {}
    name = flat_name(call["service"], call["method"]) if "service" in call else str(call.get("tool"))
    tool = record.tool(name, where, arm="arm_id" in inputs)
    return {"tool": tool, "inputs": record.inputs(inputs, record.tools.get(tool), where)}


def _references(value: Any, specs: Mapping[str, ToolSpec | None], where: str, record: Record) -> Any:
    """`value` with every `$ref` as our tools name their outputs."""
    if isinstance(value, Mapping):
        if isinstance(value.get(KEY), str):
            return {KEY: record.reference(value[KEY], specs, where)}
        return {k: _references(v, specs, where, record) for k, v in value.items()}
    return [_references(v, specs, where, record) for v in value] if isinstance(value, list) else value
