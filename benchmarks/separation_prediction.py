"""What the separation experiment gives when the inputs that its source does not say stay uncertain.

    python benchmarks/separation_prediction.py [--samples 128] [--data picks.csv] [--picture picks.png]
    python benchmarks/separation_prediction.py --drifts

The first draws restitution and friction (0.2 to 0.5 each, the same on the plate and between nuts) and a rim or none
from a scrambled Sobol sequence, runs ten cycles of scenarios/separation_100.toml with each, with the reaction of the
nuts on the plate, and prints the median and the 90 % interval of the picks beside the 70 measured. Points that are in
the data file already are not run again. Takes about half an hour on two cores.

The second asks for which restitutions and frictions both measured drift speeds are met: within two standard errors of
six runs. Takes two minutes.
"""

from __future__ import annotations

import argparse
import csv
import math
import sys
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path

import numpy as np
from scipy.stats import qmc, spearmanr

import feeder_sim
from feeder_sim.scenario import Scenario, load_scenario
from feeder_sim.studies.uncertainty.spread import interval_of

SCENARIOS = Path(__file__).parents[1] / "scenarios"
RESTITUTION, FRICTION = (0.2, 0.5), (0.2, 0.5)
MEASURED = 70
COLUMNS = ("number", "restitution", "friction", "rim", "picked", "lost")
DRIFTS = {"drift_4750hz": (1.44, 0.27), "drift_8775hz": (4.17, 0.64)}  # measured mean and SD of six runs [mm/s]
DRIFTS_ALLOW = 0.35  # largest restitution, at usual friction (--drifts)
GRID = 13  # restitutions and frictions of the drifts, from 0 to 0.6


def sample(n: int) -> list[tuple[float, float, bool]]:
    """Restitution, friction, and whether there is a rim."""
    points = qmc.Sobol(3, seed=1).random(n)
    low, high = (np.array(limits) for limits in zip(RESTITUTION, FRICTION, strict=True))
    return [(*(low + (high - low) * point[:2]).tolist(), bool(point[2] < 0.5)) for point in points]


def varied(base: Scenario, restitution: float, friction: float, *, rim: bool, seed: int) -> Scenario:
    """The scenario with other inputs, one seed of its own, and the reaction of the nuts."""
    raw = base.model_dump()
    raw["plate"]["rim"] = rim
    raw["contact"] |= {"restitution": restitution, "friction": friction}
    raw["contact"] |= {"part_restitution": restitution, "part_friction": friction}
    raw["run"] |= {"reaction": True, "seeds": 1, "seed": seed}
    return Scenario.model_validate(raw)


def picks(number: int, inputs: tuple[float, float, bool]) -> dict[str, float]:
    """Run one point of the sample."""
    restitution, friction, rim = inputs
    base = load_scenario(SCENARIOS / "separation_100.toml")
    result = feeder_sim.simulate(varied(base, restitution, friction, rim=rim, seed=number), workers=1)
    found = result.measures()
    row = (number, restitution, friction, int(rim), found["picked"]["mean"], found["lost"]["mean"])
    return dict(zip(COLUMNS, row, strict=True))


def computed(n: int, workers: int, data: Path) -> list[dict[str, float]]:
    """All points of the sample, in order; each is written to the data file as soon as it is done."""
    rows = []
    if data.exists():
        with data.open(newline="") as file:
            rows = [{name: float(value) for name, value in row.items()} for row in csv.DictReader(file)]
    done = {int(row["number"]) for row in rows}
    with data.open("a", newline="") as file, ProcessPoolExecutor(workers) as pool:
        writer = csv.DictWriter(file, COLUMNS)
        if not done:
            writer.writeheader()
        missing = [(i, inputs) for i, inputs in enumerate(sample(n)) if i not in done]
        for future in as_completed([pool.submit(picks, *point) for point in missing]):
            rows.append(future.result())
            writer.writerow(rows[-1])
            file.flush()
            print(f"{len(rows)} of {n}", file=sys.stderr)
    return sorted(rows, key=lambda row: row["number"])


