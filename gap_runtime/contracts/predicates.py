"""Checkpoints and success conditions as small expressions over `w`: checked, then walked, never run as code."""

from __future__ import annotations

import ast
import inspect
import math
import operator
import typing
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import Any

from gap_runtime.contracts.failures import DocumentError, did_you_mean
from gap_runtime.contracts.snapshot import WORLD_API, BodyView, WorldSnapshot
from gap_runtime.contracts.types import Vec3

MAX_EXPRESSION = 2000
MAX_NODES = 200
CAMERA_WORDS = (
    "camera", "image", "rgb", "depth", "mask", "iou", "pixel", "detection", "detected", "score", "confidence", "cloud",
    "segment", "observation", "obb",
)  # fmt: skip
_BINARY: dict[type[ast.AST], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv,
    ast.Lt: operator.lt, ast.LtE: operator.le, ast.Gt: operator.gt, ast.GtE: operator.ge,
    ast.Eq: operator.eq, ast.NotEq: operator.ne,
}  # fmt: skip
_UNARY: dict[type[ast.AST], Callable[[Any], Any]] = {
    ast.Not: operator.not_, ast.USub: operator.neg, ast.UAdd: operator.pos,
}  # fmt: skip
_FUNCTIONS: dict[str, Callable[..., Any]] = {
    "abs": abs, "min": min, "max": max, "sqrt": math.sqrt, "hypot": math.hypot,
}  # fmt: skip
_ARITY = {"abs": (1, 1), "min": (2, 9), "max": (2, 9), "sqrt": (1, 1), "hypot": (2, 3)}
_CLASSES: dict[str, type] = {"world": WorldSnapshot, "body": BodyView, "vector": Vec3}
_KINDS: dict[Any, str] = {float: "number", int: "number", bool: "truth", str: "text", BodyView: "body", Vec3: "vector"}


@dataclass(frozen=True)
class Problem:
    """Why an expression is refused. `camera` marks one that asks for what the cameras saw."""

    message: str
    hint: str = ""
    camera: bool = False


@dataclass(frozen=True)
class Checked:
    """An expression after checking: what is wrong with it, whether it asks anything of the world, and about what."""

    tree: ast.expr | None
    kind: str
    problems: tuple[Problem, ...]
    asks: bool = False
    bodies: tuple[str, ...] = ()
    joints: tuple[str, ...] = ()
    touched: tuple[str, ...] = ()
    arms: tuple[int, ...] = ()


@dataclass(frozen=True)
class _Member:
    """A question `w` or a body answers: argument kinds (None for a property) and the kind of the answer."""

    arguments: tuple[str, ...] | None
    required: int
    returns: str
    arm: bool = False  # whether its argument is the number of an arm


def evaluate(expression: str, snapshot: WorldSnapshot) -> Any:
    """The value of an expression in a world. Raises `DocumentError` (not an expression) or `UnknownNameError`."""
    checked = check_expression(expression)
    if checked.problems or checked.tree is None:
        problem = checked.problems[0]
        raise DocumentError(f"expression {expression!r}", problem.message, hint=problem.hint)
    try:
        return _value(checked.tree, snapshot)
    except (ArithmeticError, IndexError, TypeError, ValueError) as error:
        raise DocumentError(f"expression {expression!r}", f"has no value here ({error})") from None


@lru_cache(maxsize=4096)
def check_expression(expression: str) -> Checked:
    """Parse and check an expression against the world's API. Never raises."""
    if len(expression) > MAX_EXPRESSION:
        return _refused(f"is longer than {MAX_EXPRESSION} characters")
    try:
        tree = ast.parse(expression.strip(), mode="eval").body
    except SyntaxError as error:
        return _refused(f"is not an expression: {error.msg}")
    except (ValueError, RecursionError, MemoryError) as error:
        return _refused(f"is not an expression: {type(error).__name__}")
    if sum(1 for _ in ast.walk(tree)) > MAX_NODES:
        return _refused(f"has more than {MAX_NODES} parts", "Split it into several checkpoints.")
    checker = _Checker()
    kind = checker.kind(tree)
    named = (tuple(checker.named[key]) for key in ("body", "joint", "touches", "arm"))
    return Checked(tree, kind, tuple(checker.problems), checker.asks, *named)


