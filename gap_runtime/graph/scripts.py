"""What a skill script takes, gives and may call, read from its source by syntax alone."""

from __future__ import annotations

import ast
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from gap_runtime.contracts.documents import check_text
from gap_runtime.contracts.failures import DocumentError
from gap_runtime.contracts.tool import REQUIRED, Param
from gap_runtime.contracts.types.typeref import TypeRef
from gap_runtime.graph.annotations import Names, Read, bundle_fields, read_annotation, stream_item

COMPUTED = ...  # a default that is not a literal: there is one, its value is not known here
MAX_SCRIPT = 200_000


@dataclass(frozen=True)
class ScriptSpec:
    """The contract of a script.

    `output` is set when `run` returns one bare value, `fields` when it returns named ones. `choices` holds the words
    a `Literal` field may take ('' for the bare output). `tools` are the tools it names in `ctx.tool("...")`;
    `any_tool` is True where a name is computed, so that it may call whatever its skill allows.
    `publishes` is True for a streaming script: `run` yields, or calls `ctx.publish`. `words` are those a `Literal`
    input may be.
    """

    inputs: tuple[Param, ...]
    output: TypeRef | None
    fields: Mapping[str, TypeRef]
    choices: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    tools: frozenset[str] = frozenset()
    any_tool: bool = False
    publishes: bool = False
    words: Mapping[str, tuple[str, ...]] = field(default_factory=dict)


def read_signature(source: str, where: str) -> ScriptSpec:
    """Read `def run(ctx, name: Type = default, ...) -> Type`. Raises `DocumentError` with the line of the problem."""
    module = _parse(source, where)
    run = next((s for s in module.body if isinstance(s, ast.FunctionDef) and s.name == "run"), None)
    if run is None:
        raise DocumentError(where, "has no function run", hint="Write def run(ctx, ...) -> ...:")
    names = Names.of(module)
    inputs, words = _inputs(run, names, where)
    output, fields, choices = _outputs(run, names, where)
    tools, any_tool = _tools(module)
    return ScriptSpec(inputs, output, fields, choices, tools, any_tool, _publishes(run), words)


def _parse(source: str, where: str) -> ast.Module:
    check_text(source, where)
    if len(source) > MAX_SCRIPT:
        raise DocumentError(where, f"is longer than {MAX_SCRIPT} characters")
    try:
        return ast.parse(source)
    except SyntaxError as error:
        raise DocumentError(f"{where}:{error.lineno or 1}", f"is not Python: {error.msg}") from None
    except (ValueError, RecursionError, MemoryError) as error:
        raise DocumentError(where, f"is not Python: {type(error).__name__}") from None


def _inputs(run: ast.FunctionDef, names: Names, where: str) -> tuple[tuple[Param, ...], dict[str, tuple[str, ...]]]:
    spec = run.args
    line = f"{where}:{run.lineno}"
    if spec.vararg or spec.kwarg or spec.posonlyargs:
        raise DocumentError(line, "run takes *args, **kwargs or positional-only parameters", hint="Name every input.")
    if not spec.args or spec.args[0].arg != "ctx":
        raise DocumentError(line, "the first parameter of run must be ctx", hint="Write def run(ctx, ...) -> ...:")
    required = len(spec.args) - len(spec.defaults)
    defaults: list[ast.expr | None] = [None] * required + list(spec.defaults)
    pairs = [*zip(spec.args[1:], defaults[1:], strict=True), *zip(spec.kwonlyargs, spec.kw_defaults, strict=True)]
    read = [_param(argument, default, names, where) for argument, default in pairs]
    return tuple(p for p, _ in read), {p.name: words for p, words in read if words}


def _param(argument: ast.arg, default: ast.expr | None, names: Names, where: str) -> tuple[Param, tuple[str, ...]]:
    line = f"{where}:{argument.lineno}"
    if argument.annotation is None:
        raise DocumentError(line, f"parameter {argument.arg!r} of run has no type")
    read = _read(argument.annotation, names, line, f"parameter {argument.arg!r}")
    value: Any = REQUIRED
    if default is not None:
        try:
            value = ast.literal_eval(default)
        except (ValueError, TypeError):
            value = COMPUTED
    return Param(argument.arg, read.type, value), read.choices


def _outputs(
    run: ast.FunctionDef, names: Names, where: str
) -> tuple[TypeRef | None, dict[str, TypeRef], dict[str, tuple[str, ...]]]:
    line = f"{where}:{run.lineno}"
    returns = run.returns
    if returns is None:
        raise DocumentError(line, "run does not say what it returns", hint="Write -> None where it returns nothing.")
    returns = _unquoted(returns, line)
    returns = stream_item(returns) or returns
    if isinstance(returns, ast.Constant) and returns.value is None:
        return None, {}, {}
    definition = names.bundles.get(returns.id) if isinstance(returns, ast.Name) else None
    annotations = bundle_fields(definition) if definition else None
    if definition is not None and annotations is None:
        raise DocumentError(
            f"{where}:{definition.lineno}",
            f"{definition.name} is not a result a script can return",
            hint="Make it a NamedTuple or a TypedDict, or return a contract type.",
        )
    if annotations is None:
        read = _read(returns, names, line, "the result")
        return read.type, {}, {"": read.choices} if read.choices else {}
    reads = {n: _read(a, names, f"{where}:{a.lineno}", f"field {n!r}") for n, a in annotations.items()}
    return None, {n: r.type for n, r in reads.items()}, {n: r.choices for n, r in reads.items() if r.choices}


def _unquoted(node: ast.expr, line: str) -> ast.expr:
    if not (isinstance(node, ast.Constant) and isinstance(node.value, str)):
        return node
    try:
        return ast.parse(node.value, mode="eval").body
    except (SyntaxError, ValueError, RecursionError):
        raise DocumentError(line, f"the result: {node.value!r} is not a type") from None


def _read(node: ast.expr, names: Names, line: str, what: str) -> Read:
    try:
        return read_annotation(node, names)
    except (ValueError, SyntaxError, RecursionError) as error:
        hint = "Use the types of gap_runtime.contracts.types, float, int, bool, str, list[...] or X | None."
        raise DocumentError(line, f"{what}: {error}", hint=hint) from None


def _tools(module: ast.Module) -> tuple[frozenset[str], bool]:
    """Literal tool names of every `*.tool("...")` call, and whether any call is not literal."""
    found: set[str] = set()
    literal: set[int] = set()
    for node in ast.walk(module):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr == "tool":
            first = node.args[0] if node.args else None
            if isinstance(first, ast.Constant) and isinstance(first.value, str):
                found.add(first.value)
                literal.add(id(node.func))
    mentions = (n for n in ast.walk(module) if isinstance(n, ast.Attribute) and n.attr == "tool")
    return frozenset(found), any(id(n) not in literal for n in mentions)


def _publishes(run: ast.FunctionDef) -> bool:
    return any(
        isinstance(n, (ast.Yield, ast.YieldFrom))
        or (isinstance(n, ast.Call) and isinstance(n.func, ast.Attribute) and n.func.attr == "publish")
        for n in ast.walk(run)
    )
