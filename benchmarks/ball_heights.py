"""Flight height of a 3 mm steel ball over the amplitude of the plate, at three frequencies.

    python benchmarks/ball_heights.py [--seeds 16] [--intervals 4000] [--picture FILE]

scenarios/ball_558hz.toml at ten amplitudes per frequency, up to the amplitude measured at 100 V peak to peak or the
largest that the source simulated, and at those of the source.

at        mean over the seeds, with the standard error between seeds; at least so many intervals in all of them
around    mean and standard deviation over amplitudes within 3 %: which share of the flights starts from a ball that had
          come to rest depends on the amplitude in detail, see benchmarks/bounce_intervals.py
estimate  (2 pi f A (1 + e))^2 / 2g, the height at the mean departure velocity 2 pi f A (1 + e) of a ball whose landings
          come at phases that know nothing of each other
source    D. Shi, EPFL thesis TH7124 (2016): simulation
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from feeder_sim.constants import GRAVITY
from feeder_sim.measures.bounces import expected_interval, seed_flights
from feeder_sim.measures.statistic import Statistic
from feeder_sim.pool.work import Work
from feeder_sim.run.simulation import simulate
from feeder_sim.scenario import Scenario, load_scenario, with_run

SCENARIO = Path(__file__).parents[1] / "scenarios/ball_558hz.toml"
# D. Shi, EPFL thesis TH7124 (2016). Frequency [Hz]: amplitude measured at 100 V peak to peak [um], damping ratio
MEASURED = {558.0: (91.98, 0.0018), 2797.0: (19.70, 0.0020), 6199.0: (7.06, 0.0024)}
# The source's simulation. Frequency [Hz]: amplitude [um] and height [mm]
SOURCE = {
    558.0: ((90.0, 6.86), (54.0, 2.35), (36.0, 1.00), (18.0, 0.28)),
    2797.0: ((20.0, 7.62), (12.0, 2.85), (4.0, 0.36)),
    6199.0: ((7.70, 5.42), (4.62, 2.11), (1.54, 0.26)),
}
AMPLITUDES, LOWEST = 10, 0.1  # how many between the largest and that share of it
NEARBY = np.linspace(0.97, 1.03, 13)
FEWER = 4  # times fewer intervals at each of these


@dataclass(frozen=True)
class Height:
    """Height [mm] at one amplitude [um]: over seeds, over amplitudes around it, and the estimate."""

    amplitude: float
    at: Statistic
    around: Statistic
    estimate: float


def estimate_mm(velocity: float, restitution: float) -> float:
    """Height [mm] over the velocity amplitude of the plate [m/s]."""
    return 1e3 * ((1.0 + restitution) * velocity) ** 2 / (2.0 * GRAVITY)


def velocity(frequency: float, amplitude: float) -> float:
    """Amplitude of the plate's velocity [m/s] from its frequency [Hz] and amplitude [um]."""
    return 2e-6 * np.pi * frequency * amplitude


def scenario_at(frequency: float, amplitude: float, seeds: int, intervals: int) -> Scenario:
    """The scenario at another frequency [Hz] and amplitude [um], long enough for that many intervals."""
    base = load_scenario(SCENARIO)
    values: dict[str, Any] = {"frequency_hz": frequency, "amplitude_um": amplitude}
    drive = base.drive[0].model_copy(update=values | {"damping_ratio": MEASURED[frequency][1]})
    each = expected_interval(frequency, 1e-6 * amplitude, base.contact.coefficient, GRAVITY)
    duration = 1.0 + 1.2 * intervals * each / seeds  # a second to ring up
    return with_run(base.model_copy(update={"drive": (drive,)}), duration_s=duration, seeds=seeds)


def seed_heights(scenario: Scenario) -> Statistic:
    """Over the mean heights of the seeds [mm]."""
    result = simulate(scenario, work=Work(1))
    hops = seed_flights(result.scene, [seed.impacts for seed in result.seeds])
    return Statistic.of(1e3 * float(seed.height.mean()) for seed in hops if len(seed.height))


