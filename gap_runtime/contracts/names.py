"""The one rule for names that people choose: of tasks, variants, skills, objects, cameras and parts of a cell.

Names reach file names, builder code, MJCF, topics and command lines, so they are short, lower-case ASCII, and start
with a letter.
"""

from __future__ import annotations

import keyword
import re
from typing import Annotated

from pydantic import AfterValidator, Field

MAX_NAME = 64
MAX_IDENTIFIER = 40  # a graph's node names, of at most 64 characters, are made of an object's id and a verb
_PATTERNS = {s: re.compile(rf"[a-z][a-z0-9]*([{s}][a-z0-9]+)*") for s in ("-", "_", "-_")}
_KEBAB, _SNAKE, _EITHER = (f"^{p.pattern}$" for p in (_PATTERNS["-"], _PATTERNS["_"], _PATTERNS["-_"]))


def name_problem(name: str, separators: str = "-_", limit: int = MAX_NAME) -> str:
    """Why this is no name, or ''. `separators` are the characters that may stand between its words."""
    if _PATTERNS[separators].fullmatch(name) is None:
        allowed = " or ".join(separators)
        return f"{name!r} should be words of lower-case a-z and 0-9 joined by {allowed}, starting with a letter"
    if len(name) > limit:
        return f"{name!r} should have at most {limit} characters, not {len(name)}"
    if "-" not in separators and keyword.iskeyword(name):
        return f"{name!r} is a word of Python, and names in builder code come from it"
    return ""


def _checked(separators: str, limit: int) -> AfterValidator:
    def check(name: str) -> str:
        problem = name_problem(name, separators, limit)
        if problem:
            raise ValueError(problem)
        return name

    return AfterValidator(check)


# Folders are called like this: tasks and skills.
KebabName = Annotated[str, Field(json_schema_extra={"pattern": _KEBAB, "maxLength": MAX_NAME}), _checked("-", MAX_NAME)]
# Becomes part of names in builder code: objects, joints, scenes, regions, supports, conditions.
Identifier = Annotated[
    str, Field(json_schema_extra={"pattern": _SNAKE, "maxLength": MAX_IDENTIFIER}), _checked("_", MAX_IDENTIFIER)
]
# Only ever text: variants, cameras, noise models.
Name = Annotated[str, Field(json_schema_extra={"pattern": _EITHER, "maxLength": MAX_NAME}), _checked("-_", MAX_NAME)]
