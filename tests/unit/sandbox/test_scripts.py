import itertools
import threading
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest

from gap_cli.sandbox import ScriptJail
from gap_cli.sandbox.robots import plain, spec_of
from gap_cli.sandbox.server import ForkServer
from gap_cli.skills import load_library
from gap_runtime.contracts.types import (
    CameraObservation,
    DepthImage,
    Image,
    Mask,
    Matrix3x3,
    OrientedBoundingBox,
    PointCloud,
    Quaternion,
    Se3Pose,
    Vec3,
)
from gap_runtime.errors import (
    CancelledError,
    DocumentError,
    GapError,
    PerceptionError,
    PlanningError,
    PrivilegedReadError,
    SandboxError,
    ToolError,
    UnknownNameError,
)
from gap_runtime.plugins import load_registry

POSE = Se3Pose.of(np.eye(4))
CAMERA = CameraObservation(
    "agentview", Image(np.full((4, 5, 3), 7)), DepthImage(np.ones((4, 5))), Matrix3x3(np.eye(3)), POSE, 1.5
)
BOX = OrientedBoundingBox(Vec3(0, 0, 1), Vec3(1, 1, 1), Quaternion(1, 0, 0, 0))


class Found(NamedTuple):
    box: OrientedBoundingBox
    score: float


@pytest.fixture(scope="module")
def jail():
    with ScriptJail(max_calls=20) as made:
        if made.level() == "none":
            pytest.skip("this kernel has no seccomp: nothing would run")
        yield made


@pytest.fixture
def run(jail, tmp_path):
    numbers = itertools.count()  # a file for each call: two may be under way at once

    def run(source, call_tool=None, deadline_s=30.0, **options):
        inputs = options.pop("inputs", {})
        path = tmp_path / f"script_{next(numbers)}.py"
        path.write_text(source)
        return jail.run(path, inputs, call_tool or (lambda name, given: given), deadline_s, **options)

    return run


def failing(error):
    def call(name, inputs):
        raise error

    return call


@pytest.mark.parametrize(
    "value",
    [
        None, True, 3, 0.5, "größe", [1, [2.0, None]], {"a": {"b": []}}, POSE, CAMERA, BOX, [BOX, BOX],
        Mask(np.eye(3)), PointCloud(np.zeros((0, 3))), DepthImage(np.full((2, 2), np.nan)),
    ],
    ids=lambda v: type(v).__name__,
)  # fmt: skip
def test_values_pass_in_through_a_tool_and_out_as_they_are(run, value):
    source = "def run(ctx, value):\n    return ctx.tool('a.Echo', x=value)['x']"
    assert run(source, inputs={"value": value}) == value


def test_an_array_passes_with_its_type_and_shape(run):
    array = np.arange(6, dtype=np.int16).reshape(2, 3)
    out = run("def run(ctx, value):\n    return value", inputs={"value": array})
    assert out.dtype == array.dtype
    assert np.array_equal(out, array)


def test_a_named_result_of_a_tool_has_its_names(run):
    source = (
        "from typing import NamedTuple\n"
        "class Out(NamedTuple):\n    score: float\n    height: float\n"
        "def run(ctx):\n    box, score = found = ctx.tool('a.Find')\n"
        "    return Out(found.score, found.box.center.z)"
    )
    assert run(source, lambda name, inputs: Found(BOX, 0.5)) == {"score": 0.5, "height": 1.0}


def test_a_script_may_define_dataclasses_and_use_numpy_and_scipy(run):
    source = (
        "from __future__ import annotations\n"
        "from dataclasses import dataclass\n"
        "import numpy as np\n"
        "from scipy.spatial.transform import Rotation\n"
        "from gap_runtime.contracts.types import Vec3\n"
        "@dataclass\nclass Out:\n    where: Vec3\n"
        "def run(ctx):\n"
        "    u, s, vt = np.linalg.svd(np.diag([3.0, 2.0, 1.0]))\n"
        "    return Out(Vec3.of(Rotation.from_euler('z', 90, degrees=True).apply([s[0], 0, 0]).round(6)))"
    )
    assert run(source) == {"where": Vec3(0, 3, 0)}


