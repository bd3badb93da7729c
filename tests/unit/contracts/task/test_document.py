"""The grocery task with one value changed: what is wrong is refused when it is read, by key, value and bound."""

from __future__ import annotations

import copy
from pathlib import Path

import pytest

from gap_robots.panda import panda, panda_bimanual
from gap_robots.ur5e import ur5e
from gap_runtime.contracts.failures import DocumentError, UnknownNameError
from gap_runtime.contracts.task import Installed
from gap_runtime.contracts.task.load import TaskFile

GROCERY = TaskFile.read(Path(__file__).parents[4] / "tasks/fulfill-grocery")
ROBOTS = {"panda": panda, "panda-bimanual": panda_bimanual, "ur5e": ur5e}
GONE = object()
LONG = "o" * 70
WORDS = "should be words of lower-case a-z and 0-9 joined by"
SLOT = "belief.regions.slot_a"
TWIN = {**GROCERY.data["objects"]["milk"], "label": "twin"}
SOUP = "objects.alphabet_soup"
BASKET = "objects.basket"


def robot(name):
    if name not in ROBOTS:
        raise UnknownNameError("robot", name, ROBOTS)
    return ROBOTS[name]()


INSTALLED = Installed("fulfill-grocery", ("mujoco",), robot)


def problems(changes, installed=INSTALLED, variant="object"):
    """What is wrong with the task once each dotted key has its new value."""
    data = copy.deepcopy(GROCERY.data)
    for path, value in changes.items():
        *above, last = path.split(".")
        at = data
        for step in above:
            at = at[int(step)] if isinstance(at, list) else at.setdefault(step, {})
        if value is GONE:
            del at[last]
        else:
            at[int(last) if isinstance(at, list) else last] = value
    try:
        TaskFile(GROCERY.path, data, data["variants"]).task(variant, installed)
    except DocumentError as error:
        assert error.where.endswith("task.yaml")
        return list(error.problems)
    return []


@pytest.mark.parametrize("variant", GROCERY.variants)
def test_the_grocery_task_is_right_in_every_variant(variant):
    assert problems({}, variant=variant) == []


