import pytest

from gap_perception.language.vocabulary import build_vocabulary, singular, tokens
from gap_runtime.contracts.task import ObjectModel, Shape


@pytest.fixture
def words():
    def thing(label, kind, size, *words, style=""):
        walls = {"wall": 0.01, "floor": 0.01} if kind == "open_box" else {}
        return ObjectModel(
            label=label, words=list(words), category="grocery", mass=1, looks={"style": style} if style else {},
            shape=Shape(kind=kind, size=size, **walls),
        )  # fmt: skip

    return build_vocabulary(
        {
            "soup": thing("alphabet soup", "cylinder", (0.06, 0.06, 0.08), "letter soup", style="can"),
            "tomato": thing("tomato sauce", "cylinder", (0.06, 0.06, 0.08), style="can"),
            "bbq": thing("bbq sauce", "box", (0.05, 0.03, 0.11), "barbecue sauce", style="bottle"),
            "basket": thing("basket", "open_box", (0.2, 0.2, 0.1), "bin"),
        },
        {"soup": frozenset({"red"}), "tomato": frozenset({"green"})},
    )


@pytest.mark.parametrize(
    ("phrase", "names"),
    [
        ("alphabet soup", {"soup"}),
        ("the Alphabet Soup!", {"soup"}),
        ("letter soups", {"soup"}),
        ("alphabet soup can", {"soup"}),
        ("red can", {"soup"}),
        ("cans", {"soup", "tomato"}),
        ("sauce", {"tomato", "bbq"}),
        ("tall bottle", {"bbq"}),
        ("grocery", {"soup", "tomato", "bbq", "basket"}),
        ("barbecue sauce", {"bbq"}),
        ("alphabeth soup", {"soup"}),
        ("bin", {"basket"}),
        ("green soup", set()),
        ("unicorn", set()),
        ("red unicorn", set()),
        ("the", set()),
        ("", set()),
    ],
)
def test_a_phrase_means_the_models_all_its_words_fit(words, phrase, names):
    assert set(words.resolve(phrase)) == names


def test_the_surer_a_phrase_the_more_it_says(words):
    said = ("alphabet soup", "red letter soup", "alphabeth soup")
    exact, qualified, misspelled = (words.resolve(p)["soup"] for p in said)
    assert exact > qualified > misspelled > words.resolve("red can")["soup"]


@pytest.mark.parametrize("word", ["sauce", "glass", "citrus", "bus", "can"])
def test_words_that_are_no_plurals_stay(word):
    assert singular(word) == word


def test_filler_and_punctuation_carry_no_meaning():
    assert tokens("Is this one of the boxes, please?") == ["box"]
