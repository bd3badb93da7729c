"""The one way a value becomes bytes that git sees: schema id first, rounded floats, one layout, a trailing newline."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import yaml

from gap_cli.workspace.atomic import replace_files
from gap_runtime.contracts.documents import ambiguous
from gap_runtime.contracts.encoding.codec import to_plain

DIGITS = 6  # of a float: micrometres, microradians, microseconds
WIDTH = 110  # a list or mapping of scalars that fits in this many columns stays on one line


def plain(data: Any) -> Any:
    """`data` as JSON-able values: floats rounded, `schema` first at the top, every other key in the order given."""
    values = to_plain(data, digits=DIGITS)
    return {"schema": values["schema"], **values} if isinstance(values, dict) and "schema" in values else values


def json_text(data: Any) -> str:
    """Canonical JSON document."""
    return _layout(plain(data), "") + "\n"


def json_line(data: Any) -> str:
    """Canonical JSON on one line, without the newline."""
    return json.dumps(plain(data), ensure_ascii=False, allow_nan=False, separators=(", ", ": "))


def jsonl_text(rows: Iterable[Any]) -> str:
    """One canonical JSON line per row."""
    return "".join(json_line(row) + "\n" for row in rows)


def yaml_text(data: Any) -> str:
    """Canonical YAML document, which the strict reader of contracts/documents.py accepts."""
    return str(yaml.dump(plain(data), Dumper=_Dumper, sort_keys=False, allow_unicode=True, width=WIDTH))


def write_json(path: Path, data: Any) -> bool:
    """Write canonical JSON atomically. True when the bytes changed. Raises `StorageError`."""
    return write_text(path, json_text(data))


def write_jsonl(path: Path, rows: Iterable[Any]) -> bool:
    """Write one JSON line per row atomically. True when the bytes changed. Raises `StorageError`."""
    return write_text(path, jsonl_text(rows))


def write_yaml(path: Path, data: Any) -> bool:
    """Write canonical YAML atomically. True when the bytes changed. Raises `StorageError`."""
    return write_text(path, yaml_text(data))


def write_text(path: Path, text: str) -> bool:
    """Write text as UTF-8 atomically, newline-terminated. True when the bytes changed. Raises `StorageError`."""
    return bool(replace_files({path: text_bytes(text)}))


def text_bytes(text: str) -> bytes:
    """UTF-8, ending in exactly the newline it has or one added."""
    return (text if not text or text.endswith("\n") else text + "\n").encode("utf-8")


class _Dumper(yaml.SafeDumper):
    """SafeDumper without aliases, quoting the words the strict reader calls ambiguous."""

    def ignore_aliases(self, data: Any) -> bool:
        return True

    def represent_str(self, data: str) -> Any:
        quote = '"' if ambiguous(data) else None
        return self.represent_scalar("tag:yaml.org,2002:str", data, style=quote)


_Dumper.add_representer(str, _Dumper.represent_str)


def _layout(data: Any, indent: str) -> str:
    """JSON with two-space indents, except that short collections of scalars stay on one line."""
    flat = json.dumps(data, ensure_ascii=False, allow_nan=False)
    items = data.values() if isinstance(data, Mapping) else data if isinstance(data, list) else ()
    if not items or (not any(isinstance(v, (dict, list)) for v in items) and len(indent) + len(flat) <= WIDTH):
        return flat
    inner = indent + "  "
    if isinstance(data, Mapping):
        parts = [f"{json.dumps(k, ensure_ascii=False)}: {_layout(v, inner)}" for k, v in data.items()]
    else:
        parts = [_layout(v, inner) for v in data]
    opening, closing = "{}" if isinstance(data, Mapping) else "[]"
    return f"{opening}\n{inner}" + f",\n{inner}".join(parts) + f"\n{indent}{closing}"
