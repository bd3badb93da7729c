"""The failures a plugin may raise; the engine's own errors grow from the same root in `gap_runtime.errors`."""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Iterable, Mapping
from typing import Any

KNOWN = "Known: "  # how a hint begins that lists what exists


class GapError(Exception):
    """Root of every error GaP raises on purpose.

    `message` says what was wrong and where; `hint` says what exists instead or what to type.
    `exit_code` is what the command line returns for it (1: the user's input, 3: a bug).
    """

    exit_code = 1

    def __init__(self, message: str, *, hint: str = "") -> None:
        super().__init__(message)
        self.message = message
        self.hint = hint

    def __str__(self) -> str:
        return f"{self.message} {self.hint}".strip() if self.hint else self.message

    def __reduce__(self) -> tuple[Any, ...]:
        # Errors cross process borders (rehearsal workers); the default would re-run __init__ with str(self).
        return (_rebuild, (type(self), self.args, self.__dict__))


def _rebuild(cls: type[GapError], args: tuple[Any, ...], state: dict[str, Any]) -> GapError:
    error = cls.__new__(cls)
    Exception.__init__(error, *args)
    error.__dict__.update(state)
    return error


def nearest(name: str, known: Iterable[str]) -> str:
    """The name that was most likely meant, '' when none is near: one that differs by little, else one that shares words
    with it, in its own name or, where `known` maps names to what they stand for, in that text."""
    names = sorted(known)
    texts = known if isinstance(known, Mapping) else {}
    found = difflib.get_close_matches(name, names, n=1, cutoff=0.8) or _by_words(name, names, texts)
    return next(iter(found or difflib.get_close_matches(name, names, n=1, cutoff=0.6)), "")


def _by_words(name: str, names: list[str], texts: Mapping[str, Any]) -> list[str]:
    """The name that shares most words with `name`, where they are enough of them; a word that many share says little.

    A word counts half in a text, and in part where only its beginning is shared (`perceiving`, `perception`).
    """
    owned = [(_words(known), _words(str(texts[known])) if isinstance(texts.get(known), str) else []) for known in names]
    scores, most = [0.0] * len(names), 0.0
    for word in _words(name):
        likeness = [max(_alike(word, mine), 0.5 * _alike(word, text)) for mine, text in owned]
        weight = math.log(1 + len(names) / max(1, sum(x > 0 for x in likeness)))
        scores = [score + weight * x for score, x in zip(scores, likeness, strict=True)]
        most += weight
    best = max(range(len(names)), key=lambda i: (scores[i], _ratio(name, names[i])), default=None)
    return [names[best]] if best is not None and scores[best] > 0.5 * most else []


def _words(text: str) -> list[str]:
    """Its words in small letters, CamelCase taken apart, single letters left out."""
    return [w.lower() for w in re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+", text) if len(w) > 1]


def _alike(word: str, others: Iterable[str]) -> float:
    """How much one of the others is like `word`: 1 for the same, more than 0.7 where half of it or more is, else 0."""
    shares = [1.0 if word == other else _shared(word, other) for other in others]
    return max((0.5 + s / 2 for s in shares if s >= 0.5), default=0.0)


def _shared(a: str, b: str) -> float:
    count = next((i for i, (x, y) in enumerate(zip(a, b, strict=False)) if x != y), min(len(a), len(b)))
    return count / max(len(a), len(b)) if count > 2 else 0.0


def _ratio(a: str, b: str) -> float:
    return difflib.SequenceMatcher(None, "".join(_words(a)), "".join(_words(b))).ratio()


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """'Did you mean x?' where one is `nearest`, else the list of what exists (at most twelve)."""
    names = sorted(known)
    near = nearest(name, known)
    if near:
        return f"Did you mean {near!r}?"
    shown = ", ".join(names[:12]) + (f" and {len(names) - 12} more" if len(names) > 12 else "")
    return f"{KNOWN}{shown}." if names else "None are known."


class UnknownNameError(GapError):
    """A name that nothing answers to; the hint names the nearest that exists."""

    def __init__(self, kind: str, name: str, known: Iterable[str]) -> None:
        self.kind, self.name = kind, name
        super().__init__(f"Unknown {kind} {name!r}.", hint=did_you_mean(name, known))


class DocumentError(GapError):
    """A YAML, JSON or Markdown document that cannot be accepted. `where` is path[:line]; `problems` are all of them."""

    def __init__(self, where: str, *problems: str, hint: str = "") -> None:
        self.where, self.problems = where, problems
        count = f"{len(problems)} problems: " if len(problems) > 1 else ""
        super().__init__(f"{where}: {count}{'; '.join(problems)}", hint=hint)


class InstructionError(GapError):
    """An instruction an author cannot serve; it says what was not understood and what the task offers."""


class ToolError(GapError):
    """A tool could not do what was asked of the robot or its sensors.

    `code` is a short stable word (`unreachable`, `not_found`, ...); `detail` holds the numbers behind it.
    """

    def __init__(self, code: str, message: str, *, hint: str = "", detail: Mapping[str, Any] | None = None) -> None:
        self.code = code
        self.detail = dict(detail or {})
        super().__init__(message, hint=hint)


class BadRequestError(ToolError):
    """The arguments of a tool call are outside its contract (NaN, wrong shape, unknown link, ...)."""


class PerceptionError(ToolError):
    """Nothing (or nothing certain enough) was found in the pixels."""


class PlanningError(ToolError):
    """No motion: unreachable, in collision, outside limits, or no path within the budget."""


class MotionError(ToolError):
    """The arm did not do what was commanded: tracking, stall, contact, or a refused command."""


class GraspError(ToolError):
    """The gripper closed on nothing, or what it held is gone."""


class PrivilegedReadError(GapError):
    """A policy node tried to read simulator ground truth."""

    exit_code = 3


class SimulationDivergedError(GapError):
    """Physics blew up, reset itself or ran backwards: the episode is void."""


class TaskInfeasibleError(GapError):
    """A belief region cannot hold the objects it is asked to hold."""


class CancelledError(GapError):
    """The node was told to stop (sibling failure, deadline, Ctrl-C)."""
