"""A person's edits of generated files: builder code is run again, workflow.json is read, nothing is lost unasked."""

import json

import pytest

from gap_cli.builder.source import spec_source, subgraph_source
from gap_cli.commands.pipeline import validate_run
from gap_cli.rehearse.rehearsal import rehearse
from gap_cli.validate.sources import RECORD, generation_record, require_unedited
from gap_cli.workspace.run import Run
from gap_cli.workspace.stages import write_stage
from gap_runtime.errors import RunError
from gap_runtime.graph.load import load_workflow


@pytest.fixture
def generated(make_run):
    """A run as `gap generate` leaves it, and what it wrote."""
    run = make_run()
    workflow = load_workflow(run.graph_folder / "workflow.json")
    (run.path / "plan/spec.py").write_text(spec_source(workflow, {}))
    names = ("workflow.json", "goals.json", "checkpoints/main_sg.py")
    files = {name: (run.graph_folder / name).read_text() for name in names}
    files["subgraphs/main_sg.py"] = subgraph_source("main_sg", workflow.subgraphs["main_sg"])
    write_stage(run, "generate", {**files, RECORD: generation_record(run, files)})
    return run, files


def edit(run, name, old, new):
    file = run.path / name
    assert old in file.read_text()
    file.write_text(file.read_text().replace(old, new))


def tool_of(run, node="act"):
    return load_workflow(run.graph_folder / "workflow.json").subgraphs["main_sg"].nodes[node].tool


SG, SPEC, WORKFLOW = "generate/subgraphs/main_sg.py", "plan/spec.py", "generate/workflow.json"


def test_untouched_files_are_left_as_they_are(generated):
    run, files = generated
    assert validate_run(run) == []
    assert {name: (run.graph_folder / name).read_text() for name in files} == files


def test_edited_builder_code_is_run_again(generated):
    run, _ = generated
    edit(run, SG, "cell.Act", "fake.Nothing")
    assert validate_run(run) == [] and tool_of(run) == "fake.Nothing"
    edit(run, SG, "fake.Nothing", "cell.Act")
    assert validate_run(run) == [] and tool_of(run) == "cell.Act"


def test_an_edited_topology_is_assembled_again(generated):
    run, _ = generated
    edit(run, SPEC, "status='failure'", "status='failure', description='given up'")
    assert validate_run(run) == []
    assert load_workflow(run.graph_folder / "workflow.json").nodes["abort"].description == "given up"


def test_what_is_rehearsed_is_what_the_builder_code_says(generated):
    run, _ = generated
    validate_run(run)
    edit(run, SG, "tool='cell.Act'", "tool='cell.Act', inputs={'seconds': 0.7}")
    with pytest.raises(RunError, match=r"generate/subgraphs/main_sg\.py changed"):
        rehearse(Run(run.path), 1, record="none")
    validate_run(run)
    assert rehearse(Run(run.path), 1, record="none").rows[0]["motion_s"] > 0.6


def test_a_finding_names_the_file_and_line_of_the_builder_code(generated):
    run, _ = generated
    edit(run, SG, "cell.Act", "cell.Atc")
    (finding,) = [f for f in validate_run(run) if "cell.Atc" in f.message]
    assert "cell.Atc" in (run.path / SG).read_text().splitlines()[finding.line - 1] and finding.file == SG
    assert json.loads((run.path / "validate/findings.json").read_text())["findings"][0]["file"] == SG


@pytest.mark.parametrize(
    ("name", "old", "new", "said"),
    [
        (SG, "sg.set_on_error", "1 / 0\nsg.set_on_error", "ZeroDivisionError"),
        (SG, "sg.set_on_error", "open('x')\nsg.set_on_error", "open is not available"),
        (SG, "sg.set_on_error('failed')", "sg.set_on_error('lost')", "declared 'failed', written 'lost'"),
        (SPEC, "spec.add_end('abort'", "spec.ad_end('abort'", "ad_end"),
    ],
)
def test_builder_code_that_fails_is_a_finding_and_changes_nothing(generated, name, old, new, said):
    run, files = generated
    edit(run, name, old, new)
    (finding,) = validate_run(run)
    assert said in finding.message and finding.code == "W4"
    assert finding.file in (SG, SPEC) and finding.line
    assert (run.graph_folder / "workflow.json").read_text() == files["workflow.json"]
    with pytest.raises(RunError, match="W4"):
        rehearse(Run(run.path), 1, record="none")


def test_an_edited_workflow_is_the_source_where_builder_code_is_not_edited(generated):
    run, _ = generated
    edit(run, WORKFLOW, "cell.Act", "cell.Atc")
    (finding,) = [f for f in validate_run(run) if "cell.Atc" in f.message]
    assert finding.file == WORKFLOW
    assert "cell.Atc" in (run.path / WORKFLOW).read_text().splitlines()[finding.line - 1]
    edit(run, WORKFLOW, "cell.Atc", "fake.Nothing")
    assert validate_run(run) == [] and tool_of(run) == "fake.Nothing"


