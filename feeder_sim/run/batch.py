"""Many ensembles of one free part, measured in compiled code without frames: for maps over frequency and amplitude.

An ensemble costs the engine's time and little else, and every seed moves as the same seed of `simulate` does. With
stop = "passage" it ends at the passage, where `simulate` records its block of frames to the end: the transport speed is
the same, what is measured over the whole run is not quite.
"""

from __future__ import annotations

import itertools
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable
from concurrent.futures import Future, ThreadPoolExecutor, wait
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from feeder_sim.engines.impact_log import new_log
from feeder_sim.engines.impulse.alone import Alone, ContactNotes, Drive
from feeder_sim.engines.impulse.engine import WINDOW_ALONE
from feeder_sim.engines.impulse.kinds import read_kinds
from feeder_sim.engines.impulse.lone.engine import exactness_of
from feeder_sim.engines.impulse.lone.loop import WINDOW, Lone
from feeder_sim.engines.impulse.lone.loop import Drive as LoneDrive
from feeder_sim.engines.impulse.lone.state import PART as LONE_PART
from feeder_sim.engines.impulse.lone.state import new_part
from feeder_sim.engines.impulse.lone.state import new_scratch as new_lone_scratch
from feeder_sim.engines.impulse.state import PART, Kinds, new_parts, new_scratch
from feeder_sim.engines.noise import new_streams
from feeder_sim.engines.surface_arrays import surface_arrays
from feeder_sim.errors import InputError, check_type, check_whole
from feeder_sim.measures.drift import Drift, DriftFindings
from feeder_sim.notebook import block
from feeder_sim.records.trajectory import Frames, Status, endings
from feeder_sim.run.drift_kernel import Outcome, Recording, Way, measure_drifts, new_outcome, new_room
from feeder_sim.run.guard import what_holds
from feeder_sim.run.prepare import prepare
from feeder_sim.run.simulation import COMPILING, announced, available_cores, generators, in_daemon_thread
from feeder_sim.scenario import Scenario
from feeder_sim.scene.cell import PASSAGE_FROM, PASSAGE_TO, Cell
from feeder_sim.scene.prepared import Prepared
from feeder_sim.scene.scene import Scene
from feeder_sim.scene.start import start_poses
from feeder_sim.single_thread import single_threaded

PIECES = 16  # of an ensemble per core: seeds take different times
AHEAD = 3  # ensembles per core that are prepared before they are run


@dataclass(frozen=True, repr=False)
class Ensemble:
    """What is known of an ensemble of which no frame was kept.

    Attributes:
        prepared: what was run.
        findings: as the measure of drift has them.
        status: how every seed ended.
        simulated_s: of all seeds [s].
        kernel_s: processor time spent in compiled code [s].
    """

    prepared: Prepared
    findings: DriftFindings
    status: tuple[Status, ...]
    simulated_s: float
    kernel_s: float

    @property
    def cautions(self) -> tuple[str, ...]:
        """Settings that are known to mislead, a line each."""
        return self.prepared.cautions

    def __repr__(self) -> str:
        title = f" {self.prepared.scenario.title!r}" if self.prepared.scenario.title else ""
        return f"<Ensemble{title}: {endings(self.status)}, {self.simulated_s:.6g} s simulated>"

    def _repr_html_(self) -> str:
        cautions = [f"caution: {caution}" for caution in self.cautions]
        return block(repr(self)[1:-1], [*Drift().lines(self.prepared, self.findings), *cautions])


