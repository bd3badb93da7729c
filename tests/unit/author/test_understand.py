"""Sentences and the goals they mean; sentences and why they are refused."""

from __future__ import annotations

import pytest

from gap_cli.author.understand import understand
from gap_runtime.contracts.task import Task
from gap_runtime.errors import InstructionError
from tests.unit.author.conftest import make_task

MILK, KETCHUP, BBQ = ("milk", "basket"), ("ketchup", "basket"), ("bbq_sauce", "basket")
TOMATO = ("tomato_sauce", "basket")
TRAY = ("ketchup", "tray")
UNDERSTOOD = {
    # one goal, many phrasings
    "Pick the milk and place it in the basket": [MILK],
    "pick up the milk and put it into the basket.": [MILK],
    "Pick the milk up, and drop it inside the basket!": [MILK],
    "PUT THE MILK IN THE BASKET": [MILK],
    "Put milk in basket": [MILK],
    "put the carton of milk in to the basket": [MILK],
    "Move the milk to the basket": [MILK],
    "Transfer the milk into the basket": [MILK],
    "Pack the milk into the basket": [MILK],
    "Load the milk into the basket": [MILK],
    "Bring the milk to the basket": [MILK],
    "Grab the milk and drop it in the basket": [MILK],
    "Take the milk, then place it in the basket": [MILK],
    "Get the milk into the basket": [MILK],
    "Lift the milk and set it inside of the basket": [MILK],
    "Pick and place the milk in the basket": [MILK],
    "Pick the milk and place in the basket": [MILK],
    "Could you please put the milk in the basket?": [MILK],
    "I want you to put the milk in the basket, thanks": [MILK],
    "I'd like the milk in the basket": [MILK],
    "The milk goes in the basket": [MILK],
    "the milk should be in the basket": [MILK],
    "I want the milk to be in the basket": [MILK],
    "In the basket, put the milk": [MILK],
    "Into the basket place the milk": [MILK],
    "Fill the basket with the milk": [MILK],
    "Pick up the milk from the floor and place it in the basket": [MILK],
    "Take the milk that is on the floor and put it in the basket": [MILK],
    "Put the milk in the basket on the floor": [MILK],
    "put “the milk” in the 'basket'": [MILK],
    "Put the catsup in the basket": [KETCHUP],
    "put the tomato-sauce in the tray": [("tomato_sauce", "tray")],
    "put the TOMATO_SAUCE in the tray": [("tomato_sauce", "tray")],
    # several goals
    "Put the milk and the ketchup in the basket": [MILK, KETCHUP],
    "Put both the milk and the ketchup in the basket": [MILK, KETCHUP],
    "Put the milk, the ketchup and the bbq sauce in the basket": [MILK, KETCHUP, BBQ],
    "Put the milk, the ketchup, and the bbq sauce in the basket": [MILK, KETCHUP, BBQ],
    "Put the milk as well as the ketchup into the basket": [MILK, KETCHUP],
    "Pack the basket with the milk and the ketchup": [MILK, KETCHUP],
    "Pick the milk and the ketchup and put them in the basket": [MILK, KETCHUP],
    "Pick the milk, then the ketchup, and put both of them in the basket": [MILK, KETCHUP],
    "Pick the milk, pick the ketchup, and place both in the basket": [MILK, KETCHUP],
    "pick the milk and place it in the basket, then move the ketchup into it": [MILK, KETCHUP],
    "Put the milk in the basket and the ketchup too": [MILK, KETCHUP],
    "Put the milk in the basket, then the ketchup": [MILK, KETCHUP],
    "Put the milk in the basket and put the ketchup there too": [MILK, KETCHUP],
    "Put the milk in the basket and the ketchup in the tray": [MILK, TRAY],
    "Put the milk in the basket. Put the ketchup in the tray.": [MILK, TRAY],
    "First put the milk in the basket; after that, put the ketchup in the tray": [MILK, TRAY],
    "The milk goes in the basket and the ketchup in the tray": [MILK, TRAY],
    "Pick the milk and the ketchup, put the milk in the basket and the ketchup in the tray": [MILK, TRAY],
    # declared, not commanded
    "The basket should contain the milk": [MILK],
    "Make sure the milk ends up inside the basket": [MILK],
    "Ensure that the milk and the ketchup are in the basket": [MILK, KETCHUP],
    # what was said before holds again
    "Take the milk and drop it in the basket, then do the same with the ketchup": [MILK, KETCHUP],
    "Put the milk in the basket and likewise the ketchup": [MILK, KETCHUP],
    # several of a kind
    "Put both sauces in the basket": [BBQ, TOMATO],
    "Put the two sauces in the basket": [BBQ, TOMATO],
    "Put two of the sauces in the basket": [BBQ, TOMATO],
    "Put one of the sauces in the basket": [BBQ],
    "Put a sauce in the basket": [BBQ],
    "Put all groceries in the basket": [MILK, KETCHUP, BBQ, TOMATO],
    "Pick all the groceries and put them in the basket": [MILK, KETCHUP, BBQ, TOMATO],
    "Put every grocery except the milk and the sauces in the basket": [KETCHUP],
    "Put everything but the tray in the basket": [MILK, KETCHUP, BBQ, TOMATO],
    "Put everything on the floor in the basket except the tray": [MILK, KETCHUP, BBQ, TOMATO],
    "Put the milk in the tray and the other groceries in the basket": [("milk", "tray"), KETCHUP, BBQ, TOMATO],
}  # fmt: skip


