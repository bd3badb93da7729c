"""What a task's objects are called: from phrases to object ids, and from a sentence to the grammar's lexemes."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterator
from dataclasses import dataclass

from gap_cli.author.lexicon import MARKS, PHRASES, Kind
from gap_runtime.contracts.task import Task

_TOKEN = re.compile(r"[\w]+|[^\w\s]")
Phrase = tuple[str, ...]


@dataclass(frozen=True)
class Lexeme:
    """A word or phrase of the sentence: its kind, its text, and the object ids it may name."""

    kind: Kind
    text: str
    ids: tuple[str, ...] = ()


class Vocabulary:
    """The words of one task: object ids, labels and synonyms; the head of a label names it where that is unique."""

    def __init__(self, task: Task) -> None:
        self.task = task
        self._names: dict[Phrase, set[str]] = {}
        self._heads: dict[Phrase, set[str]] = {}
        self._supports = {tokens(name): name for name in task.environment.supports}
        for name, model in task.objects.items():
            for text in (name, model.label, *model.words):
                phrase = tokens(text)
                if phrase:
                    self._names.setdefault(phrase, set()).add(name)
            label = tokens(model.label)
            for start in range(1, len(label)):
                self._heads.setdefault(label[start:], set()).add(name)
        self._longest = max(map(len, [*self._names, *self._supports, *PHRASES]))

    def label(self, name: str) -> str:
        """How people call the object."""
        return self.task.objects[name].label

    @property
    def phrases(self) -> list[str]:
        """Every full name of an object, for near misses."""
        return sorted(" ".join(phrase) for phrase in self._names)

    def lex(self, sentence: str) -> list[Lexeme]:
        """The sentence as lexemes, longest match first; an object's name wins over a grammar word of equal length."""
        words = tokens(sentence)
        found: list[Lexeme] = []
        at = 0
        while at < len(words):
            size, lexeme = next(self._matches(words, at))
            found.append(lexeme)
            at += size
        return found

    def _matches(self, words: Phrase, at: int) -> Iterator[tuple[int, Lexeme]]:
        """Readings of the words from `at`, best first; the last one, UNKNOWN, always exists."""
        for size in range(min(self._longest, len(words) - at), 0, -1):
            phrase = words[at : at + size]
            text = " ".join(phrase)
            if phrase in self._names:
                yield size, Lexeme(Kind.OBJECT, text, tuple(sorted(self._names[phrase])))
            if phrase in PHRASES:
                yield size, Lexeme(PHRASES[phrase], text)
            if phrase in self._heads:
                yield size, Lexeme(Kind.OBJECT, text, tuple(sorted(self._heads[phrase])))
            if phrase in self._supports:
                yield size, Lexeme(Kind.SUPPORT, text)
        word = words[at]
        kind = Kind.COUNT if word.isdigit() else MARKS.get(word, Kind.UNKNOWN)
        yield 1, Lexeme(kind, word)


def tokens(text: str) -> Phrase:
    """Lower-case words and marks; hyphens, underscores and apostrophes separate, quotation marks vanish."""
    plain = unicodedata.normalize("NFKC", text).casefold()
    plain = re.sub(r"[-_'’/]", " ", plain)
    return tuple(_TOKEN.findall(re.sub(r"[\"“”‘`«»()\[\]]", " ", plain)))
