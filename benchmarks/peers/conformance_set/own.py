"""The engines of this package on the conformance cases, and the ensembles that the drifts are judged by."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
from chart_cases import BALL_HZ, BALL_PERIODS, BALL_UM, CONTACT, DROP_MM, DROP_S, PER_MS, SLIDE_MM_S, strip

from conformance_set.cases import (
    CREEP_S,
    CUBE_TILT_DEG,
    FAST_HZ,
    FAST_S,
    FAST_SPEED,
    FAST_UM,
    PISTON_HZ,
    PISTON_S,
    PISTON_UM,
    PLATE_DROP,
    PLATE_SPEED,
    REST_SPEED,
    STICK_SPEED,
    THROW_UM,
    TRAY_HZ,
    TRAY_PHASE_DEG,
    TRAY_S,
    TRAY_UM,
    Row,
    closed_rows,
    cube_corner,
    ensemble_row,
    measured_rows,
    tray_height,
    zero_rows,
)
from conformance_set.judge import Result
from conformance_set.motions import OBSERVERS, Motion
from feeder_sim.engines.protocol import engine_class
from feeder_sim.errors import InputError
from feeder_sim.measures.drift import drift_velocity, transport_speed
from feeder_sim.measures.statistic import Statistic
from feeder_sim.records.seed import Status
from feeder_sim.records.trajectory import Frames
from feeder_sim.run.prepare import prepare
from feeder_sim.run.simulation import simulate
from feeder_sim.scenario import Scenario
from feeder_sim.scenario.tables import validated

Raw = dict[str, Any]
NUT, BALL = {"shape": "hex_nut", "size": "M2.5"}, {"shape": "ball", "diameter_mm": 3.0}
START_MM = {"drift_4750": 1.95, "drift_8775": 1.43}
CUBE = {"shape": "mesh", "file": str(Path(__file__).with_name("cube.off"))}
TRAYS = ("two_axes", "fast_slip")  # the MuJoCo engine takes no tray
ONE_DEGREE = ("rising_plate", "throw", "bouncing_ball")
ZERO_SEEDS = 96
FINEST, ENSEMBLE = 160, {"drift_4750": 96, "drift_8775": 256}  # steps per period and seeds of the right values
NAMES = {
    "slide": "feeder_sim, slide",
    "exact": "feeder_sim, no step",
    "impulse": "feeder_sim, impulses",
    "mujoco": "feeder_sim, MuJoCo",
}
SEEDS = {  # by engine, of a result
    "impulse": {"piston_zero": 96, "drift_4750": 48, "drift_8775": 128},
    "exact": {"piston_zero": 96, "drift_4750": 48, "drift_8775": 128},
    "mujoco": {"piston_zero": 12, "drift_4750": 4, "drift_8775": 12},
}
SLOW_HZ = 4.0  # of a plate whose speed is constant to 0.12 % for the two milliseconds that matter
MOST_STEPS = 10_000  # per period, that a scenario allows


def _scenario(drives: list[Raw], part: Raw, start: Raw, **run: Any) -> Raw:
    return {
        "plate": {"kind": "piston"},
        "drive": [drive | {"ring_up": False} for drive in drives],
        "part": [part | {"start": start}],
        "contact": dict(CONTACT),
        "run": {"seeds": 1, "frames_per_second": 5000.0} | run,
    }


def _at_rest(part: Raw, drop_mm: float, along_mm_s: float, duration_s: float) -> Raw:
    """A part over a plate at rest; steps per period are steps per millisecond."""
    yaw = 17.0 if part is NUT else 0.0
    start = {"drop_height_mm": drop_mm, "tilt_deg": 0.0, "yaw_deg": yaw, "velocity_mm_s": [along_mm_s, 0.0, 0.0]}
    return _scenario([{"frequency_hz": PER_MS, "amplitude_um": 0.0}], part, start, duration_s=duration_s)


def _rising() -> Raw:
    drives = [{"frequency_hz": SLOW_HZ, "amplitude_um": 1e6 * PLATE_SPEED / (2.0 * math.pi * SLOW_HZ)}]
    start = {"drop_height_mm": 1e3 * PLATE_DROP, "tilt_deg": 0.0}
    raw = _scenario(drives, BALL, start, duration_s=0.01, frames_per_second=10000.0)
    raw["plate"]["thickness_mm"] = 100.0  # amplitudes are allowed up to the thickness
    return raw


def _on_shaker(amplitude_um: float) -> Raw:
    start = {"drop_height_mm": 0.5, "tilt_deg": 0.0}
    drives = [{"frequency_hz": BALL_HZ, "amplitude_um": amplitude_um}]
    return _scenario(drives, BALL, start, duration_s=BALL_PERIODS / BALL_HZ, frames_per_second=2000.0)


def cube_falls(part: Raw) -> Raw:
    """A cube on its edge; as a mesh or as a box."""
    half = math.radians(0.5 * CUBE_TILT_DEG)
    raw = _at_rest(part, 0.0, 0.0, DROP_S)
    raw["part"][0]["start"] = {
        "kind": "state",
        "position_mm": [0.0, 0.0, DROP_MM + 1e3 * cube_corner()[1]],
        "quaternion": [math.cos(half), 0.0, math.sin(half), 0.0],
    }
    return raw


def _on_tray(drives: list[Raw], speed: float, duration_s: float) -> Raw:
    start = {"drop_height_mm": 0.0, "tilt_deg": 0.0, "yaw_deg": 17.0, "velocity_mm_s": [1e3 * speed, 0.0, 0.0]}
    raw = _scenario(drives, NUT, start, duration_s=duration_s, frames_per_second=1000.0)
    raw["plate"] = {"kind": "tray", "length_mm": 200.0, "width_mm": 100.0}
    return raw


def _two_axes() -> Raw:
    along = {"frequency_hz": TRAY_HZ, "stroke_um": TRAY_UM, "angle_deg": 0.0, "phase_deg": TRAY_PHASE_DEG}
    up = {"frequency_hz": TRAY_HZ, "stroke_um": 1e6 * tray_height(), "angle_deg": 90.0}
    return _on_tray([along, up], 0.0, TRAY_S)


def _fast_slip() -> Raw:
    drive = {"frequency_hz": FAST_HZ, "stroke_um": FAST_UM, "angle_deg": 0.0}
    return _on_tray([drive], FAST_SPEED, FAST_S)


def _piston() -> Raw:
    start = {"drop_height_mm": [0.2, 0.5], "yaw_deg": [0.0, 360.0], "tilt_deg": [0.0, 3.0]}
    drives = [{"frequency_hz": PISTON_HZ, "amplitude_um": PISTON_UM}]
    return _scenario(drives, NUT, start, duration_s=PISTON_S, frames_per_second=500.0)


SCENARIOS: dict[str, Callable[[], Raw]] = {
    "rebound": lambda: _at_rest(NUT, DROP_MM, 0.0, DROP_S),
    "slide": lambda: _at_rest(BALL, DROP_MM, SLIDE_MM_S, DROP_S),
    "oblique_sticking": lambda: _at_rest(BALL, DROP_MM, 1e3 * STICK_SPEED, DROP_S),
    "slide_to_rest": lambda: _at_rest(NUT, 0.0, 1e3 * REST_SPEED, CREEP_S),
    "rising_plate": _rising,
    "throw": lambda: _on_shaker(THROW_UM),
    "bouncing_ball": lambda: _on_shaker(BALL_UM),
    "mesh_cube": lambda: cube_falls(CUBE),
    "two_axes": _two_axes,
    "fast_slip": _fast_slip,
    "piston_zero": _piston,
    "drift_4750": lambda: strip(4750.0, 1.0, START_MM["drift_4750"]),
    "drift_8775": lambda: strip(8775.0, 1.0, START_MM["drift_8775"]),
}


def scenario_of(case: str, steps: int, seeds: int = 1, *, one_degree: bool = False, **run: Any) -> Scenario:
    """A case as a scenario: `steps` per period or millisecond, 0 for none given, and further keys of [run]."""
    raw = SCENARIOS[case]()
    if case == "rising_plate":
        steps = round(steps * PER_MS / SLOW_HZ)
    raw["run"] |= ({"steps_per_period": steps} if steps else {}) | {"seeds": seeds} | run
    if one_degree:
        raw["part"][0]["guide"] = {"kind": "slide"}
    return validated(raw, Scenario, Path(case))


def once(case: str, engine: str, steps: int) -> dict[str, float]:
    """Quantities of a case without chance; "slide" is the impulse engine with one degree of freedom."""
    named = "mujoco" if engine == "mujoco" else "impulse"
    return OBSERVERS[case](motion_of(scenario_of(case, steps, one_degree=engine == "slide", engine=named)))


def motion_of(scenario: Scenario) -> Motion:
    """The motion of the only part of a scenario."""
    prepared = prepare(scenario)
    scene = prepared.scene
    frames = engine_class(prepared.engine)(scene, np.random.default_rng(0)).advance(scene.n_frames - 1)
    return Motion(frames.time, frames.position[:, 0], frames.velocity[:, 0], frames.angular_velocity[:, 0])


def ensemble(case: str, steps: int, seeds: int, **run: Any) -> dict[str, Statistic]:
    """Quantities of a case by chance.

    Raises:
        InputError: a seed failed or did not arrive.
    """
    result = simulate(scenario_of(case, steps, seeds, **run))
    ended = [seed.frames for seed in result.seeds if seed.status == Status.DONE]
    values = _piston_drift(ended)
    if case != "piston_zero":
        assert result.prepared.cell is not None
        values = {"transport_speed": [1e3 * transport_speed(frames, result.prepared.cell) for frames in ended]}
    found = {name: Statistic.of(numbers) for name, numbers in values.items()}
    if any(statistic.n < seeds for statistic in found.values()):
        raise InputError(f"only some of {seeds} seeds gave a value", key=case)
    return found


def _piston_drift(ended: Iterable[Frames]) -> dict[str, list[float]]:
    drifts = [1e3 * drift_velocity(frames) for frames in ended]
    return {"drift_x": [float(d[0]) for d in drifts], "drift_y": [float(d[1]) for d in drifts]}


def remade_rows() -> list[Row]:
    """All rows of the set; the ensembles are computed, in about a minute."""
    zero = ensemble("piston_zero", FINEST, ZERO_SEEDS, engine="impulse")
    rows = closed_rows() + zero_rows(max(found.sd for found in zero.values()))
    for case, seeds in ENSEMBLE.items():
        curved, tangent = (
            ensemble(case, FINEST, seeds, engine="impulse", tangent_surface=flat)["transport_speed"]
            for flat in (False, True)
        )
        rows.append(ensemble_row(case, curved, tangent, FINEST))
    return rows + measured_rows({row.case: row.seed_sd for row in rows})


def _settings(case: str, engine: str, *, quick: bool) -> tuple[int, ...]:
    if engine in ("slide", "exact"):
        return (40,) if engine == "slide" else (0,)
    if case == "rising_plate":
        return (20, int(MOST_STEPS * SLOW_HZ / PER_MS))
    return (40, 160) if quick else (20, 40, 80, 160, 320)


def own_results(engine: str, cases: Iterable[str], *, quick: bool) -> list[Result]:
    """Results of "impulse", "mujoco" or "slide" at several steps, or of "exact", the impulse engine without any."""
    name = NAMES[engine]
    results = []
    for case in cases:
        if (engine == "slide" and case not in ONE_DEGREE) or (engine == "mujoco" and case in TRAYS):
            continue
        if case in OBSERVERS:
            for steps in _settings(case, engine, quick=quick):
                numbers = once(case, engine, steps)
                results += [Result(case, q, value, engine=name, setting=steps) for q, value in numbers.items()]
        else:
            for steps in (0,) if engine == "exact" else (40,) if quick else (20, 40):
                seeds = max(SEEDS[engine][case] // (4 if quick else 1), 3)
                named = "impulse" if engine == "exact" else engine
                for q, found in ensemble(case, steps, seeds, engine=named).items():
                    results.append(Result(case, q, found.mean, found.se, name, steps, found.n))
    return results