@pytest.mark.parametrize("sentence", UNDERSTOOD)
def test_a_sentence_means_its_goals(task, sentence):
    goals = understand(task, sentence)
    assert [tuple(p.roles.values()) for p in goals.predicates()] == UNDERSTOOD[sentence]


ORDERED = {
    "put the milk in the basket second and the ketchup first": [KETCHUP, MILK],
    "First the ketchup, second the milk, third the bbq sauce go in the basket": None,
    "Put the milk in the basket last, first the ketchup and second the bbq sauce": [KETCHUP, BBQ, MILK],
    "Place the ketchup in the basket after the milk": [MILK, KETCHUP],
    "Place the ketchup in the basket before the milk": [KETCHUP, MILK],
    "After the milk, put the ketchup in the basket": [MILK, KETCHUP],
    "After putting the ketchup in the basket, put the milk in it": [KETCHUP, MILK],
    "Before you put the ketchup in the basket, put the milk there": None,
    "Once the milk is in the basket, put the ketchup in the tray": [MILK, TRAY],
    "First, pick the milk and place it in the basket, then pick the ketchup and put it there": [MILK, KETCHUP],
    "Put the milk in the basket, then the ketchup. Finally the bbq sauce goes in the basket": [MILK, KETCHUP, BBQ],
}


@pytest.mark.parametrize("sentence", ORDERED)
def test_words_that_carry_order_are_obeyed_or_refused(task, sentence):
    if ORDERED[sentence] is None:
        with pytest.raises(InstructionError):
            understand(task, sentence)
        return
    goals = understand(task, sentence)
    assert goals.order == "sequence"
    assert [tuple(p.roles.values()) for p in goals.predicates()] == ORDERED[sentence]


@pytest.mark.parametrize(
    "sentence",
    [
        "put the milk in the basket second",
        "put the milk in the basket first and the ketchup first",
        "put the milk in the basket first and the ketchup third",
        "put the milk in the basket first after the ketchup",
    ],
)
def test_an_order_with_gaps_or_contradictions_is_refused(task, sentence):
    with pytest.raises(InstructionError, match=r"first, second|two places in the order"):
        understand(task, sentence)


def test_without_order_words_goals_are_in_any_order(task):
    assert understand(task, "Put the milk in the basket. Put the ketchup in the tray.").order == "any"
    assert understand(task, "Put the milk and the ketchup in the basket").order == "any"


