"""Reads a workflow: strictly, all problems of its shape at once, whatever the input is."""

from __future__ import annotations

import contextlib
import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from gap_runtime.contracts.documents import read_json
from gap_runtime.contracts.models import fields_at
from gap_runtime.errors import DocumentError, Finding, WorkflowError, did_you_mean
from gap_runtime.graph.model import VERSION, Workflow

MAX_DEPTH = 64
MAX_VALUES = 2_000_000
MAX_SHAPE_FINDINGS = 200
SHAPE, NODE_KIND, VERSIONED = "W1", "W2", "W3"
_MISSING = {  # key a part of a workflow needs -> the line to add
    "skill": '"skill": "<name>" (gap skills list)',
    "exit": '"exit": {"router_field": null, "success_values": ["<exit>"]}',
    "success_values": '"success_values": ["<exit>"]',
    "mapping": '"mapping": {"<value>": "<node>"}',
    "type": '"type": "tool", "script", "router", "noop", "subgraph" or "end"',
    "tool": '"tool": "<service>.<Method>" (gap tools list)',
    "nodes": '"nodes": {"<name>": {"type": "subgraph", "ref": "<subgraph>"}}',
    "subgraphs": '"subgraphs": {"<name>": {"skill": "<name>", ...}}',
}
RETIRED = ("service", "skill", "policy")  # types of node that older graphs wrote


def load_workflow(path: Path) -> Workflow:
    """Read workflow.json. Raises `DocumentError` (not JSON) or `WorkflowError` (not a workflow)."""
    return parse_workflow(read_json(path), str(path))


def parse_workflow(data: Any, where: str) -> Workflow:
    """The workflow that plain data describes. Raises `DocumentError` or `WorkflowError` with every problem of shape;
    what it means is for `validate` to judge."""
    if not isinstance(data, Mapping):
        raise DocumentError(where, f"a workflow is a mapping, not {_kind(data)}")
    check_values(data, where)
    if (version := data.get("version", VERSION)) != VERSION:
        raise WorkflowError([_other_version(version)], what=where)
    findings, rest = _retired(data)
    try:
        workflow = Workflow.model_validate(_flat_recoveries(rest))
    except ValidationError as error:
        findings += _shape_findings(error)
    if findings:
        raise WorkflowError(sorted(findings), what=where)
    return workflow


def _other_version(version: Any) -> Finding:
    message = f"is {version!r}, and this reads version {VERSION}"
    if version == str(VERSION):
        return Finding("version", VERSIONED, message, _quoting_hint("int_type", version))
    hint = "Rewrite it: begin -> an edge from START; on_success -> an edge; on_failure -> on_error; transitions -> "
    hint += "conditional_edges; parallel branches -> several edges from one node."
    return Finding("version", VERSIONED, message, hint if version == 2 else f'Write "version": {VERSION}.')


def check_values(data: Any, where: str) -> None:
    """Refuse what no later walk should meet: depth, sheer number, numbers that are not finite, keys not text."""
    stack: list[tuple[Any, int]] = [(data, 0)]
    seen = 0
    while stack:
        value, depth = stack.pop()
        seen += 1
        if depth > MAX_DEPTH:
            raise DocumentError(where, f"is nested deeper than {MAX_DEPTH} levels")
        if seen > MAX_VALUES:
            raise DocumentError(where, f"holds more than {MAX_VALUES} values")
        if isinstance(value, Mapping):
            odd = next((k for k in value if not isinstance(k, str)), None)
            if odd is not None:
                raise DocumentError(where, f"key {odd!r} is not text")
            stack.extend((v, depth + 1) for v in value.values())
        elif isinstance(value, (list, tuple)):
            stack.extend((v, depth + 1) for v in value)
        elif isinstance(value, float) and not math.isfinite(value):
            raise DocumentError(where, f"{value} is not a finite number")
        elif not isinstance(value, (str, int, float, bool)) and value is not None:
            raise DocumentError(where, f"holds a {type(value).__name__}, which no file can")


