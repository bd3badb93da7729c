"""The head of a SKILL.md, as strict as the Agent Skills validator: what that would refuse is an error here."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import yaml
from pydantic import Field, field_validator

from gap_runtime.contracts.documents import check_text, located, parse_yaml, yaml_lines
from gap_runtime.contracts.failures import DocumentError
from gap_runtime.contracts.models import Document
from gap_runtime.contracts.names import KebabName

FENCE = "---"


class Frontmatter(Document):
    """The keys of the Agent Skills format, and no others. `name` is ASCII kebab-case, so no two names look alike."""

    name: KebabName
    description: str = Field(max_length=1024)
    license: str | None = None
    compatibility: str | None = Field(default=None, max_length=500)
    allowed_tools: str | None = Field(default=None, alias="allowed-tools")
    metadata: dict[str, str] = {}

    @field_validator("description")
    @classmethod
    def _says_something(cls, text: str) -> str:
        if not text.strip():
            raise ValueError("must say what the skill does and when to use it")
        return text.strip()


def split_frontmatter(text: str, where: str) -> tuple[str, str]:
    """The YAML between the fences, on the lines it has in the file, and the Markdown below. Raises `DocumentError`."""
    lines = check_text(text, where).replace("\r\n", "\n").split("\n")
    if lines[0] != FENCE:
        raise DocumentError(
            f"{where}:1", "does not start with frontmatter", hint=f"Begin the file with a {FENCE} line."
        )
    end = next((i for i, line in enumerate(lines[1:], 1) if line.rstrip() == FENCE), None)
    if end is None:
        raise DocumentError(f"{where}:1", "frontmatter is never closed", hint=f"End it with a {FENCE} line.")
    return "\n".join(["", *lines[1:end]]), "\n".join(lines[end + 1 :]).strip()


def parse_skill_md(text: str, where: str) -> tuple[Frontmatter, str]:
    """Split a SKILL.md into its checked frontmatter and its Markdown body.

    Raises `DocumentError` with every problem and its line.
    """
    head, body = split_frontmatter(text, where)
    data = parse_yaml(head, where, text_only=True)
    if not isinstance(data, dict):
        raise DocumentError(f"{where}:2", "frontmatter must be a mapping of keys")
    problems = [*_unreadable(head), *([] if body else ["has no text below the frontmatter"])]
    try:
        checked = Frontmatter.load(data, where)
    except DocumentError as error:
        problems += located(error, yaml_lines(head)).problems
    if problems:
        raise DocumentError(where, *problems)
    return checked, body


def _unreadable(head: str) -> Iterator[str]:
    """What the Agent Skills validator cannot read: flow style, and its fence inside a value."""
    for number, line in enumerate(head.split("\n"), 1):
        if FENCE in line:
            yield f"line {number}: holds {FENCE}, which other readers take for the end of the head"
    events: Iterator[Any] = yaml.parse(head, Loader=yaml.SafeLoader)
    for line in sorted({e.start_mark.line + 1 for e in events if getattr(e, "flow_style", None)}):
        yield f"line {line}: uses flow style, which the Agent Skills format does not; write one key or item a line"
