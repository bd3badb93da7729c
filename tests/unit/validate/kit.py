"""A small catalogue of tools, skills and scripts, and workflows filled in around the lines a test cares about."""

from __future__ import annotations

import itertools
import linecache
import textwrap

from gap_cli.analysis.catalog import Catalog
from gap_cli.builder.assemble import assembled_lines
from gap_cli.builder.workflow import END, START, Ref, ServiceCall, Subgraph, WorkflowSpec, assemble
from gap_cli.validate.validator import validate
from gap_runtime.contracts.skill import SkillContract
from gap_runtime.contracts.tool import REQUIRED, Param, ToolSpec
from gap_runtime.contracts.types.typeref import TypeRef
from gap_runtime.errors import WorkflowError
from gap_runtime.graph.checkpoints import Checkpoint
from gap_runtime.graph.load import parse_workflow
from gap_runtime.graph.scripts import read_signature

OBJECTS = frozenset({"soup", "basket"})


def tool(name, effect, inputs, result, resources=(), **flags):
    """A spec: `result` is a type, a dict of fields, or None; an input is `name: type` or `name: (type, default)`."""
    given = [(n, *(t if isinstance(t, tuple) else (t, REQUIRED))) for n, t in inputs.items()]
    parameters = tuple(Param(n, TypeRef.parse(t), d) for n, t, d in given)
    fields = {n: TypeRef.parse(t) for n, t in result.items()} if isinstance(result, dict) else {}
    output = TypeRef.parse(result) if isinstance(result, str) else None
    more = {"deadline_s": 10.0, "privileged": False, "streaming": False} | flags
    return ToolSpec(name, parameters, output, fields, effect, tuple(resources), **more, doc=name)


ARM = {"arm_id": ("int", 0)}
TOOLS = {
    t.name: t
    for t in (
        tool(
            "observation.GetObservation", "sense", {}, {"cameras": "CameraObservation[]", "arm_states": "ArmState[]"}
        ),
        tool("geometry_svc.FilterAndComputeOBB", "pure", {"point_cloud": "PointCloud[world]", "eps": ("float", 0.005)},
             "OrientedBoundingBox[world]"),
        tool("geometry_svc.DepthToPointCloud", "pure", {"depth": "DepthImage", "intrinsics": "Matrix3x3"},
             "PointCloud[camera]"),
        tool("geometry_svc.TopDownGraspFromOBB", "pure",
             {"obb": "OrientedBoundingBox[world]", "z_offset": ("float", 0.0)}, "Se3Pose[world]"),
        tool("robot_control.GoToPose", "actuate", {"pose": "Se3Pose[world]", "timeout_s": ("float", 20.0)}, None,
             ["arm:0"]),
        tool("robot_control.MoveToJoints", "actuate", {"joint_config": "any"}, None, ["arm:0"]),
        tool("robot_control.GoHome", "actuate", {}, None, ["arm:0"]),
        tool("robot_control.GetEEPose", "sense", ARM, {"pose": "Se3Pose[world]"}),
        tool("gripper.Open", "actuate", {**ARM, "settle_steps": ("int", 40)}, "GripperState", ["gripper:{arm_id}"]),
        tool("gripper.Close", "actuate", {**ARM, "settle_steps": ("int", 60)}, "GripperState", ["gripper:{arm_id}"]),
        tool("sim_bridge.GetState", "sense", {}, {"objects": "ObjectPose[]"}, privileged=True),
    )
}  # fmt: skip
PICKING = [*(t for t in TOOLS if t != "robot_control.MoveToJoints"), "track-object"]
SKILLS = {
    "see": SkillContract(
        kind="composite", template="t.j2", stage="perceive", exits={"success": {"found": "it"}, "failure": "not_found"},
        outputs={"<name>_obb": "OrientedBoundingBox[world]", "<name>_cloud": "PointCloud[world]"}, tools=PICKING,
    ),
    "pick": SkillContract(
        kind="composite", template="t.j2", stage="grasp", inputs={"target_obb": "OrientedBoundingBox[world]"},
        outputs={"grasp_pose": "Se3Pose[world]"}, tools=PICKING,
        exits={"success": dict.fromkeys(["done", "held", "empty", "grasped", "opened"], "ended"), "failure": "failed"},
        parameters={
            "lift": {"type": "float", "default": 0.1, "range": [0.05, 0.2], "unit": "m"},
            "yaw": {"type": "float", "default": 0.0, "unit": "deg"},
        },
    ),
    "track-object": SkillContract(
        kind="atomic", exits={"success": {"tracked": "it"}, "failure": "lost"}, streaming=True,
        inputs={"observation_stream": "Observation"}, outputs={"mask": "Mask"}, tools=["observation.GetObservation"],
    ),
}  # fmt: skip
SOURCES = {
    "perceive": """
        from typing import Annotated, NamedTuple
        from gap_runtime.contracts.types import WORLD, CameraObservation, Mask, PointCloud

        class Perceived(NamedTuple):
            found: bool
            cloud: Annotated[PointCloud, WORLD]
            mask: Mask | None

        def run(ctx, cameras: list[CameraObservation], object_name: str, min_score: float = 0.3) -> Perceived: ...
    """,
    "check": """
        from typing import Literal, TypedDict

        class Held(TypedDict):
            state: Literal["held", "empty"]
            sure: bool

        def run(ctx, opening: float) -> Held: ...
    """,
    "masked": "from gap_runtime.contracts.types import Mask\ndef run(ctx, mask: Mask) -> None: ...",
    "grip": """
        from typing import Literal

        def run(ctx, how: Literal["firm", "soft"], times: Literal[1, 2] = 1) -> None: ...
    """,
    "give_up": "def run(ctx) -> None: ...",
    "think": "def run(ctx) -> float: ...",
    "turn": "def run(ctx, yaw_deg: float) -> None: ...",
    "squeeze": "def run(ctx) -> None:\n    ctx.tool('gripper.Close')",
    "peek": "def run(ctx) -> None:\n    ctx.tool('sim_bridge.GetState')",
    "anything": "def run(ctx, name: str) -> None:\n    ctx.tool(name)",
    "choose": "from typing import Literal\ndef run(ctx) -> Literal['left', 'right']: ...",
    "send": "def run(ctx) -> list[dict]: ...",
    "item": "def run(ctx, item: float) -> float: ...",
    "stream": "from typing import Iterator\ndef run(ctx) -> Iterator[float]:\n    yield 1.0",
}
SCRIPTS = {f"scripts/{n}.py": read_signature(textwrap.dedent(s), n) for n, s in SOURCES.items()}
PROMISE = Checkpoint("held", 'w.body("soup").is_grasped()', "Both fingers touch it.")


