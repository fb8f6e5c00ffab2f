"""How large a part may be: drift from antinode to node, and picks, over the part's size over the wavelength.

    python benchmarks/part_size.py [--seeds 16] [--pick-seeds 8] [--picture FILE]

Parts are nuts of the M2.5's proportions; their size is the width across flats.

drift  scenarios/drift_4750hz.toml and drift_8775hz.toml as they stand (1 um at the antinode), and 8775 Hz again with
       the velocity amplitude of 4750 Hz; on a strip that is large enough for every part. `arrived` counts seeds that
       come to 0.2 of the way within the scenario's duration; `passage speed` is that of these seeds, `net speed` the
       way from the antinode that all seeds make, over their time. `expected` is the speed of the smallest part times
       the mean of the gradient of the squared amplitude over the part's width, sin(k w) / (k w), k = 2 pi / wavelength.
picks  scenarios/separation_100.toml with nine parts that start in a block of three by three, nearly in contact, and
       four cycles. A part is picked with 4.2 mm between the circles around it and around its neighbour, as much as the
       scenario's clearance leaves M2.5 nuts; in the block none has that. `lost` are those that went over the edge. The
       wavelength is that of a straight wave at the frequency of the pulse on the same plate.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from feeder_sim.measures.picking import picks_of
from feeder_sim.measures.statistic import Statistic
from feeder_sim.pool.work import Work
from feeder_sim.run.simulation import Result, simulate
from feeder_sim.scenario import Drive, Scenario, load_scenario
from feeder_sim.scenario.tables import validated

SCENARIOS = Path(__file__).parents[1] / "scenarios"
# name of the series: scenario, and the one whose velocity amplitude it has
SERIES = {
    "4750 Hz, 1 µm": ("drift_4750hz", None),
    "8775 Hz, same amplitude": ("drift_8775hz", None),
    "8775 Hz, same velocity": ("drift_8775hz", "drift_4750hz"),
}
RATIOS = tuple(float(ratio) for ratio in np.geomspace(0.05, 1.0, 12))
LONG, WIDE = 4.0, 2.5  # of the strip, in wavelengths
HEIGHT, BORE = 0.4, 0.5  # of an M2.5 nut, over its width across flats
LIMIT = 0.25  # the source's: D. Shi, EPFL thesis TH7124 (2016)

ROWS, PITCH = 3, 1.05  # of the block: parts in a row, and their distance over the circles around them
CYCLES = 4
NUT_MM = 5.0  # across the flats of M2.5
PICK_SIZES_MM = (5.0, 10.0, 16.0, 25.0, 36.0, 48.0)
DROP = {"drop_height_mm": (0.2, 0.5), "tilt_deg": (0.0, 3.0)}  # each seed draws its own, as in the drift scenarios


def nut(size_mm: float) -> dict[str, Any]:
    """A nut of the M2.5's proportions."""
    lengths = {"across_flats_mm": size_mm, "height_mm": HEIGHT * size_mm, "bore_mm": BORE * size_mm}
    return {"shape": "hex_nut", **lengths, "material": "steel"}


def changed(name: str, **tables: Any) -> Scenario:
    """A scenario of the folder with some keys of its tables replaced; a list replaces its table."""
    path = SCENARIOS / f"{name}.toml"
    raw = load_scenario(path).model_dump(exclude_none=True)
    for key, value in tables.items():
        raw[key] = {**raw[key], **value} if isinstance(value, dict) else value
    return validated(raw, Scenario, path)


def wavelength_mm(scenario: Scenario) -> float:
    """Of the strip's wave."""
    cell = simulate(changed_run(scenario)).prepared.cell
    assert cell is not None
    return 4e3 * cell.reach


def changed_run(scenario: Scenario) -> Scenario:
    """The shortest run there is, for what only depends on the plate."""
    run = scenario.run.model_copy(update={"seeds": 1, "duration_s": 0.01, "stop": "time"})
    return scenario.model_copy(update={"run": run})


@dataclass(frozen=True)
class Drifted:
    """Drift of a part of one size: size over wavelength, seeds that arrived, passage and net speed [mm/s]."""

    ratio: float
    arrived: int
    passage: Statistic
    net: Statistic


