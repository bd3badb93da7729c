"""Words: what general English words mean to the grammar, and a sentence as the grammar's tokens."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from lark import Token

from gap_runtime.contracts.documents import read_yaml
from gap_runtime.contracts.models import Document

Phrase = tuple[str, ...]
SEPARATORS = {"AND": "_LINK", "COMMA": "_LINK", "STOP": "BREAK", "THEN": "BREAK"}
_DESCRIBING = {"THE", "A", "ALL", "BOTH", "REST", "OF", "NUMBER", "ORDINAL", "PARITY", "WORD"}
_WORD = re.compile(r"\w+|[^\w\s]")


class LexiconFile(Document):
    """The content of lexicon.yaml; its comments say what each part is."""

    terminals: dict[str, str]
    politeness: str
    refused: dict[str, str]
    relations: dict[str, str]
    roles: dict[str, list[str]]
    places: dict[str, str]
    numbers: dict[str, int]
    ordinals: dict[str, int]
    parity: dict[str, int]
    sorted: dict[str, int]
    things: str
    kinds: dict[str, str]
    hues: list[tuple[int, str]]
    colours: str


class Lexicon:
    """The phrases of lexicon.yaml by what they are. `meaning` maps a phrase's text to its number, relation or place."""

    def __init__(self, file: LexiconFile) -> None:
        self.roles, self.hues = file.roles, file.hues
        self.things, self.colours = set(_phrases(file.things)), {" ".join(p) for p in _phrases(file.colours)}
        self.kinds = {kind: set(_phrases(text)) for kind, text in file.kinds.items()}
        self.reasons = {" ".join(p): why for why, text in file.refused.items() for p in _phrases(text)}
        self.meaning: dict[str, int | str] = {**file.numbers, **file.ordinals, **file.parity, **file.sorted}
        self.terminals: dict[Phrase, str] = {}
        groups = {"FILLER": file.politeness, **file.terminals}
        for kind, text in [*groups.items(), *(("REFUSED", text) for text in file.refused.values())]:
            self.terminals |= dict.fromkeys(_phrases(text), kind)
        for kind, numbered in (("NUMBER", file.numbers), ("ORDINAL", file.ordinals), ("PARITY", file.parity)):
            self.terminals |= {tuple(phrase.split()): kind for phrase in numbered}
        self.terminals |= {tuple(phrase.split()): "SORTED" for phrase in file.sorted}
        for kind, named in (("RELATION", file.relations), ("PLACE", file.places)):
            for meant, text in named.items():
                self.meaning |= {" ".join(p): meant for p in _phrases(text)}
                self.terminals |= {p: kind for p in _phrases(text) if kind == "RELATION" or len(p) > 1}
        self.place_names = list(file.places)
        self.places = {" ".join(p) for text in file.places.values() for p in _phrases(text) if len(p) == 1}
        self.longest = max(map(len, self.terminals))

    def lex(self, sentence: str, names: set[Phrase], known: set[str]) -> list[Token]:
        """The sentence as tokens, separators merged and politeness left out. Full `names` of things and closed phrases
        are matched, the longest first; a word `known` for things is a WORD, any other one UNKNOWN."""
        words, found, at = tokens(sentence), list[Token](), 0
        while at < len(words):
            before = found[-1].type if found else ""
            size, kind = next(self._readings(words[at:], before, names, known))
            text = " ".join(words[at : at + size])
            at += size
            if kind == "FILLER":
                continue
            if kind not in SEPARATORS:
                found.append(Token(kind, text))
            elif before in SEPARATORS.values():
                found[-1] = max(found[-1], Token(SEPARATORS[kind], kind), key=_weight)
            elif found:
                found.append(Token(SEPARATORS[kind], kind))
        return found[:-1] if found and found[-1].type in SEPARATORS.values() else found

    def _readings(self, words: Phrase, before: str, names: set[Phrase], known: set[str]) -> Iterator[tuple[int, str]]:
        for size in range(min(len(words), max(self.longest, max(map(len, names), default=1))), 0, -1):
            phrase = words[:size]
            described = phrase[-1] in known and (size > 1 or before in _DESCRIBING or phrase not in self.terminals)
            if (phrase in names or size == 1) and described:
                yield size, "WORD"
            named = size < len(words) and words[size] in known  # "in the back compartment": an adjective, not a place
            if phrase in self.terminals and not (named and self.terminals[phrase] == "PLACE"):
                yield size, self.terminals[phrase]
        yield 1, "NUMBER" if words[0].isdigit() else "UNKNOWN"


@cache
def lexicon() -> Lexicon:
    """The lexicon of lexicon.yaml."""
    file = Path(__file__).with_name("lexicon.yaml")
    return Lexicon(LexiconFile.load(read_yaml(file), str(file)))


def tokens(text: str) -> Phrase:
    """Lower-case words and marks; hyphens, underscores and apostrophes separate, quotation marks vanish."""
    plain = unicodedata.normalize("NFKC", text).casefold()
    plain = re.sub(r"[-_'’/]", " ", plain)
    return tuple(_WORD.findall(re.sub(r"[\"“”‘`«»()\[\]]", " ", plain)))


def _weight(separator: Token) -> int:
    """Of several separators in a row, the one that says most about order counts."""
    return ["AND", "COMMA", "STOP", "THEN"].index(separator)


def _phrases(text: str) -> list[Phrase]:
    return [tuple(phrase.split()) for phrase in text.split("|")]
