"""Many parts: wall time of the separation experiment, MuJoCo beside it, growth with the number of parts, memory.

    python benchmarks/crowd.py [--cycles 10] [--picture growth.png]
    python benchmarks/crowd.py --part FILE.stl

Speed: two seeds of scenarios/separation_100.toml on all cores, and both engines side by side for the first 0.3 s of it.
Growth: nuts on a strip whose area grows with their number, so that each has the same room and the same waves under it.
Part: fifteen parts of a mesh file (in mm) beside as many nuts on the same strip, in turn in one process.
Exits with 1 when a limit is exceeded.
"""

from __future__ import annotations

import argparse
import math
import resource
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

from feeder_sim.run.simulation import Result, simulate
from feeder_sim.scenario import Scenario, load_scenario, with_run
from feeder_sim.scenario.tables import validated

SCENARIO = Path(__file__).parents[1] / "scenarios" / "separation_100.toml"
LIMIT, LARGEST_EXPONENT, LARGEST_MEMORY = 5.0, 1.15, 1e9
COUNTS = (10, 30, 100, 300, 1000)
ROOM_MM2 = 324.0  # per nut, as in the experiment
SHORT_S = 0.3
PARTS, PART_ROOM_MM2, LARGEST_RATIO, ROUNDS, PART_S = 15, 2160.0, 2.0, 7, 1.0  # a plate of 180 x 180 mm


def cost(result: Result) -> float:
    """Wall time per simulated second."""
    return result.wall_s / sum(float(frames.time[-1]) for frames in result.trajectories)


def shortened(scenario: Scenario, engine: str, seeds: int) -> Scenario:
    raw = scenario.model_dump(exclude_none=True)
    raw["schedule"] |= {"cycles": 1, "stage": [raw["schedule"]["stage"][0] | {"duration_s": SHORT_S}]}
    raw["run"] |= {"engine": engine, "seeds": seeds}
    return validated(raw, Scenario, SCENARIO)


def crowd(count: int, duration: float, room_mm2: float = ROOM_MM2, part: Path | None = None) -> Scenario:
    """Nuts, or parts of a mesh file, on a strip of waves of 2646 Hz, 20 um, with equal room for each."""
    side = math.sqrt(count * room_mm2)
    shape = {"shape": "mesh", "file": str(part)} if part else {"shape": "hex_nut", "size": "M2.5"}
    raw: dict[str, Any] = {
        "plate": {"kind": "strip", "thickness_mm": 3.0, "length_mm": side, "width_mm": side},
        "drive": [{"frequency_hz": 2646.0, "amplitude_um": 20.0, "ring_up": False}],
        "part": [shape | {"count": count, "start": {"kind": "scattered"}}],
        "run": {"duration_s": duration, "seeds": 2, "frames_per_second": 100.0},
    }
    return validated(raw, Scenario, SCENARIO)


def growth() -> list[float]:
    """Wall time per simulated second, for each of COUNTS."""
    simulate(crowd(10, 0.02))  # compiled
    found = []
    for count in COUNTS:
        found.append(cost(simulate(crowd(count, 0.5))))
        print(f"  {count:>5} nuts  {found[-1]:8.3f} s of wall time per simulated second", flush=True)
    return found


def compare_part(file: Path) -> float:
    """Processor time of parts of a mesh file over that of nuts: the median of several rounds, in turn."""
    scenarios = {shape: crowd(PARTS, PART_S, PART_ROOM_MM2, part) for shape, part in (("nuts", None), ("parts", file))}
    for scenario in scenarios.values():
        simulate(scenario)  # compiled
    spent: dict[str, list[float]] = {shape: [] for shape in scenarios}
    for seed in range(ROUNDS):
        for shape, scenario in scenarios.items():
            run = scenario.run.model_copy(update={"seed": seed, "seeds": 1})
            begun = time.process_time()
            simulate(scenario.model_copy(update={"run": run}))
            spent[shape].append((time.process_time() - begun) / PART_S)
    for shape, seconds in spent.items():
        print(f"  {PARTS} {shape:<5} {np.median(seconds):7.3f} s of processor time per simulated second")
    return float(np.median(spent["parts"]) / np.median(spent["nuts"]))


def draw(costs: list[float], exponent: float, path: Path) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(5.2, 3.8), layout="constrained")
    axes = figure.add_subplot()
    axes.loglog(COUNTS, costs, "o-", color="#be3434")
    scale = costs[2] / COUNTS[2]
    axes.loglog(COUNTS, [scale * n for n in COUNTS], color="#999999", linestyle="--", label="proportional")
    axes.set(
        xlabel="nuts, at equal room", ylabel="wall time per simulated second (s)", title=f"exponent {exponent:.2f}"
    )
    axes.legend()
    figure.savefig(path, dpi=130)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cycles", type=int, default=10)
    parser.add_argument("--picture", type=Path)
    parser.add_argument("--part", type=Path, help="a mesh file in mm: compare with nuts, and nothing else")
    arguments = parser.parse_args()
    if arguments.part:
        ratio = compare_part(arguments.part.resolve())
        print(f"  ratio {ratio:.2f} (limit {LARGEST_RATIO:g})")
        return 1 if ratio > LARGEST_RATIO else 0
    scenario = load_scenario(SCENARIO)
    simulate(with_run(shortened(scenario, "impulse", 1), seeds=1))  # compiled
    beside = {engine: cost(simulate(shortened(scenario, engine, 2))) for engine in ("impulse", "mujoco")}
    schedule = scenario.schedule
    assert schedule is not None
    whole = scenario.model_copy(update={"schedule": schedule.model_copy(update={"cycles": arguments.cycles})})
    full = cost(simulate(with_run(whole, seeds=2)))
    print(f"{scenario.title}: wall time per simulated second, two seeds on all cores")
    print(f"  {arguments.cycles} cycles, impulse  {full:.2f} s (limit {LIMIT:g})")
    for engine, seconds in beside.items():
        print(f"  first {SHORT_S:g} s, {engine:<8} {seconds:.2f} s")
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    print(f"  memory {1e-6 * memory:.0f} MB (limit {1e-6 * LARGEST_MEMORY:.0f})")
    costs = growth()
    exponent = float(np.polyfit(np.log(COUNTS), np.log(costs), 1)[0])
    print(f"  exponent {exponent:.2f} (limit {LARGEST_EXPONENT:g})")
    if arguments.picture:
        draw(costs, exponent, arguments.picture)
    return 1 if full > LIMIT or exponent > LARGEST_EXPONENT or memory > LARGEST_MEMORY else 0


if __name__ == "__main__":
    sys.exit(main())
