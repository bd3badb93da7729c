"""The base of every document model: unknown keys refused, frozen, and errors that name file, key and fix."""

from __future__ import annotations

from typing import Any, Self

from pydantic import BaseModel, ConfigDict, ValidationError

from gap_runtime.contracts.failures import DocumentError, did_you_mean


class Document(BaseModel):
    """A frozen model that refuses unknown keys."""

    model_config = ConfigDict(extra="forbid", frozen=True, arbitrary_types_allowed=True, populate_by_name=True)

    @classmethod
    def load(cls, data: Any, where: str, context: dict[str, Any] | None = None) -> Self:
        """Validate plain data. Raises `DocumentError` naming the first bad key and how many more there are."""
        try:
            return cls.model_validate(data, context=context)
        except ValidationError as error:
            raise _document_error(cls, error, where) from None


def _document_error(model: type[BaseModel], error: ValidationError, where: str) -> DocumentError:
    problems = error.errors(include_url=False)
    # A misspelled key is also a missing one; naming the misspelling helps more.
    first = next((p for p in problems if p["type"] == "extra_forbidden"), problems[0])
    path = ".".join(str(p) for p in first["loc"]) or "the document"
    hint = ""
    if first["type"] == "extra_forbidden":
        hint = did_you_mean(str(first["loc"][-1]), fields_at(model, first["loc"][:-1]))
        text = "is not a known key"
    else:
        text = first["msg"].removeprefix("Value error, ")
    more = f" (and {len(problems) - 1} more)" if len(problems) > 1 else ""
    return DocumentError(where, f"{path}: {text}{more}", hint=hint)


def fields_at(model: Any, loc: tuple[Any, ...]) -> list[str]:
    """Field names of the model reached by walking `loc`; empty where the walk leaves models."""
    for step in loc:
        info = getattr(model, "model_fields", {}).get(step)
        if info is None:  # a key of a mapping or an index of a list, whose model is found already
            continue
        candidates = [info.annotation]
        model = next((c for c in _flatten(candidates) if isinstance(c, type) and issubclass(c, BaseModel)), None)
        if model is None:
            return []
    return sorted(getattr(model, "model_fields", {}))


def _flatten(annotations: list[Any]) -> list[Any]:
    out: list[Any] = []
    for a in annotations:
        args = getattr(a, "__args__", None)
        out.extend(_flatten(list(args)) if args else [a])
    return out
