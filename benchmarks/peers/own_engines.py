"""The engines of this package on the conformance cases, and the ensembles that the drifts are judged by."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from blocks import blocks
from case_files import FOLDER, Result, Row, case, part
from chart_cases import PER_MS, strip
from motions import OBSERVERS, Motion, motions_of, starts_of
from right_values import rms_difference, rows

from feeder_sim.engines.protocol import engine_class
from feeder_sim.errors import InputError
from feeder_sim.measures.drift import drift_velocity, transport_speed
from feeder_sim.measures.statistic import Statistic
from feeder_sim.records.seed import Status
from feeder_sim.records.trajectory import Frames
from feeder_sim.run.prepare import prepare
from feeder_sim.run.simulation import simulate
from feeder_sim.scenario import Contact, Scenario
from feeder_sim.scenario.tables import validated
from feeder_sim.studies.drops import Engine, Throw

Raw = dict[str, Any]
PARTS: dict[str, Raw] = {
    "nut": {"shape": "hex_nut", "size": "M2.5"},
    "ball": {"shape": "ball", "diameter_mm": 2e3 * part("ball").radius},
    "cube": {"shape": "box", "size_mm": [1e3 * float(np.ptp(part("cube").corners[:, 0]))] * 3},
}
MESH = {"shape": "mesh", "file": str(FOLDER / "cube.off")}
TRAYS = ("two_axes", "fast_slip")  # the MuJoCo engine takes no tray
ONE_DEGREE = ("rising_plate", "throw", "bouncing_ball")
DRIFTS = ("drift_4750", "drift_8775")
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
THROWS: dict[str, tuple[Engine, int]] = {"exact": ("impulse", 2000), "mujoco": ("mujoco", 1000)}  # of each block
SLOW_HZ = 4.0  # of a plate whose speed is constant to 0.12 % for the two milliseconds that matter
MOST_STEPS = 10_000  # per period, that a scenario allows
FRAMES = {  # per second
    "rising_plate": 10_000.0,
    "throw": 2000.0,
    "bouncing_ball": 2000.0,
    "energy_at_edge": 2000.0,
    "energy_at_corner": 2000.0,
    "energy_of_bounces": 2000.0,
    "heap_at_rest": 1000.0,
    "two_axes": 1000.0,
    "fast_slip": 1000.0,
    "piston_zero": 500.0,
}
OTHER_FRAMES = 5000.0


def raw_of(name: str, run: int = 0, *, stepped: bool = True) -> Raw:
    """A case, or one of its runs, as the tables of a scenario; `stepped` is of cases of several parts."""
    tables = case(name)
    if name in DRIFTS:
        plate, start = tables["plate"], tables["start"][0]
        return strip(plate["frequency_hz"], plate["amplitude_um"], start["x_mm"])
    raw = _still() if len(tables["start"]) > 1 and not stepped else _plate(name)
    e, mu = tables["contact"]["restitution"], tables["contact"]["friction"]
    contact = {"restitution": e, "friction": mu, "part_restitution": e, "part_friction": mu}
    times = {"duration_s": tables["duration_s"], "frames_per_second": FRAMES.get(name, OTHER_FRAMES), "seeds": 1}
    return raw | {"part": _parts(name, run), "contact": contact, "run": times}


def _still() -> Raw:
    return {"plate": {"kind": "still", "length_mm": 200.0, "width_mm": 200.0}}


def _plate(name: str) -> Raw:
    """Plate and drives; steps per period are steps per millisecond where nothing moves."""
    plate, motion = case(name)["plate"], case(name)["plate"]["motion"]
    piston: Raw = {"kind": "piston"}
    if motion == "rest":
        return {"plate": piston, "drive": [{"frequency_hz": PER_MS, "amplitude_um": 0.0, "ring_up": False}]}
    if motion == "rising":
        amplitude_um = 1e6 * plate["speed_m_s"] / (2.0 * math.pi * SLOW_HZ)
        piston["thickness_mm"] = 100.0  # amplitudes are allowed up to the thickness
        return {"plate": piston, "drive": [{"frequency_hz": SLOW_HZ, "amplitude_um": amplitude_um, "ring_up": False}]}
    drive = {"frequency_hz": plate["frequency_hz"], "ring_up": False}
    if "x_um" not in plate:
        return {"plate": piston, "drive": [drive | {"amplitude_um": plate["z_um"]}]}
    along = {"stroke_um": plate["x_um"], "angle_deg": 0.0, "phase_deg": plate.get("x_phase_deg", 0.0)}
    up = [drive | {"stroke_um": plate["z_um"], "angle_deg": 90.0}] if "z_um" in plate else []
    return {"plate": {"kind": "tray", "length_mm": 200.0, "width_mm": 100.0}, "drive": [drive | along, *up]}


def _parts(name: str, run: int) -> list[Raw]:
    starts = case(name)["start"]
    first = starts[0]
    if "tilt_deg" in first:
        start = {"drop_height_mm": first["height_mm"], "yaw_deg": first["yaw_deg"], "tilt_deg": first["tilt_deg"]}
        return [PARTS[first["part"]] | {"start": start}]
    if first["part"] != "cube" and "height_mm" in first:
        start = {"drop_height_mm": first["height_mm"], "tilt_deg": 0.0}
        start |= {"yaw_deg": first["turn"]["deg"]} if "turn" in first else {}
        start |= {"velocity_mm_s": [1e3 * v for v in first["velocity_m_s"]]} if "velocity_m_s" in first else {}
        return [PARTS[first["part"]] | {"start": start}]
    states = starts_of(name)
    states = states if len(starts) > 1 else [states[run]]
    return [
        (MESH if name == "mesh_cube" else PARTS[body])
        | {
            "start": {
                "kind": "state",
                "position_mm": (1e3 * position).tolist(),
                "quaternion": quaternion.tolist(),
                "velocity_mm_s": (1e3 * velocity).tolist(),
                "angular_velocity_rad_s": spin.tolist(),
            }
        }
        for body, position, quaternion, velocity, spin in states
    ]


def scenario_of(name: str, steps: int, run: int = 0, *, one_degree: bool = False, **keys: Any) -> Scenario:
    """A case as a scenario: `steps` per period or millisecond, 0 for none given, and further keys of [run]."""
    raw = raw_of(name, run, stepped=steps > 0)
    if name == "rising_plate":
        steps = round(steps * PER_MS / SLOW_HZ)
    raw["run"] |= ({"steps_per_period": steps} if steps else {}) | keys
    if one_degree:
        raw["part"][0]["guide"] = {"kind": "slide"}
    return validated(raw, Scenario, Path(name))


def once(name: str, engine: str, steps: int) -> dict[str, float]:
    """Quantities of a case without chance; "slide" is the impulse engine with one degree of freedom."""
    named = "mujoco" if engine == "mujoco" else "impulse"
    one_degree = engine == "slide"
    runs = case(name).get("sweep", {}).get("runs", 1)
    motions: list[Motion] = []
    for run in range(runs):
        motions += motions_in(scenario_of(name, steps, run, one_degree=one_degree, engine=named))
    assert len(motions) == motions_of(name)
    return OBSERVERS[name](*motions)


def motions_in(scenario: Scenario) -> list[Motion]:
    """Motions of all parts of a scenario."""
    prepared = prepare(scenario)
    scene = prepared.scene
    engine = engine_class(prepared.engine)(scene, np.random.default_rng(0))
    frames = Frames.joined([engine.current(), engine.advance(scene.n_frames - 1)])
    return [
        Motion(
            frames.time,
            frames.position[:, i],
            frames.velocity[:, i],
            frames.angular_velocity[:, i],
            attitude=frames.quaternion[:, i],
        )
        for i in range(len(scene.parts))
    ]


def ensemble(name: str, steps: int, seeds: int, **run: Any) -> dict[str, Statistic]:
    """Quantities of a case by chance.

    Raises:
        InputError: a seed failed or did not arrive.
    """
    result = simulate(scenario_of(name, steps, seeds=seeds, **run))
    ended = [seed.frames for seed in result.seeds if seed.status == Status.DONE]
    values = _piston_drift(ended)
    if name != "piston_zero":
        assert result.prepared.cell is not None
        values = {"transport_speed": [1e3 * transport_speed(frames, result.prepared.cell) for frames in ended]}
    found = {quantity: Statistic.of(numbers) for quantity, numbers in values.items()}
    if any(statistic.n < seeds for statistic in found.values()):
        raise InputError(f"only some of {seeds} seeds gave a value", key=name)
    return found


def _piston_drift(ended: Iterable[Frames]) -> dict[str, list[float]]:
    drifts = [1e3 * drift_velocity(frames) for frames in ended]
    return {"drift_x": [float(d[0]) for d in drifts], "drift_y": [float(d[1]) for d in drifts]}


def rms_of_blocks(engine: Engine, throws: int) -> tuple[float, float]:
    """Root mean square of computed less measured shares, and its standard error."""
    tables = case("blocks")
    contact, start = Contact(**tables["contact"]), tables["start"][0]
    shares, spread = [], 0.0
    for block in blocks():
        if block.share is None:
            continue
        body = block.part()
        throw = Throw.of(body, height=(start["height_over_longest"] * body.longest,) * 2)
        turn = start["turn_over_longest_rad"] * throw.speed[0] / body.longest
        throw = Throw(throw.height, throw.speed, (turn, turn))
        shares.append(block.computed(throws, throw, contact, engine=engine))
        spread += (shares[-1] - block.share) ** 2 * shares[-1] * (1.0 - shares[-1]) / throws
    rms = rms_difference(shares)
    return rms, math.sqrt(spread) / (len(shares) * rms)


def ensemble_row(name: str, curved: Statistic, tangent: Statistic, steps: int) -> Row:
    """Transport speed by ensembles of the impulse engine [mm/s] at `steps` per period.

    A rigid plane under the part instead of the curved surface is a fair model, so both count as right.
    """
    ends = [found.mean + sign * 2.0 * found.se for found in (curved, tangent) for sign in (-1.0, 1.0)]
    source = (
        f"ensemble of the impulse engine at {steps} steps per period: "
        f"curved surface {curved.mean:.4f} +- {curved.se:.4f} (SE) of {curved.n} seeds, "
        f"plane under the part {tangent.mean:.4f} +- {tangent.se:.4f} of {tangent.n}"
    )
    rule = "both means, the curved surface's and the plane's, +- 2 SE"
    mean, sd = curved.mean, curved.sd
    return Row(name, "transport_speed", "mm/s", mean, min(ends), max(ends), abs(mean), True, sd, source, rule)


def remade_rows() -> list[Row]:
    """All rows of the set; the ensembles are computed, in about a minute."""
    zero = ensemble("piston_zero", FINEST, ZERO_SEEDS, engine="impulse")
    ensembles = []
    for name, seeds in ENSEMBLE.items():
        curved, tangent = (
            ensemble(name, FINEST, seeds, engine="impulse", tangent_surface=flat)["transport_speed"]
            for flat in (False, True)
        )
        ensembles.append(ensemble_row(name, curved, tangent, FINEST))
    return rows(ensembles, max(found.sd for found in zero.values()))


def _settings(name: str, engine: str, *, quick: bool) -> tuple[int, ...]:
    if engine in ("slide", "exact"):
        return (40,) if engine == "slide" else (0,)
    if name == "rising_plate":
        return (20, int(MOST_STEPS * SLOW_HZ / PER_MS))
    if "sweep" in case(name):
        return (40,) if quick else (40, 160)
    return (40, 160) if quick else (20, 40, 80, 160, 320)


def own_results(engine: str, cases: Iterable[str], *, quick: bool) -> list[Result]:
    """Results of "impulse", "mujoco" or "slide" at several steps, or of "exact", the impulse engine without any."""
    return [result for name in cases for result in _results(engine, name, quick=quick)]


def _results(engine: str, name: str, *, quick: bool) -> Sequence[Result]:
    of = NAMES[engine]
    if (engine == "slide" and name not in ONE_DEGREE) or (engine == "mujoco" and name in TRAYS):
        return []
    if name == "blocks":
        if engine not in THROWS:
            return []
        drops, throws = THROWS[engine]
        throws //= 2 if quick else 1
        value, se = rms_of_blocks(drops, throws)
        return [Result(name, "rms_difference", value, se, of, n=throws)]
    results = []
    if name in OBSERVERS:
        for steps in _settings(name, engine, quick=quick):
            numbers = once(name, engine, steps)
            results += [Result(name, q, value, engine=of, setting=steps) for q, value in numbers.items()]
        return results
    for steps in (0,) if engine == "exact" else (40,) if quick else (20, 40):
        seeds = max(SEEDS[engine][name] // (4 if quick else 1), 3)
        named = "impulse" if engine == "exact" else engine
        for q, found in ensemble(name, steps, seeds, engine=named).items():
            results.append(Result(name, q, found.mean, found.se, of, steps, found.n))
    return results
