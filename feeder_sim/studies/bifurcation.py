"""How the motion of a bouncing part changes with the plate's amplitude: sweep, boundaries of period one, two, four, ...

A boundary is found by bisection on the motion of the seeds: period one begins at the smallest amplitude at which any
seed ends in it, period 2 n at the amplitude above which no seed ends in period n any more. Seeds have different drop
heights, since other motions can coexist with the periodic one.
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from feeder_sim.constants import GRAVITY
from feeder_sim.errors import InputError
from feeder_sim.measures.bounces import (
    LAST_IMPACTS,
    impact_tolerance,
    motion,
    period_one_threshold,
    period_two_threshold,
)
from feeder_sim.run.prepare import prepare
from feeder_sim.run.simulation import simulate
from feeder_sim.scenario import PistonPlate, Scenario, Slide, with_run
from feeder_sim.scene.scene import build_scene

CASCADE = ("1", "2", "4", "8", "16")  # periods of the motion in the order in which they appear
RECORDED_FRAMES = 4  # per run, since only its impacts are used
SETTLE = 4000  # plate periods before the impacts that count
BISECTIONS = 12  # of the interval between two amplitudes of the sweep


@dataclass(frozen=True)
class SweepPoint:
    """Motions and impact speeds of the seeds at one amplitude.

    Attributes:
        amplitude: [m].
        motions: one name per seed; see `feeder_sim.measures.bounces.motion`.
        impact_speed: relative to the plate at the last impacts of each seed [m/s].
    """

    amplitude: float
    motions: tuple[str, ...]
    impact_speed: tuple[NDArray[np.float64], ...]


@dataclass(frozen=True)
class Boundary:
    """Amplitude at which a motion begins.

    Attributes:
        motion: "1", "2", ...: its period.
        amplitude: found by bisection [m].
        uncertainty: width of the last bracket [m].
        theory: amplitude by the closed form [m]; None where there is none.
    """

    motion: str
    amplitude: float
    uncertainty: float
    theory: float | None


@dataclass(frozen=True)
class Diagram:
    """A sweep over the amplitude and the boundaries found in it."""

    scenario: Scenario
    sweep: tuple[SweepPoint, ...]
    boundaries: tuple[Boundary, ...]

    def feigenbaum_ratios(self) -> list[float]:
        """Distance between two successive period doublings over the next such distance.

        The limit is 4.669 (Feigenbaum, J. Stat. Phys. 19 (1978) 25).
        """
        doublings = np.array([b.amplitude for b in self.boundaries if b.motion != CASCADE[0]])
        steps = np.diff(doublings)
        return [float(ratio) for ratio in steps[:-1] / steps[1:]]


def sweep_amplitude(
    scenario: Scenario,
    amplitudes: Sequence[float],
    *,
    settle: int = SETTLE,
    progress: Callable[[float], None] | None = None,
) -> Diagram:
    """Sweep the amplitude and find the boundaries within the sweep.

    Args:
        scenario: a part on a slide over a piston with one drive; its amplitude is replaced.
        amplitudes: of the sweep, ascending [m].
        settle: plate periods before the impacts that count. Near a boundary the motion converges slowly.
        progress: called with the fraction of the sweep done.

    Raises:
        InputError: the scenario is not of that kind, or the plate cannot have the largest amplitude.
    """
    check_scenario(scenario)
    build_scene(_driven(scenario, max(amplitudes)))  # refuses too large an amplitude before any work is done
    sweep = []
    for amplitude in amplitudes:
        sweep.append(run_at(scenario, amplitude, settle=settle))
        if progress:
            progress(len(sweep) / len(amplitudes))
    return Diagram(scenario, tuple(sweep), tuple(_boundaries(scenario, sweep, settle)))


def check_scenario(scenario: Scenario) -> None:
    """Refuse a scenario without a single steady amplitude to sweep, or with more than one degree of freedom.

    Raises:
        InputError: the plate is no piston, the part is not on a slide, or there is not exactly one steady drive at
            resonance.
    """
    if not isinstance(scenario.plate, PistonPlate) or not isinstance(scenario.guide, Slide):
        raise InputError('must be kind = "slide" over a piston', key="part[0].guide")
    if len(scenario.drive) != 1:
        raise InputError(f"has {len(scenario.drive)} entries, must be one", key="drive")
    for name in ("natural_frequency_hz", "duration_s"):
        if getattr(scenario.drive[0], name) is not None:
            raise InputError("is given, must be a steady drive at resonance", key=f"drive[0].{name}")


def _driven(scenario: Scenario, amplitude: float) -> Scenario:
    """The scenario with another amplitude [m], which the plate has from the start, and without noise.

    Periods double without end only where nothing scatters.
    """
    changes = {"amplitude_um": 1e6 * amplitude, "ring_up": False, "start_s": 0.0}
    drive = (scenario.drive[0].model_copy(update=changes),)
    return scenario.model_copy(
        update={"drive": drive, "contact": scenario.contact.model_copy(update={"noise_m_s": 0.0})}
    )


def run_at(scenario: Scenario, amplitude: float, *, settle: int) -> SweepPoint:
    """Run every seed at one amplitude [m] for `settle` plate periods, and then for the impacts that count."""
    plate_period = 1.0 / scenario.drive[0].frequency_hz
    duration = (settle + 2 * LAST_IMPACTS) * plate_period
    prepared = prepare(
        with_run(
            _driven(scenario, amplitude),
            duration_s=duration,
            frames_per_second=min(max(1.0, RECORDED_FRAMES / duration), 1e6),
        )
    )
    tolerance = impact_tolerance(prepared)
    seeds = simulate(prepared).seeds
    return SweepPoint(
        amplitude,
        tuple(motion(s.impacts, plate_period, tolerance, end=float(s.frames.time[-1])) for s in seeds),
        tuple(s.impacts.approach_speed[-LAST_IMPACTS:] for s in seeds),
    )


def theoretical_boundaries(scenario: Scenario) -> dict[str, float]:
    """Amplitudes [m] at which period one and two begin, by the formulas of feeder_sim.measures.bounces.

    Empty where they do not hold: in a tilted guide and with compliant contact.
    """
    assert isinstance(scenario.guide, Slide)
    if scenario.guide.tilt_deg or scenario.contact.model != "restitution":
        return {}
    e = scenario.contact.coefficient
    per_throw_number = GRAVITY / (2.0 * np.pi * scenario.drive[0].frequency_hz) ** 2
    thresholds = {"1": period_one_threshold(e), "2": period_two_threshold(e)}
    return {name: threshold * per_throw_number for name, threshold in thresholds.items()}


def _boundaries(scenario: Scenario, sweep: Sequence[SweepPoint], settle: int) -> Iterator[Boundary]:
    """Boundaries of the motions of the cascade in ascending order, as far as the sweep shows them."""
    theory = theoretical_boundaries(scenario)
    motions, index = [set(point.motions) for point in sweep], 0
    # Period one begins where it first appears, each further period where the one before it is absent.
    for gained, watched in zip(CASCADE, (CASCADE[0], *CASCADE), strict=False):
        begins = gained == watched
        beyond = (i for i in range(index, len(sweep)) if (watched in motions[i]) == begins)
        index = next(beyond, len(sweep))
        if index == len(sweep) or (not begins and watched not in motions[index - 1]):
            return  # the sweep ends, or is too coarse to show the motion between two boundaries
        if index > 0:
            low, high = sweep[index - 1].amplitude, sweep[index].amplitude
            amplitude, uncertainty = bisect(scenario, low, high, watched, begins=begins, settle=settle)
            yield Boundary(gained, amplitude, uncertainty, theory.get(gained))


def bisect(
    scenario: Scenario, low: float, high: float, name: str, *, begins: bool, settle: int = SETTLE
) -> tuple[float, float]:
    """Find the amplitude at which a motion begins or ends.

    Args:
        scenario: as for `sweep_amplitude`.
        low: amplitude below the boundary [m].
        high: amplitude above it [m].
        name: of the motion.
        begins: whether the motion begins at the boundary, or else ends there.
        settle: plate periods before the impacts that count.

    Returns:
        The amplitude and the width of the last bracket, both [m].
    """
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        if (name in run_at(scenario, middle, settle=settle).motions) == begins:
            high = middle
        else:
            low = middle
    return 0.5 * (low + high), high - low


def write_sweep(diagram: Diagram, path: Path) -> None:
    """Write one row per impact as CSV: amplitude_um, throw_number, seed, motion, impact_speed_mm_s."""
    squared_omega = (2.0 * np.pi * diagram.scenario.drive[0].frequency_hz) ** 2
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["amplitude_um", "throw_number", "seed", "motion", "impact_speed_mm_s"])
        for point in diagram.sweep:
            throw_number = point.amplitude * squared_omega / GRAVITY
            for seed, (name, speeds) in enumerate(zip(point.motions, point.impact_speed, strict=True)):
                columns = [f"{1e6 * point.amplitude:.6g}", f"{throw_number:.6g}", seed, name]
                writer.writerows([*columns, f"{1e3 * speed:.9g}"] for speed in speeds)
