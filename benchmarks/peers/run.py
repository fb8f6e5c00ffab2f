"""The same physical cases in other engines: value and cost of each, as CSV.

    python benchmarks/peers/run.py --out FILE.csv [--quick] [--only NAME]

An engine whose library is not installed is skipped. Wall time is that of the
stepping loop alone, on one core, per simulated second or per throw.
"""

from __future__ import annotations

import argparse
import csv
import importlib
import math
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

sys.path.append(str(Path(__file__).parents[1]))

import cases
import throws
from cases import AT_REST, DRIFTS, Method, Outcome
from chart_scenes import SCENES
from cube_tosses import DATA, read_tosses
from heap import ENGINES as HEAPS
from heap import watched
from tosses import ENGINES as TOSSERS
from tosses import scores

from feeder_sim.measures.statistic import Statistic

MODULES = {
    "plain_mujoco": "mujoco-core",
    "drake_engine": "drake",
    "drake_continuous": "drake",
    "bullet": "pybullet",
    "rapier": "rapier3d",
}
HEADER = ("case", "method", "setting", "value", "se", "n", "wall_s", "cost", "failure", "details")
DEFAULT_WALL_S = {scene.case: scene.default_wall_s for scene in SCENES}
PER_PERIOD, PER_MS, DRIFT_STEPS = (20, 40, 80, 160, 320), (20, 40, 80, 160, 320, 640), (20, 40)
QUICK = (20, 80)
GROUP_STEPS = (10, 40)  # per millisecond
LEAST_HEIGHT = 0.9e-3  # of the centre of a nut that lies flat, 1 mm [m]
THROW_STEPS, THROWS, THROWS_QUICK = 10, 250, 10
SEEDS, SEEDS_QUICK = 16, 2
SECONDS = 40.0  # of wall time that the seeds of one setting may take; slower engines get fewer of them
SLOW_US = 50.0  # a step; from there on there is no time for the finest steps, and for no seeds in a quick run


def plan(case: str, method: Method, *, quick: bool) -> list[tuple[int, int]]:
    """Settings and seeds of a case."""
    slow = method.us_per_step > SLOW_US
    if case == "which_side_up":
        return [(THROW_STEPS, THROWS_QUICK if quick else THROWS)]
    if case in AT_REST:
        return [(steps, 1) for steps in (QUICK if quick else PER_MS[:-2] if slow else PER_MS)]
    if case not in DRIFTS:
        slow = slow and case == "tray"
        return [(steps, 1) for steps in (QUICK if quick or slow else PER_PERIOD)]
    if quick:
        return [] if slow or not method.arrives or case != "drift_8775" else [(DRIFT_STEPS[0], SEEDS_QUICK)]
    if not method.arrives:
        return [(DRIFT_STEPS[0], 1)]
    frequency = float(case.split("_")[1])
    planned = []
    for steps in DRIFT_STEPS:
        seed_s = cases.EXPECTED_S[case] * frequency * steps * method.us_per_step * 1e-6
        planned.append((steps, min(SEEDS, round(SECONDS / seed_s))))
    return [(steps, seeds) for steps, seeds in planned if seeds]


def outcome_of(case: str, method: Method, steps: int, seeds: int) -> Outcome:
    if case in DRIFTS:
        return cases.drift(method, case, steps, seeds)
    if case == "which_side_up":
        return throws.which_side_up(method, steps, seeds)
    single = {
        "bouncing_ball": cases.bouncing_ball,
        "flat_drop": cases.flat_drop,
        "sliding_impact": cases.sliding_impact,
        "sticking_impact": cases.sticking_impact,
        "tray": cases.tray,
    }
    return single[case](method, steps)


def row_of(case: str, method: str, steps: int, seeds: int, outcome: Outcome) -> dict[str, Any]:
    """One line of the table; the cost is over that of the default of this package, which is measured right after."""
    wall = outcome.wall_s / outcome.simulated_s
    statistic = Statistic.of(outcome.values)
    details = outcome.details
    if case in DRIFTS:
        details += f"; {seeds} of {SEEDS} seeds"
    return {
        "case": case,
        "method": method,
        "setting": steps,
        "value": f"{statistic.mean:.5g}" if statistic.n else "",
        "se": f"{se:.3g}" if math.isfinite(se := statistic.se if statistic.n > 1 else outcome.se) else "",
        "n": statistic.n,
        "wall_s": f"{wall:.4g}",
        "cost": f"{wall / DEFAULT_WALL_S[case]():.4g}",
        "failure": "; ".join(sorted(set(outcome.failures))),
        "details": details,
    }


def groups(*, quick: bool) -> Iterator[tuple[str, str, int, Outcome]]:
    """Case, engine, steps per millisecond and outcome of what has a program of its own: tosses, and a heap [%]."""
    measured = read_tosses(DATA)[:: 20 if quick else 1]
    for name, module in TOSSERS.items():
        try:
            engine: Any = importlib.import_module(module)
        except ImportError:
            continue
        for steps in GROUP_STEPS:
            study = scores(measured, engine, steps)
            error = 100.0 * study["median_error_mm"] / study["median_way_mm"]
            yield "tosses", name, steps, Outcome([error], wall_s=study["processor_s_per_s"], simulated_s=1.0)
    for name, build in HEAPS.items():
        for steps in GROUP_STEPS:
            try:
                heap = watched(build(1e-3 / steps), steps)
            except ImportError:
                break
            failures = ["sinks into the plate"] if heap.lowest < LEAST_HEIGHT else []
            values = [] if failures else [heap.largest]
            yield "heap", name, steps, Outcome(values, failures, heap.wall_s, 1.0)


def methods_installed(only: str | None, modules: dict[str, str] = MODULES) -> list[Method]:
    """Methods of the engines that can be imported; `modules` and the packages that they need."""
    found: list[Method] = []
    for module, package in modules.items():
        try:
            found += importlib.import_module(module).METHODS
        except ImportError as error:
            print(f"{package}: skipped, not installed ({error})", file=sys.stderr)
    return [method for method in found if only is None or only.lower() in method.name.lower()]


def main() -> int:
    parser = argparse.ArgumentParser(description="The same physical cases in other engines.")
    parser.add_argument("--out", type=Path, required=True, help="CSV file to write")
    parser.add_argument("--quick", action="store_true", help="fewer settings and seeds")
    parser.add_argument("--only", metavar="NAME", help="methods whose name holds this")
    options = parser.parse_args()
    started = time.perf_counter()
    with options.out.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, HEADER)
        writer.writeheader()

        def note(row: dict[str, Any]) -> None:
            writer.writerow(row)
            file.flush()
            shown = " ".join(f"{row[key]!s:>9}" for key in HEADER[2:8])
            print(f"{row['case']:<15} {row['method']:<21} {shown}  {row['failure']}", file=sys.stderr)

        for method in methods_installed(options.only):
            for case in (*method.cases, *(("tray",) if method.shakes else ())):
                for steps, seeds in plan(case, method, quick=options.quick):
                    note(row_of(case, method.name, steps, seeds, outcome_of(case, method, steps, seeds)))
        for case, name, steps, outcome in groups(quick=options.quick):
            if options.only is None or options.only.lower() in name.lower():
                note(row_of(case, name, steps, 1, outcome))
    print(f"{time.perf_counter() - started:.0f} s", file=sys.stderr)
    return 0


if __name__ == "__main__":
    sys.exit(main())
