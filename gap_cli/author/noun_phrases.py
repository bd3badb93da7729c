"""From noun phrases to things: names, attributes, places, quantifiers, numbers, and what "it" and "them" mean."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, NoReturn

from lark import Token, Tree
from lark.visitors import Interpreter

from gap_cli.author.goals import refuse
from gap_cli.author.lexicon import lexicon, tokens
from gap_cli.author.scene import Scene
from gap_cli.author.things import NotFoundError, Thing, Things


@dataclass(frozen=True)
class Chosen:
    """What a noun phrase picks: each of these things, or any `count` of them."""

    things: tuple[Thing, ...]
    count: int | None = None


@dataclass
class NounPhrases(Interpreter[Token, Any]):
    """Reads the noun phrases of one instruction in one scene. Raises `InstructionError`."""

    vocabulary: Things
    scene: Scene
    held: list[Chosen] = field(default_factory=list)  # picked up, and not yet told where to go
    last: list[Chosen] = field(default_factory=list)  # what "it" and "them" mean when nothing is held
    mentioned: dict[str, Thing] = field(default_factory=dict)

    def fail(self, problem: str, word: str = "") -> NoReturn:
        """Refuse the instruction, with what the task offers instead."""
        raise refuse(self.scene.task, problem, word=word, known=self.vocabulary.phrases)

    def things(self, tree: Tree[Token]) -> list[Chosen]:
        """A list of noun phrases."""
        found = [chosen for child in tree.children if isinstance(child, Tree) for chosen in self.visit(child)]
        self.mentioned |= {thing.id: thing for chosen in found for thing in chosen.things}
        return found

    def np(self, tree: Tree[Token]) -> list[Chosen]:
        """A pronoun, one thing, or the things of a plural."""
        marks = marks_of(tree)
        if not subtrees(tree, "words"):
            return self.pronoun(tree, several="IT" not in marks, exactly=2 if "BOTH" in marks else _number(marks))
        found, plural, said = self.described(tree, several="A" in marks)
        if len(found) > 1 and "A" not in marks and not plural:
            names = [describe(self.vocabulary, self.scene, thing) or thing.id for thing in found]
            self.fail(f"{said!r} could be {' or '.join(f'the {name}' for name in names)}.")
        return [Chosen(tuple(found), 1 if "A" in marks and len(found) > 1 else None)]

    def quantified(self, tree: Tree[Token]) -> list[Chosen]:
        """All, both, two of, the rest of, everything, except."""
        marks = marks_of(tree)
        if subtrees(tree, "words"):
            found, _, said = self.described(tree, several=True)
        else:
            objects = [t for t in self.vocabulary.all.values() if t.kind == "object" and self.scene.has(t)]
            found, said = self.qualified(objects, tree, "thing", []), "thing"
        rest = [thing for thing in found if "REST" not in marks or thing.id not in self.mentioned]
        kept = self.without(rest, tree)
        number = 2 if "BOTH" in marks else _number(marks)
        exact = "BOTH" in marks or "ALL" in marks or ("THE" in marks and "OF" not in marks)
        if not kept or (number and (len(kept) < number or (exact and len(kept) > number))):
            self.fail(f"The scene has {len(kept) or 'no'} {said!r}{f', not {number}' if number else ' left'}.")
        return [Chosen(kept, number if number and number < len(kept) else None)]

    def without(self, found: list[Thing], tree: Tree[Token]) -> tuple[Thing, ...]:
        """The things without those that "except" leaves out, which must be among them."""
        left_out = {
            t.id: t for child in subtrees(tree, "exclusion") for chosen in self.visit(child) for t in chosen.things
        }
        stray = [Chosen((thing,)) for thing in left_out.values() if thing not in found]
        if stray:
            self.fail(f"{listed(stray)} cannot be left out: nothing was said of it.")
        return tuple(thing for thing in found if thing.id not in left_out)

    def exclusion(self, tree: Tree[Token]) -> list[Chosen]:
        """What "except" leaves out."""
        return list(self.visit(subtrees(tree, "things")[0]))

    def described(self, tree: Tree[Token], *, several: bool) -> tuple[list[Thing], bool, str]:
        """What words and qualifiers leave, whether as a plural, and the words. What is not one thing by its name alone
        is looked for in the scene."""
        words, marks = self.visit(subtrees(tree, "words")[0])
        said = " ".join(words)
        try:
            found, places, plural = self.vocabulary.find(words)
        except NotFoundError as error:
            self.fail(str(error), error.word)
        if "PARITY" in marks or "ORDINAL" in marks:
            meant = {name: int(lexicon().meaning[text]) for name, text in marks.items()}
            if any(thing.number is None for thing in found):
                self.fail(f"{said!r} are not numbered, so which are {' '.join(marks.values())} is not known.")
            found = [t for t in found if t.number is not None and meant.get("PARITY", t.number % 2) == t.number % 2]
            found = [t for t in found if meant.get("ORDINAL", t.number) == t.number]
        if several or plural or places or subtrees(tree, "qualifier"):
            found = [thing for thing in found if self.scene.has(thing)]
        found = self.qualified(found, tree, said, places)
        if not found:
            self.fail(f"There is no {said!r} like that in the scene.")
        return found, plural, said

    def words(self, tree: Tree[Token]) -> tuple[list[str], dict[str, str]]:
        """Words that name and describe, "can of soup" as "soup can", and ordinals and parity beside."""
        marks = {t.type: str(t) for t in tree.children if isinstance(t, Token) and t.type in ("ORDINAL", "PARITY")}
        said = [w for t in tree.children if isinstance(t, Token) and t.type == "WORD" for w in t.split()]
        said += [str(_number({"NUMBER": t})) for t in tree.children if isinstance(t, Token) and t.type == "NUMBER"]
        inner = [self.visit(child) for child in subtrees(tree, "words")]
        return [w for words, _ in inner for w in words] + said, marks | {k: v for _, m in inner for k, v in m.items()}

    def qualified(self, found: list[Thing], tree: Tree[Token], said: str, places: list[str]) -> list[Thing]:
        """Those that stand where the qualifiers and places say, in every instance of the task."""
        for child in subtrees(tree, "qualifier"):
            marks, others = (
                marks_of(child),
                [t for np in subtrees(child, "np") for c in self.visit(np) for t in c.things],
            )
            if "PLACE" in marks:
                places = [*places, str(lexicon().meaning[marks["PLACE"]])]
            elif len(others) != 1:
                self.fail(f"'{' '.join(marks.values())} ...' must name one thing.")
            elif "RELATION" in marks and others[0].kind == "object":
                relation = str(lexicon().meaning[marks["RELATION"]])
                rest = [thing for thing in found if thing is not others[0]]
                found = self.certain(self.scene.related(relation, rest, others[0]), said, marks["RELATION"])
            elif others[0].kind == "support":
                found = [thing for thing in found if self.scene.support(thing.id) == others[0].id]
            else:
                self.fail(
                    f"The task does not say whether a {said} is {' '.join(marks.values())} the {others[0].label}."
                )
        for place in places:
            best = self.scene.at(place, found) if found else None
            found = self.certain([best] if best else [], said, place)
        return found

    def certain(self, found: list[Thing], said: str, where: str) -> list[Thing]:
        """What was found, which must be something."""
        if not found:
            self.fail(f"Which {said!r} is {where} is not the same in every instance of the task.")
        return found

    def pronoun(self, tree: Tree[Token], *, several: bool, exactly: int | None) -> list[Chosen]:
        """What was mentioned before."""
        word, meant = " ".join(map(str, tree.children)), list(self.held or self.last)
        count = sum(chosen.count or len(chosen.things) for chosen in meant)
        if not meant:
            self.fail(f"{word!r} refers to nothing mentioned before.")
        exactly = 2 if word.startswith("both") else exactly
        if (count > 1) != several or (exactly is not None and count != exactly):
            self.fail(f"{word!r} does not fit {listed(meant)} mentioned before.")
        return meant


def describe(vocabulary: Things, scene: Scene, thing: Thing) -> str | None:
    """The shortest phrase that means this thing and no other of the scene: its label, with a colour or a place where
    need be."""
    words = lexicon()
    attributes = [*sorted(thing.words & words.colours), *dict.fromkeys(words.place_names)]
    for text in (thing.label, *(f"{word} {thing.label}" for word in attributes)):
        try:
            found, places, _ = vocabulary.find(tokens(text))
        except NotFoundError:
            continue
        found = [t for t in found if scene.has(t)]
        for place in places:
            best = scene.at(place, found)
            found = [best] if best else []
        if found == [thing]:
            return text
    return None


def listed(chosen: Sequence[Chosen]) -> str:
    """'the milk and the butter'."""
    return " and ".join(f"the {thing.label}" for c in chosen for thing in c.things[: c.count])


def marks_of(tree: Tree[Token]) -> dict[str, str]:
    """The tokens right below, by type."""
    return {child.type: str(child) for child in tree.children if isinstance(child, Token)}


def subtrees(tree: Tree[Token], name: str) -> list[Tree[Token]]:
    """The trees of that name right below."""
    return [child for child in tree.children if isinstance(child, Tree) and child.data == name]


def _number(marks: dict[str, str]) -> int | None:
    text = marks.get("NUMBER")
    return None if text is None else int(text) if text.isdigit() else int(lexicon().meaning[text])
