"""The head of a SKILL.md, read strictly: what the Agent Skills validator would refuse or guess at is an error here."""

from __future__ import annotations

from typing import Any

import yaml
from pydantic import Field, field_validator

from gap_runtime.contracts.documents import check_text, parse_yaml
from gap_runtime.contracts.failures import DocumentError
from gap_runtime.contracts.models import Document

FENCE = "---"


class Frontmatter(Document):
    """The keys of the Agent Skills format, and no others. `name` is ASCII kebab-case, so no two names look alike."""

    name: str = Field(pattern=r"^[a-z0-9]+(-[a-z0-9]+)*$", max_length=64)
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


def parse_skill_md(text: str, where: str) -> tuple[Frontmatter, str]:
    """Split a SKILL.md into its checked frontmatter and its Markdown body.

    Raises `DocumentError` with the line of the problem.
    """
    lines = check_text(text, where).replace("\r\n", "\n").split("\n")
    if lines[0] != FENCE:
        raise DocumentError(
            f"{where}:1", "does not start with frontmatter", hint=f"Begin the file with a {FENCE} line."
        )
    end = next((i for i, line in enumerate(lines[1:], 1) if line.rstrip() == FENCE), None)
    if end is None:
        raise DocumentError(f"{where}:1", "frontmatter is never closed", hint=f"End it with a {FENCE} line.")
    head = "\n".join(["", *lines[1:end]])  # the empty first line keeps line numbers those of the file
    _check_plain(head, where)
    data = parse_yaml(head, where)
    if not isinstance(data, dict):
        raise DocumentError(f"{where}:2", "frontmatter must be a mapping of keys")
    body = "\n".join(lines[end + 1 :]).strip()
    if not body:
        raise DocumentError(f"{where}:{end + 1}", "has no text below the frontmatter")
    return Frontmatter.load(data, where), body


def _check_plain(head: str, where: str) -> None:
    """Refuse what the Agent Skills validator cannot read: flow style, tags, and its fence inside a value."""
    for number, line in enumerate(head.split("\n"), 1):
        if FENCE in line:
            raise DocumentError(f"{where}:{number}", f"holds {FENCE}, which other readers take for the end of the head")
    try:
        for event in yaml.parse(head, Loader=yaml.SafeLoader):
            _check_event(event, where)
    except yaml.YAMLError:
        return  # parse_yaml, which comes next, reports it with its line


def _check_event(event: Any, where: str) -> None:
    line = f"{where}:{event.start_mark.line + 1}"
    if getattr(event, "flow_style", None):
        raise DocumentError(line, "uses flow style, which the Agent Skills format does not", hint="One key per line.")
    if getattr(event, "tag", None):
        raise DocumentError(line, f"uses the tag {event.tag}", hint="Write the plain value.")
