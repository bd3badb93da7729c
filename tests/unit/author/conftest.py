"""A small task whose words are easy to confuse: two sauces, two containers, one thing too large for a box."""

from __future__ import annotations

import pytest

from gap_runtime.contracts.task import Task

BOX = {"kind": "open_box", "wall": 0.02, "floor": 0.02}
SIZES = {"milk": 0.13, "ketchup": 0.14, "bbq_sauce": 0.11, "tomato_sauce": 0.07, "butter": 0.02}
WORDS = {"milk": ["carton of milk"], "ketchup": ["catsup"], "butter": ["stick of butter"]}


def make_task(**changes):
    objects = {
        name: {
            "label": name.replace("_", " "),
            "words": WORDS.get(name, []),
            "category": "grocery",
            "shape": {"kind": "box", "size": [0.05, 0.05, height]},
            "mass": 0.05,
        }
        for name, height in SIZES.items()
    }
    objects["melon"] = {"label": "melon", "category": "grocery", "mass": 1, "shape": {"kind": "box", "size": [0.2] * 3}}
    objects["hammer"] = {"label": "hammer", "category": "tool", "mass": 1, "shape": {"kind": "box", "size": [0.03] * 3}}
    for name, side in (("basket", 0.18), ("tray", 0.3)):
        shape = {**BOX, "size": [side, side, 0.16]}
        objects[name] = {"label": name, "category": "container", "mass": 0.2, "shape": shape, "accepts": ["grocery"]}
    near = {name: "near" for name in ("milk", "ketchup", "tomato_sauce", "bbq_sauce", "basket", "tray")}
    data = {
        "schema": "gap/task/v1",
        "name": "kitchen",
        "description": "A kitchen.",
        "instructions": ["Put the milk in the basket"],
        "environment": {
            "supports": {"floor": {"z": 0.0, "half_size": [1, 1]}},
            "workspace": [[-1, -1, 0], [1, 1, 1]],
        },
        "robots": [{"model": "panda"}],
        "objects": objects,
        "belief": {"regions": {"near": {"center": [0, 0], "support": "floor"}}},
        "scenes": {"all": near, "ketchup": near, "dairy": {"butter": "near", "melon": "near", "basket": "near"}},
        "success": {"contained": 'w.body("{target}").is_in(w.body("{container}"))'},
        **changes,
    }
    return Task.load(data, "task.yaml")


@pytest.fixture
def task():
    return make_task()
