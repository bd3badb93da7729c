"""Turns a predicate given as a lambda into the text of its expression, so that it can leave the sandbox as data."""

from __future__ import annotations

import ast
import linecache
from collections.abc import Callable, Mapping
from types import FunctionType
from typing import Any

from gap_runtime.contracts.failures import DocumentError

WORLD = "w"  # what an expression calls the world, whatever the lambda called it
_HINT = "Write the predicate as text: 'w.body(\"id\").is_grasped()'."


def expression_of(predicate: str | Callable[..., Any], where: str) -> str:
    """The expression, as text over `w`; constants the lambda closes over are written out.

    Raises `DocumentError` for a lambda of several parameters, or one whose source is not at hand.
    """
    if isinstance(predicate, str):
        return predicate.strip()
    if not isinstance(predicate, FunctionType):
        raise DocumentError(where, f"a predicate is text or a lambda, not a {type(predicate).__name__}", hint=_HINT)
    parameter, body = _source(predicate, where)
    renamed = _Rename(parameter, _constants(predicate)).visit(body)
    return ast.unparse(ast.fix_missing_locations(renamed))


def _source(function: FunctionType, where: str) -> tuple[str, ast.expr]:
    code = function.__code__
    text = "".join(linecache.getlines(code.co_filename))
    try:
        module = ast.parse(text)
    except (SyntaxError, ValueError, RecursionError):
        module = ast.Module([], [])
    spans = {(p[0], p[2]) for p in code.co_positions() if p[0] is not None}
    for node in ast.walk(module):
        if isinstance(node, ast.Lambda) and (node.body.lineno, node.body.col_offset) in spans:
            return _parameter(node.args, where), node.body
        if isinstance(node, ast.FunctionDef) and node.lineno == code.co_firstlineno and node.name == code.co_name:
            match node.body:
                case [ast.Return(value=ast.expr() as value)]:
                    return _parameter(node.args, where), value
            raise DocumentError(where, f"{node.name} must be a single return of an expression", hint=_HINT)
    raise DocumentError(where, "the source of the predicate cannot be found", hint=_HINT)


def _parameter(arguments: ast.arguments, where: str) -> str:
    names = [a.arg for a in arguments.args]
    if len(names) != 1 or arguments.vararg or arguments.kwarg or arguments.kwonlyargs:
        raise DocumentError(where, "a predicate takes the world and nothing else", hint=_HINT)
    return names[0]


def _constants(function: FunctionType) -> dict[str, Any]:
    """Words and numbers the function can see by name."""
    names = function.__code__.co_freevars
    cells = dict(zip(names, function.__closure__ or (), strict=True))
    seen: Mapping[str, Any] = {**function.__globals__, **{n: c.cell_contents for n, c in cells.items()}}
    return {n: v for n, v in seen.items() if type(v) in (str, int, float, bool)}


class _Rename(ast.NodeTransformer):
    def __init__(self, parameter: str, constants: Mapping[str, Any]) -> None:
        self.parameter, self.constants = parameter, constants

    def visit_Name(self, node: ast.Name) -> ast.expr:
        if node.id == self.parameter:
            return ast.Name(WORLD, ast.Load())
        return ast.Constant(self.constants[node.id]) if node.id in self.constants else node