def _refused(message: str, hint: str = "") -> Checked:
    return Checked(None, "?", (Problem(message, hint),))


class _Checker:
    """Walks an expression, inferring the kind of each part: world, body, vector, number, truth, text; '?' unknown."""

    def __init__(self) -> None:
        self.problems: list[Problem] = []
        self.asks = False
        self.named: dict[str, list[Any]] = {"body": [], "joint": [], "touches": [], "arm": []}

    def kind(self, node: ast.expr) -> str:
        match node:
            case ast.Name(id="w"):
                self.asks = True
                return "world"
            case ast.Name(id=name):
                return self.refuse(f"{name!r} is not known", "An expression sees nothing but w.", word=name)
            case ast.Constant(value=bool()):
                return "truth"
            case ast.Constant(value=float() | int()):
                return "number"
            case ast.Constant(value=str()):
                return "text"
            case ast.BoolOp(values=parts):
                return self.all_of(parts, ("truth", "number"), "truth")
            case ast.UnaryOp(op=op, operand=part) if type(op) in _UNARY:
                negated = isinstance(op, ast.Not)
                return self.all_of([part], ("truth",) if negated else ("number",), "truth" if negated else "number")
            case ast.BinOp(left=left, op=op, right=right) if type(op) in _BINARY:
                return self.all_of([left, right], ("number",), "number")
            case ast.Compare(left=left, ops=ops, comparators=rest) if all(type(o) in _BINARY for o in ops):
                return self.all_of([left, *rest], ("number", "truth", "text"), "truth")
            case ast.IfExp(test=test, body=body, orelse=other):
                self.all_of([test], ("truth",), "truth")
                kinds = {self.kind(body), self.kind(other)}
                return kinds.pop() if len(kinds) == 1 else "?"
            case ast.Attribute():
                return self.member(node, None)
            case ast.Call():
                return self.call(node)
        return self.refuse(f"{ast.unparse(node)} is not allowed", "Use and, or, not, comparisons, + - * / and w.")

    def refuse(self, message: str, hint: str = "", word: str = "") -> str:
        camera = any(part in CAMERA_WORDS for part in word.lower().split("_"))
        if camera:
            hint = "A checkpoint judges what the cameras led to, so it reads ground truth: poses, contacts, joints."
        self.problems.append(Problem(message, hint, camera))
        return "?"

    def all_of(self, parts: list[ast.expr], allowed: tuple[str, ...], result: str) -> str:
        for part in parts:
            kind = self.kind(part)
            if kind not in (*allowed, "?"):
                self.refuse(f"{ast.unparse(part)} is a {kind}, not a {' or '.join(allowed)}")
        return result

    def call(self, node: ast.Call) -> str:
        if isinstance(node.func, ast.Name) and node.func.id in _FUNCTIONS:
            want = _ARITY[node.func.id]
            if node.keywords or not want[0] <= len(node.args) <= want[1]:
                return self.refuse(f"{node.func.id} takes {want[0]} to {want[1]} arguments, by position")
            return self.all_of(node.args, ("number",), "number")
        if isinstance(node.func, ast.Attribute):
            return self.member(node.func, node)
        if isinstance(node.func, ast.Name):
            return self.refuse(
                f"{node.func.id}(...) is not known", f"There are {', '.join(_FUNCTIONS)}.", word=node.func.id
            )
        return self.refuse(f"{ast.unparse(node)} is not allowed")

    def member(self, node: ast.Attribute, call: ast.Call | None) -> str:
        owner = self.kind(node.value)
        if owner == "?":
            return "?"
        known = _members(owner)
        found = known.get(node.attr)
        if found is None:
            return self.refuse(f"a {owner} has no {node.attr!r}", did_you_mean(node.attr, known), word=node.attr)
        if found.arguments is None:
            return found.returns if call is None else self.refuse(f"{node.attr} is not called", "Leave out the ().")
        if call is None:
            return self.refuse(f"{node.attr} is a question", f"Write {node.attr}(...).")
        self.arguments(node.attr, found, call)
        self.remember(node.attr, found, call)
        return found.returns

    def arguments(self, name: str, member: _Member, call: ast.Call) -> None:
        assert member.arguments is not None
        if call.keywords:
            self.refuse(f"{name} takes its arguments by position")
        elif not member.required <= len(call.args) <= len(member.arguments):
            self.refuse(f"{name} takes {member.required} arguments, not {len(call.args)}")
        for part, want in zip(call.args, member.arguments, strict=False):
            kind = self.kind(part)
            if kind not in (want, "?"):
                self.refuse(f"{name} wants a {want}, and {ast.unparse(part)} is a {kind}")

    def remember(self, name: str, member: _Member, call: ast.Call) -> None:
        """Keep what the call is about: the body, joint or thing to touch it names, or the number of the arm."""
        match (name, call.args):
            case ("body" | "joint" | "touches", [ast.Constant(value=str(text))]):
                self.named[name].append(text)
            case ("body" | "joint", [_]):
                self.refuse(f"{name}(...) must name one in quotes")
            case (_, []) if member.arm:
                self.named["arm"].append(0)
            case (_, [ast.Constant(value=int(index))]) if member.arm:
                self.named["arm"].append(index)
            case (_, [_]) if member.arm:
                self.refuse(f"{name}(...) must give the arm's number")