def height_at(frequency: float, amplitude: float, seeds: int, intervals: int) -> Height:
    scenario = scenario_at(frequency, amplitude, seeds, intervals)
    few = [scenario_at(frequency, float(factor * amplitude), seeds, intervals // FEWER) for factor in NEARBY]
    around = Statistic.of(seed_heights(one).mean for one in few)
    estimate = estimate_mm(velocity(frequency, amplitude), scenario.contact.coefficient)
    return Height(amplitude, seed_heights(scenario), around, estimate)


def amplitudes(frequency: float) -> list[float]:
    """Ten from low to the largest [um], and those of the source."""
    largest = max(MEASURED[frequency][0], *(amplitude for amplitude, _ in SOURCE[frequency]))
    even = largest * np.linspace(LOWEST, 1.0, AMPLITUDES)
    return sorted({float(round(value, 3)) for value in even} | {amplitude for amplitude, _ in SOURCE[frequency]})


def draw(rows: dict[float, list[Height]], restitution: float, picture: Path) -> None:
    """Height over amplitude, and over the velocity amplitude."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.4, 3.9), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True)
    for (frequency, heights), colour in zip(rows.items(), ("#3a60be", "#be3434", "#2e8b57"), strict=True):
        mean, spread = [row.around.mean for row in heights], [row.around.sd or 0.0 for row in heights]
        at = np.array([row.amplitude for row in heights])
        fine = np.geomspace(at[0], at[-1], 100)
        for axes, scale in ((left, 1.0), (right, 1e3 * velocity(frequency, 1.0))):
            axes.errorbar(scale * at, mean, spread, fmt="o", ms=4, color=colour, label=f"{frequency:g} Hz, around")
            axes.plot(scale * at, [row.at.mean for row in heights], "o", ms=2.5, mfc="none", color=colour)
            of_source = np.array(SOURCE[frequency])
            axes.plot(scale * of_source[:, 0], of_source[:, 1], "x", ms=8, color=colour)
            curve = [estimate_mm(velocity(frequency, value), restitution) for value in fine]
            axes.plot(scale * fine, curve, "-", lw=0.8, color=colour if axes is left else "0.5")
    left.plot([], [], "ko", ms=2.5, mfc="none", label="at one amplitude")
    left.plot([], [], "kx", ms=8, label="source's simulation")
    left.plot([], [], "-", lw=0.8, color="0.4", label="estimate")
    left.set(xscale="log", yscale="log", xlabel="amplitude (µm)", ylabel="flight height (mm)")
    right.set(xscale="log", yscale="log", xlabel="velocity amplitude (mm/s)")
    for axes, ticks in ((left, (1, 3, 10, 30, 100)), (right, (30, 60, 100, 200, 300))):
        axes.set_xticks(ticks, [f"{tick}" for tick in ticks])
        axes.xaxis.set_minor_formatter("")
    right.legend(*left.get_legend_handles_labels(), fontsize=8, loc="lower right")
    figure.savefig(picture, dpi=110)


def main(
    seeds: Annotated[int, typer.Option()] = 16,
    intervals: Annotated[int, typer.Option(help="in all seeds together, at least")] = 4000,
    picture: Annotated[Path | None, typer.Option()] = None,
) -> None:
    print("| f (Hz) | A (µm) | velocity (mm/s) | at (mm) | around (mm) | estimate | source | over source: at, around |")
    print("|---|---|---|---|---|---|---|---|")
    rows: dict[float, list[Height]] = {}
    over: dict[str, list[float]] = {
        name: [] for name in ("at/estimate", "around/estimate", "at/source", "around/source")
    }
    for frequency, of_source in SOURCE.items():
        rows[frequency] = []
        for amplitude in amplitudes(frequency):
            row = height_at(frequency, amplitude, seeds, intervals)
            rows[frequency].append(row)
            at, around, source = row.at.mean, row.around.mean, dict(of_source).get(amplitude)
            over["at/estimate"].append(at / row.estimate)
            over["around/estimate"].append(around / row.estimate)
            compared = " | "
            if source is not None:
                over["at/source"].append(at / source)
                over["around/source"].append(around / source)
                compared = f"{source:.2f} | {at / source:.2f}, {around / source:.2f}"
            print(
                f"| {frequency:.0f} | {amplitude:.2f} | {1e3 * velocity(frequency, amplitude):.0f} "
                f"| {at:.3f} ± {row.at.se or 0.0:.3f} | {around:.3f} ± {row.around.sd or 0.0:.3f} "
                f"| {row.estimate:.3f} | {compared} |",
                flush=True,
            )
    for name, ratios in over.items():
        low, middle, high = np.min(ratios), np.mean(ratios), np.max(ratios)
        print(f"{name}: mean {middle:.3f}, from {low:.2f} to {high:.2f} ({len(ratios)} rows)")
    if picture is not None:
        draw(rows, load_scenario(SCENARIO).contact.coefficient, picture)


if __name__ == "__main__":
    typer.run(main)
