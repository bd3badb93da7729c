import pytest

from gap_perception.language.phrases import read_phrase
from gap_perception.language.vocabulary import build_vocabulary
from gap_runtime.contracts.task import ObjectModel, Shape


@pytest.fixture(scope="module")
def words():
    shape = Shape(kind="box", size=(0.05, 0.05, 0.1))
    labels = {"milk": "milk", "soup": "alphabet soup", "side": "left over pie"}
    models = {n: ObjectModel(label=label, category="food", shape=shape, mass=1) for n, label in labels.items()}
    return build_vocabulary(models)


@pytest.mark.parametrize(
    ("text", "relation"),
    [
        ("milk left of the soup", "left"),
        ("the milk to the right of the soup", "right"),
        ("milk in front of soup", "front"),
        ("milk behind the alphabet soup", "behind"),
        ("milk that is next to the soup", "near"),
        ("the milk nearest to the soup", "nearest"),
        ("milk on top of the soup", "on"),
        ("milk inside the soup", "in"),
        ("milk under the soup", "below"),
    ],
)
def test_relations_are_read(words, text, relation):
    phrase = read_phrase(text, words)
    assert (set(phrase.names), phrase.relation, set(phrase.reference)) == ({"milk"}, relation, {"soup"})


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("leftmost milk", "leftmost"),
        ("the milk on the right", "rightmost"),
        ("nearest milk", "frontmost"),
        ("largest food", "largest"),
    ],
)
def test_places_are_read(words, text, place):
    assert read_phrase(text, words).place == place


def test_a_place_and_a_relation_may_come_together(words):
    phrase = read_phrase("the leftmost milk behind the soup", words)
    assert (phrase.place, phrase.relation, set(phrase.reference)) == ("leftmost", "behind", {"soup"})


def test_a_name_that_holds_a_relation_word_stays_a_name(words):
    phrase = read_phrase("left over pie", words)
    assert set(phrase.names) == {"side"} and phrase.relation is None and phrase.place is None


@pytest.mark.parametrize("text", ["unicorn", "milk left of the unicorn", "leftmost unicorn", "", "behind"])
def test_what_names_nothing_is_not_understood(words, text):
    assert read_phrase(text, words) is None
