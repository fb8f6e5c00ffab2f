"""How the motion of a bouncing part changes with the plate's amplitude: sweep, boundaries of period one, two, four, ...

    python docs/examples/bifurcation.py scenarios/ball_50hz.toml --from 195 --to 300 --points 421 --picture FILE

A boundary is found by bisection on the motion of the seeds: period one begins at the smallest amplitude at which any
seed ends in it, period 2 n at the amplitude above which no seed ends in period n any more. Seeds have different drop
heights, since other motions can coexist with the periodic one.

Period-one motion on a plate A sin(omega t), one impact per plate period, exists and is stable for

    pi (1 - e) / (1 + e)  <  A omega^2 / g  <  sqrt(4 (1 + e^2)^2 / (1 + e)^4 + pi^2 (1 - e)^2 / (1 + e)^2)

At the upper limit an eigenvalue of the impact map, linearised about that motion, passes -1 and the period doubles
(compare Barroso, Carneiro and Macau, Phys. Rev. E 79 (2009) 026206).
"""

from __future__ import annotations

import csv
import math
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from numpy.typing import NDArray

import feeder_sim
from feeder_sim.constants import GRAVITY
from feeder_sim.document.figure import MM, UM, empty_figure
from feeder_sim.errors import FeederSimError, InputError
from feeder_sim.measures.bounces import LAST_IMPACTS, impact_tolerance, motion
from feeder_sim.scenario import RigidPlate, Scenario, Slide
from feeder_sim.scene.scene import build_scene

LABEL_WIDTH = 0.02  # of the axis; labels of boundaries nearer to each other than this are staggered
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


def period_one_threshold(restitution: float) -> float:
    """Throw number A omega^2 / g at which period-one motion begins, for a coefficient of restitution [1]."""
    return math.pi * (1.0 - restitution) / (1.0 + restitution)


def period_two_threshold(restitution: float) -> float:
    """Throw number A omega^2 / g at which period two replaces period one, for a coefficient of restitution [1]."""
    e = restitution
    return math.hypot(2.0 * (1.0 + e * e) / (1.0 + e) ** 2, math.pi * (1.0 - e) / (1.0 + e))


def sweep_amplitude(scenario: Scenario, amplitudes: Sequence[float], *, settle: int = SETTLE) -> Diagram:
    """Sweep the amplitude and find the boundaries within the sweep.

    Args:
        scenario: a part on a slide over a piston with one drive; its amplitude is replaced.
        amplitudes: of the sweep, ascending [m].
        settle: plate periods before the impacts that count. Near a boundary the motion converges slowly.

    Raises:
        InputError: the scenario is not of that kind, or the plate cannot have the largest amplitude.
    """
    check_scenario(scenario)
    build_scene(_driven(scenario, max(amplitudes)))  # refuses too large an amplitude before any work is done
    sweep = [run_at(scenario, amplitude, settle=settle) for amplitude in amplitudes]
    return Diagram(scenario, tuple(sweep), tuple(_boundaries(scenario, sweep, settle)))


def check_scenario(scenario: Scenario) -> None:
    """Refuse a scenario without a single steady amplitude to sweep, or with more than one degree of freedom.

    Raises:
        InputError: the plate is no piston, the part is not on a slide, or there is not exactly one steady drive at
            resonance.
    """
    if not isinstance(scenario.plate, RigidPlate) or not isinstance(scenario.guide, Slide):
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
    frames_per_second = min(max(1.0, RECORDED_FRAMES / duration), 1e6)
    run = {"run.duration_s": duration, "run.frames_per_second": frames_per_second}
    result = feeder_sim.simulate(_driven(scenario, amplitude).changed(run))
    tolerance, seeds = impact_tolerance(result.prepared), result.seeds
    return SweepPoint(
        amplitude,
        tuple(motion(s.impacts, plate_period, tolerance, end=float(s.frames.time[-1])) for s in seeds),
        tuple(s.impacts.approach_speed[-LAST_IMPACTS:] for s in seeds),
    )


