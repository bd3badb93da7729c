"""JSON Schemas of the documents people write by hand, derived from the models, for editors and other programs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel

from gap_cli.validate.rules.node_keys import INSIDE, KEYS, TOP
from gap_runtime.contracts.types import CONTRACT_TYPES, SCALAR_TYPES
from gap_runtime.graph.model import Workflow
from gap_runtime.graph.references import STREAM, STREAM_TYPES

DIALECT = "https://json-schema.org/draft/2020-12/schema"
NAMES = [*CONTRACT_TYPES, *SCALAR_TYPES, "any"]
TYPE = {"type": "string", "pattern": rf"^({'|'.join(NAMES)})(\[[a-z_]+\])?(\[\])?\??$"}
_TYPED = ("inputs", "outputs", "literals")  # keys of a contract and of a subgraph that map names to types


def json_schema(model: type[BaseModel], name: str, *, leave_out: tuple[str, ...] = ()) -> dict[str, Any]:
    """The schema of one kind of document; `leave_out` names fields that are filled in by the reader."""
    schema = model.model_json_schema(by_alias=True)
    for key in leave_out:
        schema.get("properties", {}).pop(key, None)
    parts: dict[str, Any] = schema.get("$defs", {})
    if model is Workflow:
        _sharpen_workflow(schema, parts)
    if "ObjectModel" in parts:
        _needed(parts["Shape"], "size", {"properties": {"kind": {"const": "mesh"}}})
        links = {"properties": {"shape": {"properties": {"kind": {"const": "articulated"}}}}}
        _needed(parts["ObjectModel"], "mass", {"required": ["density"]}, links)
    for part in (schema, *parts.values()):
        _type_names(part)
    head = {"$schema": DIALECT, "$id": f"gap:schema/{name}", "title": name}
    return {**head, **{k: v for k, v in schema.items() if k != "title"}}


def _sharpen_workflow(schema: dict[str, Any], parts: dict[str, Any]) -> None:
    """Say which keys each type of node has, and which types stand where; the model leaves that to rule W2."""
    node = parts.pop("Node")
    parts.update({f"{kind}_node": _node(node, kind) for kind in KEYS})
    schema["properties"]["nodes"]["additionalProperties"] = _one_of(TOP)
    subgraph = parts["SubgraphDef"]["properties"]
    subgraph["nodes"]["additionalProperties"] = _one_of(INSIDE)
    subgraph["inputs"]["properties"] = {STREAM: {"enum": list(STREAM_TYPES)}}


def _needed(part: dict[str, Any], key: str, *unless: dict[str, Any]) -> None:
    """Ask for a key that the model has a default for only where the reader can fill it in from a file."""
    part["anyOf"] = [{"required": [key]}, *unless]


def _node(node: Mapping[str, Any], kind: str) -> dict[str, Any]:
    needed, allowed = KEYS[kind]
    properties = {k: _required_form(v, k in needed) for k, v in node["properties"].items() if k in allowed}
    properties["type"] = {"const": kind}
    return {
        "type": "object",
        "properties": properties,
        "required": ["type", *sorted(needed)],
        "additionalProperties": False,
    }


def _required_form(schema: dict[str, Any], needed: bool) -> dict[str, Any]:
    """Without null where the key must be given."""
    options = [o for o in schema.get("anyOf", ()) if o != {"type": "null"}]
    return options[0] if needed and options else schema


def _one_of(kinds: tuple[str, ...]) -> dict[str, Any]:
    return {"oneOf": [{"$ref": f"#/$defs/{kind}_node"} for kind in kinds]}


def _type_names(part: dict[str, Any]) -> None:
    """Where a mapping holds type names as text, say which there are."""
    for key in _TYPED:
        mapping = part.get("properties", {}).get(key, {})
        if mapping.get("additionalProperties") == {"type": "string"}:
            mapping["additionalProperties"] = TYPE
