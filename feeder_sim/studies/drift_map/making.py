"""Runs of one part on strips of all frequencies and amplitudes -> its drift map."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from feeder_sim.constants import GRAVITY
from feeder_sim.errors import InputError, Interrupted
from feeder_sim.plate.mode_file import read_mode_file
from feeder_sim.plate.mode_shapes import standing_wave
from feeder_sim.plate.rectangle import RectangularPlate
from feeder_sim.pool.work import Work, silent
from feeder_sim.records.trajectory import Frames
from feeder_sim.run.provenance import content_text
from feeder_sim.run.simulation import simulate
from feeder_sim.scenario import (
    BendingPlate,
    CustomMaterial,
    Drive,
    ModePlate,
    Run,
    Scattered,
    Scenario,
    Strip,
    resolve_material,
    with_run,
)
from feeder_sim.scenario.engine_choice import choose_engine
from feeder_sim.scene.part import build_part
from feeder_sim.studies.drift_map.drift_map import DriftMap, MapInputs

# Paths of parts on a standing wave -> mean drift and diffusion over the angle from antinode to node.
#
# What counts is where a part is at the begin of an increment and where after a *lag*. The lag has to be longer than a
# part remembers a hop, so that the increments make a chain without memory, and short against the way to the node.
# Increments of one path follow on each other and do not overlap. Standard errors are those between seeds.

Floats = NDArray[np.float64]
LEAST = 8  # increments of a bin that a mean is made of


@dataclass(frozen=True)
class Bins:
    """Of every bin (n,): drift [m/s] toward the node, its standard error, diffusion [m^2/s] along and across, count."""

    drift: Floats
    drift_se: Floats
    along: Floats
    across: Floats
    count: NDArray[np.int64]


def binned(paths: Iterable[Floats], steps: int, lag: float, wavenumber: float, bins: int) -> Bins:
    """Put the increments of many paths into bins of the angle.

    Args:
        paths: places (frames, 2) [m] of one part each, without the time that it takes to forget its start.
        steps: frames of an increment.
        lag: their duration [s].
        wavenumber: of the wave, whose antinode is at x = 0 [1/m].
        bins: of the angle from 0 to pi/2.
    """
    seeds, places, moves = [], [], []
    for number, path in enumerate(paths):
        ends = path[:: max(steps, 1)]
        seeds.append(np.full(max(len(ends) - 1, 0), number))
        places.append(ends[:-1, 0])
        moves.append(np.diff(ends, axis=0))
    seed, (angle, sign) = np.concatenate(seeds), folded(wavenumber * np.concatenate(places))
    move = np.concatenate(moves)
    move[:, 0] *= sign
    index = np.minimum((angle * (2.0 / math.pi) * bins).astype(int), bins - 1)
    values = [_of_bin(move[index == j], seed[index == j], lag) for j in range(bins)]
    drift, drift_se, along, across = np.array(values).T
    return Bins(drift, drift_se, along, across, np.bincount(index, minlength=bins))


def folded(phase: Floats) -> tuple[Floats, Floats]:
    """Angle (n,) from the next antinode, 0 to pi/2, of phases k x (n,); and the sign of x toward the node there."""
    turned = np.mod(phase, math.pi)
    far = turned > 0.5 * math.pi
    return np.where(far, math.pi - turned, turned), np.where(far, -1.0, 1.0)


def _of_bin(move: Floats, seed: NDArray[np.int64], lag: float) -> tuple[float, float, float, float]:
    """Drift, its standard error, and both diffusions of the increments (m, 2) of one bin; NaN of too few."""
    if len(move) < LEAST:
        return math.nan, math.nan, math.nan, math.nan
    drift = float(move[:, 0].mean())
    _, seed_index = np.unique(seed, return_inverse=True)
    excess = np.bincount(seed_index, move[:, 0] - drift)  # of every seed over the mean: a ratio of sums over seeds
    m = len(excess)
    error = math.sqrt(float((excess**2).sum()) * m / max(m - 1, 1)) / len(move)
    spread = ((move - [drift, 0.0]) ** 2).mean(axis=0) / (2.0 * lag)
    return drift / lag, error / lag, float(spread[0]), float(spread[1])


FREQUENCIES_HZ = (400.0, 900.0, 2000.0, 4500.0, 10000.0)
SPEEDS_M_S = (0.005, 0.01, 0.02, 0.035, 0.06, 0.1, 0.15, 0.2, 0.3, 0.45, 0.7)
SEEDS = 1000
ALL_SEEDS_M_S, LEAST_SEEDS = 0.06, 0.2  # below this speed parts hardly diffuse and fewer seeds do, of which this share
BINS = 24
MEASURED_S = 1.5  # of every seed, after it has forgotten its start; shorter where it would be at the node by then
USUAL = 0.7  # drift over the speed of the surface to and fro, about
MOST_SEEDS = 5.0  # times as many where runs are shorter
LEAST_LAG_S, LAG_OF_HOPS = 0.05, 5.0  # lag: a time, and so many times V/g, about what hops last
FORGETS_S = 0.1  # the begin of a seed that is left out, with as many hops
FRAMES_PER_S = 100.0
DROP_MM = (0.05, 0.3)
WAVELENGTHS, WIDE_MM = 20.0, 3000.0  # of the strip; a part that tumbles crosses many cells
STARTS_OVER = 4.0  # wavelengths


def made_of(scenario: Scenario, thickness: float) -> MapInputs:
    """What a map for the part and the contact of a scenario is made of.

    Raises:
        InputError: there are several kinds of parts, a guide, or a contact or simplification beyond the map.
    """
    if len(scenario.part) != 1:
        raise InputError(f"is given {len(scenario.part)} times, must be one kind of part with a drift map", key="part")
    if scenario.part[0].guide is not None:
        raise InputError("is given, must be none with a drift map", key="part[0].guide")
    run = scenario.run
    for name, plain in (
        ("in_plane_velocity", True),
        ("tangent_surface", False),
        ("planar", False),
        ("reaction", False),
    ):
        if getattr(run, name) != plain:
            raise InputError(
                f"is {str(not plain).lower()}, must be {str(plain).lower()} with a drift map", key=f"run.{name}"
            )
    part = content_text(scenario.part[0].model_dump(exclude={"start", "count", "name", "guide"}))
    contact = scenario.contact.model_dump_json(exclude={"part_restitution", "part_friction"})
    # A map is made of one free part, also for many parts and a plate with a rim, which are computed in steps.
    one, strip = scenario.part[0].model_copy(update={"count": 1}), Strip(thickness_mm=1e3 * thickness)
    alone = scenario.model_copy(update={"part": (one,), "plate": strip, "refill": None})
    engine = choose_engine(alone)
    exact = (
        f"tolerance {alone.tolerance:g} nm" if engine.method in ("exact", "joint") else f"{run.steps} steps per period"
    )
    method = f"{engine.name}, {exact}"
    return MapInputs(part, contact, method, thickness)


def strip_of(scenario: Scenario) -> Strip:
    """A strip of the thickness and material of the plate of a scenario; of an orthotropic one it bends along x.

    Raises:
        InputError: it has no bending waves.
    """
    plate = scenario.plate
    if isinstance(plate, Strip | BendingPlate):
        return Strip(thickness_mm=plate.thickness_mm, material=plate.material)
    if not isinstance(plate, ModePlate):
        raise InputError(f'is "{plate.kind}", must be a plate with bending waves', key="plate.kind")
    body = read_mode_file(plate.mode_file).modes.plate
    e_y, g = body.material.youngs_modulus_y, body.material.shear_modulus
    material = CustomMaterial(
        density_kg_m3=body.material.density,
        youngs_modulus_gpa=1e-9 * body.material.youngs_modulus,
        poisson_ratio=body.material.poisson_ratio,
        youngs_modulus_y_gpa=None if e_y is None else 1e-9 * e_y,
        shear_modulus_gpa=None if g is None else 1e-9 * g,
    )
    return Strip(thickness_mm=1e3 * body.thickness, material=material)


def make_map(
    scenario: Scenario,
    strip: Strip,
    *,
    frequencies_hz: Sequence[float] = FREQUENCIES_HZ,
    speeds_m_s: Sequence[float] = SPEEDS_M_S,
    seeds: int = SEEDS,
    measured_s: float = MEASURED_S,
    bins: int = BINS,
    work: Work | None = None,
) -> DriftMap:
    """Make the drift map of a part.

    Args:
        scenario: has the part and its contact; its plate, drives and starts do not count.
        strip: thickness and material of the strips.
        frequencies_hz: of the table, rising.
        speeds_m_s: velocity amplitudes of antinodes, rising.
        seeds: runs at each of their pairs, which start anywhere on the wave; fewer at low speeds.
        measured_s: of every run, at most; shorter ones are more.
        bins: of the angle between antinode and node.
        work: as for `simulate`; where it is stopped, there is no map.

    Raises:
        InputError: as for `made_of`, or no wave of a frequency.
        Interrupted: it was given up.
    """
    plate = RectangularPlate(1.0, 1.0, 1e-3 * strip.thickness_mm, resolve_material(strip.material))
    inputs = made_of(scenario, plate.thickness)
    shape = (len(frequencies_hz), len(speeds_m_s), bins)
    work = work or Work()
    of_entry = replace(work, progress=silent)
    table, simulated, began = np.zeros((4, *shape)), 0.0, time.process_time()
    for i, frequency in enumerate(frequencies_hz):
        wavenumber = standing_wave(plate, frequency).wavenumber
        omega = 2.0 * math.pi * frequency
        for j, speed in enumerate(speeds_m_s):
            if omega * speed > GRAVITY:
                wavelength_mm = 2e3 * math.pi / wavenumber
                lasts = min(measured_s, _to_node(plate, wavenumber, speed))
                number = math.ceil(seeds_at(speed, seeds) * min(MOST_SEEDS, measured_s / lasts))
                run = with_run(_on_strip(scenario, strip, wavelength_mm, frequency, speed, lasts), seeds=number)
                result = simulate(run, work=of_entry)
                if work.stop.is_set():
                    raise Interrupted("interrupted")
                bin_values = _bins(result.trajectories, speed, wavenumber, bins)
                units = (0.5 * plate.thickness * wavenumber * speed,) * 2 + (speed**3 / GRAVITY,) * 2
                values = (bin_values.drift, bin_values.drift_se, bin_values.along, bin_values.across)
                table[:, i, j] = [filled(value) / unit for value, unit in zip(values, units, strict=True)]
                simulated += sum(float(frames.time[-1]) for frames in result.trajectories)
            work.progress((i * len(speeds_m_s) + j + 1) / (len(frequencies_hz) * len(speeds_m_s)))
    drift, drift_se, along, across = table
    of = np.array(frequencies_hz, float), np.array(speeds_m_s, float)
    return DriftMap(inputs, plate, *of, drift, drift_se, along, across, simulated, time.process_time() - began)


def seeds_at(speed: float, seeds: int) -> int:
    """How many runs a velocity amplitude [m/s] gets."""
    return math.ceil(seeds * min(1.0, max(LEAST_SEEDS, speed / ALL_SEEDS_M_S)))


def _to_node(plate: RectangularPlate, wavenumber: float, speed: float) -> float:
    """Time [s] that a part takes for half of the way to the node, about, but two increments at least."""
    half_distance = 0.25 * math.pi / wavenumber
    return max(2.0 * lag_of(speed), half_distance / (USUAL * 0.5 * plate.thickness * wavenumber * speed))


def lag_of(speed: float) -> float:
    """Duration [s] of the increments at a velocity amplitude [m/s]."""
    return LEAST_LAG_S + LAG_OF_HOPS * speed / GRAVITY


def _on_strip(
    scenario: Scenario,
    strip: Strip,
    wavelength_mm: float,
    frequency: float,
    speed: float,
    measured_s: float,
) -> Scenario:
    """One part anywhere on a standing wave that has no ring-up."""
    part = scenario.part[0]
    size_mm = 2e3 * build_part(part, name="part").size
    start = Scattered(
        kind="scattered", size_mm=(STARTS_OVER * wavelength_mm + size_mm, 0.1 * WIDE_MM), drop_height_mm=DROP_MM
    )
    large = {"length_mm": WAVELENGTHS * wavelength_mm + WIDE_MM, "width_mm": WIDE_MM}
    amplitude_um = 1e6 * speed / (2.0 * math.pi * frequency)
    return Scenario(
        plate=strip.model_copy(update=large),
        drive=(Drive(frequency_hz=frequency, amplitude_um=amplitude_um, ring_up=False),),
        part=(part.model_copy(update={"start": start, "count": 1}),),
        contact=scenario.contact,
        run=Run(
            duration_s=_forgets(speed) + measured_s + lag_of(speed),
            frames_per_second=FRAMES_PER_S,
            steps_per_period=scenario.run.steps_per_period,
            tolerance_nm=scenario.run.tolerance_nm,
        ),
    )


def _forgets(speed: float) -> float:
    return FORGETS_S + LAG_OF_HOPS * speed / GRAVITY


def _bins(trajectories: Sequence[Frames], speed: float, wavenumber: float, bins: int) -> Bins:
    paths, interval = [], 1.0 / FRAMES_PER_S
    for frames in trajectories:
        if len(frames) > 1:
            interval = float(frames.time[1] - frames.time[0])
        paths.append(frames.position[int(_forgets(speed) / interval) :, 0, :2])
    steps = max(1, round(lag_of(speed) / interval))
    return binned(paths, steps, steps * interval, wavenumber, bins)


def filled(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Values of bins (n,); those of empty ones are interpolated between their neighbours."""
    occupied = np.flatnonzero(np.isfinite(values))
    return np.interp(np.arange(len(values)), occupied, values[occupied]) if len(occupied) else np.zeros(len(values))