def drifted(name: str, like: str | None, ratio: float, seeds: int) -> Drifted:
    base = load_scenario(SCENARIOS / f"{name}.toml")
    wave, drive = wavelength_mm(base), base.drive[0]
    assert isinstance(drive, Drive)
    amplitude = drive.amplitude_um
    if like is not None:
        other = load_scenario(SCENARIOS / f"{like}.toml").drive[0]
        assert isinstance(other, Drive) and other.amplitude_um is not None
        amplitude = other.amplitude_um * other.frequency_hz / drive.frequency_hz
    start = base.part[0].start.model_dump(exclude_none=True)
    result = simulate(
        changed(
            name,
            plate={"length_mm": LONG * wave, "width_mm": WIDE * wave},
            drive=[{**drive.model_dump(exclude_none=True), "amplitude_um": amplitude}],
            part=[{**nut(ratio * wave), "start": start}],
            run={"seeds": seeds},
        ),
        work=Work(1),
    )
    measured = result.measures()
    return Drifted(ratio, measured["arrived"], Statistic(**measured["transport_speed_mm_s"]), net_speed(result))


def net_speed(result: Result) -> Statistic:
    """Way from the antinode that the seeds make over their time [mm/s], toward the node positive."""
    cell, speeds = result.prepared.cell, []
    assert cell is not None
    for seed in result.seeds:
        frames = seed.frames
        way = cell.distance_to_node(frames[np.array([0, len(frames) - 1])])
        speeds.append(1e3 * cell.reach * float(way[0] - way[1]) / float(frames.time[-1] - frames.time[0]))
    return Statistic.of(speeds)


def mean_gradient(ratio: float) -> float:
    """Mean over a width of the gradient of the squared amplitude, over that at its middle: sin(k w) / (k w)."""
    return float(np.sinc(2.0 * ratio))


@dataclass(frozen=True)
class Picked:
    """Parts of one size: size over wavelength, parts picked in the first cycle and in all, and lost over the edge."""

    size_mm: float
    ratio: float
    at_once: Statistic
    picked: Statistic
    lost: Statistic


def picked(size_mm: float, wave_mm: float, seeds: int) -> Picked:
    base = load_scenario(SCENARIOS / "separation_100.toml")
    assert base.schedule is not None
    stages = [stage.model_dump(exclude_none=True) for stage in base.schedule.stage]
    start = {"kind": "placed", "places_mm_deg": block(size_mm), **DROP}
    for stage in stages:
        if "pick" in stage:
            room = stage["pick"]["clearance_mm"] - across_corners(NUT_MM)
            stage["pick"] = {"clearance_mm": across_corners(size_mm) + room}
    result = simulate(
        changed(
            "separation_100",
            schedule={"cycles": CYCLES, "stage": stages},
            part=[{**nut(size_mm), "count": ROWS**2, "start": start}],
            run={"seeds": seeds},
        ),
        work=Work(1),
    )
    found = result.measures()
    at_once = Statistic.of(seed_picks(result, cycle=1))
    return Picked(size_mm, size_mm / wave_mm, at_once, Statistic(**found["picked"]), Statistic(**found["lost"]))


def seed_picks(result: Result, cycle: int) -> list[int]:
    """Parts picked in a cycle, by seed."""
    return [int(np.count_nonzero(picks_of(result.scene, seed).cycle == cycle)) for seed in result.seeds]


def across_corners(size_mm: float) -> float:
    """Diameter [mm] of the circle around a nut."""
    return 2.0 * size_mm / math.sqrt(3.0)


def block(size_mm: float) -> list[tuple[float, float, float]]:
    """Places of parts in a square in the middle of the plate."""
    steps = PITCH * across_corners(size_mm) * (np.arange(ROWS) - 0.5 * (ROWS - 1))
    return [(float(x), float(y), 0.0) for x in steps for y in steps]


def wave_on_plate_mm() -> float:
    """Wavelength of a straight wave at the frequency of the pulse that throws the parts apart."""
    strip = load_scenario(SCENARIOS / "drift_4750hz.toml")
    schedule = load_scenario(SCENARIOS / "separation_100.toml").schedule
    assert schedule is not None
    # Bending waves are as long as one over the square root of the frequency; both plates are 3 mm of aluminium.
    return wavelength_mm(strip) * math.sqrt(strip.drive[0].frequency_hz / schedule.stage[-1].drive[0].frequency_hz)


