"""Renders templates, the author's own and those of skills: what they are filled with is data and never becomes code."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined, TemplateError, TemplateSyntaxError, Undefined
from jinja2.sandbox import ImmutableSandboxedEnvironment

from gap_runtime.contracts.documents import read_text
from gap_runtime.errors import DocumentError, GapError

TEMPLATES = Path(__file__).parent / "templates"
_MARKDOWN = re.compile(r"([\\`*_\[\]<>|&#~!])")


class Verbatim(str):
    """Text that is written as it stands: a name that is known to be an identifier, or a finished code span."""


def identifier(text: str) -> Verbatim:
    """An identifier, to be written as it stands. Raises `GapError` for anything else."""
    if not text.isidentifier():
        raise GapError(f"{text!r} is used as a name and is not an identifier.")
    return Verbatim(text)


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


def markdown(value: Any) -> str:
    """A value as one line of Markdown that shows nothing but its text, inside tables too."""
    return _MARKDOWN.sub(r"\\\1", " ".join(str(value).split()))


def code_span(value: Any) -> Verbatim:
    """A value as a Markdown code span."""
    text = " ".join(str(value).replace("`", "'").split())
    return Verbatim("`" + text.replace("|", "\\|") + "`")


def render(template: str, **context: Any) -> str:
    """One of the author's own templates: `*.py.j2` gives Python, `*.md.j2` Markdown."""
    return _own(literal if template.endswith(".py.j2") else markdown).get_template(template).render(**context)


def render_file(path: Path, **context: Any) -> str:
    """A skill's template of Python code. Raises `DocumentError` with the line of a mistake in it.

    Whatever an expression gives is written as a Python literal, except what is `Verbatim`. Templates see only what
    `context` holds and cannot reach Python's internals.
    """
    environment = ImmutableSandboxedEnvironment(**_options(literal))
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


@cache
def _own(escape: Any) -> Environment:
    environment = Environment(loader=FileSystemLoader(TEMPLATES), **_options(escape))
    environment.filters["code"] = code_span
    return environment


def _options(escape: Any) -> dict[str, Any]:
    return {
        "undefined": StrictUndefined,
        "trim_blocks": True,
        "lstrip_blocks": True,
        "keep_trailing_newline": True,
        "autoescape": False,
        "finalize": lambda value: value if isinstance(value, Verbatim) else escape(value),
    }
