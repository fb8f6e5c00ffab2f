"""Picks per minute of a rigid plate that shakes up and down, beside the plate of bending modes.

    python benchmarks/rigid_plate.py [--seeds 16] [--rim] [--picture rigid_plate.png]

The modal plate is scenarios/refill_nuts.toml, as it is and with its best recipe, the rigid one
scenarios/rigid_plate.toml. Parts, pick, refill, pause, camera and robot are the same; no plate has a rim, or with --rim
all have one. A rigid plate that rocks has a turn in phase with its stroke, of 5 % of it at the edge. The plate rests
while the robot picks, so that one run gives the picks per minute of robots of any speed. Printed are means and standard
errors over the seeds; `lost` is the share of all nuts that came onto the plate. The picture also has the rigid plate
over the acceleration, at three frequencies, with a quarter of the seeds. Takes minutes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import typer

from feeder_sim import StatisticsOnly, load_scenario, simulate
from feeder_sim.measures.statistic import Statistic
from feeder_sim.scenario import Scenario

SCENARIOS = Path(__file__).parents[1] / "scenarios"
MODAL, RIGID = SCENARIOS / "refill_nuts.toml", SCENARIOS / "rigid_plate.toml"
PICK_S = (1.0, 0.3, 0.0)  # robots: that of the scenarios, a fast one, and one that takes no time
GRAVITY = 9.81
ROCKING = 0.05  # of the stroke, at the edge
ACCELERATIONS = (3.0, 4.5, 6.0)  # [g]
FREQUENCIES = (50.0, 65.0, 80.0)
MODAL_BEST = {  # by the command in docs/validation.md, rounded
    "stage[0].duration_s": 0.23,
    "stage[0].drive[0].voltage_vpp": 113.0,
    "stage[1].duration_s": 0.30,
    "stage[1].drive[0].voltage_vpp": 114.0,
}
PRESENT, BEST = "modal, as it stands", "modal, best"


@dataclass(frozen=True)
class Case:
    """A plate and its recipe.

    Attributes:
        name: for people.
        file: its scenario.
        changes: values in place of those of the file.
    """

    name: str
    file: Path
    changes: Mapping[str, Any] = field(default_factory=dict)

    def scenario(self, seeds: int, rim: bool = False) -> Scenario:
        return load_scenario(self.file).changed({**self.changes, "plate.rim": rim, "run.seeds": seeds})


@dataclass(frozen=True)
class Rates:
    """What a case gives.

    Attributes:
        per_minute: picks per minute of each of PICK_S.
        per_cycle: picks per cycle that counts.
        lost: share of the nuts that came [%].
    """

    per_minute: tuple[Statistic, ...]
    per_cycle: Statistic
    lost: Statistic


def rocking() -> dict[str, Any]:
    """Drives of the rigid plate whose guide lets it rock about y."""
    plate, stage = load_scenario(RIGID).plate, load_scenario(RIGID).schedule.stage[0]  # type: ignore[union-attr]
    drive = stage.drive[0]
    turn = 1e3 * ROCKING * drive.stroke_um * 1e-3 / (0.5 * plate.length_mm)  # type: ignore[union-attr, operator]
    turned = {"frequency_hz": drive.frequency_hz, "turn_mrad": turn, "axis": "y"}
    return {"stage[0].drive": [drive.model_dump(exclude_none=True), turned]}


def cases() -> list[Case]:
    return [
        Case(PRESENT, MODAL),
        Case(BEST, MODAL, MODAL_BEST),
        Case("rigid, best", RIGID),
        Case("rigid, best, rocks", RIGID, rocking()),
    ]


def rates(scenario: Scenario) -> Rates:
    """Run a scenario once, for all robots."""
    schedule, robot = scenario.schedule, scenario.robot
    assert schedule is not None and robot is not None and scenario.refill is not None
    rows = simulate(scenario, record=StatisticsOnly()).to_frame()
    of = rows.pivot(index="seed", columns="measure", values="value")
    picks = of["picks_per_minute"] * of["counted_s"] / 60.0
    rest = of["counted_s"] - robot.pick_s * picks
    return Rates(
        per_minute=tuple(Statistic.of(60.0 * picks / (rest + pick_s * picks)) for pick_s in PICK_S),
        per_cycle=Statistic.of(picks / (schedule.cycles - 1)),  # the first does not count
        lost=Statistic.of(100.0 * of["lost"] / (scenario.refill.to + of["refilled"])),
    )


def of_acceleration(frequency: float, acceleration: float) -> Case:
    """The rigid plate at a frequency [Hz] and a peak acceleration [g]."""
    stroke = 1e6 * acceleration * GRAVITY / (2.0 * math.pi * frequency) ** 2
    changes = {"stage[0].drive[0].frequency_hz": frequency, "stage[0].drive[0].stroke_um": stroke}
    return Case(f"{frequency:g} Hz, {acceleration:g} g", RIGID, changes)


def row(case: Case, found: Rates) -> str:
    cells = [*found.per_minute, found.per_cycle, found.lost]
    return f"| {case.name} | " + " | ".join(f"{cell.mean:.1f} ± {cell.se:.1f}" for cell in cells) + " |"


def draw(of_cases: Mapping[str, Rates], seeds: int, picture: Path) -> None:
    """Picks per minute of the cases, and those of the rigid plate over the acceleration."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 3.6), layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=(1.15, 1.0))
    names, colours = list(of_cases), ("#9db4d8", "#3a60be", "#1d2f5f")
    height = 0.8 / len(PICK_S)
    for i, (pick_s, colour) in enumerate(zip(PICK_S, colours, strict=True)):
        found = [of_cases[name].per_minute[i] for name in names]
        at = [n + (i - 1) * height for n in range(len(names))]
        means, errors = [rate.mean for rate in found], [rate.se for rate in found]
        left.barh(at, means, height, xerr=errors, color=colour, label=f"{pick_s:g} s")
    left.set_yticks(range(len(names)), names)
    left.invert_yaxis()
    left.set(xlabel="picks per minute")
    left.legend(title="robot, per nut", fontsize=8, title_fontsize=8)
    robot = PICK_S.index(0.3)
    for frequency, colour in zip(FREQUENCIES, ("C0", "C1", "C2"), strict=True):
        found = [rates(of_acceleration(frequency, g).scenario(seeds)).per_minute[robot] for g in ACCELERATIONS]
        means, errors = [rate.mean for rate in found], [rate.se for rate in found]
        right.errorbar(
            ACCELERATIONS, means, errors, fmt="o-", color=colour, capsize=2, label=f"rigid, {frequency:g} Hz"
        )
    for name, line in ((PRESENT, ":"), (BEST, "--")):
        right.axhline(of_cases[name].per_minute[robot].mean, color="0.4", linestyle=line, label=name)
    right.set(xlabel="peak acceleration (g)", ylabel="picks per minute, robot 0.3 s")
    right.set_ylim(0.0, 1.5 * of_cases[BEST].per_minute[robot].mean)  # with room for the legend
    right.legend(fontsize=8, loc="upper left", ncols=2)
    figure.savefig(picture, dpi=100)


def main(
    seeds: Annotated[int, typer.Option()] = 16,
    rim: Annotated[bool, typer.Option(help="round every plate")] = False,
    picture: Annotated[Path | None, typer.Option(help="draw the table, and the rigid plate over acceleration")] = None,
) -> None:
    robots = " | ".join(f"{pick_s:g} s per nut" for pick_s in PICK_S)
    print(f"picks per minute, {seeds} seeds\n\n| | {robots} | picks per cycle | lost (%) |")
    print("|---|" + "---|" * (len(PICK_S) + 2))
    of_cases = {}
    for case in cases():
        of_cases[case.name] = rates(case.scenario(seeds, rim))
        print(row(case, of_cases[case.name]), flush=True)
    if picture:
        draw(of_cases, max(2, seeds // 4), picture)


if __name__ == "__main__":
    typer.run(main)
