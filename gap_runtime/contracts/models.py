"""The base of every document model: unknown keys refused, frozen, and errors that name file, key, value and fix."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from typing import Any, Self

from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic_core import ErrorDetails

from gap_runtime.contracts.failures import DocumentError, did_you_mean, nearest

_SHOWN = 60  # characters of a refused value


class ProblemsError(ValueError):
    """What a validator found wrong with a part of a document: (path below the part or "", text), all of them."""

    def __init__(self, problems: Iterable[tuple[str, str]]) -> None:
        self.problems = tuple(problems)
        super().__init__("; ".join(f"{path}: {text}" if path else text for path, text in self.problems))

    @classmethod
    def raise_any(cls, problems: Iterable[tuple[str, str]]) -> None:
        """Raise it where there is a problem."""
        if found := tuple(problems):
            raise cls(found)


def unknown(asked: Iterable[tuple[str, str]], known: Collection[str], what: str) -> list[tuple[str, str]]:
    """A problem for each (path, name) whose name is not among the known ones, which are `what`."""
    return [(path, f"{name!r} is not {what}. {did_you_mean(name, known)}") for path, name in asked if name not in known]


class Document(BaseModel):
    """A frozen model that refuses unknown keys."""

    model_config = ConfigDict(extra="forbid", frozen=True, arbitrary_types_allowed=True)

    @classmethod
    def load(cls, data: Any, where: str, context: Any = None) -> Self:
        """Validate plain data; `context` is what validators may ask for. Raises `DocumentError` with every problem."""
        try:
            return cls.model_validate(data, context=context)
        except ValidationError as error:
            problems = tuple(_problems(cls, error, data))
            raise DocumentError(where, *problems) from None


def _problems(model: type[BaseModel], error: ValidationError, data: Any) -> Iterator[str]:
    """Each problem as `path: text`, in the order of the document's fields."""
    errors = error.errors(include_url=False)
    found: dict[str, dict[str, None]] = {}  # the branches of a union are problems of one path
    meant: set[tuple[Any, ...]] = set()  # keys that are missing because they are misspelled
    for problem in errors:
        loc = problem["loc"]
        if problem["type"] == "extra_forbidden":
            known = fields_at(model, loc[:-1])
            meant |= {(*loc[:-1], name) for name in [nearest(str(loc[-1]), known)] if name}
            text = f"is not a known key. {did_you_mean(str(loc[-1]), known)}"
            found.setdefault(_path(loc, data), {})[text] = None
    for problem in errors:
        if problem["type"] == "extra_forbidden" or (problem["type"] == "missing" and problem["loc"] in meant):
            continue
        above = _path(problem["loc"], data, absent=problem["type"] == "missing")
        for path, text in _texts(problem):
            found.setdefault(".".join(filter(None, (above, path))), {})[text] = None
    for path, texts in found.items():
        yield f"{path or 'the document'}: {_joined(list(texts))}"


def _texts(problem: ErrorDetails) -> Iterator[tuple[str, str]]:
    """What is wrong, by path below the problem's own."""
    cause = problem.get("ctx", {}).get("error")
    value = shown(problem["input"])
    if isinstance(cause, ProblemsError):
        yield from cause.problems
    elif isinstance(cause, Exception):
        yield "", str(cause)
    elif problem["type"] == "missing":
        yield "", "is missing"
    else:
        text = problem["msg"].replace(" after validation", "")
        subject, _, rest = text.partition(" should ")
        about = {"Input": value, "String": value}.get(subject, subject)
        yield "", f"{about} should {rest}" if rest else f"{value}: {text}"


def _joined(texts: Sequence[str]) -> str:
    """Texts about one value in one sentence: those of a union as alternatives."""
    head = texts[0].partition(" should be ")[0] + " should be "
    if len(texts) > 1 and all(t.startswith(head) for t in texts):
        return head + " or ".join(t.removeprefix(head) for t in texts)
    return "; ".join(texts)


def shown(value: Any) -> str:
    """A value as a message shows it."""
    text = repr(value)
    return text if len(text) <= _SHOWN else text[: _SHOWN - 3] + "..."


def _path(loc: Sequence[int | str], data: Any, *, absent: bool = False) -> str:
    """The keys of the document that lead to a problem, the last of which may be `absent` from it; pydantic also names
    the branches of unions."""
    found: list[str] = []
    for step in loc:
        keys = data if isinstance(data, Mapping) else range(len(data)) if isinstance(data, list | tuple) else ()
        if step in keys:
            data = data[step]
        elif not (absent and step == loc[-1]):
            continue
        found.append(str(step))
    return ".".join(found)


def fields_at(model: Any, loc: tuple[Any, ...]) -> list[str]:
    """The keys, as documents spell them, of the model reached by walking `loc`; none where the walk leaves models."""
    for step in loc:
        fields = getattr(model, "model_fields", {})
        info = next((f for name, f in fields.items() if step in (name, f.alias)), None)
        if info is None:  # a key of a mapping or an index of a list, whose model is found already
            continue
        candidates = [info.annotation]
        model = next((c for c in _flatten(candidates) if isinstance(c, type) and issubclass(c, BaseModel)), None)
        if model is None:
            return []
    return sorted(f.alias or name for name, f in getattr(model, "model_fields", {}).items())


def _flatten(annotations: list[Any]) -> list[Any]:
    out: list[Any] = []
    for a in annotations:
        args = getattr(a, "__args__", None)
        out.extend(_flatten(list(args)) if args else [a])
    return out
