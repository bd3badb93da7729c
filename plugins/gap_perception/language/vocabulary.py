"""Resolves noun phrases to the task's object models: names, synonyms, attributes, plurals and small misspellings."""

from __future__ import annotations

import difflib
import re
from collections.abc import Mapping
from dataclasses import dataclass

from gap_runtime.contracts.task import ObjectModel

# How sure a phrase is about a model, by the way it was understood.
EXACT, WITH_ATTRIBUTES, PART_OF_NAME, ATTRIBUTES_ONLY, MISSPELLED = 1.0, 0.95, 0.8, 0.7, 0.9
_FILLER = "a an the of this that these those some any all my your its please one it with is are there"
FILLER = frozenset(_FILLER.split())
GENERIC = frozenset({"object", "thing", "item", "product"})
KIND_WORDS = {
    "cylinder": "can tin cylinder", "box": "box pack package packet", "open_box": "container bin", "pan": "pan skillet",
    "mug": "mug cup", "mesh": "object thing", "articulated": "fixture",
}  # fmt: skip
STYLE_WORDS = {
    "can": "can tin", "carton": "carton pack package", "bottle": "bottle", "box": "box pack package packet",
    "basket": "basket container bin",
}  # fmt: skip
UPRIGHT = 1.5  # height over width from which something is tall; below its inverse it is flat
_WORD = re.compile(r"[^\W_]+")


@dataclass(frozen=True)
class Entry:
    """One model in the vocabulary: token sets of its names, and the words that may describe it."""

    names: tuple[frozenset[str], ...]
    attributes: frozenset[str]


@dataclass(frozen=True)
class Vocabulary:
    """All models of a task by name."""

    entries: Mapping[str, Entry]

    def resolve(self, phrase: str) -> dict[str, float]:
        """Models the phrase may mean, with how sure (0 to 1); empty when it is not understood. Every word counts."""
        words = tokens(phrase)
        if not words:
            return {}
        found = self._understand(words)
        if found:
            return found
        corrected = [self._corrected(w) for w in words]
        if corrected == words:
            return {}
        return {name: MISSPELLED * sure for name, sure in self._understand(corrected).items()}

    def _understand(self, words: list[str]) -> dict[str, float]:
        given = frozenset(words)
        exact = {name: EXACT for name, e in self.entries.items() if given in e.names}
        if exact:
            return exact
        qualified = {
            name: WITH_ATTRIBUTES
            for name, e in self.entries.items()
            if any(n <= given and given - n <= e.attributes for n in e.names)
        }
        if qualified:
            return qualified
        described = {name: ATTRIBUTES_ONLY for name, e in self.entries.items() if given <= e.attributes}
        named = {
            name: PART_OF_NAME
            for name, e in self.entries.items()
            if any(given <= n | e.attributes and given & n for n in e.names)
        }
        return {**described, **named}

    def _corrected(self, word: str) -> str:
        known = sorted({w for e in self.entries.values() for n in (*e.names, e.attributes) for w in n})
        if word in known or len(word) < 4:
            return word
        near = difflib.get_close_matches(word, known, n=1, cutoff=0.8)
        # Who mistypes a word seldom gets its first letter wrong; without that, "right" would be read as "upright".
        return near[0] if near and near[0][0] == word[0] else word


def tokens(text: str) -> list[str]:
    """Lower-case singular words without filler."""
    return [singular(w) for w in _WORD.findall(text.lower().replace("'", "")) if w not in FILLER]


def singular(word: str) -> str:
    """'cans' to 'can', 'boxes' to 'box', 'groceries' to 'grocery'; 'sauce' and 'glass' stay."""
    if len(word) > 4 and word.endswith("ies"):
        return word[:-3] + "y"
    if len(word) > 4 and word.endswith(("xes", "ches", "shes", "sses")):
        return word[:-2]
    if len(word) > 3 and word.endswith("s") and not word.endswith(("ss", "us", "is")):
        return word[:-1]
    return word


def build_vocabulary(
    objects: Mapping[str, ObjectModel], colours: Mapping[str, frozenset[str]] | None = None
) -> Vocabulary:
    """The vocabulary of a task; `colours` names the colours each model shows."""
    colours = colours or {}
    return Vocabulary({n: _entry(n, model, colours.get(n, frozenset())) for n, model in objects.items()})


def _entry(name: str, model: ObjectModel, colours: frozenset[str]) -> Entry:
    names = dict.fromkeys(frozenset(tokens(text)) for text in (name.replace("_", " "), model.label, *model.words))
    x, y, z = model.shape.size
    shape_words = STYLE_WORDS.get(model.looks.style, KIND_WORDS[model.shape.kind])
    attributes = {*GENERIC, *tokens(model.category), *shape_words.split(), *colours}
    if z > UPRIGHT * max(x, y):
        attributes |= {"tall", "upright", "high"}
    if z < min(x, y) / UPRIGHT:
        attributes |= {"flat", "low", "thin"}
    return Entry(tuple(n for n in names if n), frozenset(attributes))