REFUSED = {
    # nothing, or nothing to do
    "": "nothing to do",
    "  ,.!": "nothing to do",
    "please": "nothing to do",
    "the milk": "what to do with the milk",
    "milk basket": "No basket is known to be 'milk'",
    "Make me a sandwich": "The action 'make me' is not known",
    # unknown words, at any place
    "Put the pepsi in the basket": "The object 'pepsi' is not known",
    "Put the milk and the pepsi in the basket": "The object 'pepsi' is not known",
    "Put the milk and pepsi in the basket": "'pepsi'",
    "Put the milk in the bucket": "The place 'bucket' is not known",
    "Juggle the milk": "The action 'juggle'",
    "Put the milk in the basket and shake it": "'shake'",
    "Put the milk in the basket quickly": "'quickly'",
    "Put the red milk in the basket": "'red'",
    "Put the milk in the basket using the left arm": "'using'",
    "Mets le lait dans le panier": "'mets le lait dans le panier'",
    "把牛奶放进篮子": "把",
    # incomplete
    "Put the milk": "ends after 'put the milk'",
    "Pick up the milk": "where the milk should go",
    "Pick the milk and put the ketchup in the basket": "where the milk should go",
    "Put in the basket": "what to put",
    "Put it in the basket": "nothing mentioned before",
    "Put the milk in it": "no place mentioned before",
    "Put the milk in": "ends after 'put the milk in'",
    "Put the milk and": "ends after 'put the milk'",
    # ambiguous
    "Put the sauce in the basket": "could be the bbq sauce or the tomato sauce",
    "Pick the milk and the ketchup and put it in the basket": "does not fit the milk and the ketchup",
    "Pick the milk and put them in the basket": "does not fit the milk",
    "Put both the milk, the ketchup and the butter in the basket": "1 'milk', not 2",
    # not inside a container
    "Take the milk out of the basket": "whether a milk is out of the basket",
    "Move the milk to the ketchup": "whether in or on the ketchup",
    "Put the milk in the ketchup": "Nothing can be put into the ketchup",
    # numbers, quantifiers, negations, conditions
    "Put two milks in the basket": "1 'milks', not 2",
    "Put 3 milks in the basket": "1 'milks', not 3",
    "Put all three sauces in the basket": "2 'sauces', not 3",
    "Put some of the sauces in the basket": "how many",
    "If the milk is cold, put it in the basket": "conditions",
    "Gently put the milk in the basket": "the skills' business",
    "Put everything in the basket": "takes grocery, not the tray",
    "Do not put the milk in the basket": "'do not'.*what should be done",
    "Don't put the milk in the basket": "don t",
    "Put the milk in the basket but not the ketchup": "the ketchup cannot be left out",
    "Never put the milk in the basket": "'never'",
    # nonsense over known things
    "Put the basket in the basket": "itself",
    "Put the milk in the basket and the milk in the basket": "twice",
    "Put the milk in the basket and the milk in the tray": "two places",
    "Put the basket in the tray": "takes grocery, not the basket",
    "Put the hammer in the basket": "takes grocery, not the hammer",
    "Put the melon in the basket": "too large for the basket",
}


@pytest.mark.parametrize("sentence", REFUSED)
def test_a_sentence_is_refused_for_its_reason(task, sentence):
    with pytest.raises(InstructionError, match=REFUSED[sentence]) as caught:
        understand(task, sentence)
    assert "Objects: milk, ketchup" in caught.value.hint
    assert "Containers: basket, tray" in caught.value.hint


def test_a_near_miss_is_named_and_not_taken(task):
    with pytest.raises(InstructionError, match="Did you mean 'ketchup'") as caught:
        understand(task, "Put the ketchap in the basket")
    assert "ketchap" in caught.value.message


def test_a_container_that_cannot_hold_all_is_refused(task):
    basket = task.objects["basket"]
    shape = basket.shape.model_copy(update={"size": (0.1, 0.1, 0.09)})
    small = basket.model_copy(update={"shape": shape})
    crowded = task.model_copy(update={"objects": {**task.objects, "basket": small}})
    with pytest.raises(InstructionError, match="cannot hold all 2 things"):
        understand(crowded, "Put the milk and the ketchup in the basket")


PAN = {"kind": "pan", "size": (0.4, 0.2, 0.05), "wall": 0.005, "floor": 0.005, "handle": (0.03, 0.02)}
MUG = {"kind": "mug", "size": (0.12, 0.08, 0.1), "wall": 0.005, "floor": 0.005, "handle": (0.02, 0.02)}


def kitchen_with(accepts=("grocery",), **shapes):
    """The task with a pan, a mug, ... in place of its tray."""
    data = make_task().model_dump(by_alias=True, exclude={"path"}, exclude_none=True)
    tray = data["objects"].pop("tray")
    data["objects"] |= {n: {**tray, "label": n, "accepts": list(accepts), "shape": s} for n, s in shapes.items()}
    data["scenes"] = {"all": dict.fromkeys(["milk", "ketchup", "butter", "basket", *shapes], "near")}
    return Task.load(data, "task.yaml")


