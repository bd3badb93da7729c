import pytest

from gap_cli.validate.bundle import check_bundle, edited_scripts
from gap_cli.workspace.inventory import Inventory
from gap_cli.workspace.run import RunConfig
from gap_runtime.bundle.bundle import GraphBundle

SCRIPT = "scripts/main_sg/wait.py"
WAIT = "def run(ctx) -> None:\n    ctx.tool('fake.Nothing')\n"


@pytest.fixture
def check(make_run):
    """The findings about the little graph with a script of its own, whose text is given."""
    run = make_run()
    bundle = GraphBundle.load(run.graph_folder)
    node = f'"script", "script": "{SCRIPT}"'
    workflow = bundle.files["workflow.json"].replace('"tool", "tool": "fake.Look"', node)

    def findings(text, config=run.config, workflow=workflow):
        changed = bundle.replace({"workflow.json": workflow, SCRIPT: text})
        return check_bundle(changed, Inventory.of(config), folder="generate/")

    return findings


def test_a_bundle_that_is_nowhere_on_disk_is_judged(check):
    assert check(WAIT) == []


def test_an_edited_script_is_checked_with_its_line(check):
    (finding,) = check("import requests\n" + WAIT)
    assert (finding.code, finding.path) == ("K3", "subgraphs.main_sg.nodes.look.script")
    assert finding.source == f"generate/{SCRIPT}:1" and "requests" in finding.message


def test_a_borrowed_name_is_no_contract_type(check):
    found = check("from nowhere import CameraObservation\ndef run(ctx, of: CameraObservation) -> None: ...\n")
    assert any("comes from nowhere, which has no contract types" in f.message for f in found)


def test_a_skills_own_script_is_trusted(monkeypatch, tmp_path):
    file = tmp_path / "wait.py"
    file.write_text("import requests\n" + WAIT)
    bundle = GraphBundle({
        "workflow.json": '{"nodes": {}, "subgraphs": {"main_sg": {"skill": "s", "nodes": {"a": {"type": "script", '
        f'"script": "{SCRIPT}"}}}}, "exit": {{"success_values": []}}, "on_error": ""}}}}}}',
        SCRIPT: file.read_text(),
    })  # fmt: skip

    class Library:
        library = property(lambda self: self)

        def canonical_scripts(self, workflow):
            return {SCRIPT: file}

    assert edited_scripts(bundle, Library()) == {}
    edited = bundle.replace({SCRIPT: WAIT})
    assert edited_scripts(edited, Library()) == {SCRIPT: WAIT}


def test_without_a_task_names_of_objects_are_not_checked(check):
    assert check(WAIT, RunConfig(task="", instruction="x")) == []