def test_where_both_were_edited_a_person_chooses(generated):
    run, _ = generated
    edit(run, WORKFLOW, "cell.Act", "fake.Nothing")
    edit(run, SG, "fake.Look", "fake.Nothing")
    with pytest.raises(RunError) as caught:
        validate_run(run)
    assert SG in caught.value.message and WORKFLOW in caught.value.message and "--source builder" in caught.value.hint
    validate_run(run, "workflow")
    assert (tool_of(run, "look"), tool_of(run, "act")) == ("fake.Look", "fake.Nothing")
    validate_run(run)  # the choice holds
    assert tool_of(run, "act") == "fake.Nothing"
    edit(run, SG, "sg.set_on_error", "# again\nsg.set_on_error")
    with pytest.raises(RunError, match="both edited"):
        validate_run(run)
    validate_run(run, "builder")
    assert (tool_of(run, "look"), tool_of(run, "act")) == ("fake.Nothing", "cell.Act")


def test_a_deleted_workflow_is_assembled_again(generated):
    run, files = generated
    (run.path / WORKFLOW).unlink()
    assert validate_run(run) == []
    assert (run.path / WORKFLOW).read_text() == files["workflow.json"]


def test_a_deleted_workflow_whose_builder_code_fails_is_a_finding(generated):
    run, _ = generated
    (run.path / WORKFLOW).unlink()
    edit(run, SG, "sg.set_on_error", "1 / 0\nsg.set_on_error")
    (finding,) = validate_run(run)
    assert finding.file == SG and not (run.path / WORKFLOW).exists()


def test_checkpoints_of_the_builder_code_are_written_unless_edited_by_hand(generated):
    run, _ = generated
    added = "sg.add_checkpoint('new', 'w.body(\"can\").y < 9', rationale='why')\nsg.set_on_error"
    edit(run, SG, "sg.set_on_error", added)
    assert validate_run(run) == []
    assert "'new'" in (run.graph_folder / "checkpoints/main_sg.py").read_text()
    edit(run, "generate/checkpoints/main_sg.py", "y < 9", "y < 8")
    assert validate_run(run) == []  # checkpoints are edited where they are
    edit(run, SG, "y < 9", "y < 7")
    with pytest.raises(RunError, match=r"checkpoints/main_sg\.py"):
        validate_run(run)


def test_an_edited_plan_is_generated_again(generated):
    run, _ = generated
    edit(run, "plan/plan.json", "gap/plan/v1", "gap/plan/v1 ")
    with pytest.raises(RunError, match=r"plan/plan\.json was edited") as caught:
        validate_run(run)
    assert caught.value.hint.startswith("Type: gap generate")


@pytest.mark.parametrize("name", ["workflow.json", "subgraphs/main_sg.py", "checkpoints/main_sg.py", "goals.json"])
def test_an_edited_file_is_not_overwritten(generated, name):
    run, files = generated
    require_unedited(run, files)
    require_unedited(run, {**files, name: "another version of GaP writes this"})
    (run.graph_folder / name).write_text(files[name] + "\n")
    require_unedited(run, {**files, name: files[name] + "\n"})  # nothing is lost
    with pytest.raises(RunError) as caught:
        require_unedited(run, files)
    assert caught.value.message.endswith(f": generate/{name}.") and "--overwrite" in caught.value.hint


def test_edited_builder_code_is_not_overwritten_after_validation_either(generated):
    run, files = generated
    edit(run, SG, "cell.Act", "fake.Nothing")
    validate_run(run)
    with pytest.raises(RunError) as caught:
        require_unedited(run, files)
    assert caught.value.message.endswith(f": {SG}.")  # what was assembled from it is not a loss of its own


def test_a_file_that_a_person_added_is_not_removed(generated):
    run, files = generated
    (run.graph_folder / "scripts/main_sg").mkdir(parents=True)
    (run.graph_folder / "scripts/main_sg/mine.py").write_text("def run(ctx) -> None: ...\n")
    with pytest.raises(RunError, match=r"scripts/main_sg/mine\.py"):
        require_unedited(run, files)


def test_edited_builder_code_without_its_topology_is_refused(generated):
    run, _ = generated
    (run.path / "plan/spec.py").unlink()
    assert validate_run(run) == []
    edit(run, SG, "cell.Act", "fake.Nothing")
    with pytest.raises(RunError, match="which joins it, is not there"):
        validate_run(run)
    validate_run(run, "workflow")
    assert tool_of(run) == "cell.Act"
