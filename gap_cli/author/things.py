"""What a task's things are called and look like: from the words of a noun phrase to objects, joints and supports."""

from __future__ import annotations

import colorsys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

from gap_cli.author.lexicon import Phrase, lexicon, tokens
from gap_runtime.contracts.task import ObjectModel, Task
from gap_runtime.contracts.task.appearance import rgb


@dataclass(frozen=True)
class Thing:
    """An object, a joint or a support. `heads` are the nouns it may be called by, `words` all that may describe it."""

    id: str
    label: str
    kind: str
    names: tuple[Phrase, ...]
    heads: frozenset[Phrase]
    words: frozenset[str]

    @property
    def number(self) -> int | None:
        """Which of a family it is: 3 for `port_3`."""
        last = self.names[0][-1] if self.names else ""
        return int(last) if last.isdigit() else None


class NotFoundError(Exception):
    """Words that describe nothing: `word` is the one at fault, the text says why."""

    def __init__(self, problem: str, word: str = "") -> None:
        super().__init__(problem)
        self.word = word


class Things:
    """Every thing of a task by id, and what their names are made of."""

    def __init__(self, task: Task) -> None:
        self.all = {name: _object(name, model) for name, model in task.objects.items()}
        self.all |= {name: _plain(name, "joint", tokens(name)) for name in task.joints if name not in self.all}
        supports = [name for name in task.environment.supports if name not in self.all]
        self.all |= {name: _plain(name, "support", tokens(name)) for name in supports}

    @property
    def phrases(self) -> list[str]:
        """Every full name, for near misses."""
        return sorted({" ".join(name) for thing in self.all.values() for name in thing.names})

    @cached_property
    def names(self) -> set[Phrase]:
        """Every full name of more than one word."""
        return {name for thing in self.all.values() for name in thing.names if len(name) > 1}

    @cached_property
    def known(self) -> set[str]:
        """Every word that may stand in a noun phrase. The grammar's own words are only where they are nouns: "of" in a
        name is none, the "switch" of a lamp is."""
        nouns = {head for thing in self.all.values() for head in thing.heads}
        described = {w for thing in self.all.values() for w in thing.words
                     if (w,) not in lexicon().terminals or (w,) in nouns}  # fmt: skip
        heads = {w for head in nouns for w in (head[-1], *_plurals(head[-1]))}
        return described | heads | lexicon().colours | lexicon().places

    def find(self, words: Sequence[str]) -> tuple[list[Thing], list[str], bool]:
        """The things the words may mean, which places they must still be told apart by, and whether as a plural.

        Raises `NotFoundError`.
        """
        phrase = tuple(words)
        exact = [t for t in self.all.values() if phrase in t.names]
        if exact:
            return exact, [], False
        for size in range(len(phrase), 0, -1):
            head, modifiers = phrase[-size:], phrase[:-size]
            for plural in (False, True):
                found = [t for t in self.all.values() if any(_fits(head, name, plural) for name in t.heads)]
                if found:
                    return *_describe(found, modifiers, head), plural
        raise NotFoundError(f"{' '.join(phrase)!r} is not known.", " ".join(phrase))


def _describe(found: list[Thing], modifiers: Phrase, head: Phrase) -> tuple[list[Thing], list[str]]:
    places = []
    for word in modifiers:
        fitting = [t for t in found if word in t.words]
        if not fitting and word in lexicon().places:
            places.append(str(lexicon().meaning[word]))
        elif not fitting:
            raise NotFoundError(f"No {' '.join(head)} is known to be {word!r}.", word)
        else:
            found = fitting
    return found, places


def _object(name: str, model: ObjectModel) -> Thing:
    words, names = lexicon(), [_words(text) for text in (name, model.label, *model.words)]
    kinds = {k for key in (model.shape.kind, model.looks.style) for k in words.kinds.get(key, ())}
    category = _words(model.category)
    families = [name[:-1] for name in names if name and name[-1].isdigit()]  # "port" for `port_3`
    heads = {n[start:] for n in [*names, *families] for start in range(len(n))} | kinds | {category} | words.things
    described = {w for phrase in (*names, *kinds, category) for w in phrase} | _colour(model)
    kept = tuple(dict.fromkeys(n for n in names if n))
    return Thing(name, model.label, "object", kept, frozenset(h for h in heads if h), frozenset(described))


def _plain(name: str, kind: str, phrase: Phrase) -> Thing:
    """A joint or a support, called by its id or any of its words: `stove_knob` is the stove's."""
    heads = {phrase[a:b] for a in range(len(phrase)) for b in range(a + 1, len(phrase) + 1)}
    return Thing(name, " ".join(phrase), kind, (phrase,), frozenset(heads), frozenset(phrase))


def _words(text: str) -> Phrase:
    return tuple(w for w in tokens(text) if w.isalnum())


def _fits(head: Phrase, name: Phrase, plural: bool) -> bool:
    return head[:-1] == name[:-1] and (head[-1] in _plurals(name[-1]) if plural else head[-1] == name[-1])


def _plurals(word: str) -> Iterable[str]:
    yield word + "s"
    if word.endswith(("s", "x", "z", "ch", "sh")):
        yield word + "es"
    if word.endswith("y"):
        yield word[:-1] + "ies"


def _colour(model: ObjectModel) -> set[str]:
    """The colour words for an object, where the task says what it looks like."""
    if "base" not in model.looks.model_fields_set:
        return set()
    red, green, blue = (channel / 255 for channel in rgb(model.looks.base))
    hue, saturation, value = colorsys.rgb_to_hsv(red, green, blue)
    if value < 0.2:
        return {"black"}
    if saturation < 0.15:
        return {"white"} if value > 0.8 else {"grey", "gray", "silver"}
    if hue < 1 / 8 and (value < 0.5 or (saturation < 0.6 and value < 0.75)):  # dark orange is what people call brown
        return {"brown"}
    return {next(name for limit, name in lexicon().hues if 360 * hue <= limit)}
