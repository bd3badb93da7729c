"""Foreign Python as text: builder code for the sandbox, scripts with our names, checkpoints as expressions."""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from gap_cli.importer.names import TYPES, Record, Verdict
from gap_cli.sandbox import run_builder
from gap_cli.sandbox.lint import SCRIPT, lint
from gap_runtime.contracts.documents import read_text
from gap_runtime.contracts.predicates import check_expression
from gap_runtime.contracts.types import CONTRACT_TYPES
from gap_runtime.errors import DocumentError
from gap_runtime.graph.checkpoints import Checkpoint

PRELUDE = Path(__file__).with_name("dialect.py")
PACKAGE = "gap"  # of the other dialect
_BODIES = ("is_in", "is_on", "is_above", "distance_to", "xy_distance_to")  # questions about a second body
_MEMBERS = {"is_on_strict": "is_on"}
_KEYS = {"type_name": "proto_type", "generated": None, "diagnostics_fn": None, "subgraph": None}
_SILENT = ("save", "print")
_END = 1 << 30  # the end of a line


def parse(source: str, where: str) -> ast.Module:
    """The syntax tree. Raises `DocumentError`."""
    try:
        return ast.parse(source)
    except (SyntaxError, ValueError, RecursionError) as error:
        raise DocumentError(where, f"is not Python: {error}") from None


def run_builder_code(source: str, where: str, record: Record) -> tuple[Any, dict[str, list[Checkpoint]]]:
    """The workflow a builder script makes, run in the sandbox without its imports, and its checkpoints by subgraph.

    Raises `DocumentError` where nothing in it makes a workflow, `SandboxError`.
    """
    module = _Builder(record).visit(parse(source, where))
    entry = _entry(module)
    if entry is None:
        raise DocumentError(where, "binds no Workflow and has no function that returns one")
    body = _without_imports(module.body, where, record)
    code = ast.unparse(ast.fix_missing_locations(ast.Module([*body, *ast.parse(f"spec = {entry}").body], [])))
    made = run_builder(f"{read_text(PRELUDE)}\n{code}\n", expect="spec")
    if not isinstance(made["checkpoints"], dict):
        raise DocumentError(where, "declares subgraphs and writes none", hint="Give one file with a Workflow in it.")
    return made["def"], {name: _usable(points, record) for name, points in made["checkpoints"].items()}


def read_checkpoints(source: str, where: str, record: Record) -> list[Checkpoint]:
    """The checkpoints of a sidecar file, as far as their predicates are expressions over the world."""
    module = parse(source, where)
    constants = {
        s.targets[0].id: s.value
        for s in module.body
        if isinstance(s, ast.Assign) and isinstance(s.targets[0], ast.Name) and isinstance(s.value, ast.Constant)
    }
    found: list[dict[str, Any]] = []
    for call in ast.walk(module):
        if isinstance(call, ast.Call) and isinstance(call.func, ast.Name) and call.func.id == "Checkpoint":
            given = _checkpoint(call, record, constants)
            if given:
                words = {k: v for k, v in given.items() if k != "predicate" and isinstance(v, ast.Constant)}
                text = ast.unparse(given["predicate"].body)
                found.append({"predicate": text, **{k: v.value for k, v in words.items()}})
    return _usable(found, record)


def _usable(points: list[dict[str, Any]], record: Record) -> list[Checkpoint]:
    """The checkpoints whose predicates are in our language of predicates."""
    kept = []
    for point in points:
        where, problems = f"checkpoint {point['name']}", check_expression(point["predicate"]).problems
        verdict: Verdict = "left" if problems else "mapped"
        record.note(verdict, where, "its predicate", point["predicate"], problems[0].message if problems else "")
        kept += [] if problems else [Checkpoint.of(point, where)]
    return kept


