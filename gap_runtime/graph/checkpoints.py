"""Checkpoints: what must be true of the world when a subgraph ends, as expressions over ground truth.

The sidecar file `checkpoints/<subgraph>.py` is a Python literal, read as syntax and never run:

    CHECKPOINTS = [
        Checkpoint("held", 'w.body("soup").is_grasped()', rationale="...", validate=True, diagnostics={"z": '...'}),
    ]
"""

from __future__ import annotations

import ast
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from gap_runtime.contracts.documents import check_text
from gap_runtime.contracts.failures import DocumentError
from gap_runtime.contracts.predicates import evaluate

__all__ = ["MAX_CHECKPOINTS", "Checkpoint", "evaluate", "parse_checkpoints", "render_checkpoints", "unique"]

MAX_CHECKPOINTS = 6
MAX_FILE = 200_000
_KEYS = ("name", "predicate", "rationale", "validate", "weight", "diagnostics")


@dataclass(frozen=True)
class Checkpoint:
    """One promise. `validate` marks a postcondition; the others are probes. `diagnostics` are numbers to report."""

    name: str
    predicate: str
    rationale: str = ""
    validate: bool = True
    weight: float = 1.0
    diagnostics: Mapping[str, str] = field(default_factory=dict)

    def as_dict(self) -> dict[str, Any]:
        """Plain data, every key present."""
        return {key: dict(v) if isinstance(v := getattr(self, key), Mapping) else v for key in _KEYS}

    @classmethod
    def of(cls, data: Any, where: str) -> Checkpoint:
        """From plain data. Raises `DocumentError` naming the key."""
        if not isinstance(data, Mapping):
            raise DocumentError(where, f"a checkpoint must be a mapping, not {type(data).__name__}")
        unknown = [k for k in data if k not in _KEYS]
        if unknown:
            raise DocumentError(where, f"a checkpoint has no {unknown[0]!r}", hint=f"It has {', '.join(_KEYS)}.")
        point = cls(**{**{"name": "", "predicate": ""}, **data})
        problem = _problem(point)
        if problem:
            raise DocumentError(where, f"checkpoint {point.name!r}: {problem}")
        return point


def parse_checkpoints(source: str, where: str) -> tuple[Checkpoint, ...]:
    """Read a sidecar file. Raises `DocumentError` with the line."""
    if len(source) > MAX_FILE:
        raise DocumentError(where, f"is longer than {MAX_FILE} characters")
    try:
        module = ast.parse(check_text(source, where))
    except SyntaxError as error:
        raise DocumentError(f"{where}:{error.lineno or 1}", f"is not Python: {error.msg}") from None
    except (ValueError, RecursionError, MemoryError) as error:
        raise DocumentError(where, f"is not Python: {type(error).__name__}") from None
    statements = [s for s in module.body if not isinstance(s, (ast.Import, ast.ImportFrom)) and not _is_docstring(s)]
    match statements:
        case [ast.Assign(targets=[ast.Name(id="CHECKPOINTS")], value=ast.List(elts=calls))]:
            points = tuple(_call(c, where) for c in calls)
        case _:
            raise DocumentError(where, "must hold nothing but CHECKPOINTS = [Checkpoint(...), ...]")
    return unique(points, where)


def render_checkpoints(points: Sequence[Checkpoint]) -> str:
    """The sidecar file for these checkpoints; `parse_checkpoints` reads it back unchanged."""
    lines = [
        '"""What must be true when this subgraph ends, judged on ground truth and never seen by the policy."""\n',
        "from gap_runtime.graph.checkpoints import Checkpoint\n",
        "CHECKPOINTS = [",
    ]
    for point in points:
        lines.append("    Checkpoint(")
        lines += [f"        {value!r}," for value in (point.name, point.predicate)]
        lines.append(f"        rationale={point.rationale!r},")
        lines.append(f"        validate={point.validate},")
        lines += [f"        weight={point.weight!r},"] if point.weight != 1.0 else []
        lines += [f"        diagnostics={dict(point.diagnostics)!r},"] if point.diagnostics else []
        lines.append("    ),")
    return "\n".join([*lines, "]"]) + "\n"


def unique(points: Sequence[Checkpoint], where: str) -> tuple[Checkpoint, ...]:
    """The same checkpoints. Raises `DocumentError` where two share a name."""
    seen: set[str] = set()
    for point in points:
        if point.name in seen:
            raise DocumentError(where, f"two checkpoints are named {point.name!r}")
        seen.add(point.name)
    return tuple(points)


def _call(node: ast.expr, where: str) -> Checkpoint:
    line = f"{where}:{getattr(node, 'lineno', 1)}"
    if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "Checkpoint"):
        raise DocumentError(line, "is not a Checkpoint(...) with literal arguments")
    if len(node.args) > len(_KEYS) or any(k.arg is None for k in node.keywords):
        raise DocumentError(line, "Checkpoint(...) takes no * arguments and at most six values")
    try:
        data = {key: _literal(value) for key, value in zip(_KEYS, node.args, strict=False)}
        for keyword in node.keywords:
            if keyword.arg in data:
                raise DocumentError(line, f"{keyword.arg} is given twice")
            data[str(keyword.arg)] = _literal(keyword.value)
    except (ValueError, TypeError, RecursionError):
        raise DocumentError(line, "Checkpoint(...) takes literals only, predicates as text") from None
    return Checkpoint.of(data, line)


def _literal(node: ast.expr) -> Any:
    return ast.literal_eval(node)


def _is_docstring(statement: ast.stmt) -> bool:
    return isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant)


def _problem(point: Checkpoint) -> str:
    """Why this is not a checkpoint, or ''. What its expressions mean is the validator's business."""
    for key in ("name", "predicate"):
        value = getattr(point, key)
        if not isinstance(value, str) or not value.strip():
            return f"{key} must be text"
    if not isinstance(point.rationale, str):
        return "rationale must be text"
    if not isinstance(point.validate, bool):
        return "validate must be True or False"
    weight = point.weight
    if isinstance(weight, bool) or not isinstance(weight, (int, float)) or not (math.isfinite(weight) and weight > 0):
        return "weight must be a positive number"
    given = point.diagnostics
    if not isinstance(given, Mapping) or not all(isinstance(k, str) and isinstance(v, str) for k, v in given.items()):
        return "diagnostics must map names to expressions"
    return ""
