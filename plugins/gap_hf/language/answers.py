"""Reads yes or no out of what a language model answers."""

from __future__ import annotations

import re

from gap_runtime.contracts.failures import PerceptionError

ASK = "Answer with yes or no only."
_FIRST = re.compile(r"[\s*_`\"'(]*(yes|no)\b", re.IGNORECASE)


def yes_or_no(answer: str) -> bool:
    """True for an answer that begins with yes, False with no. Raises `PerceptionError` (`cannot_answer`) otherwise."""
    first = _FIRST.match(answer)
    if first is None:
        raise PerceptionError("cannot_answer", f"The model answered {answer.strip()[:120]!r}: neither yes nor no.")
    return first[1].lower() == "yes"
