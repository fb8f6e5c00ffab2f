"""How the motion of a bouncing part changes with the plate's amplitude: sweep, boundaries of period one, two, four, ...

A boundary is found by bisection on what the part does: period one from the smallest amplitude at which any seed settles
to it, period 2 n from where no seed stays in period n any more. Seeds differ in their drop heights, since other motions
can coexist with the periodic one.
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

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
from feeder_sim.scene.scene import GRAVITY, build_scene

CASCADE = ("1", "2", "4", "8", "16")
RECORDED_FRAMES = 4  # impacts are what counts here
SETTLE = 4000  # plate periods
BISECTIONS = 12  # halves the step of the sweep so often


@dataclass(frozen=True)
class Settlement:
    """What the seeds do at one amplitude.

    Attributes:
        amplitude: [m].
        motions: one name per seed; see `bounces.motion`.
        impact_speed: relative to the plate [m/s], the last impacts of each seed.
    """

    amplitude: float
    motions: tuple[str, ...]
    impact_speed: tuple[NDArray[np.float64], ...]


@dataclass(frozen=True)
class Boundary:
    """Where one motion takes over.

    Attributes:
        motion: "1", "2", ...: its period.
        amplitude: found by bisection [m].
        uncertainty: width of the last bracket [m].
        theory: [m]; None where there is no closed form.
    """

    motion: str
    amplitude: float
    uncertainty: float
    theory: float | None


@dataclass(frozen=True)
class Diagram:
    """A sweep over the amplitude and the boundaries found in it."""

    scenario: Scenario
    sweep: tuple[Settlement, ...]
    boundaries: tuple[Boundary, ...]

    def feigenbaum_ratios(self) -> list[float]:
        """Distance between two successive period doublings over the next one; tends to 4.669 (Feigenbaum 1978)."""
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
        amplitudes: ascending [m].
        settle: plate periods before the motion is looked at. Convergence is slow near a boundary.
        progress: called with the fraction of the sweep done.

    Raises:
        InputError: the scenario is not of that kind.
    """
    check_scenario(scenario)
    build_scene(_driven(scenario, max(amplitudes)))  # too large an amplitude is refused before any work is done
    sweep = []
    for amplitude in amplitudes:
        sweep.append(settle_at(scenario, amplitude, settle=settle))
        if progress:
            progress(len(sweep) / len(amplitudes))
    return Diagram(scenario, tuple(sweep), tuple(_boundaries(scenario, sweep, settle)))


def check_scenario(scenario: Scenario) -> None:
    """Refuse what has no one amplitude to sweep, or more than one coordinate.

    Raises:
        InputError: as said.
    """
    if not isinstance(scenario.plate, PistonPlate) or not isinstance(scenario.guide, Slide):
        raise InputError('allowed is kind = "slide" over a piston', key="part[0].guide")
    if len(scenario.drive) != 1:
        raise InputError(f"has {len(scenario.drive)} entries, allowed is one", key="drive")
    for name in ("natural_frequency_hz", "duration_s"):
        if getattr(scenario.drive[0], name) is not None:
            raise InputError("is given, allowed is a steady drive at resonance", key=f"drive[0].{name}")


def _driven(scenario: Scenario, amplitude: float) -> Scenario:
    """The scenario at another amplitude [m], reached at once."""
    driven = {"amplitude_um": 1e6 * amplitude, "ring_up": False, "start_s": 0.0}
    return scenario.model_copy(update={"drive": (scenario.drive[0].model_copy(update=driven),)})


def settle_at(scenario: Scenario, amplitude: float, *, settle: int) -> Settlement:
    """Run every seed at one amplitude [m] and look at its last impacts."""
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
    return Settlement(
        amplitude,
        tuple(motion(s.impacts, plate_period, tolerance, end=float(s.frames.time[-1])) for s in seeds),
        tuple(s.impacts.approach_speed[-LAST_IMPACTS:] for s in seeds),
    )


def theoretical_boundaries(scenario: Scenario) -> dict[str, float]:
    """Amplitudes [m] of period one and two; none where the formula does not hold: tilted guide, compliant contact."""
    assert isinstance(scenario.guide, Slide)
    if scenario.guide.tilt_deg or scenario.contact.model != "restitution":
        return {}
    e = scenario.contact.restitution
    per_throw_number = GRAVITY / (2.0 * np.pi * scenario.drive[0].frequency_hz) ** 2
    thresholds = {"1": period_one_threshold(e), "2": period_two_threshold(e)}
    return {name: threshold * per_throw_number for name, threshold in thresholds.items()}


def _boundaries(scenario: Scenario, sweep: Sequence[Settlement], settle: int) -> Iterator[Boundary]:
    """Follow the cascade upwards: where each motion of it begins, as far as the sweep shows it."""
    theory = theoretical_boundaries(scenario)
    shown, at = [set(s.motions) for s in sweep], 0
    # Period one begins where it first shows, each further period where the one before it shows no more.
    for gained, watched in zip(CASCADE, (CASCADE[0], *CASCADE), strict=False):
        begins = gained == watched
        reached = (i for i in range(at, len(sweep)) if (watched in shown[i]) == begins)
        at = next(reached, len(sweep))
        if at == len(sweep) or (not begins and watched not in shown[at - 1]):
            return  # the sweep ends, or is too coarse to show the motion between two boundaries
        if at > 0:
            low, high = sweep[at - 1].amplitude, sweep[at].amplitude
            found = bisect(scenario, low, high, watched, begins=begins, settle=settle)
            yield Boundary(gained, *found, theory.get(gained))


def bisect(
    scenario: Scenario, low: float, high: float, name: str, *, begins: bool, settle: int = SETTLE
) -> tuple[float, float]:
    """Find where between two amplitudes [m] a motion begins, or else ends; returns that and its bracket."""
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        if (name in settle_at(scenario, middle, settle=settle).motions) == begins:
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
        for at in diagram.sweep:
            throw_number = at.amplitude * squared_omega / GRAVITY
            for seed, (name, speeds) in enumerate(zip(at.motions, at.impact_speed, strict=True)):
                head = [f"{1e6 * at.amplitude:.6g}", f"{throw_number:.6g}", seed, name]
                writer.writerows([*head, f"{1e3 * speed:.9g}"] for speed in speeds)