@pytest.mark.parametrize(
    ("key", "value", "text"),
    [
        # head
        ("schema", "gap/task/v2", "'gap/task/v2' should be 'gap/task/v1'"),
        ("name", "Fulfill", f"'Fulfill' {WORDS} -, starting with a letter"),
        ("name", "a" * 65, f"'{'a' * 65}' should have at most 64 characters, not 65"),
        ("name", "other-name", "'other-name' should be 'fulfill-grocery', the name of its folder; rename either"),
        ("description", " ", "' ' should hold a letter or a digit"),
        ("instructions", [], "List should have at least 1 item, not 0"),
        ("instructions.0", "...", "'...' should hold a letter or a digit"),
        ("max_time", 0, "0 should be greater than 0"),
        ("max_time", True, "True should be a valid number"),
        ("reward.success_weight", -1.0, "-1.0 should be greater than or equal to 0"),
        # cell
        ("environment.simulator", "mujco", "'mujco' is not an installed simulator. Did you mean 'mujoco'?"),
        ("environment.supports", {}, "Dictionary should have at least 1 item, not 0"),
        ("environment.supports.floor.z", -0.1, "-0.1 should be greater than or equal to 0"),
        ("environment.supports.floor.half_size", [1.2, 0], ".1: 0 should be greater than or equal to 0.001"),
        ("environment.supports.floor.center", [0.0], "[0.0] should be a list of 2 numbers"),
        ("environment.supports.second", {"z": 0, "half_size": [1, 1]}, ".z: 0 is the floor, which is floor already"),
        ("environment.workspace.0.0", 0.5, "0.5 should be less than 0.45, which is the max corner's"),
        ("environment.workspace.0", [-0.55, -0.55], "[-0.55, -0.55] should be a list of 3 numbers"),
        ("environment.workspace.1.2", float("inf"), "inf should be a finite number"),
        ("environment.lights.0", [0, 0, 0], "[0.0, 0.0, 0.0] should be away from [0, 0, 0], where lights shine to"),
        ("environment.lights", [[1, 1, 1]] * 8, "List should have at most 7 items, not 8"),
        # robots
        ("robots", [], "List should have at least 1 item, not 0"),
        ("robots.0.model", "pandda", "Unknown robot 'pandda'. Did you mean 'panda'?"),
        ("robots.0.position", ["0", 0, 0], ".0: '0' should be a valid number"),
        ("robots.0.yaw_deg", 1e9, "1000000000.0 should be less than or equal to 360"),
        ("robots.0.home", [0.0] * 6, "[0.0, 0.0, 0.0, 0.0, 0.0, 0.0] should be 7 joint positions, as panda has, not 6"),
        (
            "robots.0.home",
            [9.0, 0, 0, -2, 0, 2, 0],
            ".0: 9 should be within [-2.8973, 2.8973] rad, the range of panda_joint1",
        ),
        # cameras
        ("cameras.agentview.fovy", 200, "200 should be less than 180"),
        ("cameras.agentview.fovy", 0, "0 should be greater than 0"),
        ("cameras.agentview.fovy", "45", "'45' should be a valid number"),
        ("cameras.agentview.quaternion", [0, 0, 0, 0], "[0.0, 0.0, 0.0, 0.0] should have a norm greater than 0"),
        ("cameras.agentview.quaternion", [1, 0, 0], "[1, 0, 0] should be a list of 4 numbers"),
        (
            "cameras.agentview.resolution",
            [0, 0],
            [".0: 0 should be greater than or equal to 16", ".1: 0 should be greater than or equal to 16"],
        ),
        ("cameras.agentview.resolution", [640, 100_000], ".1: 100000 should be less than or equal to 4096"),
        ("cameras.agentview.resolution", [640.5, 480], ".0: 640.5 should be a valid integer"),
        ("cameras.agentview.position.2", 1e6, "1000000.0 should be less than or equal to 100"),
        (
            "cameras.wrist",
            {"position": [1, 0, 1], "quaternion": [1, 0, 0, 0], "fovy": 45.0},
            "'wrist' is the name of the robot's own camera; choose another",
        ),
        ("sensors.use", "mildd", "'mildd' is not in sensors.models. Did you mean 'mild'?"),
        ("sensors.use", {"agentvew": "mild"}, ".agentvew: 'agentvew' is not a camera. Did you mean 'agentview'?"),
        ("sensors.models.mild.colour", -1, "-1 should be greater than or equal to 0"),
        ("sensors.models.mild.depth.baseline", 0, "0 should be greater than 0"),
        # objects
        (f"{SOUP}.label", "", "'' should hold a letter or a digit"),
        (
            f"{SOUP}.label",
            "dr. soup",
            "'dr. soup' should hold no full stop, which separates the phrases a detector looks for",
        ),
        (f"{SOUP}.label", "milk", "'milk' is the id of another object"),
        (f"{SOUP}.words.0", "", "'' should hold a letter or a digit"),
        (f"{SOUP}.mass", 0, "0 should be greater than or equal to 0.0001"),
        (f"{SOUP}.friction", 0, "0 should be greater than 0"),
        (
            f"{SOUP}.shape.kind",
            "sphere",
            "'sphere' should be 'box', 'cylinder', 'open_box', 'pan', 'mug', 'mesh' or 'articulated'",
        ),
        (f"{SOUP}.shape.size", [0.062, 0.062], "[0.062, 0.062] should be a list of 3 numbers"),
        (f"{SOUP}.shape.size.2", 1e-6, "1e-06 should be greater than or equal to 0.001"),
        (f"{SOUP}.shape.size.0", 0.07, "0.07 should be 0.062, the y size: a cylinder is round"),
        (f"{SOUP}.shape.wall", 0.001, "is for kinds open_box, pan, mug, not for cylinder"),
        (f"{BASKET}.shape.wall", GONE, "is missing, and needed for kind open_box"),
        (f"{BASKET}.shape.wall", 0.09, "0.09 should be less than 0.088, half of what it goes around"),
        (f"{BASKET}.shape.floor", 0.2, "0.2 should be less than 0.164, the height"),
        (f"{BASKET}.looks.rim", 0.03, "0.03 should be less than 0.025, the wall that it is part of"),
        (
            f"{BASKET}.accepts.0",
            "grocerie",
            "'grocerie' is not the id or the category of an object. Did you mean 'grocery'?",
        ),
        (f"{SOUP}.looks.style", "tin", "'tin' should be 'plain', 'can', 'carton', 'bottle', 'box' or 'basket'"),
        (f"{SOUP}.looks.style", "basket", "'basket' is for kind open_box, not for cylinder"),
        (f"{BASKET}.looks.style", "carton", "'carton' is for closed shapes, not for kind open_box"),
        (f"{SOUP}.looks.base", "red", "'red' should match pattern '^#[0-9a-fA-F]{6}$'"),
        (
            f"{SOUP}.looks.pattern",
            "zigzag",
            "'zigzag' should be 'none', 'letters', 'disc', 'stripes', 'dots', 'waves', 'chevrons' or 'checks'",
        ),
        ("objects.floor", TWIN, "'floor' is also a support; rename it"),
        ("objects.robot", TWIN, "'robot' is also what a robot is called; rename it"),
        ("joints", {"knob": {"range": [1.0, 0.0]}}, ".knob.range: 1 should be less than 0"),
        ("joints", {"knob": {"range": [0.0, 1.0], "initial": 2.0}}, ".knob.initial: 2 should be within [0, 1]"),
        # belief
        ("belief.clearance", 0, "0 should be greater than 0"),
        ("belief.attempts", 0, "0 should be greater than or equal to 1"),
        (f"{SLOT}.center", [0.1, 0.2, 0.3], "[0.1, 0.2, 0.3] should be a list of 2 numbers"),
        (
            f"{SLOT}.offset.uniform",
            [[0, 0, 0], [1, 1, 1]],
            [
                ".0: [0.0, 0.0, 0.0] should be 2 numbers, along x and y",
                ".1: [1.0, 1.0, 1.0] should be 2 numbers, along x and y",
            ],
        ),
        (
            f"{SLOT}.offset.uniform",
            [0.0, 0.1],
            [".0: 0.0 should be 2 numbers, along x and y", ".1: 0.1 should be 2 numbers, along x and y"],
        ),
        (
            f"{SLOT}.offset.uniform",
            [[0.1, 0.1], [0.0, 0.2]],
            "[0.1, 0.1] should be at most [0.0, 0.2] along every axis",
        ),
        (
            f"{SLOT}.offset",
            {"normal": [[0, 0], [0.01, -0.01]]},
            ".normal.1: [0.01, -0.01] should be at least 0: it is the standard deviation",
        ),
        (f"{SLOT}.offset", {"choice": []}, ".choice: List should have at least 1 item, not 0"),
        (f"{SLOT}.offset", {"choice": [0.1]}, ".choice.0: 0.1 should be 2 numbers, along x and y"),
        (f"{SLOT}.offset", {}, "should be exactly one of constant, uniform, normal, choice, not none"),
        (
            f"{SLOT}.yaw_deg",
            {"uniform": [[0, 0], [90, 90]]},
            [".uniform.0: [0.0, 0.0] should be a number", ".uniform.1: [90.0, 90.0] should be a number"],
        ),
        (f"{SLOT}.yaw_deg", {"choice": []}, ".choice: List should have at least 1 item, not 0"),
        (f"{SLOT}.support", "flor", "'flor' is not in environment.supports. Did you mean 'floor'?"),
        # scenes and success
        ("scenes", {}, "Dictionary should have at least 1 item, not 0"),
        ("scenes.milk", {}, "Dictionary should have at least 1 item, not 0"),
        ("scenes.milk.milkk", "slot_a", "'milkk' is not in objects. Did you mean 'milk'?"),
        ("scenes.milk.milk", "slot_x", "'slot_x' is not in belief.regions. Did you mean 'slot_f'?"),
        ("success", {}, "Dictionary should have at least 1 item, not 0"),
        ("success.contained", "True", "'True' asks nothing of the world"),
        (
            "success",
            {"late": "w.time > 1"},
            "no condition asks about an object, a joint or an arm: success would say nothing",
        ),
        (
            "success.contained",
            'w.body("milkk").is_settled()',
            "'w.body(\"milkk\").is_settled()': 'milkk' is not one of the task's bodies. Did you mean 'milk'?",
        ),
        (
            "success.contained",
            'w.body("{target}").is_inn(w.body("basket"))',
            "'w.body(\"{target}\").is_inn(w.body(\"basket\"))': a body has no 'is_inn'. Did you mean 'is_in'?",
        ),
        (
            "success.contained",
            'w.body("{target}").z',
            "'w.body(\"{target}\").z' is a number, not a condition. Compare it: ... > 0.05.",
        ),
        (
            "success.contained",
            'w.body("{thing}").is_released()',
            "'w.body(\"{thing}\").is_released()': no goal says what {thing} is; goals fill {target} and {container}",
        ),
        (
            "success.contained",
            'w.body("{target}").touches("table")',
            "'w.body(\"{target}\").touches(\"table\")': 'table' is not one of the task's contacts. Known: "
            "alphabet_soup, basket, bbq_sauce, butter, chocolate_pudding, cream_cheese, floor, "
            "ketchup, milk, orange_juice, robot, salad_dressing and 1 more.",
        ),
        (
            "success.contained",
            'w.body("{target}").is_grasped(1)',
            "'w.body(\"{target}\").is_grasped(1)': '1' is not one of the task's arms. Known: 0.",
        ),
        (
            "success.contained",
            'w.joint("knob") > 1',
            "'w.joint(\"knob\") > 1': 'knob' is not one of the task's joints. None are known.",
        ),
        (
            "sequence",
            [{"name": "first", "when": 'w.body("milkk").z > 0'}, {"name": "first", "when": 'w.body("{target}").z > 0'}],
            [
                ".1.name: 'first' is a step's name already",
                ".0.when: 'w.body(\"milkk\").z > 0': 'milkk' is not one of the task's bodies. Did you mean 'milk'?",
                ".1.when: 'w.body(\"{target}\").z > 0': no goal says what {target} is; name the object",
            ],
        ),
        (
            f"{SOUP}.parts",
            {"lid": {"center": [0, 0], "size": [0.1, 0.1, 0.1]}},
            ".lid.center: [0, 0] should be a list of 3 numbers",
        ),
        ("success.contained", "w.body(", "'w.body(': is not an expression: '(' was never closed."),
    ],
)
def test_a_wrong_value_is_refused_by_key_value_and_bound(key, value, text):
    texts = text if isinstance(text, list) else [text]
    assert problems({key: value}) == [key + (t if t.startswith(".") else f": {t}") for t in texts]