def _entry(module: ast.Module) -> str | None:
    """The expression that gives the workflow: a variable, or a call of the function that returns it."""
    kinds = ("Workflow", "WorkflowSpec")
    for statement in module.body:
        match statement:
            case ast.Assign(targets=[ast.Name(id=name)], value=ast.Call(func=ast.Name(id=kind))) if kind in kinds:
                return name
            case ast.FunctionDef(name=name, returns=ast.Name(id=kind)) if kind in kinds:
                return f"{name}()"
    names = [s.name for s in module.body if isinstance(s, ast.FunctionDef) and s.name.startswith("build")]
    return f"{names[0]}()" if names else None


def _without_imports(body: list[ast.stmt], where: str, record: Record) -> list[ast.stmt]:
    """The statements that need nothing imported, but for the builder itself."""
    gone = {"__name__", "__file__"}
    for statement in body:
        if isinstance(statement, (ast.Import, ast.ImportFrom)):
            module = getattr(statement, "module", "") or ""
            if not module.startswith((f"{PACKAGE}.builder", "vos.")):
                gone |= {(a.asname or a.name).partition(".")[0] for a in statement.names}
    kept = [s for s in body if not isinstance(s, (ast.Import, ast.ImportFrom))]
    while needing := [s for s in kept if gone & {n.id for n in ast.walk(s) if isinstance(n, ast.Name)}]:
        for statement in needing:
            name = getattr(statement, "name", ast.unparse(statement).partition("\n")[0][:40])
            gone |= {name} if hasattr(statement, "name") else set()
            record.note("left", f"{where}:{statement.lineno}", name, note="needs what is imported: not run")
        kept = [s for s in kept if s not in needing]
    return kept


class _Builder(ast.NodeTransformer):
    """Calls in our spelling, predicates of the world alone, nothing that writes, and no names that start with _."""

    def __init__(self, record: Record) -> None:
        self.record = record

    def visit_Expr(self, node: ast.Expr) -> ast.AST | None:
        match node.value:
            case ast.Call(func=ast.Name(id=name) | ast.Attribute(attr=name)) if name in _SILENT:
                return ast.Pass()
            case ast.Call(func=ast.Attribute(attr="add_checkpoint")) as call:
                given = _checkpoint(call, self.record, {})
                call.args, call.keywords = [], [ast.keyword(k, v) for k, v in given.items()]
                return self.generic_visit(node) if given else ast.Pass()
        return self.generic_visit(node)

    def visit_Call(self, node: ast.Call) -> ast.AST:
        self.generic_visit(node)
        node.keywords = [k for k in node.keywords if k.arg is None or _KEYS.get(k.arg, k.arg)]
        for keyword in node.keywords:
            keyword.arg = keyword.arg and _KEYS.get(keyword.arg, keyword.arg)
        return node

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.AST:
        self.generic_visit(node)
        node.name = _public(node.name)
        for argument in ast.walk(node.args):
            if isinstance(argument, ast.arg):
                argument.annotation = None
        return node

    def visit_Name(self, node: ast.Name) -> ast.AST:
        node.id = _public(node.id)
        return node


def _public(name: str) -> str:
    return name.lstrip("_") + "_" if name.startswith("_") and name.strip("_") and not name.endswith("__") else name


def _checkpoint(call: ast.Call, record: Record, constants: Mapping[str, ast.expr]) -> dict[str, Any]:
    """The keywords of our call, the predicate as a lambda of `w` alone; empty, and noted, where there is none."""
    given = {k.arg: k.value for k in call.keywords if k.arg} | dict(zip(("name", "predicate"), call.args, strict=False))
    predicate, where = given.get("predicate"), f"checkpoint {ast.unparse(given.get('name', ast.Constant('')))}"
    if not isinstance(predicate, ast.Lambda) or not predicate.args.args:
        record.note("left", where, "its predicate", note="is no lambda of the world")
        return {}
    world, *others = (a.arg for a in predicate.args.args)
    if {n.id for n in ast.walk(predicate.body) if isinstance(n, ast.Name)} & set(others):
        record.note("left", where, "its predicate", note="reads the subgraph's outputs; ours judge the world alone")
        return {}
    body = _Predicate(world, constants).visit(predicate.body)
    only_world = ast.arguments([], [ast.arg("w")], None, [], [], None, [])
    kept = {k: v for k, v in given.items() if k in ("name", "rationale", "validate", "weight")}
    return {**kept, "predicate": ast.Lambda(only_world, body)}


