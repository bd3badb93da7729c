"""What a worker keeps between episodes: the compiled graph and one simulator, reset for every instance."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from gap_cli.rehearse.episode import run_episode
from gap_cli.rehearse.prepare import Prepared, prepare, tools_used
from gap_cli.rehearse.recording.pictures import save_frame
from gap_cli.workspace.inventory import Inventory
from gap_cli.workspace.metadata import recording_path
from gap_cli.workspace.run import Run
from gap_runtime.bundle.bundle import GraphBundle
from gap_runtime.contracts.cell import CellFrame
from gap_runtime.contracts.engine import EpisodeResult, RehearsalJob
from gap_runtime.contracts.robot import RobotSpec
from gap_runtime.contracts.simulator import Simulator
from gap_runtime.contracts.task import Task
from gap_runtime.contracts.task.rendering import ObjectRenderer, require_renderer
from gap_runtime.errors import UnknownNameError
from gap_runtime.graph.checkpoints import evaluate
from gap_runtime.plugins import Registry
from gap_runtime.run.events import Event
from gap_runtime.run.execute import RunSetup
from gap_runtime.run.services import SHARED, ScriptRunner

if TYPE_CHECKING:
    from gap_cli.rehearse.recording.mcap import McapRecorder

RECORD_HZ = 10.0


@dataclass
class EpisodeRunner:
    """One worker's world and graph."""

    job: RehearsalJob
    prepared: Prepared
    simulator: Simulator
    jail: ScriptRunner | None

    @classmethod
    def build(cls, job: RehearsalJob) -> EpisodeRunner:
        """Compile the graph and make the world. Raises `GapError` for what would fail every episode."""
        inventory = Inventory.of(Run(job.run).config)
        prepared = prepare(GraphBundle.load(job.run), job.run, inventory)
        prepare_models(inventory.registry, inventory.task, frozenset(tools_used(prepared.graph)))
        return cls(job, prepared, make_simulator(prepared), open_jail(prepared))

    def roll(self, seed: int) -> EpisodeResult:
        """Roll out one seed, with pictures and a recording where the job asks for them."""
        recording: _Recording | None = None
        stood = False

        def on_reset() -> None:
            nonlocal recording, stood
            stood = True
            self._picture(seed, "first")
            if self.job.record:
                recording = _Recording(self, seed)

        def on_event(event: Event) -> None:
            if recording is not None:
                recording.recorder.on_event(event)

        try:
            observers = [on_event] if self.job.record else []
            result, sound = run_episode(self.prepared, self.simulator, self._setup(seed), observers, on_reset)
        finally:
            if recording is not None:
                recording.stop()
        if not sound:
            self.simulator.close()
            self.simulator = make_simulator(self.prepared)
        elif stood:
            self._picture(seed, "last")
        return result

    def _setup(self, seed: int) -> RunSetup:
        return make_setup(self.prepared, self.simulator, seed, self.jail)

    def _picture(self, seed: int, which: str) -> None:
        if self.job.frames:
            save_frame(self.simulator, self.job.output, seed, which)


def make_setup(prepared: Prepared, simulator: Simulator, seed: int, jail: ScriptRunner | None) -> RunSetup:
    """How an episode is run: held to world time alone, so that a busy machine does not change what is found."""
    task, registry = prepared.inventory.task, prepared.inventory.registry

    def broken(node: str, ref: str, end: str) -> list[str]:
        snapshot = simulator.snapshot()
        points = [p for p in prepared.bundle.checkpoints.get(ref, ()) if p.validate]
        return [p.name for p in points if evaluate(p.predicate, snapshot) is not True]

    return RunSetup(
        cell=simulator, task=task, robots=tuple(registry.robot(p.model) for p in task.robots), seed=seed,
        script_runner=jail, renderer=registry.renderer, cell_budget_s=task.max_time, lockstep=True, checkpoints=broken,
    )  # fmt: skip


def make_simulator(prepared: Prepared) -> Simulator:
    """The task's world with the run's scene in it. Raises `UnknownNameError`, `EnvironmentSetupError`, ..."""
    inventory = prepared.inventory
    name, cells = inventory.task.environment.simulator, inventory.registry.cells
    if name not in cells:
        raise UnknownNameError("simulator", name, cells)
    factory: Callable[..., Any] = cells[name].value
    simulator: Simulator = factory(inventory.task, prepared.bundle.goals.scene, inventory.robots)
    return simulator


def open_jail(prepared: Prepared) -> ScriptRunner | None:
    """The jail for the graph's inline scripts, kept for as long as the process lives; None where it has none."""
    if not prepared.graph.jailed:
        return None
    from gap_cli.sandbox import ScriptJail

    return ScriptJail().run


@dataclass(frozen=True)
class ModelContext:
    """The part of a `ToolContext` that is known before any world is: the task, its robots, and what is made of them."""

    task: Task
    robots: tuple[RobotSpec, ...]
    object_renderer: ObjectRenderer | None

    @property
    def renderer(self) -> ObjectRenderer:
        """Renders object models. Raises `ToolError`."""
        return require_renderer(self.object_renderer)

    def robot(self, arm_id: int = 0) -> RobotSpec:
        """The spec of one arm."""
        return self.robots[arm_id]

    def shared(self, key: str, make: Callable[[], Any]) -> Any:
        """The process's own store, where nodes will find it."""
        return SHARED.get(key, make)


def prepare_models(registry: Registry, task: Task, used: frozenset[str]) -> None:
    """Run the preparations of every plugin that serves one of the tools `used`, in the order of their names."""
    plugins = {registry.tool(name).plugin for name in used}
    context = ModelContext(task, tuple(registry.robot(placement.model) for placement in task.robots), registry.renderer)
    for _, entry in sorted(registry.preparations.items()):
        if entry.plugin in plugins:
            entry.value(context)


class _Recording:
    """An MCAP of one episode, from the instant the instance stands to the verdict."""

    def __init__(self, stage: EpisodeRunner, seed: int) -> None:
        from gap_cli.rehearse.recording.mcap import McapRecorder

        inventory, simulator = stage.prepared.inventory, stage.simulator
        self.recorder: McapRecorder = McapRecorder(
            recording_path(stage.job.output, seed),
            inventory.task.scene_objects(stage.prepared.bundle.goals.scene),
            tuple(inventory.robots[placement.model] for placement in inventory.task.robots),
        )
        self.recorder.on_frame(CellFrame(simulator.time, simulator.observe(), simulator.snapshot()))
        self._unsubscribe = simulator.subscribe(self.recorder.on_frame, RECORD_HZ, simulator.camera_names)

    def stop(self) -> None:
        """Finish the file."""
        self._unsubscribe()
        self.recorder.close()