def text(value: Statistic, digits: int = 2) -> str:
    """Mean and standard error."""
    return f"{value.mean:.{digits}f} ± {value.se or 0.0:.{digits}f}" if value.n else "-"


def draw(series: dict[str, list[Drifted]], picks: Sequence[Picked], seeds: int, picture: Path) -> None:
    """Net speed over that of the smallest part, share that arrives, and picks, over size over wavelength."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.4, 7.2 if picks else 5.2), layout="constrained")
    heights = (1.5, 1.0, 1.0) if picks else (1.5, 1.0)
    panels = figure.subplots(len(heights), 1, sharex=True, height_ratios=heights)
    speed, share, last = panels[0], panels[1], panels[-1]
    for (name, rows), colour in zip(series.items(), ("#3a60be", "#be3434", "#2e8b57"), strict=True):
        ratios, unit = [row.ratio for row in rows], rows[0].net.mean
        spread = [(row.net.se or 0.0) / unit for row in rows]
        speed.errorbar(ratios, [row.net.mean / unit for row in rows], spread, fmt="o-", ms=4, color=colour, label=name)
        share.plot(ratios, [100.0 * row.arrived / seeds for row in rows], "o-", ms=4, color=colour)
    fine = np.geomspace(RATIOS[0], RATIOS[-1], 200)
    speed.plot(fine, np.sinc(2.0 * fine), "--", color="0.5", label=r"sin(kw) / kw")
    speed.set(ylabel="speed over that of the\nsmallest part", title="Drift from antinode to node")
    share.set(ylabel="arrived (%)", ylim=(-5, 105))
    if picks:
        at = [row.ratio for row in picks]
        for values, label, style in (
            ([row.picked for row in picks], f"picked in {CYCLES} cycles", "o-"),
            ([row.at_once for row in picks], "in the first cycle", "o--"),
        ):
            last.errorbar(at, [v.mean for v in values], [v.se or 0.0 for v in values], fmt=style, ms=4, label=label)
        last.legend(fontsize=8)
        last.set(ylabel=f"of {ROWS**2} parts", ylim=(0, None))
    last.set(xlabel="size over wavelength", xscale="log")
    for axes in panels:
        axes.axvline(LIMIT, color="0.6", linestyle=":")
    speed.annotate("a quarter", (LIMIT, 0.05), xytext=(4, 0), textcoords="offset points", fontsize=8, color="0.4")
    speed.legend(fontsize=8)
    ticks = (0.05, 0.1, 0.25, 0.5, 1.0)
    last.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    last.minorticks_off()
    figure.savefig(picture, dpi=95)


def main(
    seeds: Annotated[int, typer.Option()] = 16,
    pick_seeds: Annotated[int, typer.Option(help="0: no picks")] = 8,
    picture: Annotated[Path | None, typer.Option()] = None,
) -> None:
    series: dict[str, list[Drifted]] = {}
    for name, (scenario, like) in SERIES.items():
        print(
            f"\n{name}\n| size / wavelength | arrived of {seeds} | passage speed (mm/s) | net speed (mm/s) | expected |"
        )
        print("|---|---|---|---|---|")
        series[name] = []
        for ratio in RATIOS:
            row = drifted(scenario, like, ratio, seeds)
            series[name].append(row)
            expected = series[name][0].net.mean * mean_gradient(ratio) / mean_gradient(RATIOS[0])
            numbers = f"{row.arrived} | {text(row.passage)} | {text(row.net)} | {expected:.2f}"
            print(f"| {ratio:.3f} | {numbers} |", flush=True)
    picks: list[Picked] = []
    if pick_seeds:
        wave = wave_on_plate_mm()
        print(f"\n{ROWS**2} parts, {CYCLES} cycles, {pick_seeds} seeds; wavelength {wave:.1f} mm")
        print("| size (mm) | size / wavelength | picked in the first cycle | picked | lost |\n|---|---|---|---|---|")
        for size in PICK_SIZES_MM:
            row_of_picks = picked(size, wave, pick_seeds)
            picks.append(row_of_picks)
            numbers = f"{text(row_of_picks.at_once, 1)} | {text(row_of_picks.picked, 1)} | {text(row_of_picks.lost, 1)}"
            print(f"| {size:g} | {row_of_picks.ratio:.3f} | {numbers} |", flush=True)
    if picture is not None:
        draw(series, picks, seeds, picture)


if __name__ == "__main__":
    typer.run(main)