def report(rows: list[dict[str, float]]) -> None:
    """Median and interval of the picks, and how they go with each input."""
    picked = np.array([row["picked"] for row in rows])
    median, (low, high) = np.median(picked), interval_of(picked)
    share = float((picked >= MEASURED).mean())
    print(f"{len(rows)} runs: median {median:.1f} picked, 90 % interval {low:.1f} to {high:.1f}, measured {MEASURED}")
    print(f"runs with at least {MEASURED} picked: {100 * share:.0f} %")
    print("input        rank correlation with the picks")
    for name in COLUMNS[1:4]:
        print(f"{name:<12} {spearmanr([row[name] for row in rows], picked).statistic:+.2f}")
    groups = {
        "with a rim": [row for row in rows if row["rim"]],
        "without a rim": [row for row in rows if not row["rim"]],
        f"restitution up to {DRIFTS_ALLOW:g}, which both drifts allow": [
            row for row in rows if row["restitution"] <= DRIFTS_ALLOW
        ],
    }
    for words, group in groups.items():
        of_group = [row["picked"] for row in group]
        median, (low, high) = np.median(of_group), interval_of(of_group)
        lost = np.mean([row["lost"] for row in group])
        print(f"{words}: median {median:.1f}, 90 % interval {low:.1f} to {high:.1f}; lost over the edge {lost:.1f}")


def draw(rows: list[dict[str, float]], path: Path) -> None:
    """Picks over restitution, with friction as colour and the rim as the mark."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.5, 4.2), layout="constrained")
    axes = figure.add_subplot()
    picked = np.array([row["picked"] for row in rows])
    for rim, mark, words in ((1.0, "s", "rim"), (0.0, "o", "no rim")):
        some = [row for row in rows if row["rim"] == rim]
        points = axes.scatter(
            [row["restitution"] for row in some],
            [row["picked"] for row in some],
            c=[row["friction"] for row in some],
            vmin=FRICTION[0],
            vmax=FRICTION[1],
            marker=mark,
            label=words,
        )
    figure.colorbar(points, ax=axes, label="friction")
    median, (low, high) = np.median(picked), interval_of(picked)
    axes.axhspan(low, high, color="0.5", alpha=0.15, label="90 % interval")
    axes.axhline(median, color="0.4", linewidth=1.0, label="median")
    axes.axhline(MEASURED, color="#be3434", linewidth=1.4, label="measured")
    axes.set(xlabel="restitution, plate and nuts", ylabel="picked of 100 nuts in ten cycles", ylim=(0, 100))
    axes.legend(fontsize=8)
    figure.savefig(path, dpi=150)


def allowed_by_drifts() -> None:
    """Print the drift speeds over restitution and friction, and where both measured ones are met."""
    values = np.linspace(0.0, 0.6, GRID)
    met = np.ones((GRID, GRID), bool)
    for name, (mean, sd) in DRIFTS.items():
        base = load_scenario(SCENARIOS / f"{name}.toml").model_dump()
        scenarios = [
            Scenario.model_validate(base | {"contact": base["contact"] | {"restitution": e, "friction": mu}})
            for e in values
            for mu in values
        ]
        found = [ensemble.findings.transport_speed_mm_s for ensemble in feeder_sim.measure_drift(scenarios)]
        speed = np.array([one.mean for one in found]).reshape(GRID, GRID)
        error = np.hypot(sd / math.sqrt(6), np.array([one.se for one in found]).reshape(GRID, GRID))
        within = np.abs(speed - mean) < 2.0 * error
        met &= within
        print(f"{name}: speed [mm/s] over restitution (down) and friction (across); * within two standard errors")
        print("      " + "  ".join(f"{mu:5.2f} " for mu in values))
        for e, row, marks in zip(values, speed, within, strict=True):
            print(f"{e:4.2f}  " + "  ".join(f"{v:5.2f}{'*' if m else ' '}" for v, m in zip(row, marks, strict=True)))
    print("both drifts are met at")
    for e, row in zip(values, met, strict=True):
        if row.any():
            print(f"  restitution {e:.2f}: friction {', '.join(f'{mu:.2f}' for mu in values[row])}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--samples", type=int, default=128)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--data", type=Path, default=Path("separation_prediction.csv"))
    parser.add_argument("--picture", type=Path)
    parser.add_argument("--drifts", action="store_true")
    options = parser.parse_args()
    if options.drifts:
        allowed_by_drifts()
        return
    rows = computed(options.samples, options.workers, options.data)
    report(rows)
    if options.picture:
        draw(rows, options.picture)


if __name__ == "__main__":
    main()
