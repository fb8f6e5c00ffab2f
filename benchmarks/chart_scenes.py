"""The scenes of the chart of docs/choosing.md: what is right in each, and what the methods of this package give.

An error is in percent of the right value unless the scene says of what. A cost is the wall time on one core over that
of the default, both taken in turn. What is right is a closed form, a law, a measurement, or else the finest setting,
which the next finest one checks.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Any

sys.path += [str(Path(__file__).parent / folder) for folder in ("peers", "validation")]

import numpy as np
from blocks import blocks, rms_beyond_chance
from chart_cases import (
    BALL_COUNTED,
    BALL_HZ,
    BALL_PERIODS,
    BALL_UM,
    CONTACT,
    FLAT_DROP,
    SLIDING_IMPACT,
    STICKING_IMPACT,
    TRAY_FROM_S,
    TRAY_HEIGHT,
    TRAY_HZ,
    TRAY_PHASE_DEG,
    TRAY_S,
    TRAY_UM,
    Drop,
    Raw,
    strip,
)
from cube_tosses import DATA, compute_tosses, read_tosses
from drift_map_errors import compare_passage, compare_transport
from heap import DURATION_S, energy, starts
from numpy.typing import NDArray
from right_values import ball_height, tray_speed

from feeder_sim import chart
from feeder_sim.constants import GRAVITY
from feeder_sim.engines.protocol import Engine, engine_class
from feeder_sim.measures.statistic import Statistic
from feeder_sim.pool.work import Work
from feeder_sim.records.seed import Seed
from feeder_sim.records.trajectory import Frames
from feeder_sim.run.prepare import prepare
from feeder_sim.run.simulation import simulate
from feeder_sim.scenario import Scenario, load_scenario, with_run
from feeder_sim.scenario.tables import validated
from feeder_sim.scene.prepared import Prepared
from feeder_sim.studies.chart.chart import Chart
from feeder_sim.studies.chart.settings import (
    METHODS,
    MUJOCO,
    NO_STEP,
    SIMPLIFIED,
    STEPS,
    Setting,
    is_default,
    settings_of,
)
from feeder_sim.studies.drift_map.making import make_map, strip_of
from feeder_sim.studies.drops import ENGINES, Throw

SCENARIOS = Path(__file__).parents[1] / "scenarios"
STUDY_SEEDS, MUJOCO_SEEDS = 64, 16
REPEATS, TIMED_S = 5, 0.2
TOSS_STEPS = (20, 40, 80)  # in 4 ms
HEAP_FRAMES_PER_S = 1000.0
THROWS = 2000  # of each block
MAP_SEEDS = 100
MAPPED = {"drift_4750": "drift_4750hz", "drift_8775": "drift_8775hz", "transport": "transport_strip"}  # by a drift map
BALL_RADIUS_MM, BALL_FRAMES_PER_S = 1.5, 2000.0
GATHERING_S, GATHERING_COUNT = 2.0, 20
STILL_MS = 4.0  # steps of a plate at rest are so many in this time
NOTHING = 1e-9  # [%]; a smaller gain of energy is round-off
FILE = Path("chart")


@dataclass(frozen=True)
class Row:
    """What one setting of one method gives in one scene.

    Attributes:
        scene, method, setting: names.
        value, se, n: of the scene's measure, over n seeds, throws or tosses.
        error, error_se: of the value and its standard error [%].
        cost: over the default [1].
        wall_s: of a seed where there is chance, of a throw, else per simulated second [s].
        failure: why there is no value, or why it is of some seeds only.
        default: whether this is what a scenario gets that says nothing.
    """

    scene: str
    method: str
    setting: str
    value: float
    se: float
    n: int
    error: float
    error_se: float
    cost: float
    wall_s: float
    failure: str = ""
    default: bool = False

    def as_dict(self) -> dict[str, object]:
        return asdict(self)


@dataclass(frozen=True)
class Scene:
    """One thing to get right.

    Attributes:
        name, title: in tables and pictures.
        measure: what is compared, with its unit.
        right: what is right, in words.
        rows: of the methods of this package; quick with few seeds.
        default_wall_s: of the default, per simulated second or throw, to hold other simulators against.
        case: the name of the scene among the cases of benchmarks/peers; empty where they have none.
    """

    name: str
    title: str
    measure: str
    right: str
    rows: Callable[[bool], Iterator[Row]]
    default_wall_s: Callable[[], float]
    case: str = ""


# --- one part, without chance -----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Alone:
    """A scenario of one seed, its error [%], and the settings that it gets."""

    name: str
    raw: Raw
    error: Callable[[Prepared, Seed], float]

    @property
    def scenario(self) -> Scenario:
        return validated(self.raw, Scenario, FILE)

    def rows(self, quick: bool) -> Iterator[Row]:
        for setting, scenario in _settings(self.scenario, METHODS[:-1]):
            prepared = prepare(scenario)
            (seed,) = simulate(prepared).seeds
            failure = seed.failure.cause if seed.failure else ""
            error = math.nan if failure else abs(self.error(prepared, seed))
            wall = seconds_per_second(prepared)
            cost, default = wall / self.default_wall_s(), is_default(self.scenario, setting, FILE)
            yield Row(self.name, setting.method, setting.name, error, 0.0, 1, error, 0.0, cost, wall, failure, default)

    def default_wall_s(self) -> float:
        return seconds_per_second(_prepared(self.scenario))


@cache
def _prepared(scenario: Scenario) -> Prepared:
    return prepare(scenario)


def seconds_per_second(prepared: Prepared) -> float:
    """Wall time of the engine per simulated second [s]: the least of some repeats, each after a start of its own."""
    scene = prepared.scene
    build: type[Engine] = engine_class(prepared.engine)
    walls: list[float] = []
    while not walls or (len(walls) < REPEATS and sum(walls) < TIMED_S):
        engine = build(scene, np.random.default_rng(0))
        started = time.perf_counter()
        engine.advance(scene.n_frames - 1)
        walls.append(time.perf_counter() - started)
    return min(walls) / scene.times.duration


def _settings(scenario: Scenario, methods: Sequence[str]) -> Iterator[tuple[Setting, Scenario]]:
    for setting in settings_of(scenario, tuple(methods), FILE)[0]:
        yield setting, scenario.changed({"uncertain": None, **setting.changes}, file=FILE)


def _top_error(prepared: Prepared, seed: Seed) -> float:
    """Of the mean height of the last tops of a ball on a shaker [%]: each from the highest frame of a period."""
    frames, right = seed.frames, ball_height(BALL_HZ, 1e-6 * BALL_UM, CONTACT["restitution"])
    top = frames.position[:, 0, 2] + frames.velocity[:, 0, 2] ** 2 / (2.0 * GRAVITY) - 1e-3 * BALL_RADIUS_MM
    per_period = round(BALL_FRAMES_PER_S / BALL_HZ)
    height = frames.position[-BALL_COUNTED * per_period :, 0, 2].reshape(BALL_COUNTED, per_period).argmax(axis=1)
    last = top[-BALL_COUNTED * per_period :].reshape(BALL_COUNTED, per_period)
    return 100.0 * (float(np.take_along_axis(last, height[:, None], axis=1).mean()) / right - 1.0)


def _bouncing() -> Raw:
    return {
        "plate": {"kind": "piston"},
        "drive": [{"frequency_hz": BALL_HZ, "amplitude_um": BALL_UM, "ring_up": False}],
        "part": [{"shape": "ball", "diameter_mm": 2.0 * BALL_RADIUS_MM, "start": {"drop_height_mm": 0.5}}],
        "contact": dict(CONTACT),
        "run": {"duration_s": BALL_PERIODS / BALL_HZ, "seeds": 1, "frames_per_second": BALL_FRAMES_PER_S},
    }


def _on_tray() -> Raw:
    along = {"stroke_um": TRAY_UM, "angle_deg": 0.0, "phase_deg": TRAY_PHASE_DEG}
    up = {"stroke_um": 1e6 * TRAY_HEIGHT, "angle_deg": 90.0}
    start = {"drop_height_mm": 0.0, "tilt_deg": 0.0, "yaw_deg": 17.0}
    return {
        "plate": {"kind": "tray", "length_mm": 200.0, "width_mm": 100.0},
        "drive": [{"frequency_hz": TRAY_HZ, "ring_up": False} | line for line in (along, up)],
        "part": [{"shape": "hex_nut", "size": "M2.5", "start": start}],
        "contact": dict(CONTACT),
        "run": {"duration_s": TRAY_S, "seeds": 1, "frames_per_second": 1000.0},
    }


def _tray_error(prepared: Prepared, seed: Seed) -> float:
    x = seed.frames.position[:, 0, 0]
    speed = (x[-1] - x[np.searchsorted(seed.frames.time, TRAY_FROM_S - 1e-9)]) / (TRAY_S - TRAY_FROM_S)
    return 100.0 * (float(speed) / tray_speed() - 1.0)


def _drop(name: str, of: Drop) -> Alone:
    return Alone(name, of.scenario(), of.error)


# --- by chance: the study of the command `chart` ----------------------------------------------------------------------


@dataclass(frozen=True)
class Studied:
    """A scenario with chance, and the measure that is charted, against the finest setting without a step."""

    name: str
    scenario: Callable[[], Scenario]
    measure: str
    seeds: int = STUDY_SEEDS
    methods: tuple[str, ...] = METHODS

    def rows(self, quick: bool) -> Iterator[Row]:
        seeds, few = (4, 4) if quick else (self.seeds, MUJOCO_SEEDS)
        scenario, own = self.scenario(), tuple(m for m in self.methods if m != MUJOCO)
        study = chart(scenario, measure=self.measure, method=own, seeds=seeds)
        right = next(row for row in study.rows if row.reference)
        yield from self._rows(study, Statistic(right.mean, math.nan, right.se, right.n), scenario)
        if MUJOCO in self.methods:
            study = chart(scenario, measure=self.measure, method=[MUJOCO], seeds=few, known=right.mean)
            rows = self._rows(study, Statistic(right.mean, math.nan, right.se, right.n), scenario)
            yield from (row for row in rows if row.method == MUJOCO)

    def _rows(self, study: Chart, right: Statistic, scenario: Scenario) -> Iterator[Row]:
        for row in study.rows:
            failure = "" if row.n >= 0.5 * row.seeds else f"{row.n} of {row.seeds} seeds arrive"
            known = row.n > 0 and not (failure and row.method != SIMPLIFIED)
            error = 100.0 * abs(row.mean / right.mean - 1.0) if known else math.nan
            se = 0.0 if row.reference else 100.0 * math.hypot(row.se, right.se) / abs(right.mean)
            yield Row(
                self.name,
                row.method,
                row.setting,
                row.mean,
                row.se,
                row.n,
                error,
                se,
                row.cost,
                row.wall_s,
                failure,
                row.default,
            )

    def default_wall_s(self) -> float:
        """Per simulated second, of two seeds."""
        result = simulate(with_run(self.scenario(), seeds=2), work=Work(1))
        walls, simulated = zip(*((seed.wall_s, seed.frames.time[-1]) for seed in result.seeds), strict=True)
        return float(sum(walls) / sum(simulated))


def _ball_on_strip() -> Scenario:
    """A ball in place of the nut of drift_8775hz."""
    raw = strip(8775.0, 1.0, 1.43)
    raw["part"][0] = {"shape": "ball", "diameter_mm": 3.0, "start": raw["part"][0]["start"]}
    return validated(raw, Scenario, FILE)


def _gathering() -> Scenario:
    """Nuts scattered on the square plate, and a mode that gathers them on its nodal lines."""
    stage = {"name": "gather", "duration_s": GATHERING_S, "drive": [{"frequency_hz": 2646.0, "voltage_vpp": 120.0}]}
    part = {"shape": "hex_nut", "size": "M2.5", "count": GATHERING_COUNT, "start": {"kind": "scattered"}}
    plate = {"kind": "modes", "mode_file": str(SCENARIOS.parent / "models/plate_180/modes.h5")}
    run = {"frames_per_second": 100.0}
    return validated({"plate": plate, "schedule": {"stage": [stage]}, "part": [part], "run": run}, Scenario, FILE)


# --- tosses, throws and a heap ----------------------------------------------------------------------------------------


def toss_rows(quick: bool) -> Iterator[Row]:
    """Median distance between the computed and the measured last place of a cube, over the measured way [%]."""
    tosses = read_tosses(DATA)[:: 20 if quick else 1]
    way, default = math.nan, math.nan
    stepped = [(engine, steps) for engine in ENGINES for steps in TOSS_STEPS]
    for engine, steps in [(ENGINES[0], None), *stepped]:
        name = f"{steps / STILL_MS:g} per ms" if steps else "no step"
        study = compute_tosses(tosses, engine, steps=steps)
        error, cost = study.summary()["median_error_mm"], study.processor_s_per_s
        way, default = study.summary()["median_way_mm"], cost if steps is None else default
        method = NO_STEP if steps is None else STEPS if engine == "impulse" else MUJOCO
        scatter = 100.0 * _median_se(1e3 * study.error) / way
        values = error, scatter * way / 100.0, len(tosses), 100.0 * error / way, scatter
        yield Row("tosses", method, name, *values, cost / default, cost, default=steps is None)


def toss_wall_s() -> float:
    """Per simulated second [s]."""
    return compute_tosses(read_tosses(DATA)[::20], steps=None).processor_s_per_s


def _median_se(values: NDArray[np.float64]) -> float:
    """Standard error of a median, by drawing again (bootstrap)."""
    again = np.random.default_rng(0).choice(values, (1000, len(values)))
    return float(np.median(again, axis=1).std(ddof=1))


def throw_rows(quick: bool) -> Iterator[Row]:
    """Differences of the share with a square face up to that of blocks that were rolled: rms in percentage points."""
    default = math.nan
    for engine in ENGINES:
        started, throws = time.perf_counter(), 20 if quick else THROWS
        rolled = [block for block in blocks() if block.share is not None]
        shares = [block.computed(throws, Throw.of(block.part()), engine=engine, work=Work(1)) for block in rolled]
        wall = (time.perf_counter() - started) / (throws * len(rolled))
        default = wall if math.isnan(default) else default
        rms, se = (100.0 * each for each in rms_beyond_chance(rolled, shares, throws))
        method = MUJOCO if engine == "mujoco" else "drops"
        yield Row(
            "throws", method, "usual throw", rms, se, throws, rms, se, wall / default, wall, default=engine != "mujoco"
        )


def throw_wall_s() -> float:
    """Per throw [s]."""
    started, block = time.perf_counter(), blocks()[2]
    block.computed(200, Throw.of(block.part()), work=Work(1))
    return (time.perf_counter() - started) / 200


def heap_scenario() -> Scenario:
    """Nuts that fall one upon the other, onto a plate at rest."""
    parts = [
        {
            "shape": "hex_nut",
            "size": "M2.5",
            "start": {"kind": "state", "position_mm": (1e3 * row[:3]).tolist(), "quaternion": row[3:].tolist()},
        }
        for row in starts()
    ]
    run = {"duration_s": DURATION_S, "seeds": 1, "frames_per_second": HEAP_FRAMES_PER_S}
    plate = {"kind": "still", "length_mm": 200.0, "width_mm": 200.0}
    contact = CONTACT | {"part_restitution": CONTACT["restitution"], "part_friction": CONTACT["friction"]}
    return validated({"plate": plate, "part": parts, "contact": contact, "run": run}, Scenario, FILE)


def _heap_error(_: Prepared, seed: Seed) -> float:
    """Largest gain of energy between two frames [%] of that at the start."""
    values = np.array([energy(motion) for motion in _motions(seed.frames)])
    gain = 100.0 * float(np.diff(values).max()) / float(values[0])
    return gain if gain > NOTHING else 0.0


def _motions(frames: Frames) -> Iterator[NDArray[np.float64]]:
    for k in range(len(frames)):
        yield np.hstack([frames.position[k], frames.quaternion[k], frames.velocity[k], frames.angular_velocity[k]])


# --- all of them ------------------------------------------------------------------------------------------------------


def _alone(title: str, measure: str, right: str, of: Alone, case: str = "") -> Scene:
    return Scene(of.name, title, measure, right, of.rows, of.default_wall_s, case)


def _studied(title: str, measure: str, of: Studied, case: str = "") -> Scene:
    right = "finest tolerance, which the next finest checks"
    return Scene(of.name, title, measure, right, of.rows, of.default_wall_s, case)


def _file(name: str) -> Callable[[], Scenario]:
    return lambda: load_scenario(SCENARIOS / f"{name}.toml")


NO_SIMPLER = METHODS[:-1]
SCENES = (
    _alone(
        "a ball bounces on a shaker",
        "height of the tops",
        "closed form, period one (Holmes 1982)",
        Alone("bounce", _bouncing(), _top_error),
        "bouncing_ball",
    ),
    _alone("a nut lands flat", "velocity after it", "closed form", _drop("flat", FLAT_DROP), "flat_drop"),
    _alone(
        "a ball lands sliding", "velocity after it", "closed form", _drop("slide", SLIDING_IMPACT), "sliding_impact"
    ),
    _alone(
        "a ball lands and sticks",
        "velocity after it",
        "closed form",
        _drop("stick", STICKING_IMPACT),
        "sticking_impact",
    ),
    _alone("a nut on a tray", "mean speed", "ODE of a point", Alone("tray", _on_tray(), _tray_error), "tray"),
    _studied(
        "a nut drifts, 4750 Hz",
        "transport speed",
        Studied("drift_4750", _file("drift_4750hz"), "transport_speed_mm_s"),
        "drift_4750",
    ),
    _studied(
        "a nut drifts, 8775 Hz",
        "transport speed",
        Studied("drift_8775", _file("drift_8775hz"), "transport_speed_mm_s"),
        "drift_8775",
    ),
    _studied(
        "a ball drifts, 8775 Hz",
        "transport speed",
        Studied("ball", _ball_on_strip, "transport_speed_mm_s", methods=NO_SIMPLER),
    ),
    _studied(
        "20 nuts gather",
        "nuts on nodal lines after 2 s",
        Studied("gather", _gathering, "stages[0].on_nodal_line", 32, NO_SIMPLER),
    ),
    _studied(
        "five modes carry a nut",
        "time of arrival",
        Studied("transport", _file("transport_strip"), "arrival_time_s", 32, NO_SIMPLER),
    ),
    Scene(
        "tosses",
        "a cube is tossed",
        "median error of the last place, over the way",
        "measured (ContactNets, 285 tosses)",
        toss_rows,
        toss_wall_s,
        "tosses",
    ),
    Scene(
        "throws",
        "which side of a block is up",
        "share of square faces: rms over eight blocks, percentage points",
        "measured (Budden 1980, 5,197 rolls)",
        throw_rows,
        throw_wall_s,
        "which_side_up",
    ),
    _alone(
        "ten nuts in a heap",
        "largest gain of energy in 1 ms",
        "law: none",
        Alone("heap", heap_scenario().model_dump(), _heap_error),
        "heap",
    ),
)


def drift_map_rows(quick: bool) -> Iterator[Row]:
    """Walks by one drift map, which is made first; errors are against the same scenario with default settings."""
    nut, seeds = load_scenario(SCENARIOS / "drift_4750hz.toml"), 4 if quick else STUDY_SEEDS
    drift_map = make_map(nut, strip_of(nut), seeds=4 if quick else MAP_SEEDS)
    for name, file in (
        ("drift_4750", "drift_4750hz"),
        ("drift_8775", "drift_8775hz"),
        ("transport", "transport_strip"),
    ):
        compare, number = (compare_transport, seeds // 2) if name == "transport" else (compare_passage, seeds)
        agreement = compare(drift_map, load_scenario(SCENARIOS / f"{file}.toml"), number)
        error, walked = (abs(agreement.error_percent), agreement.error_se_percent), agreement.walked
        numbers = walked.mean, math.hypot(walked.se, agreement.map_se), walked.n, *error, 1.0 / agreement.speed_up
        yield Row(name, "drift map", "", *numbers, agreement.walked_cpu_s)


def engine_values() -> dict[str, float]:
    """What each engine gives at a point of the chart, from which it can be told that it has changed since."""
    drift = load_scenario(SCENARIOS / "drift_8775hz.toml")
    settings: dict[str, dict[str, Any]] = {
        NO_STEP: {},
        STEPS: {"run.steps_per_period": 40},
        MUJOCO: {"run.engine": "mujoco", "run.steps_per_period": 20},
    }
    values = {}
    for name, changes in settings.items():
        result = simulate(drift.changed(changes | {"run.seeds": 1}, file=FILE))
        values[name] = float(result.measures()["transport_speed_mm_s"]["mean"])
    (heap,) = simulate(with_run(heap_scenario(), duration_s=0.1)).seeds
    block = blocks()[2]
    return values | {
        "many parts": float(heap.frames.position[-1].sum()),
        "drops": block.computed(100, Throw.of(block.part()), work=Work(1)),
    }
