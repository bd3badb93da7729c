"""Renders builder code from templates, the author's own and those of skills."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined, TemplateError, TemplateSyntaxError, Undefined
from jinja2.sandbox import ImmutableSandboxedEnvironment

from gap_runtime.contracts.documents import read_text
from gap_runtime.errors import DocumentError, GapError

TEMPLATES = Path(__file__).parent / "templates"


def render(name: str, **context: Any) -> str:
    """One of the author's own templates."""
    return _own().get_template(name).render(**context)


def render_file(path: Path, **context: Any) -> str:
    """A skill's template. Raises `DocumentError` with the line of a mistake in it.

    Templates of skills see only what `context` holds and cannot reach Python's internals.
    """
    environment = ImmutableSandboxedEnvironment(**_options())
    environment.filters["py"] = literal
    try:
        return environment.from_string(read_text(path)).render(**context)
    except TemplateSyntaxError as error:
        raise DocumentError(f"{path}:{error.lineno}", f"is not a template: {error.message}") from None
    except TemplateError as error:
        raise DocumentError(str(path), f"cannot be rendered: {error}") from None
    except GapError:
        raise
    except Exception as error:  # a template is the skill author's code
        raise DocumentError(str(path), f"cannot be rendered: {type(error).__name__}: {error}") from None


def literal(value: Any) -> str:
    """A value as a Python literal in double quotes, so that rendered code reads like written code."""
    if isinstance(value, Undefined):
        str(value)  # raises, naming what is undefined
    if isinstance(value, str):
        text = repr(value)
        if text.startswith("'") and '"' not in text and "\\'" not in text:
            return f'"{text[1:-1]}"'
        return text
    if isinstance(value, dict):
        return "{" + ", ".join(f"{literal(k)}: {literal(v)}" for k, v in value.items()) + "}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(literal, value)) + "]"
    return repr(value)


@cache
def _own() -> Environment:
    environment = Environment(loader=FileSystemLoader(TEMPLATES), **_options())
    environment.filters["py"] = literal
    return environment


def _options() -> dict[str, Any]:
    return {
        "undefined": StrictUndefined,
        "trim_blocks": True,
        "lstrip_blocks": True,
        "keep_trailing_newline": True,
        "autoescape": False,
    }