@single_threaded
def measure_drift(
    scenarios: Iterable[Scenario | Prepared],
    *,
    workers: int | None = None,
    progress: Callable[[int], None] | None = None,
    stop: threading.Event | None = None,
    notify: Callable[[str], None] | None = None,
) -> list[Ensemble]:
    """Run all seeds of many scenarios and measure their drift; see `feeder_sim.measure_drift`.

    Args:
        scenarios: what to run.
        workers: threads. Default: all cores.
        progress: called with the number of ensembles done, from this thread.
        stop: set it to end within a second.
        notify: takes a line for the user, such as that the engine is being compiled.

    Raises:
        InputError: a scenario cannot be built, or is not of that kind.
    """
    check_type(scenarios, Iterable, "a list of scenarios", "measure_drift")
    stop, interrupt = stop or threading.Event(), np.zeros(1, np.int64)
    cores = available_cores() if workers is None else check_whole(workers, "workers")
    done: list[Ensemble] = []
    under_way: deque[_UnderWay] = deque()
    starts: _Starts | None = None

    def take_first() -> None:
        ensemble = under_way[0].result(stop)
        if ensemble is not None:
            under_way.popleft()
            done.append(ensemble)
            if progress:
                progress(len(done))

    with ThreadPoolExecutor(cores) as pool:
        try:
            for scenario in scenarios:
                prepared = scenario if isinstance(scenario, Prepared) else prepare(scenario)
                check_batch(prepared)
                if starts is None or starts.key != _Starts.key_of(prepared.scene):
                    starts = _Starts(prepared.scene)
                seeds = _Seeds(prepared, starts)
                if not done and not under_way:
                    with announced(COMPILING, notify):
                        in_daemon_thread(seeds.compile)
                under_way.append(_UnderWay.begin(seeds, pool, cores, interrupt))
                while len(under_way) > AHEAD * cores and not stop.is_set():
                    take_first()
                if stop.is_set():
                    break
            while under_way and not stop.is_set():
                take_first()
        finally:
            interrupt[0] = 1  # stopped, or an error: what is left ends where it is
    return done


def check_batch(prepared: Prepared) -> None:
    """Refuse what cannot be measured without frames.

    Raises:
        InputError: not one free part on a plate without rim and without a schedule, or not the impulse engine.
    """
    scene, scenario = prepared.scene, prepared.scenario
    why = "where drifts are measured without frames"
    if len(scene.parts) > 1:
        raise InputError(f"has {len(scene.parts)} parts, allowed is one {why}", key="part")
    if scene.guides[0] is not None:
        raise InputError(f"is given, allowed is none {why}", key="part[0].guide")
    if scene.rim:
        raise InputError(f"is true, allowed is false {why}", key="plate.rim")
    if scenario.schedule is not None:
        raise InputError(f"is given, allowed is none {why}", key="schedule")
    if scenario.run.reaction:
        raise InputError(f"is true, allowed is false {why}", key="run.reaction")
    if prepared.engine.method not in ("impulse", "exact"):
        raise InputError(f'is "{prepared.engine.name}", allowed is "impulse" {why}', key="run.engine")


class _Starts:
    """Parts at their starts, one for each seed, drawn when they are asked for; many scenarios have them in common."""

    def __init__(self, scene: Scene) -> None:
        self._scene, self._random, self.key = scene, generators(scene), _Starts.key_of(scene)
        self._parts, self._drawn = np.zeros(len(self._random), LONE_PART), np.zeros(len(self._random), bool)
        self._lock = threading.Lock()

    @staticmethod
    def key_of(scene: Scene) -> object:
        """What the starts go by."""
        scenario = scene.scenario
        surface, outline = scene.surface, scene.surface.outline
        plate = surface.length, surface.width, outline and outline.key  # that of a strip goes with the frequency
        return scenario.part, plate, scenario.run.seed, scenario.run.seeds, scenario.run.planar

    def of(self, some: slice) -> NDArray[np.void]:
        """The parts of some seeds, as the engine starts them."""
        from scipy.spatial.transform import Rotation

        with self._lock:
            for seed in range(*some.indices(len(self._parts))):
                if not self._drawn[seed]:
                    pose = start_poses(self._scene, self._random[seed])[0]
                    attitude = self._scene.principal_attitudes(pose.quaternion[None])
                    turned = Rotation.from_quat(attitude, scalar_first=True).as_matrix()
                    part = new_parts([pose.position], turned, [0], [pose.velocity])
                    self._parts[seed] = new_part(part, new_streams(self._random[seed], 1))[0]
                    self._drawn[seed] = True
            return self._parts[some].copy()


