"""Tasks are found by the name of their folder, and every variant is checked."""

from __future__ import annotations

import pytest

from gap_cli.workspace.tasks import find_tasks, open_task, task_folders, task_problems
from gap_runtime.contracts.failures import DocumentError
from gap_runtime.plugins import load_registry


@pytest.fixture
def registry(little_cell):
    return load_registry()


@pytest.fixture
def folder(registry, tmp_path):
    """A copy of the little task, to be changed."""
    text = (find_tasks(registry)["little"] / "task.yaml").read_text()
    copy = tmp_path / "little"
    copy.mkdir()
    (copy / "task.yaml").write_text(text)
    return copy


def append(folder, text):
    file = folder / "task.yaml"
    file.write_text(file.read_text() + text)


def test_a_task_is_opened_by_the_name_it_is_found_by(registry, folder):
    assert open_task(registry, "little").name == "little"
    registry.task_paths[:] = [(folder.rename(folder.with_name("other")), "p")]
    with pytest.raises(DocumentError, match="name: 'little' should be 'other', the name of its folder"):
        open_task(registry, *find_tasks(registry))


def test_every_variant_is_checked_and_what_they_share_is_named_once(registry, folder):
    assert task_problems(registry, folder) == []
    append(folder, "max_time: 0\nvariants: {a: {}, b: {reward: {success_weight: -1}}, c: {extends: b}}\n")
    assert task_problems(registry, folder) == [
        "max_time: 0 should be greater than 0",
        "variant b, c: reward.success_weight: -1 should be greater than or equal to 0",
    ]


def test_a_variant_that_extends_nothing_is_one_problem(registry, folder):
    append(folder, "variants: {a: {}, d: {extends: x}}\n")
    assert task_problems(registry, folder) == ["variant d: variants.d.extends: 'x' is not a variant. Known: a, d."]


def test_a_file_that_cannot_be_read_is_one_problem(registry, folder):
    append(folder, "\tname: little")
    (problem,) = task_problems(registry, folder)
    assert "is not YAML" in problem


def test_a_path_may_be_a_file_a_task_or_a_folder_of_tasks(folder):
    for path in (folder / "task.yaml", folder, folder.parent):
        assert task_folders(path) == [folder]
    assert task_folders(folder.parent.parent / "nowhere") == []
