import pytest

from gap_cli.workspace.metadata import read_meta, record_stage
from gap_cli.workspace.run import Run, RunConfig


@pytest.fixture
def run(tmp_path):
    return Run.create(tmp_path, RunConfig(task="pack", instruction="pack it"))


def test_notes_of_stages_add_up(run):
    record_stage(run, "plan", 0.0, n=1)
    record_stage(run, "generate", 0.0, n=2)
    record_stage(run, "plan", 0.0, n=3)
    assert {k: v["n"] for k, v in read_meta(run)["stages"].items()} == {"plan": 3, "generate": 2}


@pytest.mark.parametrize("damage", ["", "{", "[]", '{"stages": 3}'])
def test_a_damaged_meta_costs_only_itself(run, damage):
    (run.path / "meta.json").write_text(damage)
    record_stage(run, "plan", 0.0, n=1)
    assert read_meta(run)["stages"]["plan"]["n"] == 1
