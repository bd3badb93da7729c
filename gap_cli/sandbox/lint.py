"""A first look at untrusted source, for friendly messages only: the jail, not this, is what holds."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

MAX_SOURCE = 256_000
MAX_NODES = 50_000
MAX_DEPTH = 100
NO_IMPORT = " cannot be imported"
_IO = {
    "open", "input", "print", "exec", "eval", "compile", "__import__", "breakpoint", "help", "exit", "quit",
    "globals", "locals", "vars", "getattr", "setattr", "delattr", "memoryview",
}  # fmt: skip
_SCRIPT_MODULES = {
    "__future__", "collections", "collections.abc", "contextlib", "dataclasses", "enum", "functools", "itertools",
    "math", "operator", "re", "statistics", "time", "typing", "numpy", "numpy.linalg", "numpy.random", "numpy.fft",
    "numpy.typing", "scipy.spatial.transform",
}  # fmt: skip


@dataclass(frozen=True)
class Dialect:
    """What one kind of jailed code may look like. `modules` and what is below `packages` may be imported; `private`
    names start with one underscore, which a script may use for its own helpers and builder code may not."""

    what: str
    modules: frozenset[str]
    packages: tuple[str, ...] = ()
    private: bool = False
    calls: frozenset[str] = frozenset(_IO)


BUILDER = Dialect(
    "builder code", frozenset({"vos.builder", "vos.runtime.workflow", "gap_cli.builder.workflow", "__future__"})
)
SCRIPT = Dialect(
    "a script",
    frozenset(_SCRIPT_MODULES),
    packages=("gap_runtime.contracts",),
    private=True,
    calls=frozenset(_IO - {"print", "getattr"}),
)


def lint(source: str, dialect: Dialect, filename: str = "<source>") -> list[tuple[int, str]]:
    """What is not allowed, as (line, message), in order of lines. Raises SyntaxError where it is not Python."""
    if len(source) > MAX_SOURCE:
        return [(1, f"{dialect.what} is limited to {MAX_SOURCE // 1000} kB")]
    try:
        tree = ast.parse(source, filename)
    except (RecursionError, MemoryError):
        return [(1, "the source is nested too deeply")]
    except ValueError as error:
        return [(1, str(error))]
    count, depth = _size(tree)
    if count > MAX_NODES or depth > MAX_DEPTH:
        return [(1, f"{dialect.what} is limited to {MAX_NODES} syntax nodes, {MAX_DEPTH} deep")]
    return sorted({problem for node in ast.walk(tree) for problem in _problems(node, dialect)})


def report(source: str, dialect: Dialect, filename: str) -> dict[str, Any] | None:
    """What `lint` says as one error report for the host; None when it has nothing to say. Raises SyntaxError."""
    problems = lint(source, dialect, filename)
    if not problems:
        return None
    line, message = problems[0]
    hints = [f"Also line {n}: {m}." for n, m in problems[1:6]]
    if any(m.endswith(NO_IMPORT) for _, m in problems):
        hints.insert(0, importable(dialect))
    return {"cause": "forbidden", "line": line, "message": message, "hint": " ".join(hints)}


def importable(dialect: Dialect) -> str:
    """What may be imported, as a hint."""
    names = sorted(m for m in {*dialect.modules, *(p + ".*" for p in dialect.packages)} if m != "__future__")
    return f"Importable: {', '.join(names)}."


def _size(tree: ast.AST) -> tuple[int, int]:
    count, depth, layer = 0, 0, [tree]
    while layer:
        count, depth = count + len(layer), depth + 1
        layer = [child for node in layer for child in ast.iter_child_nodes(node)]
    return count, depth


def _problems(node: ast.AST, dialect: Dialect) -> Iterator[tuple[int, str]]:
    line = getattr(node, "lineno", 1)
    if isinstance(node, ast.Import):
        for alias in node.names:
            yield from _import(alias.name, line, dialect)
    elif isinstance(node, ast.ImportFrom):
        yield from _import("." * node.level + (node.module or ""), line, dialect)
    elif isinstance(node, ast.Attribute):
        if _hidden(node.attr, dialect):
            yield line, f"the attribute {node.attr} is out of bounds"
        elif node.attr in ("format", "format_map") and not dialect.private:
            yield line, f"write an f-string instead of .{node.attr}()"
    elif isinstance(node, ast.Name):
        if node.id in dialect.calls:
            yield line, f"{node.id} is not available: {dialect.what} does no input, output or evaluation"
        elif _hidden(node.id, dialect):
            yield line, f"the name {node.id} is out of bounds"
    elif isinstance(node, (ast.AsyncFunctionDef, ast.AsyncFor, ast.AsyncWith, ast.Await)):
        yield line, f"{dialect.what} is not asynchronous"
    elif isinstance(node, ast.MatchClass):
        yield node.lineno, "class patterns in match are out of bounds"


def _import(name: str, line: int, dialect: Dialect) -> Iterator[tuple[int, str]]:
    inside = any(name == p or name.startswith(p + ".") for p in dialect.packages)
    if name not in dialect.modules and not inside:
        yield line, name + NO_IMPORT


def _hidden(name: str, dialect: Dialect) -> bool:
    if dialect.private:
        return name.startswith("__") and name != "__name__"
    return name.startswith("_") and name != "_"