def test_the_failure_of_a_tool_can_be_handled(run):
    source = (
        "from gap_runtime.contracts.failures import PlanningError\n"
        "def run(ctx):\n"
        "    try: ctx.tool('a.Plan')\n"
        "    except PlanningError as error: return [error.code, error.message, error.hint, error.detail]"
    )
    error = PlanningError("unreachable", "too far", hint="move", detail={"m": 2.0})
    assert run(source, failing(error)) == ["unreachable", "too far", "move", {"m": 2.0}]


def test_the_failure_of_a_tool_let_through_is_that_very_failure(run):
    error = PlanningError("unreachable", "too far")
    with pytest.raises(PlanningError) as caught:
        run("def run(ctx):\n    ctx.tool('a.Plan')", failing(error))
    assert caught.value is error


def test_a_failure_the_script_raises_is_the_contracts(run):
    source = (
        "from gap_runtime.contracts.failures import PerceptionError\n"
        "def run(ctx):\n    raise PerceptionError('not_found', 'no basket', detail={'n': 0})"
    )
    with pytest.raises(PerceptionError, match="no basket") as caught:
        run(source)
    assert (caught.value.code, caught.value.detail) == ("not_found", {"n": 0})


def test_any_other_exception_names_its_line(run):
    with pytest.raises(SandboxError, match="line 3: ZeroDivisionError") as caught:
        run("def run(ctx):\n    x = 0\n    return 1 / x")
    assert caught.value.line == 3


@pytest.mark.parametrize(
    "error", [CancelledError("stop"), PrivilegedReadError("truth"), UnknownNameError("tool", "x", []), KeyError("bug")]
)
def test_a_script_cannot_swallow_what_concerns_the_host(run, error):
    with pytest.raises(type(error)) as caught:
        run("def run(ctx):\n    try: ctx.tool('a.B')\n    except BaseException: return 1", failing(error))
    assert caught.value is error


def test_too_many_calls_end_it(run):
    with pytest.raises(SandboxError, match="too many"):
        run("def run(ctx):\n    while True: ctx.tool('a.B')")


def test_waiting_for_a_script_can_be_given_up(run):
    stop = threading.Event()
    threading.Timer(0.1, stop.set).start()

    def check():
        if stop.is_set():
            raise CancelledError("stop")

    with pytest.raises(CancelledError):
        run("def run(ctx):\n    while True: pass", check=check)


def test_an_endless_script_is_ended(run):
    with pytest.raises(SandboxError) as caught:
        run("def run(ctx):\n    while True: pass", deadline_s=0.2)
    assert caught.value.cause == "timeout"


def test_a_slow_tool_counts_towards_the_deadline(run):
    with pytest.raises(SandboxError) as caught:
        run("def run(ctx):\n    ctx.tool('a.B')\n    while True: ctx.tool('a.B')",
            lambda name, inputs: threading.Event().wait(0.15), deadline_s=0.4)  # fmt: skip
    assert caught.value.cause == "timeout"


def test_what_a_generator_yields_is_published(run):
    seen = []
    source = "def run(ctx):\n    for i in range(3): yield i\n    ctx.publish('last')"
    assert run(source, publish=seen.append) is None
    assert seen == [0, 1, 2, "last"]


def test_global_random_numbers_follow_the_seed(run):
    source = "import numpy as np\ndef run(ctx):\n    return [float(np.random.normal()), ctx.seed]"
    assert run(source, seed=4) == run(source, seed=4) != run(source, seed=5)


def test_entropy_is_refused_with_a_hint(run):
    with pytest.raises(SandboxError, match="seed random generators"):
        run("import numpy as np\ndef run(ctx):\n    return np.random.default_rng().normal()")