class _Predicate(ast.NodeTransformer):
    """The world is `w`, and a second body is asked for by name."""

    def __init__(self, world: str, constants: Mapping[str, ast.expr]) -> None:
        self.names = {world: ast.Name("w", ast.Load()), **constants}

    def visit_Name(self, node: ast.Name) -> ast.AST:
        return self.names.get(node.id, node)

    def visit_Call(self, node: ast.Call) -> ast.AST:
        self.generic_visit(node)
        if isinstance(node.func, ast.Attribute):
            node.func.attr = _MEMBERS.get(node.func.attr, node.func.attr)
            if node.func.attr in _BODIES:
                body = ast.Attribute(ast.Name("w", ast.Load()), "body", ast.Load())
                texts = (isinstance(a, ast.Constant) and isinstance(a.value, str) for a in node.args)
                node.args = [ast.Call(body, [a], []) if t else a for a, t in zip(node.args, texts, strict=True)]
        return node


def translate_script(source: str, where: str, record: Record) -> str:
    """A node's script with the tools and types it names as they are called here; the rest is untouched and listed."""
    edits: list[tuple[int, int, int, str]] = []  # line, first and last column in bytes, text
    for node in ast.walk(parse(source, where)):
        match node:
            case ast.ImportFrom(module=str(name)) if name.partition(".")[0] == PACKAGE:
                edits += [(line, 0, _END, "") for line in range(node.lineno + 1, (node.end_lineno or 0) + 1)]
                edits.append((node.lineno, node.col_offset, _END, "\n".join(_imports(node))))
            case ast.Call(func=ast.Attribute(attr="tool"), args=[ast.Constant(value=str(name)) as given, *_]):
                tool = record.tool(name, f"{where}:{node.lineno}")
                edits.append((given.lineno, given.col_offset, given.end_col_offset or 0, f'"{tool}"'))
                words = {k.arg: k for k in node.keywords if k.arg}
                renamed = record.inputs(words, record.tools.get(tool), f"{where}:{node.lineno}")
                for now, word in renamed.items():
                    edits.append((word.lineno, word.col_offset, word.col_offset + len(str(word.arg).encode()), now))
            case ast.Subscript(slice=ast.Constant(value=str(key)), value=value) if key in _MEMBER_NAMES:
                note = f"values are objects here: {ast.unparse(value)}.{key}"
                record.note("left", f"{where}:{node.lineno}", ast.unparse(node), note=note)
    lines = source.encode().split(b"\n")
    for line, first, last, text in sorted(edits, reverse=True):
        lines[line - 1] = lines[line - 1][:first] + text.encode() + lines[line - 1][last:]
    new = b"\n".join(lines).decode()
    for line, problem in lint(new, SCRIPT):
        record.note("left", f"{where}:{line}", problem, note="the jail of scripts refuses it")
    return new


def _imports(node: ast.ImportFrom) -> Iterator[str]:
    """What to import instead, name by name; one that does not exist here stays."""
    for alias in node.names:
        now, bound = TYPES.get(alias.name, alias.name), alias.asname or alias.name
        given = f" as {bound}" if bound != now else ""
        if alias.name == "NodeContext":
            yield f"from gap_runtime.contracts.tool import ScriptContext as {bound}"
        elif now in CONTRACT_TYPES:
            yield f"from gap_runtime.contracts.types import {now}{given}"
        else:
            yield f"from {node.module} import {alias.name}{given}"


_MEMBER_NAMES = {name for cls in CONTRACT_TYPES.values() for name in getattr(cls, "__dataclass_fields__", ())} - {
    "data"
}