@cache
def _members(kind: str) -> dict[str, _Member]:
    cls = _CLASSES.get(kind)
    if cls is None:
        return {}
    names = WORLD_API.get(kind, frozenset({"x", "y", "z"}))
    return {name: _member(cls, name) for name in sorted(names)}


def _member(cls: type, name: str) -> _Member:
    value = inspect.getattr_static(cls, name, None)
    if isinstance(value, property):
        hints = typing.get_type_hints(value.fget)
        return _Member(None, 0, _KINDS.get(hints.get("return"), "?"))
    if not inspect.isfunction(value):  # a data field, such as time
        return _Member(None, 0, _KINDS.get(typing.get_type_hints(cls).get(name), "?"))
    hints = typing.get_type_hints(value)
    parameters = list(inspect.signature(value).parameters.values())[1:]
    required = sum(p.default is inspect.Parameter.empty for p in parameters)
    kinds = tuple(_KINDS.get(hints[p.name], "?") for p in parameters)
    return _Member(kinds, required, _KINDS.get(hints["return"], "?"), [p.name for p in parameters] == ["arm"])


def _value(node: ast.expr, world: WorldSnapshot) -> Any:  # noqa: PLR0912 (one case per kind of node)
    match node:
        case ast.Name():
            return world
        case ast.Constant(value=value):
            return value
        case ast.BoolOp(op=op, values=parts):
            found: Any = None
            for part in parts:
                found = _value(part, world)
                if bool(found) == isinstance(op, ast.Or):
                    break
            return found
        case ast.UnaryOp(op=op, operand=part):
            return _UNARY[type(op)](_value(part, world))
        case ast.BinOp(left=left, op=op, right=right):
            return _BINARY[type(op)](_value(left, world), _value(right, world))
        case ast.Compare(left=left, ops=ops, comparators=rest):
            before = _value(left, world)
            for compare, part in zip(ops, rest, strict=True):
                after = _value(part, world)
                if not _BINARY[type(compare)](before, after):
                    return False
                before = after
            return True
        case ast.IfExp(test=test, body=body, orelse=other):
            return _value(body if _value(test, world) else other, world)
        case ast.Attribute(value=owner, attr=name):
            return getattr(_value(owner, world), name)
        case ast.Call(func=ast.Name(id=name), args=parts):
            return _FUNCTIONS[name](*(_value(p, world) for p in parts))
        case ast.Call(func=func, args=parts):
            return _value(func, world)(*(_value(p, world) for p in parts))
    raise AssertionError(f"{ast.dump(node)} passed the check")
