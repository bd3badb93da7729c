"""The grocery task: what the suite it rebuilds prescribes, and nothing that another part could not use."""

from __future__ import annotations

import pytest

from gap_cli.contracts.task import load_task
from gap_mujoco.looks import Looks

pytestmark = pytest.mark.sim


def test_every_scene_has_six_groceries_and_the_basket(task):
    assert len(task.scenes) == 10
    for scene, members in task.scenes.items():
        assert members["basket"] == "bin" and len(members) == 7
        assert sorted(set(members.values())) == ["bin", *(f"slot_{s}" for s in "abcdef")]
        assert members[scene] in ("slot_a", "slot_b")


def test_every_instruction_names_a_scenes_object(task):
    for sentence in task.instructions:
        assert sum(task.objects[scene].label in sentence for scene in task.scenes) == 1


def test_names_of_objects_are_told_apart(task):
    words = [w for model in task.objects.values() for w in (model.label, *model.words)]
    assert len(words) == len({w.lower() for w in words})


def test_every_grocery_fits_the_jaws_and_the_basket(task, robots):
    basket = task.objects["basket"].shape
    for name, model in task.objects.items():
        Looks.of(model.looks, name)
        if model.category == "grocery":
            assert min(model.shape.size[:2]) < robots["panda"].gripper.max_width
            assert max(model.shape.size[:2]) < basket.size[0] - 2 * basket.wall
    assert task.objects["basket"].accepts == ["grocery"]


@pytest.mark.parametrize("variant", ["object", "xy20"])
def test_every_variant_loads(task, variant):
    assert load_task(task.path, variant).variant == variant