def theoretical_boundaries(scenario: Scenario) -> dict[str, float]:
    """Amplitudes [m] at which period one and two begin, by the formulas above.

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


def draw_bifurcation(diagram: Diagram, path: Path) -> None:
    """Draw impact speeds over the amplitude, with the boundaries found by bisection and the exact ones."""
    figure = empty_figure(9.0, 5.2)
    axes = figure.add_subplot()
    for point in diagram.sweep:
        speeds = np.concatenate(point.impact_speed)
        axes.scatter(np.full(len(speeds), point.amplitude * UM), speeds * MM, s=0.6, color="black", linewidths=0.0)
    drive = diagram.scenario.drive[0]
    throw_number = (2.0 * np.pi * drive.frequency_hz) ** 2 / GRAVITY / UM
    axes.secondary_xaxis("top", functions=(lambda a: a * throw_number, lambda k: k / throw_number)).set_xlabel(
        "throw number $A\\omega^2/g$"
    )
    axes.set(
        xlabel="amplitude of the plate (µm)",
        ylabel="impact speed relative to the plate (mm/s)",
        xlim=(diagram.sweep[0].amplitude * UM, diagram.sweep[-1].amplitude * UM),
        ylim=(0.0, None),
    )
    _draw_boundaries(axes, diagram.boundaries)
    axes.set_title(f"{diagram.scenario.title or 'Bouncing part'}, restitution {diagram.scenario.contact.restitution:g}")
    figure.savefig(path, dpi=150)


def _draw_boundaries(axes: Any, boundaries: Sequence[Boundary]) -> None:
    """Draw the boundaries of a bifurcation diagram, with labels that do not overlap."""
    low, high = axes.get_xlim()
    right = low
    for boundary in boundaries:
        crowded = boundary.amplitude * UM - right < LABEL_WIDTH * (high - low)
        right = boundary.amplitude * UM
        if boundary.theory is not None:
            axes.axvline(boundary.theory * UM, color="tab:red", linewidth=3.0, alpha=0.35)
        axes.axvline(boundary.amplitude * UM, color="tab:blue", linewidth=0.8, linestyle="--")
        axes.annotate(
            f"period {boundary.motion}",
            (boundary.amplitude * UM, 1.0),
            xycoords=("data", "axes fraction"),
            xytext=(-2, -60 if crowded else -4),
            textcoords="offset points",
            rotation=90,
            ha="right",
            va="top",
            color="tab:blue",
            fontsize=8,
        )
    axes.plot([], [], color="tab:red", linewidth=3.0, alpha=0.35, label="exact boundary")
    axes.plot([], [], color="tab:blue", linewidth=0.8, linestyle="--", label="found by bisection")
    axes.legend(loc="center left", fontsize=8)


def lines(diagram: Diagram) -> Iterator[str]:
    """The amplitude at which each period begins, beside the exact value."""
    yield "period   from (um)  exact (um)  deviation (%)"
    for b in diagram.boundaries:
        exact = "" if b.theory is None else f"  {1e6 * b.theory:10.5g}  {100.0 * (b.amplitude / b.theory - 1.0):+13.3f}"
        yield f"{b.motion:>6}  {1e6 * b.amplitude:10.5g}{exact}"
    if ratios := diagram.feigenbaum_ratios():
        yield f"ratios of successive doublings: {', '.join(f'{r:.3f}' for r in ratios)} (Feigenbaum: 4.669)"


def main(
    scenario: Path,
    low: Annotated[float, typer.Option("--from", help="smallest amplitude [um]")],
    high: Annotated[float, typer.Option("--to", help="largest amplitude [um]")],
    points: Annotated[int, typer.Option(min=2, help="amplitudes in the sweep")] = 211,
    settle: Annotated[int, typer.Option(min=1, help="plate periods to settle")] = SETTLE,
    picture: Annotated[Path | None, typer.Option(help="draw the diagram to this file")] = None,
    data: Annotated[Path | None, typer.Option(help="write the impact speeds to this CSV file")] = None,
) -> None:
    try:
        if not 0.0 < low < high:
            raise InputError(f"are {low:g} and {high:g}, must be 0 < --from < --to", key="--from, --to")
        amplitudes = (np.linspace(low, high, points) * 1e-6).tolist()
        diagram = sweep_amplitude(feeder_sim.load_scenario(scenario), amplitudes, settle=settle)
    except FeederSimError as error:
        sys.exit(f"{Path(__file__).name}: {error}")
    if picture is not None:
        draw_bifurcation(diagram, picture)
    if data is not None:
        write_sweep(diagram, data)
    print(*lines(diagram), sep="\n")


if __name__ == "__main__":
    typer.run(main)