@pytest.mark.parametrize(
    ("section", "joined"),
    [
        ("objects", "_"),
        ("joints", "_"),
        ("scenes", "_"),
        ("success", "_"),
        ("environment.supports", "_"),
        ("belief.regions", "_"),
        ("cameras", "- or _"),
        ("sensors.models", "- or _"),
        ("variants", "- or _"),
    ],
)
@pytest.mark.parametrize("name", ["a/b c", "молоко", "Milk", "2nd", "a__b", "", "a.b", LONG])
def test_names_follow_one_rule(section, joined, name):
    value = {
        "objects": TWIN, "joints": {"range": [0, 1]}, "scenes": {"milk": "slot_a"}, "sensors.models": {},
        "variants": {}, "success": 'w.body("milk").is_settled()',
        "environment.supports": {"z": 0.1, "half_size": [1, 1]},
        "belief.regions": {"center": [0, 0], "support": "floor"},
        "cameras": {"position": [1, 0, 1], "quaternion": [1, 0, 0, 0], "fovy": 45.0},
    }[section]  # fmt: skip
    at, data = GROCERY.data, copy.deepcopy(GROCERY.data)
    at = data
    for step in section.split("."):
        at = at.setdefault(step, {})
    at[name] = value
    limit = 40 if joined == "_" else 64
    with pytest.raises(DocumentError) as refused:
        TaskFile(GROCERY.path, data, {"object": {}}).task("object", INSTALLED)
    (problem,) = refused.value.problems
    rule = f"should have at most {limit} characters, not 70" if name == LONG else f"{WORDS} {joined}, starting"
    assert problem.startswith(f"{section}.{name}") and f"{name!r} {rule}" in problem


