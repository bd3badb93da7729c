"""Reads a Python annotation as a contract type, from syntax alone: no script is imported to learn its types."""

from __future__ import annotations

import ast
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from gap_runtime.contracts.types.typeref import TypeRef

_SCALARS = {
    "float": "float",
    "int": "int",
    "bool": "bool",
    "str": "string",
    "Any": "any",
    "dict": "any",
    "object": "any",
}
_LISTS = {"list", "List", "tuple", "Tuple", "Sequence"}
_STREAMS = {"Iterator", "Iterable", "Generator"}
_TYPE_MODULES = {"typing", "typing_extensions", "collections.abc", "collections"}
_FRAMES = {"WORLD": "world", "CAMERA": "camera", "BASE": "base", "TCP": "tcp"}


@dataclass
class Names:
    """What a module's names stand for: imports, type aliases, and classes that bundle named results."""

    imports: dict[str, str] = field(default_factory=dict)
    foreign: dict[str, str] = field(default_factory=dict)  # imported names that no contract type can be -> module
    aliases: dict[str, ast.expr] = field(default_factory=dict)
    bundles: dict[str, ast.ClassDef] = field(default_factory=dict)

    @classmethod
    def of(cls, module: ast.Module) -> Names:
        """Collect from the top level of a module."""
        names = cls()
        for statement in module.body:
            if isinstance(statement, ast.ImportFrom):
                names.imports |= {a.asname or a.name: a.name for a in statement.names}
                if not _offers_types(statement.module or ""):
                    names.foreign |= {a.asname or a.name: statement.module or "." for a in statement.names}
            elif isinstance(statement, ast.ClassDef):
                names.bundles[statement.name] = statement
            elif isinstance(statement, ast.Assign) and isinstance(statement.targets[0], ast.Name):
                names.aliases[statement.targets[0].id] = statement.value
            elif isinstance(statement, ast.AnnAssign) and isinstance(statement.target, ast.Name) and statement.value:
                names.aliases[statement.target.id] = statement.value
        return names


@dataclass(frozen=True)
class Read:
    """An annotation as read: its type, and the words it may take where it is a `Literal`."""

    type: TypeRef
    choices: tuple[str, ...] = ()


def read_annotation(node: ast.expr, names: Names, depth: int = 0) -> Read:
    """The contract type an annotation names. Raises ValueError saying which part is not one."""
    if depth > 16:
        raise ValueError("is an alias of itself")
    match node:
        case ast.Constant(value=str(text)):
            return read_annotation(ast.parse(text, mode="eval").body, names, depth + 1)
        case ast.Constant(value=None):
            raise ValueError("None is not a type a value can have")
        case ast.BinOp(left=left, op=ast.BitOr(), right=right):
            return _union([left, right], names, depth)
        case ast.Subscript(value=head, slice=inner):
            return _subscript(_last_name(head), inner, names, depth)
        case ast.Name() | ast.Attribute():
            return _plain(_last_name(node), names, depth)
    raise ValueError(f"{ast.unparse(node)} is not a contract type")


def bundle_fields(definition: ast.ClassDef) -> dict[str, ast.expr] | None:
    """Field annotations of a NamedTuple, TypedDict or dataclass; None for any other class."""
    bases = {_last_name(b) for b in definition.bases}
    decorators = {_last_name(d.func if isinstance(d, ast.Call) else d) for d in definition.decorator_list}
    if not bases & {"NamedTuple", "TypedDict"} and "dataclass" not in decorators:
        return None
    return {
        s.target.id: s.annotation
        for s in definition.body
        if isinstance(s, ast.AnnAssign) and isinstance(s.target, ast.Name)
    }


def stream_item(node: ast.expr) -> ast.expr | None:
    """X of `Iterator[X]` or `Generator[X, ...]`, else None."""
    if isinstance(node, ast.Subscript) and _last_name(node.value) in _STREAMS:
        return node.slice.elts[0] if isinstance(node.slice, ast.Tuple) else node.slice
    return None


def _offers_types(module: str) -> bool:
    return module in _TYPE_MODULES or module.startswith("gap_runtime.contracts")


def _plain(name: str, names: Names, depth: int) -> Read:
    if name in names.foreign:
        raise ValueError(f"{name} comes from {names.foreign[name]}, which has no contract types")
    name = names.imports.get(name, name)
    if name in names.aliases:
        return read_annotation(names.aliases[name], names, depth + 1)
    if name in _SCALARS or name in names.bundles:
        return Read(TypeRef(_SCALARS.get(name, "any")))
    if name in _LISTS:
        return Read(TypeRef("any", is_list=True))
    return Read(TypeRef.parse(name))


def _subscript(head: str, inner: ast.expr, names: Names, depth: int) -> Read:
    parts = list(inner.elts) if isinstance(inner, ast.Tuple) else [inner]
    if head in _LISTS:
        return Read(replace(read_annotation(parts[0], names, depth + 1).type, is_list=True))
    if head in ("dict", "Dict", "Mapping"):
        return Read(TypeRef("any"))
    if head == "Optional":
        return _union([parts[0], ast.Constant(value=None)], names, depth)
    if head == "Union":
        return _union(parts, names, depth)
    if head in ("Required", "NotRequired"):
        read = read_annotation(parts[0], names, depth + 1)
        return replace(read, type=replace(read.type, optional=read.type.optional or head == "NotRequired"))
    if head == "Literal":
        return _literal(parts)
    if head == "Annotated":
        read = read_annotation(parts[0], names, depth + 1)
        frame = next((f for f in (_frame(p, names.imports) for p in parts[1:]) if f), None)
        return replace(read, type=replace(read.type, frame=frame))
    raise ValueError(f"{head}[...] is not a contract type")


def _union(parts: list[ast.expr], names: Names, depth: int) -> Read:
    rest = [p for p in parts if not (isinstance(p, ast.Constant) and p.value is None)]
    if len(rest) != 1:
        raise ValueError("only `X | None` unions can cross a contract")
    read = read_annotation(rest[0], names, depth + 1)
    return replace(read, type=replace(read.type, optional=len(rest) < len(parts) or read.type.optional))


def _literal(parts: list[ast.expr]) -> Read:
    values = [p.value for p in parts if isinstance(p, ast.Constant)]
    for python, name in ((bool, "bool"), (int, "int"), (str, "string")):
        if len(values) == len(parts) and all(type(v) is python for v in values):
            return Read(TypeRef(name), tuple(str(v).lower() if name == "bool" else str(v) for v in values))
    raise ValueError("Literal[...] must list words or whole numbers of one kind")


def _frame(node: ast.expr, imports: Mapping[str, str]) -> str | None:
    match node:
        case ast.Call(func=func, args=[ast.Constant(value=str(name))]) if _last_name(func) == "Frame":
            return name
        case ast.Name() | ast.Attribute():
            name = _last_name(node)
            return _FRAMES.get(imports.get(name, name))
    return None


def _last_name(node: ast.expr) -> str:
    if isinstance(node, ast.Attribute):
        return node.attr
    return node.id if isinstance(node, ast.Name) else ""
