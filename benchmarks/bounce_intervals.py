"""Bounce intervals of a 3 mm steel ball on a plate, ten rows: exact method, the source's simulation, and the estimate.

    python benchmarks/bounce_intervals.py [--engine mujoco --steps-per-period 160] [--intervals 2000]

at        mean over at least that many intervals at the row's amplitude, with the standard error of batch means
around    mean and standard deviation over amplitudes within 3 % of it: which share of the flights starts from a ball
          that had come to rest (`rested`) depends on the amplitude in detail, and with it the mean
long      of these, without hops shorter than half the estimate
source    D. Shi, EPFL thesis TH7124 (2016): one run of 2.5 s each
estimate  4 pi f A (1 + e) / g, for landings at phases that know nothing of each other and no rest
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from feeder_sim.constants import GRAVITY
from feeder_sim.measures.bounces import expected_interval, flights, impact_tolerance, settling_time
from feeder_sim.records.seed import Events
from feeder_sim.run.simulation import Result, simulate
from feeder_sim.scenario import Scenario, load_scenario, with_run

SCENARIO = Path(__file__).parents[1] / "scenarios/ball_558hz.toml"
# frequency (Hz), amplitude (um), the source's interval (ms) and height (mm)
ROWS = [
    (558.0, 90.0, 75.0, 6.86),
    (558.0, 54.0, 44.0, 2.35),
    (558.0, 36.0, 29.0, 1.00),
    (558.0, 18.0, 15.0, 0.28),
    (2797.0, 20.0, 79.0, 7.62),
    (2797.0, 12.0, 48.0, 2.85),
    (2797.0, 4.0, 17.0, 0.36),
    (6199.0, 7.70, 67.0, 5.42),
    (6199.0, 4.62, 42.0, 2.11),
    (6199.0, 1.54, 14.0, 0.26),
]
SEEDS = 8
NEARBY = np.linspace(0.97, 1.03, 31)
LONG = 0.5  # of the estimate


def row(frequency: float, amplitude: float, intervals: int, **run: Any) -> Scenario:
    """The scenario at another frequency [Hz] and amplitude [um], long enough for that many intervals."""
    base = load_scenario(SCENARIO)
    drive = base.drive[0].model_copy(update={"frequency_hz": frequency, "amplitude_um": amplitude})
    each = expected_interval(frequency, 1e-6 * amplitude, base.contact.coefficient, GRAVITY)
    duration = 1.0 + 1.2 * intervals * each / SEEDS  # a second to ring up
    return with_run(base.model_copy(update={"drive": (drive,)}), duration_s=duration, seeds=SEEDS, **run)


def rested(result: Result) -> float:
    """Share of the flights longer than a plate period that begin at the end of a phase of rest."""
    period = 1.0 / result.prepared.scenario.drive[0].frequency_hz
    least = impact_tolerance(result.prepared) * period

    def share(impacts: Events) -> float:
        flies = impacts.time[1:] - impacts.until[:-1] >= period
        return float((impacts.until - impacts.time > least)[:-1][flies].mean())

    return float(np.mean([share(seed.impacts) for seed in result.seeds]))


def around(frequency: float, amplitude: float, estimate: float, intervals: int, **run: Any) -> list[float]:
    """Mean interval [ms], its deviation between amplitudes, mean of the long ones, and the rested share."""
    means, longs, rests = [], [], []
    for factor in NEARBY:
        result = simulate(row(frequency, float(amplitude * factor), intervals, **run))
        period, after = 1.0 / frequency, settling_time(result.scene)
        hops = np.concatenate([flights(s.impacts, period, GRAVITY, after=after).interval for s in result.seeds])
        means.append(1e3 * hops.mean())
        longs.append(1e3 * hops[hops > LONG * estimate].mean())
        rests.append(rested(result))
    return [float(np.mean(means)), float(np.std(means)), float(np.mean(longs)), float(np.mean(rests))]


def main(
    engine: Annotated[str, typer.Option()] = "impulse",
    steps_per_period: Annotated[int, typer.Option()] = 40,
    intervals: Annotated[int, typer.Option()] = 2000,
) -> None:
    print(
        "   f (Hz)  A (um)   at (ms)                  around (ms)  long   source  estimate"
        "  rested at, around  height (mm)  source"
    )
    run: dict[str, Any] = {"engine": engine, "steps_per_period": steps_per_period}
    ratios = []
    for frequency, amplitude, source, source_height in ROWS:
        scenario = row(frequency, amplitude, intervals, **run)
        result = simulate(scenario)
        found = result.measures()
        interval, height = found["bounce_interval_ms"], found["flight_height_mm"]
        estimate = expected_interval(frequency, 1e-6 * amplitude, scenario.contact.coefficient, GRAVITY)
        mean, spread, long, rest = around(frequency, amplitude, estimate, intervals // 10, **run)
        ratios.append([mean / (1e3 * estimate), mean / source, long / source])
        print(
            f"{frequency:9.0f}  {amplitude:6.2f}  {interval['mean']:6.2f} +- {interval['se']:.2f} (n = {interval['n']})"
            f"  {mean:6.2f} +- {spread:4.2f}  {long:5.1f}  {source:6.1f}  {1e3 * estimate:8.2f}"
            f"  {rested(result):6.0%} {rest:6.0%}"
            f"         {height['mean']:11.3f}  {source_height:6.2f}",
            flush=True,
        )
    over_estimate, over_source, long_over_source = np.mean(ratios, axis=0)
    print(
        f"means of the ten rows: around/estimate {over_estimate:.3f}, around/source {over_source:.3f}, "
        f"long/source {long_over_source:.3f}"
    )


if __name__ == "__main__":
    typer.run(main)