def _retired(data: Mapping[str, Any]) -> tuple[list[Finding], Mapping[str, Any]]:
    """A finding with the exact migration for every node of a retired type, and the data with those out of the way."""
    found, rest = _retired_in(data, "")
    definitions = data.get("subgraphs")
    if isinstance(definitions, Mapping):
        mended = dict(definitions)
        for name, definition in definitions.items():
            if isinstance(definition, Mapping):
                more, mended[name] = _retired_in(definition, f"subgraphs.{name}.")
                found += more
        rest = {**rest, "subgraphs": mended}
    return found, rest


def _retired_in(graph: Mapping[str, Any], prefix: str) -> tuple[list[Finding], Mapping[str, Any]]:
    nodes = graph.get("nodes")
    if not isinstance(nodes, Mapping):
        return [], graph
    old = {n: d for n, d in nodes.items() if isinstance(d, Mapping) and d.get("type") in RETIRED}
    found = [
        Finding(f"{prefix}nodes.{n}", NODE_KIND, f"node type {d['type']!r} is retired", migration(d["type"], d))
        for n, d in old.items()
    ]
    return found, {
        **graph,
        "nodes": {n: {"type": "noop"} if n in old else d for n, d in nodes.items()},
    } if old else graph


def flat_name(service: str, method: str) -> str:
    """`gripper.v1.Gripper` and `Open` as the flat tool name `gripper.Open`."""
    return f"{service.partition('.')[0]}.{method}"


def migration(kind: str, keys: Mapping[str, Any]) -> str:
    """What replaces a node of a retired type: the exact keys, as builder code."""
    if kind == "service":
        service, method = keys.get("service"), keys.get("method")
        known = isinstance(service, str) and isinstance(method, str)
        tool = flat_name(str(service), str(method)) if known else "<service>.<Method>"
        drop = "service and method"
    else:
        tool = next((v for k in (kind, "name", "tool") if isinstance(v := keys.get(k), str)), f"<{kind} name>")
        drop = kind
    return f'Write type="tool", tool="{tool}" and keep inputs; drop {drop}.'


def _flat_recoveries(data: Mapping[str, Any]) -> Mapping[str, Any]:
    """The paper writes a recovery as {service, method, inputs}; here it is {tool, inputs}."""
    nodes = data.get("nodes")
    if not isinstance(nodes, Mapping):
        return data
    return {**data, "nodes": {name: _flat_recovery(node) for name, node in nodes.items()}}


def _flat_recovery(node: Any) -> Any:
    calls = node.get("recovery") if isinstance(node, Mapping) else None
    if not isinstance(calls, list):
        return node
    return {**node, "recovery": [_flat_call(c) for c in calls]}


def _flat_call(call: Any) -> Any:
    match call:
        case {"service": str(service), "method": str(method)} if "tool" not in call:
            rest = {k: v for k, v in call.items() if k not in ("service", "method")}
            return {"tool": flat_name(service, method), **rest}
    return call


def _shape_findings(error: ValidationError) -> list[Finding]:
    problems = error.errors(include_url=False, include_context=False)
    found = {_shape_finding(p) for p in problems[:MAX_SHAPE_FINDINGS]}
    return sorted(found)


def _shape_finding(problem: Any) -> Finding:
    location = problem["loc"]
    path = ".".join(map(str, location)) or "the workflow"
    if problem["type"] == "extra_forbidden":
        known = fields_at(Workflow, location[:-1])
        return Finding(path, SHAPE, "is not a known key", did_you_mean(str(location[-1]), known))
    if problem["type"] == "missing":
        return Finding(path, SHAPE, "is missing", f"Add {_MISSING[location[-1]]}." if location[-1] in _MISSING else "")
    message = problem["msg"].removeprefix("Value error, ")
    return Finding(path, SHAPE, message, _quoting_hint(problem["type"], problem["input"]))


def _quoting_hint(wanted: str, value: Any) -> str:
    """How to write a number that was given as text, or a text that was given as a number: neither is the other."""
    if wanted == "string_type" and isinstance(value, (bool, int, float)):
        return f'Write "{json.dumps(value)}", in quotes.'
    if wanted in ("int_type", "float_type", "bool_type") and isinstance(value, str):
        with contextlib.suppress(ValueError):
            if isinstance(json.loads(value), (bool, int, float)):
                return f"Write {value}, without quotes."
    return ""


def _kind(value: Any) -> str:
    names = {type(None): "null", list: "a list", str: "text", bool: "a boolean", int: "a number", float: "a number"}
    return names.get(type(value), type(value).__name__)