def test_scripts_run_side_by_side(run):
    meet = threading.Barrier(2, timeout=20)
    results = []

    def work(n):
        source = "def run(ctx, n):\n    ctx.tool('a.Meet')\n    return n"
        results.append(run(source, lambda name, inputs: meet.wait() and None, inputs={"n": n}))

    threads = [threading.Thread(target=work, args=(n,)) for n in (1, 2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(results) == [1, 2]


@pytest.mark.parametrize(
    ("source", "said"),
    [
        ("x = 1", "no function run"),
        ("import os\ndef run(ctx): pass", "os cannot be imported"),
        ("def run(ctx, other): pass", "missing"),
        ("def run(ctx):", "expected an indented block"),
    ],
)
def test_a_malformed_script_is_told_what_is_wrong(run, source, said):
    with pytest.raises(GapError, match=said):
        run(source)


def test_an_input_that_cannot_travel_is_the_callers_mistake(run):
    with pytest.raises(ToolError, match="object"):
        run("def run(ctx, x): pass", inputs={"x": object()})


def test_a_missing_file_is_named(jail, tmp_path):
    with pytest.raises(DocumentError, match="no such file"):
        jail.run(tmp_path / "none.py", {}, lambda name, inputs: None, 1.0)


def test_where_the_kernel_cannot_filter_nothing_runs_unless_told_so(tmp_path):
    path = tmp_path / "script.py"
    path.write_text("def run(ctx):\n    return 1")
    server = ForkServer("gap_cli.sandbox.script_child", machine="unheard-of")
    with pytest.raises(SandboxError, match="refused the system-call filter"):
        ScriptJail(server=server).run(path, {}, lambda name, inputs: None, 5.0)
    with ScriptJail(server=server, unsafe=True) as jail:
        assert jail.run(path, {}, lambda name, inputs: None, 5.0) == 1


PANDA = load_registry().robots["panda"].value()


def test_a_robot_s_spec_arrives_whole_but_for_its_files(run):
    bare = spec_of(plain(PANDA))
    assert bare.visuals == () and replace(bare, model_file=PANDA.model_file, visuals=PANDA.visuals) == PANDA
    source = (
        "from gap_runtime.contracts.robot import RobotSpec\n"
        "from gap_runtime.contracts.tool import ScriptContext\n"
        "def run(ctx: ScriptContext, arm: int) -> list:\n"
        "    spec = ctx.robot(arm)\n"
        "    assert isinstance(spec, RobotSpec)\n"
        "    return [spec.name, spec.gripper.max_width, spec.dof, str(spec.model_file)]\n"
    )
    asked = []
    found = run(source, inputs={"arm": 1}, robot=lambda arm: (asked.append(arm), PANDA)[1])
    assert found == ["panda", PANDA.gripper.max_width, len(PANDA.joints), PANDA.model_file.name] and asked == [1]


def test_a_robot_that_is_not_there_ends_the_script(run):
    def robot(arm):
        raise UnknownNameError("arm", str(arm), ["0"])

    with pytest.raises(UnknownNameError, match="arm"):
        run("def run(ctx): return ctx.robot(7).dof", robot=robot)
    with pytest.raises(SandboxError, match="asks for a robot"):
        run("def run(ctx): return ctx.robot()")


def test_an_import_the_jail_has_not_says_why_it_is_there_and_what_there_is(run):
    with pytest.raises(SandboxError, match=r"'gap_runtime.contracts.snapshots'.*byte for byte") as caught:
        run("import gap_runtime.contracts.snapshots\ndef run(ctx): return 1")
    assert "gap_runtime.contracts.robot" in caught.value.hint
    with pytest.raises(SandboxError, match=r"os cannot be imported.*byte for byte") as caught:
        run("import os\ndef run(ctx): return 1")
    assert "Importable" in caught.value.hint


SCRIPTS = [p for bundle in load_library(load_registry().skill_paths).values() for p in bundle.scripts.values()]


@pytest.mark.parametrize("path", SCRIPTS, ids=lambda p: f"{p.parent.parent.name}/{p.name}")
def test_a_skill_s_script_may_be_edited_and_then_runs_in_the_jail(run, path):
    assert run(path.read_text() + "\n\ndef run(ctx): return 1\n") == 1
