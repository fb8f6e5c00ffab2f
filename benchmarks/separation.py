"""What the picks depend on: the separation experiment with one thing changed at a time.

    python benchmarks/separation.py [--seeds 8] [--cycles 10] [--only NAME ...]
    python benchmarks/separation.py --engines [--seeds 8]

Prints parts picked and lost in all, and in dead positions at the end (mean and standard deviation over the seeds). The
first row is scenarios/separation_100.toml as it stands; nothing is fitted to the measured mean of 70. With --engines
both engines do two cycles of it with 20 nuts instead; exits with 1 when their picks differ by more than three standard
errors.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from feeder_sim.run.simulation import Result, simulate
from feeder_sim.scenario import Scenario, load_scenario
from feeder_sim.scenario.tables import validated

SCENARIO = Path(__file__).parents[1] / "scenarios" / "separation_100.toml"
MEASURED = 70

Change = Callable[[dict[str, Any]], None]


def _contact(**values: float) -> Change:
    return lambda raw: raw["contact"].update(values)


def _stage(number: int, **values: float) -> Change:
    return lambda raw: raw["schedule"]["stage"][number].update(values)


def _voltage(factor: float) -> Change:
    def change(raw: dict[str, Any]) -> None:
        for stage in raw["schedule"]["stage"]:
            for drive in stage["drive"]:
                drive["voltage_vpp"] *= factor

    return change


def _amplitude_at_antinode(raw: dict[str, Any]) -> None:
    """Take the measured amplitude for that of the highest antinode instead of the driven point."""
    for stage, amplitude in zip(raw["schedule"]["stage"], (1.2 * 20.30, 1.2 * 19.70), strict=True):
        stage["drive"] = [{**stage["drive"][0], "amplitude_um": amplitude, "voltage_vpp": None}]


def _no_ring_up(raw: dict[str, Any]) -> None:
    for stage in raw["schedule"]["stage"]:
        stage["drive"] = [{**stage["drive"][0], "ring_up": False}]


def _spread_first(raw: dict[str, Any]) -> None:
    drive = {"frequency_hz": 558.0, "voltage_vpp": 60.0}
    raw["schedule"]["prepare"] = [{"name": "spread", "drive": [drive], "duration_s": 1.0, "pause_s": 0.5}]


def _poured(raw: dict[str, Any]) -> None:
    """Pour the nuts in the middle and let 558 Hz spread them."""
    _spread_first(raw)
    raw["part"] = [{**raw["part"][0], "start": {"kind": "heap", "diameter_mm": 40.0}}]


VARIANTS: dict[str, Change] = {
    "as it stands": lambda raw: None,
    "pause 0.2 s": _stage(1, pause_s=0.2),
    "pause 1.0 s": _stage(1, pause_s=1.0),
    "restitution on the plate 0.1": _contact(restitution=0.1),
    "restitution on the plate 0.4": _contact(restitution=0.4),
    "restitution between parts 0.6": _contact(part_restitution=0.6),
    "friction on the plate 0.2": _contact(friction=0.2),
    "friction on the plate 0.5": _contact(friction=0.5),
    "friction between parts 0.1": _contact(part_friction=0.1),
    "no ring-up": _no_ring_up,
    "amplitude at the antinode": _amplitude_at_antinode,
    "voltage 0.8 times": _voltage(0.8),
    "voltage 1.2 times": _voltage(1.2),
    "pulse 0.07 s": _stage(1, duration_s=0.07),
    "pulse 0.15 s": _stage(1, duration_s=0.15),
    "with a rim": lambda raw: raw["plate"].update(rim=True),
    "spread at 558 Hz first": _spread_first,
    "poured in the middle, spread at 558 Hz": _poured,
    "20 steps per period": lambda raw: raw["run"].update(steps_per_period=20),
    "80 steps per period": lambda raw: raw["run"].update(steps_per_period=80),
    "400 steps per period": lambda raw: raw["run"].update(steps_per_period=400),
}


def changed(change: Change, seeds: int, cycles: int) -> Scenario:
    """The scenario with one thing changed."""
    raw = load_scenario(SCENARIO).model_dump(exclude_none=True)
    raw["run"]["seeds"], raw["schedule"]["cycles"] = seeds, cycles
    raw["schedule"]["stage"] = list(raw["schedule"]["stage"])
    change(raw)
    return validated(_without_none(raw), Scenario, SCENARIO)


def _without_none(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_none(entry) for key, entry in value.items() if entry is not None}
    return [_without_none(entry) for entry in value] if isinstance(value, list | tuple) else value


def row(name: str, result: Result) -> str:
    found = result.measures()
    last = found["stages"][-1]
    cells = [found["picked"], found["lost"], last["dead"]]
    numbers = " | ".join(f"{cell['mean']:.1f} ± {cell['sd'] or 0.0:.1f}" for cell in cells)
    return f"| {name} | {numbers} | {found['picked']['n']} |"


def engines_agree(seeds: int) -> bool:
    """Two cycles with 20 nuts by both engines, side by side."""
    picks = []
    for engine in ("impulse", "mujoco"):

        def change(raw: dict[str, Any], engine: str = engine) -> None:
            raw["part"] = [{**raw["part"][0], "count": 20}]
            raw["run"]["engine"] = engine

        result = simulate(changed(change, seeds, 2))
        print(row(f"20 nuts, 2 cycles, {engine}", result), flush=True)
        picks.append(result.measures()["picked"])
    difference = picks[0]["mean"] - picks[1]["mean"]
    error = math.hypot(picks[0]["se"], picks[1]["se"])
    print(f"\ndifference of the picks {difference:+.1f}, standard error {error:.1f}")
    return abs(difference) <= 3.0 * error


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=8)
    parser.add_argument("--cycles", type=int, default=10)
    parser.add_argument("--only", nargs="+", choices=VARIANTS, default=list(VARIANTS))
    parser.add_argument("--engines", action="store_true")
    arguments = parser.parse_args()
    heading = "| | picked | lost | dead at the end | seeds |\n|---|---|---|---|---|"
    if arguments.engines:
        print(heading)
        return 0 if engines_agree(arguments.seeds) else 1
    print(f"measured: {MEASURED} picked in ten cycles\n\n{heading}")
    for name in arguments.only:
        result = simulate(changed(VARIANTS[name], arguments.seeds, arguments.cycles))
        print(row(name, result), flush=True)
        for failure in result.failures:
            print(f"  {failure}", file=sys.stderr)
    return 0


if __name__ == "__main__":
    sys.exit(main())