def test_an_object_id_may_not_be_a_word_of_python():
    assert problems({"objects.class": TWIN}) == [
        "objects.class: 'class' is a word of Python, and names in builder code come from it"
    ]


def test_robots_do_not_stand_in_each_other():
    pair = [{"model": "panda-bimanual", "position": [-0.6, y, 0.0]} for y in (0.0, 0.1)]
    assert problems({"robots": pair}) == [
        "robots.1.position: [-0.6, 0.1, 0.0] should be farther from robots.0 at [-0.6, 0.0, 0.0]: "
        "their bases overlap by 150 mm"
    ]
    pair[1]["position"] = [-0.6, 0.4, 0.0]
    assert problems({"robots": pair}) == []


def test_the_cameras_of_two_robots_are_numbered():
    pair = [{"model": "ur5e", "position": [-0.6, y, 0.0]} for y in (-0.3, 0.3)]
    camera = {"position": [1, 0, 1], "quaternion": [1, 0, 0, 0], "fovy": 45.0}
    assert problems({"robots": pair, "cameras.wrist": camera, "sensors.use": {"wrist_1": "mild"}}) == []
    assert problems({"robots": pair, "cameras.wrist_1": camera}) == [
        "cameras.wrist_1: 'wrist_1' is the name of the robot's own camera; choose another"
    ]


def test_all_problems_of_all_sections_come_at_once():
    wrong = {
        "cameras.agentview.fovy": 200,
        f"{SLOT}.support": "flor",
        "scenes.milk.milkk": "slot_a",
        "success.a": "1 < 2",
    }
    assert [
        p.partition(":")[0] for p in problems({**wrong, "success.a": "1 < 2", "robots.0.home": [0.0], "schem": "x"})
    ] == [
        "schem",
        "robots.0.home",
        "cameras.agentview.fovy",
        "belief.regions.slot_a.support",
        "scenes.milk.milkk",
        "success.a",
    ]


def test_a_task_can_be_read_where_nothing_is_installed():
    assert problems({"robots.0.model": "unheard", "environment.simulator": "unheard"}, installed=None) == []