def test_a_pan_and_a_mug_are_containers_where_the_task_says_what_they_take():
    task = kitchen_with(pan=PAN, mug=MUG)
    assert [p.fact for p in understand(task, "Put the milk in the pan").predicates()] == ["in(milk, pan)"]
    three = understand(task, "Put the milk and the ketchup in the pan and the butter in the mug")
    assert three.predicates()[2].fact == "in(butter, mug)"
    with pytest.raises(InstructionError, match="melon is too large for the pan"):
        understand(task, "Put the melon in the pan")
    with pytest.raises(InstructionError, match="milk is too large for the mug"):  # 5 cm square, and the mug is round
        understand(task, "Put the milk in the mug")


def test_a_pan_holds_what_stands_side_by_side_in_it():
    small = {**PAN, "size": (0.2, 0.09, 0.03)}
    task = kitchen_with(pan=small)
    assert understand(task, "Put the milk in the pan")
    with pytest.raises(InstructionError, match="cannot hold all 3 things"):
        understand(task, "Put the milk, the ketchup and the bbq sauce in the pan")


def test_a_hollow_thing_of_which_the_task_says_nothing_is_told_apart():
    with pytest.raises(InstructionError, match="does not say what it takes") as caught:
        understand(kitchen_with(accepts=(), pan=PAN), "Put the milk in the pan")
    assert "accepts" in caught.value.hint


@pytest.mark.parametrize("sentence", ["put " * 1000, "a" * 100_000, "milk and " * 500, "\0\x1b[31m", "🥛" * 500])
def test_mangled_input_is_refused_at_once(task, sentence):
    with pytest.raises(InstructionError):
        understand(task, sentence)


def shelf():
    """A caddy with two named compartments, two cans of one label, numbered ports, and a drawer that slides."""
    data = make_task().model_dump(by_alias=True, exclude={"path"}, exclude_none=True)
    can = {**data["objects"]["milk"], "label": "can", "words": []}
    box = {**data["objects"]["tray"], "accepts": ["grocery"]}
    data["objects"] |= {"can_1": can, "can_2": can}
    data["objects"] |= {
        f"caddy_{side}_compartment": {**box, "label": f"{side} compartment"} for side in ("left", "back")
    }
    data["objects"] |= {f"port_{n}": {**box, "label": f"port {n}", "words": []} for n in (1, 2, 3)}
    data["joints"] = {"cabinet_top_drawer": {"range": [0, 0.2]}, "cabinet_bottom_drawer": {"range": [0, 0.2]}}
    regions = {"west": [0.0, -0.4], "east": [0.0, 0.4], "near": [0.3, 0.0]}
    data["belief"]["regions"] = {name: {"center": at, "support": "floor"} for name, at in regions.items()}
    data["scenes"] = {"all": dict.fromkeys(data["objects"], "near") | {"can_1": "west", "can_2": "east"}}
    return Task.load(data, "task.yaml")


FACTS = {
    "Put the milk in the left compartment": ["in(milk, caddy_left_compartment)"],
    "Put the milk in the back compartment of the caddy": ["in(milk, caddy_back_compartment)"],
    "Open the top drawer": ["open(cabinet_top_drawer)"],
    "Make sure the bottom drawer is closed": ["closed(cabinet_bottom_drawer)"],
    "Put can_2 in the basket": ["in(can_2, basket)"],
    "Put the rightmost can in the basket": ["in(can_1, basket)"],
    "Put the can on the left in the basket": ["in(can_2, basket)"],
    "Put the milk in the second port": ["in(milk, port_2)"],
}


@pytest.mark.parametrize("sentence", FACTS)
def test_parts_places_and_numbers_single_things_out(sentence):
    assert [p.fact for p in understand(shelf(), sentence).predicates()] == FACTS[sentence]


def test_things_of_one_label_ask_for_what_tells_them_apart():
    with pytest.raises(InstructionError, match="could be the rightmost can or the leftmost can"):
        understand(shelf(), "Put the can in the basket")


def test_a_place_that_differs_between_instances_is_refused():
    task = shelf()
    wide = {"offset": {"uniform": [[-0.5, -0.5], [0.5, 0.5]]}}
    regions = {n: r.model_copy(update={"offset": r.offset.model_validate(wide["offset"])})
               for n, r in task.belief.regions.items()}  # fmt: skip
    task = task.model_copy(update={"belief": task.belief.model_copy(update={"regions": regions})})
    with pytest.raises(InstructionError, match="not the same in every instance"):
        understand(task, "Put the leftmost can in the basket")