class _Seeds:
    """The seeds of a scenario as compiled code takes them."""

    def __init__(self, prepared: Prepared, starts: _Starts) -> None:
        self.prepared, self._starts, scene = prepared, starts, prepared.scene
        self._kinds: Kinds = read_kinds(scene)
        surface = surface_arrays(scene.surface, scene.scenario.run)
        self._exact = prepared.engine.method == "exact"
        extremes = scene.surface.extremes
        self._drive: Drive | LoneDrive
        if self._exact:
            self._drive = LoneDrive(surface, extremes, exactness_of(scene), WINDOW)
        else:
            self._drive = Drive(surface, extremes, scene.timestep, WINDOW_ALONE)
        self._recording = Recording(scene.frame_interval, scene.n_frames)
        still, level = np.zeros((1, 1, 3)), np.array([[[1.0, 0.0, 0.0, 0.0]]])
        # Of the limits only that of the energy goes by the start; the kernel takes that of every seed.
        first = Frames(np.zeros(1), still, level, still, still, np.ones((1, 1), bool))
        self._held = what_holds(prepared, first)
        self._way = _way(prepared)
        self.outcome = new_outcome(scene.scenario.run.seeds)

    def compile(self) -> None:
        self.run(slice(0), np.ones(1, np.int64))

    def run(self, some: slice, interrupt: NDArray[np.int64]) -> float:
        """Run some of the seeds; returns the processor time [s] that it took."""
        parts, n_shapes = self._starts.of(some), self.prepared.scene.surface.n_shapes
        alone: Alone | Lone
        if self._exact:
            alone = Lone(parts, self._kinds, new_lone_scratch(self._kinds, n_shapes))
        else:
            stepping = np.zeros(len(parts), PART)
            for name in PART.names or ():
                stepping[name] = parts[name]
            alone = Alone(stepping, self._kinds, None, new_scratch(self._kinds, n_shapes))
        notes, outcome = ContactNotes(new_log(1), np.zeros(2)), self.outcome.some(some)
        room = new_room()
        started = time.thread_time()
        measure_drifts(alone, self._drive, notes, self._recording, self._held, self._way, interrupt, room, outcome)
        return time.thread_time() - started


@dataclass(frozen=True)
class _UnderWay:
    """The seeds of a scenario in the hands of threads, some of them in each task."""

    seeds: _Seeds
    tasks: list[Future[float]]

    @staticmethod
    def begin(seeds: _Seeds, pool: ThreadPoolExecutor, cores: int, interrupt: NDArray[np.int64]) -> _UnderWay:
        n = len(seeds.outcome.status)
        ends = [n * i // (PIECES * cores) for i in range(PIECES * cores + 1)]
        pieces = [slice(*piece) for piece in itertools.pairwise(ends) if piece[1] > piece[0]]
        return _UnderWay(seeds, [pool.submit(seeds.run, piece, interrupt) for piece in pieces])

    def result(self, stop: threading.Event) -> Ensemble | None:
        """Wait for the seeds; None if that is to stop before."""
        while wait(self.tasks, timeout=0.1).not_done:
            if stop.is_set():
                return None
        kernel_s = sum(task.result() for task in self.tasks)
        outcome, prepared = self.seeds.outcome, self.seeds.prepared
        ended = outcome.status == Status.DONE
        velocities = outcome.moved[ended] / np.maximum(outcome.time[ended], 1e-300)[:, None]
        speeds = _transport_speeds(outcome, prepared.cell)[ended] if prepared.cell else ()
        findings = DriftFindings.of(speeds, velocities, outcome.rise[ended], prepared.cell)
        status = tuple(Status(int(value)) for value in outcome.status)
        return Ensemble(prepared, findings, status, float(outcome.time.sum()), kernel_s)


def _way(prepared: Prepared) -> Way:
    """The nodal lines as segments."""
    cell = prepared.cell
    lines = cell.lines.lines if cell else ()
    segments = [np.concatenate([line[:-1], line[1:]], axis=1) for line in lines]
    return Way(
        np.concatenate(segments) if segments else np.empty((0, 4)),
        cell.reach if cell else 1.0,
        np.array([PASSAGE_FROM, PASSAGE_TO]),
        cell is not None and prepared.scenario.run.stop == "passage",
    )


def _transport_speeds(outcome: Outcome, cell: Cell) -> NDArray[np.float64]:
    """Speed [m/s] of every seed between the levels; NaN where it has not passed both."""
    duration = outcome.passed[:, 1] - outcome.passed[:, 0]
    passed = (outcome.passed >= 0.0).all(axis=1) & (duration > 0.0)
    speed = np.full(len(duration), np.nan)
    speed[passed] = (PASSAGE_FROM - PASSAGE_TO) * cell.reach / duration[passed]
    return speed