def catalog(checkpoints=None, **changes):
    """The catalogue above; `checkpoints` as written by `Subgraph.to_dict`."""
    points = {n: tuple(Checkpoint.of(c, n) for c in cs) or (PROMISE,) for n, cs in (checkpoints or {}).items()}
    given = {"scripts": SCRIPTS, "objects": OBJECTS, "checkpoints": points or None} | changes
    return Catalog(TOOLS, SKILLS, **given)


def see_sg(name="see_sg", role="target"):
    """A subgraph that finds something."""
    sg = Subgraph(name, skill="see")
    sg.add_node("look", type="tool", tool="observation.GetObservation")
    inputs = {"cameras": Ref("look.cameras"), "object_name": role}
    sg.add_node("find", type="script", script="scripts/perceive.py", inputs=inputs)
    sg.add_node("box", type="tool", tool="geometry_svc.FilterAndComputeOBB", inputs={"point_cloud": Ref("find.cloud")})
    sg.add_exit("found")
    sg.set_outputs(**{f"{role}_obb": Ref("box"), f"{role}_cloud": Ref("find.cloud")})
    sg.set_on_error("not_found")
    return fill(sg)


def pick_sg(code="", declared=None):
    """A subgraph of skill `pick` around some builder code; what the code leaves out is filled in."""
    sg = Subgraph("pick_sg", skill="pick")
    sg.add_input("target_obb", proto_type="OrientedBoundingBox")
    run(code, sg=sg, declared={} if declared is None else declared)
    return fill(sg)


def run(code, **names):
    """Run builder code, its source at hand for lambdas."""
    filename = f"<example {hash(code)}>"
    linecache.cache[filename] = (len(code), None, code.splitlines(keepends=True), filename)
    space = {"Ref": Ref, "ServiceCall": ServiceCall, "Subgraph": Subgraph, "START": START, "END": END, **names}
    exec(compile(code, filename, "exec"), space)
    return space


