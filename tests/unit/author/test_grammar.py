"""Sentences and the goals they mean; sentences and why they are refused."""

from __future__ import annotations

import pytest

from gap_cli.author.goals import Goal
from gap_cli.author.grammar import parse_instruction
from gap_runtime.contracts.task import Task
from gap_runtime.errors import InstructionError
from tests.unit.author.conftest import make_task

MILK, KETCHUP, BUTTER = ("milk", "basket"), ("ketchup", "basket"), ("butter", "basket")
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
    "Put the milk, the ketchup and the butter in the basket": [MILK, KETCHUP, BUTTER],
    "Put the milk, the ketchup, and the butter in the basket": [MILK, KETCHUP, BUTTER],
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
}  # fmt: skip


@pytest.mark.parametrize("sentence", UNDERSTOOD)
def test_a_sentence_means_its_goals(task, sentence):
    goals = parse_instruction(task, sentence)
    assert [(g.target, g.container) for g in goals] == UNDERSTOOD[sentence]


REFUSED = {
    # nothing, or nothing to do
    "": "nothing to do",
    "  ,.!": "nothing to do",
    "please": "nothing to do",
    "the milk": "what to do with the milk",
    "milk basket": "what to do with the milk",
    "Make me a sandwich": "The action 'make me' is not known",
    # unknown words, at any place
    "Put the pepsi in the basket": "The object 'pepsi' is not known",
    "Put the milk and the pepsi in the basket": "The object 'pepsi' is not known",
    "Put the milk and pepsi in the basket": "'pepsi'",
    "Put the milk in the bucket": "The container 'bucket'",
    "Juggle the milk": "The action 'juggle'",
    "Put the milk in the basket and shake it": "'shake'",
    "Put the milk in the basket quickly": "'quickly'",
    "Put the red milk in the basket": "'red'",
    "Put the milk in the basket using the left arm": "'using'",
    "Mets le lait dans le panier": "'mets le lait dans le panier'",
    "把牛奶放进篮子": "把",
    # incomplete
    "Put the milk": "which container the milk",
    "Pick up the milk": "which container the milk",
    "Pick the milk and put the ketchup in the basket": "which container the milk",
    "Put in the basket": "what to put",
    "Put it in the basket": "nothing mentioned before",
    "Put the milk in it": "no container mentioned before",
    "Put the milk in": "ends where the container",
    "Put the milk and": "which container the milk",
    # ambiguous
    "Put the sauce in the basket": "could be the bbq sauce or the tomato sauce",
    "Pick the milk and the ketchup and put it in the basket": "does not fit the milk and ketchup",
    "Pick the milk and put them in the basket": "does not fit the milk",
    "Put both the milk, the ketchup and the butter in the basket": "'both' is followed by 3",
    # not inside a container
    "Put the milk on the floor": "not 'on the floor'",
    "Put the milk on the basket": "'on' is not understood here: things can be put into containers",
    "Put the milk next to the basket": "next to",
    "Take the milk out of the basket": "out of",
    "Put the milk in the ketchup": "Nothing can be put into the ketchup",
    # numbers, quantifiers, negations, conditions
    "Put two milks in the basket": "'two'.*one of each",
    "Put 3 milks in the basket": "'3'.*one of each",
    "Put all groceries in the basket": "'all'.*one by one",
    "Put everything in the basket": "'everything'",
    "Do not put the milk in the basket": "'do not'.*what should be done",
    "Don't put the milk in the basket": "don t",
    "Put the milk in the basket but not the ketchup": "'but'",
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
        parse_instruction(task, sentence)
    assert "Objects: milk, ketchup" in caught.value.hint
    assert "Containers: basket, tray" in caught.value.hint


def test_a_near_miss_is_named_and_not_taken(task):
    with pytest.raises(InstructionError, match="Did you mean 'ketchup'") as caught:
        parse_instruction(task, "Put the ketchap in the basket")
    assert "ketchap" in caught.value.message


def test_a_container_that_cannot_hold_all_is_refused(task):
    basket = task.objects["basket"]
    shape = basket.shape.model_copy(update={"size": (0.1, 0.1, 0.09)})
    small = basket.model_copy(update={"shape": shape})
    crowded = task.model_copy(update={"objects": {**task.objects, "basket": small}})
    with pytest.raises(InstructionError, match="cannot hold all 2 things"):
        parse_instruction(crowded, "Put the milk and the ketchup in the basket")


PAN = {"kind": "pan", "size": (0.4, 0.2, 0.05), "wall": 0.005, "floor": 0.005, "handle": (0.03, 0.02)}
MUG = {"kind": "mug", "size": (0.12, 0.08, 0.1), "wall": 0.005, "floor": 0.005, "handle": (0.02, 0.02)}


def kitchen_with(accepts=("grocery",), **shapes):
    """The task with a pan, a mug, ... in place of its tray."""
    data = make_task().model_dump(by_alias=True, exclude={"path"})
    tray = data["objects"].pop("tray")
    data["objects"] |= {n: {**tray, "label": n, "accepts": list(accepts), "shape": s} for n, s in shapes.items()}
    data["scenes"] = {"all": dict.fromkeys(["milk", "ketchup", "butter", "basket", *shapes], "near")}
    return Task.load(data, "task.yaml")


def test_a_pan_and_a_mug_are_containers_where_the_task_says_what_they_take():
    task = kitchen_with(pan=PAN, mug=MUG)
    assert parse_instruction(task, "Put the milk in the pan") == (Goal("milk", "pan"),)
    assert (
        parse_instruction(task, "Put the milk and the ketchup in the pan and the butter in the mug")[2].container
        == "mug"
    )
    with pytest.raises(InstructionError, match="melon is too large for the pan"):
        parse_instruction(task, "Put the melon in the pan")
    with pytest.raises(InstructionError, match="milk is too large for the mug"):  # 5 cm square, and the mug is round
        parse_instruction(task, "Put the milk in the mug")


def test_a_pan_holds_what_stands_side_by_side_in_it():
    small = {**PAN, "size": (0.2, 0.09, 0.03)}
    task = kitchen_with(pan=small)
    assert parse_instruction(task, "Put the milk in the pan")
    with pytest.raises(InstructionError, match="cannot hold all 3 things"):
        parse_instruction(task, "Put the milk, the ketchup and the bbq sauce in the pan")


def test_a_hollow_thing_of_which_the_task_says_nothing_is_told_apart():
    with pytest.raises(InstructionError, match="does not say what it takes") as caught:
        parse_instruction(kitchen_with(accepts=(), pan=PAN), "Put the milk in the pan")
    assert "accepts" in caught.value.hint


@pytest.mark.parametrize("sentence", ["put " * 1000, "a" * 100_000, "milk and " * 500, "\0\x1b[31m", "🥛" * 500])
def test_mangled_input_is_refused_at_once(task, sentence):
    with pytest.raises(InstructionError):
        parse_instruction(task, sentence)
