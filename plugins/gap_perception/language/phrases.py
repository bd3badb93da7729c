"""Reads noun phrases with places in them: 'leftmost can', 'bottle behind the milk', 'box nearest to the basket'."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace

from gap_perception.language.vocabulary import Vocabulary

_RELATIONS = (  # longest first, so that "in front of" is not read as "in"
    ("left", r"(?:to the |on the )?left (?:side )?of"),
    ("right", r"(?:to the |on the )?right (?:side )?of"),
    ("front", r"in front of"),
    ("behind", r"behind|in back of"),
    ("nearest", r"(?:nearest|closest)(?: to)?"),
    ("farthest", r"(?:farthest|furthest)(?: from)?"),
    ("near", r"next to|near to|near|beside|by|close to"),
    ("above", r"above|over"),
    ("below", r"below|under(?:neath)?|beneath"),
    ("in", r"inside of|inside|within|in|into"),
    ("on", r"on top of|on|atop"),
)
_PLACES = (
    ("leftmost", r"leftmost|left most|far left|left"),
    ("rightmost", r"rightmost|right most|far right|right"),
    ("frontmost", r"frontmost|front|nearest|closest"),
    ("backmost", r"backmost|back|rear|farthest|furthest"),
    ("largest", r"largest|biggest"),
    ("smallest", r"smallest"),
    ("tallest", r"tallest|highest"),
)
_ARTICLE = r"(?:the |a |an )?"


@dataclass(frozen=True)
class Phrase:
    """What is meant: models with how sure (`names`), the `place` among them, and a `relation` to a `reference`."""

    text: str
    names: dict[str, float]
    place: str | None = None
    relation: str | None = None
    reference: dict[str, float] | None = None


def read_phrase(text: str, vocabulary: Vocabulary) -> Phrase | None:
    """The phrase as a whole if the vocabulary knows it, else with a place or a relation; None when not understood."""
    clean = " ".join(re.sub(r"[^\w' ]|_", " ", text.lower().replace("-", " ")).split())
    names = vocabulary.resolve(clean)
    if names:
        return Phrase(text, names)
    return _with_place(text, clean, vocabulary) or _with_relation(text, clean, vocabulary)


def read_relation(text: str) -> tuple[str, str, str] | None:
    """Split 'SUBJECT RELATION REFERENCE' at its first relation: (subject, relation, reference), or None."""
    found = []
    for relation, words in _RELATIONS:
        match = re.search(
            rf"^(?P<subject>.*?)\b(?:that is |which is |is |are )?(?:{words}) {_ARTICLE}(?P<ref>.+)$", text
        )
        if match:
            found.append((len(match["subject"]), relation, match))
    if not found:
        return None
    _, relation, match = min(found, key=lambda f: f[0])
    return match["subject"].strip(), relation, match["ref"].strip()


def _with_relation(text: str, clean: str, vocabulary: Vocabulary) -> Phrase | None:
    parts = read_relation(clean)
    if parts is None:
        return None
    subject, relation, reference = parts
    names, others = vocabulary.resolve(subject), vocabulary.resolve(reference)
    placed = Phrase(text, names) if names else _with_place(text, subject, vocabulary)
    return replace(placed, relation=relation, reference=others) if placed and others else None


def _with_place(text: str, clean: str, vocabulary: Vocabulary) -> Phrase | None:
    for place, words in _PLACES:
        for pattern in (rf"^{_ARTICLE}(?:{words}) (?P<core>.+)$", rf"^(?P<core>.+?) (?:on|at|in|to) the (?:{words})$"):
            match = re.search(pattern, clean)
            names = vocabulary.resolve(match["core"]) if match else {}
            if names:
                return Phrase(text, names, place)
    return None