def fill(sg):
    """Add the exit, the edges and the failure that are missing."""
    if not sg.exits and sg.router_field is None:
        sg.add_exit("done")
    ends = sg.exits if sg.router_field is None else []
    if not sg.edges:
        chain = [START, *(n for n in sg.nodes if n not in ends), *ends[:1]]
        for pair in itertools.pairwise(chain):
            sg.add_edge(*pair)
    for name in ends:
        if not any(source == name for source, _ in sg.edges):
            sg.add_edge(name, END)
    if not sg.on_error:
        sg.set_on_error("failed")
    return sg


def declare(spec, sg, **changes):
    """Declare a subgraph as it was written."""
    d = sg.to_dict()["def"]
    given = {
        "skill": d["skill"], "inputs": d["inputs"], "on_error": d["on_error"],
        "exit_success_values": d["exit"]["success_values"], "outputs": dict.fromkeys(d["outputs"], "any"),
    }  # fmt: skip
    spec.declare_subgraph(sg.name, **(given | changes))


def workflow_of(spec, subgraphs):
    """Fill in the topology and assemble: (workflow, checkpoints, lines)."""
    complete(spec, {s.name: s for s in subgraphs})
    top, built = spec.to_dict(), {s.name: s.to_dict() for s in subgraphs}
    return assemble(top, built), {n: b["checkpoints"] for n, b in built.items()}, assembled_lines(top, built)


def complete(spec, subgraphs):
    """Place the subgraphs in order, add the ends, and route every exit: success onwards, failure to abort."""
    if not any(n["type"] == "subgraph" for n in spec.nodes.values()):
        for name in subgraphs:
            spec.add_subgraph_node(name.removesuffix("_sg"), ref=name)
    for end, status in (("done", "success"), ("abort", "failure")):
        if end not in spec.nodes:
            spec.add_end(end, status=status)
    order = [n for n, node in spec.nodes.items() if node["type"] == "subgraph"]
    if not any(source == START for source, _ in spec.edges):
        spec.add_edge(START, order[0])
    for name, after in zip(order, [*order[1:], "done"], strict=True):
        sg = subgraphs[spec.nodes[name]["ref"]]
        if name not in spec.conditional_edges:
            routes = {**dict.fromkeys(sg.exits, after), sg.on_error: "abort"}
            spec.add_conditional_edges(name, routes, router_field="exit")


def findings_at(at, code):
    """The findings of a rule's example."""
    try:
        return {"sg": _at_sg, "spec": _at_spec, "data": _at_data}[at](code)
    except WorkflowError as error:
        return list(error.findings)


def _at_sg(code):
    spec, declared = WorkflowSpec("example"), {}
    subgraphs = [see_sg(), pick_sg(code, declared)]
    declare(spec, subgraphs[0])
    declare(spec, subgraphs[1], **declared)
    return _judge(*workflow_of(spec, subgraphs))


def _at_spec(code):
    spec = WorkflowSpec("example")
    subgraphs = [see_sg(), pick_sg('sg.add_node("close", type="tool", tool="gripper.Close")')]
    for sg in subgraphs:
        declare(spec, sg)

    def also(name, names):
        subgraphs.append(see_sg(name, names["name"]))
        declare(spec, subgraphs[-1], names=names)

    run(code, spec=spec, declare=also)
    return _judge(*workflow_of(spec, subgraphs))


def _at_data(code):
    data = plain_workflow()
    run(code, workflow=data)
    return _judge(parse_workflow(data, "example"), dict.fromkeys(data["subgraphs"], ()))


def _judge(workflow, checkpoints, lines=None):
    return validate(workflow, catalog(checkpoints), lines)


def plain_workflow():
    """A valid workflow as plain data."""
    from gap_runtime.graph.dump import dump_workflow

    spec = WorkflowSpec("example")
    subgraphs = [see_sg(), pick_sg('sg.add_node("open", type="tool", tool="gripper.Open")')]
    for sg in subgraphs:
        declare(spec, sg)
    return dump_workflow(workflow_of(spec, subgraphs)[0])
