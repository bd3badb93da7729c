"""Finds the references inside data that a workflow holds."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from gap_runtime.graph.references import KEY, Reference


def references_in(value: Any, path: str) -> Iterator[tuple[str, Reference | None]]:
    """Every reference with its path; None for one that is malformed."""
    if isinstance(value, Mapping):
        if KEY in value:
            yield path, parse_reference(value)
            return
        for name, part in value.items():
            yield from references_in(part, f"{path}.{name}")
    elif isinstance(value, list):
        for i, part in enumerate(value):
            yield from references_in(part, f"{path}.{i}")


def parse_reference(value: Mapping[str, Any]) -> Reference | None:
    """The reference `{"$ref": ...}` means, or None."""
    try:
        return Reference.parse(value[KEY]) if set(value) == {KEY} else None
    except (ValueError, TypeError):
        return None
