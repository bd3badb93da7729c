"""Answers plain questions about an image from its candidates, and says so when a question is beyond it."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence

from gap_perception.candidates import Candidate
from gap_perception.image_view import ImageView
from gap_perception.language.phrases import Phrase, read_phrase, read_relation
from gap_perception.language.relations import distance, holds, matches
from gap_runtime.contracts.failures import PerceptionError

PRESENT = 0.3  # probability from which a thing counts as there
CANNOT = "cannot answer"
_NUMBER = r"(-?[\d.]+)"
_LISTED_BOX = re.compile(rf"(?m)^\s*(?:box |#)?(\d+)\s*[:.)]\s*\[?\s*{_NUMBER}" + rf"[,\s]+{_NUMBER}" * 3)
_BOX_OVERLAP = 0.3


class NotUnderstood(Exception):
    """The question, or a phrase in it, is not one this provider can answer; the text says why."""


def answer(view: ImageView, prompt: str) -> str:
    """A short answer: yes, no, a number, a label, a comma-separated list, or none. Raises `NotUnderstood`."""
    boxes = [(int(n), tuple(float(v) for v in box)) for n, *box in _LISTED_BOX.findall(prompt)]
    question = " ".join(prompt.strip().split("\n")[0].lower().split())
    if boxes:
        return _which_box(view, question, boxes)
    clean = re.sub(r"[?.!]+(?: (?:please )?(?:answer|reply|respond)\b.*)?$", "", question).strip()
    for pattern, handle in _FORMS:
        match = re.fullmatch(pattern, clean)
        if match:
            return handle(view, match)
    raise NotUnderstood(
        "this provider answers questions about presence, number, kind and place of the task's objects only"
    )


def _phrase(view: ImageView, text: str) -> Phrase:
    phrase = read_phrase(text, view.vocabulary)
    if phrase is None:
        known = ", ".join(sorted(view.vocabulary.entries))
        raise NotUnderstood(f"{text.strip()!r} names nothing among the task's objects ({known})")
    return phrase


def _found(view: ImageView, text: str) -> list[tuple[float, Candidate]]:
    return matches(view, _phrase(view, text), PRESENT)


def _only(view: ImageView, text: str) -> Candidate:
    found = _found(view, text)
    if not found:
        raise NotUnderstood(f"no {text.strip()} can be seen")
    return found[0][1]


def _which_box(view: ImageView, question: str, boxes: Sequence[tuple[int, tuple[float, ...]]]) -> str:
    """The number of the listed box that holds what is asked for, or none."""
    forms = (
        r".*?\b(?:show|contain|hold|match|is|depict)(?:e?s)?\b (?:best )?(?:only )?(?P<what>.+?)",
        r".*?\b(?:select|pick|choose|find)\b(?: the (?:number|box) (?:of|with|around))? (?P<what>.+?)",
    )
    clean = re.split(r"[?.:]", question)[0]
    for form in forms:
        match = re.fullmatch(form, clean.strip())
        phrase = read_phrase(match["what"], view.vocabulary) if match else None
        if phrase is not None:
            break
    else:
        raise NotUnderstood("it is not clear what the numbered boxes are searched for")
    best: tuple[float, float, int] | None = None
    for score, candidate in matches(view, phrase, PRESENT):
        for number, box in boxes:
            overlap = _iou(candidate.box, box)
            if overlap >= _BOX_OVERLAP and (best is None or (score, overlap) > best[:2]):
                best = (score, overlap, number)
    return str(best[2]) if best else "none"


def _iou(a: Sequence[float], b: Sequence[float]) -> float:
    wide, high = min(a[2], b[2]) - max(a[0], b[0]), min(a[3], b[3]) - max(a[1], b[1])
    if wide <= 0 or high <= 0:
        return 0.0
    return wide * high / ((a[2] - a[0]) * (a[3] - a[1]) + (b[2] - b[0]) * (b[3] - b[1]) - wide * high)


def _is_there(view: ImageView, match: re.Match[str]) -> str:
    return "yes" if _found(view, match["what"]) else "no"


def _how_many(view: ImageView, match: re.Match[str]) -> str:
    return str(len(_found(view, match["what"])))


def _list_all(view: ImageView, match: re.Match[str]) -> str:
    return _labels(view, view.candidates)


def _is_related(view: ImageView, match: re.Match[str]) -> str:
    parts = read_relation(match["rest"])
    if parts is None:
        return _is_a(view, match["rest"])
    subject, relation, reference = parts
    a, b = _only(view, subject), _only(view, reference)
    if relation in ("nearest", "farthest"):
        others = [c for c in view.candidates if c is not b and _label(view, c)]
        pick = min if relation == "nearest" else max
        return "yes" if pick(others, key=lambda c: distance(c, b)) is a else "no"
    return "yes" if a is not b and holds(relation, a, b) else "no"


def _is_a(view: ImageView, text: str) -> str:
    """'this the alphabet soup' about a crop: is its largest segment that?"""
    this = rf"(?:this|it|that|the (?:object|item|{_PICTURE}))(?: shown)?"
    match = re.fullmatch(rf"{this} (?:is )?{_A}(?P<what>.+)", text)
    if match is None:
        raise NotUnderstood("no relation between objects was recognised")
    phrase = _phrase(view, match["what"])
    if not view.candidates:
        return "no"
    return "yes" if _main(view).score(phrase.names) >= PRESENT else "no"


def _what_related(view: ImageView, match: re.Match[str]) -> str:
    parts = read_relation("x " + match["rest"])
    if parts is None:
        raise NotUnderstood("no relation between objects was recognised")
    _, relation, reference = parts
    b = _only(view, reference)
    others = [c for c in view.candidates if c is not b and _label(view, c)]
    if match["kind"] and match["kind"].strip() not in ("object", "thing", "item", "one"):
        wanted = [c for _, c in _found(view, match["kind"])]
        others = [c for c in others if any(c is w for w in wanted)]
    if relation in ("nearest", "farthest"):
        others = sorted(others, key=lambda c: distance(c, b) * (1 if relation == "nearest" else -1))[:1]
    else:
        others = [c for c in others if holds(relation, c, b)]
    return _labels(view, others)


def _what_is_this(view: ImageView, match: re.Match[str]) -> str:
    return _labels(view, [_main(view)] if view.candidates else [])


def _where(view: ImageView, match: re.Match[str]) -> str:
    found = _found(view, match["what"])
    if not found:
        return "none"
    return ", ".join("[{}, {}, {}, {}]".format(*c.box) for _, c in found)


def _main(view: ImageView) -> Candidate:
    """The segment a crop is about: the one that covers most of it."""
    return max(view.candidates, key=lambda c: (int(c.mask.sum()), c.box))


def _label(view: ImageView, candidate: Candidate) -> str:
    best = max(candidate.scores, key=lambda n: candidate.scores[n], default="")
    return best.replace("_", " ") if best and candidate.scores[best] >= PRESENT else ""


def _labels(view: ImageView, candidates: Sequence[Candidate]) -> str:
    return ", ".join(sorted(label for label in (_label(view, c) for c in candidates) if label)) or "none"


_A = r"(?:a |an |any |the )?"
_PICTURE = r"(?:image|picture|photo|crop|box|scene|view)"
_SEEN = rf"(?: (?:visible|shown|present|seen))?(?: (?:in|on) (?:the|this) (?:{_PICTURE}|floor|table))?"
_FORMS: tuple[tuple[str, Callable[[ImageView, re.Match[str]], str]], ...] = (
    (rf"how many (?P<what>.+?)(?: (?:are|can)(?: there| you see| be seen)?)?{_SEEN}", _how_many),
    (rf"count (?:the )?(?P<what>.+?){_SEEN}", _how_many),
    (rf"(?:which|what) (?:objects|things|items)(?: are(?: there)?| (?:do|can) you see)?{_SEEN}", _list_all),
    (rf"(?:what (?:do|can) you see|list (?:all )?(?:the )?objects){_SEEN}", _list_all),
    (rf"describe (?:the|this) {_PICTURE}", _list_all),
    (r"what is (?:this|it|shown)(?: object| item)?|what (?:object|item) is (?:this|it|shown)", _what_is_this),
    (r"(?:what|which)(?P<kind> [a-z ]+?)? (?:is|are|lies|stands|sits) (?P<rest>.+)", _what_related),
    (rf"(?:is|are) there {_A}(?P<what>.+?){_SEEN}", _is_there),
    (rf"(?:do|can) you see {_A}(?P<what>.+?){_SEEN}", _is_there),
    (rf"(?:does|do) (?:the|this) {_PICTURE} (?:show|contain|depict) {_A}(?P<what>.+?)", _is_there),
    (rf"(?:is|are) {_A}(?P<what>.+?) (?:visible|present|shown|in view|in the {_PICTURE})", _is_there),
    (r"where (?:is|are) (?:the )?(?P<what>.+)", _where),
    (r"(?:is|are) (?P<rest>.+)", _is_related),
)


def yes_or_no(text: str) -> bool:
    """True for yes, False for no. Raises `PerceptionError` (`cannot_answer`) for anything else."""
    if text in ("yes", "no"):
        return text == "yes"
    raise PerceptionError("cannot_answer", f"The answer {text!r} is neither yes nor no.", hint="Ask a yes-no question.")
