"""The grocery task: what the suite it rebuilds prescribes, and nothing that another part could not use."""

from __future__ import annotations

import pytest

from gap_runtime.contracts.task import load_task

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
    for model in task.objects.values():
        if model.category == "grocery":
            assert min(model.shape.size[:2]) < robots["panda"].gripper.max_width
            assert max(model.shape.size[:2]) < basket.size[0] - 2 * basket.wall
    assert task.objects["basket"].accepts == ["grocery"]


def test_every_variant_loads_and_uses_the_noise_it_is_named_after(task):
    assert {"object", "xy20", "xy20-realistic"} <= set(task.variants)
    for variant in task.variants:
        loaded = load_task(task.path, variant)
        level = variant.rpartition("-")[2]
        assert loaded.variant == variant and loaded.sensors.use == (level if level in task.sensors.models else {})


def test_noise_grows_from_level_to_level_in_every_way(task):
    mild, realistic, harsh = task.sensors.models.values()
    for a, b in ((mild, realistic), (realistic, harsh)):
        assert a.colour < b.colour and a.light < b.light and a.shift < b.shift and a.turn < b.turn
        assert a.depth.deviation(1) < b.depth.deviation(1)
        assert a.depth.dropout < b.depth.dropout and a.depth.jitter < b.depth.jitter
