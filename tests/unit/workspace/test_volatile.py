import pytest

from gap_cli.workspace.metadata import note, read_meta
from gap_cli.workspace.run import Run
from gap_cli.workspace.run_config import Asked


@pytest.fixture
def run(tmp_path):
    return Run.create(tmp_path, Asked(task="pack", instruction="pack it"))


def test_notes_of_stages_add_up(run):
    note(run, "plan", 0.0, n=1)
    note(run, "generate", 0.0, n=2)
    note(run, "plan", 0.0, n=3)
    assert {k: v["n"] for k, v in read_meta(run)["stages"].items()} == {"plan": 3, "generate": 2}


@pytest.mark.parametrize("damage", ["", "{", "[]", '{"stages": 3}'])
def test_a_damaged_meta_costs_only_itself(run, damage):
    (run.path / "meta.json").write_text(damage)
    note(run, "plan", 0.0, n=1)
    assert read_meta(run)["stages"]["plan"]["n"] == 1
