from gap_cli.rehearse.prepare import describe, in_order, prepare, tools_used
from gap_cli.workspace.inventory import Inventory
from gap_runtime.bundle.bundle import GraphBundle
from gap_runtime.testing import fake_workflow


def test_subgraphs_come_in_the_order_control_reaches_them():
    workflow = fake_workflow({}, [])
    top = workflow.nodes["main"]
    nodes = {"b": top, "lonely": top, "a": top, "end": workflow.nodes["success"]}
    edges = [("START", "a"), ("a", "b"), ("b", "end"), ("b", "a")]
    shuffled = workflow.model_copy(update={"nodes": nodes, "edges": edges, "conditional_edges": {}})
    assert in_order(shuffled) == ["a", "b", "lonely"]


def test_what_was_rolled_out_is_described_without_the_run_or_the_machine(make_run):
    run = make_run()
    prepared = prepare(GraphBundle.load(run.graph_folder), run.graph_folder, Inventory.of(run.config))
    data = describe(prepared, "of the lock")
    assert tools_used(prepared.graph) == ["cell.Act", "fake.Look"]
    assert list(data["providers"]) == ["cell.Act", "fake.Look"]
    assert data["goals"] == [{"target": "can", "container": "bin"}]
    assert str(run.path) not in str(data) and run.name not in str(data)
