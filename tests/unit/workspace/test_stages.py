import pytest

from gap_cli.workspace.run import Run, RunConfig
from gap_cli.workspace.stages import PRODUCT, folder_digest, product, write_stage
from gap_runtime.errors import RunError


@pytest.fixture
def run(tmp_path):
    return Run.create(tmp_path, RunConfig(task="pack", instruction="pack it"))


@pytest.mark.parametrize("stage", [stage for stage in PRODUCT if stage != "plan"])
def test_a_verb_too_early_is_told_what_to_type(run, stage):
    with pytest.raises(RunError, match=f"gap {stage} {run.argument}"):
        product(run, stage)


def test_a_run_without_a_plan_is_told_to_plan(run):
    with pytest.raises(RunError, match="gap plan --task TASK"):
        product(run, "plan")


def test_a_bare_folders_graph_is_its_own_workflow(tmp_path):
    (tmp_path / "workflow.json").write_text("{}")
    assert product(Run(tmp_path), "generate") == tmp_path / "workflow.json"


def test_a_stage_folder_holds_exactly_what_was_written_last(run):
    write_stage(run, "generate", {"workflow.json": "1", "subgraphs/a.py": "a"})
    write_stage(run, "generate", {"workflow.json": "2"})
    assert [p.name for p in run.folder("generate").rglob("*")] == ["workflow.json"]


def test_files_to_keep_stay(run):
    write_stage(run, "rehearse/00", {"summary.json": "{}", "seed-1.mcap": "x"})
    write_stage(run, "rehearse/00", {"summary.json": "{}"}, keep=(".mcap",))
    assert (run.folder("rehearse/00") / "seed-1.mcap").is_file()


def test_a_folder_digest_sees_names_and_bytes_but_not_order_or_caches(tmp_path):
    def make(name, files):
        for file, text in files.items():
            (tmp_path / name / file).parent.mkdir(parents=True, exist_ok=True)
            (tmp_path / name / file).write_text(text)
        return folder_digest(tmp_path / name)

    same = {"a.txt": "a", "b/c.txt": "c"}
    assert make("one", same) == make("two", dict(reversed(same.items())) | {"__pycache__/x.pyc": "x"})
    assert make("three", {"a.txt": "a", "b/d.txt": "c"}) != make("one", same)
