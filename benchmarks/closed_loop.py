"""Closed loops: picks per minute of a greedy policy against a fixed schedule, and a nut along a letter.

python benchmarks/closed_loop.py --seeds 12 --map nut.npz
python benchmarks/closed_loop.py --fit 0.03 --seeds 40 --map nut.npz
python benchmarks/closed_loop.py --letter N --seeds 8 --picture docs/figures/letter.png
"""

from __future__ import annotations

import argparse
import time
from functools import partial
from pathlib import Path

import numpy as np

import feeder_sim
from feeder_sim.measures.statistic import Statistic
from feeder_sim.studies.closed_loop.fit import fit_pulses
from feeder_sim.studies.closed_loop.letter import LETTERS, letter_path, letter_scenario, steer
from feeder_sim.studies.closed_loop.prediction import GradientDrift, MapDrift, Prediction
from feeder_sim.studies.closed_loop.separation import SECONDS, SHARE, compare
from feeder_sim.studies.drift_map.files import load_map, save_map
from feeder_sim.studies.drift_map.making import SPEEDS_M_S, make_map, strip_of

FASTEST_M_S = 1.2  # antinodes that the pulses of the separation move
ROOT = Path(__file__).resolve().parent.parent


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=12)
    parser.add_argument("--threads", type=int, default=1, help="of one seed; the result does not depend on them")
    parser.add_argument("--scenario", type=Path, default=ROOT / "scenarios" / "separation_100.toml")
    parser.add_argument("--share", type=float, default=SHARE, help="of the parts, which each policy is to pick")
    parser.add_argument("--seconds", type=float, default=SECONDS, help="on the clock at most")
    parser.add_argument("--letter", choices=sorted(LETTERS), help="steer a nut along it instead")
    parser.add_argument("--fit", type=float, metavar="M_S", help="fit the prediction to random pulses of this speed")
    parser.add_argument("--map", type=Path, help="predict by this drift map of the nut; it is made if it is not there")
    parser.add_argument("--map-seeds", type=int, default=300, help="of each entry of the map")
    parser.add_argument("--plate", type=Path, default=ROOT / "models" / "plate_180" / "modes.h5")
    parser.add_argument("--picture", type=Path, help="of the first seed's way along the letter")
    asked = parser.parse_args()
    if asked.map and not asked.map.exists():
        nut = feeder_sim.load_scenario(asked.scenario)
        save_map(make_map(nut, strip_of(nut), speeds_m_s=(*SPEEDS_M_S, FASTEST_M_S), seeds=asked.map_seeds), asked.map)
    begun = time.perf_counter()
    if asked.fit:
        fit(asked)
    elif asked.letter:
        letter(asked)
    else:
        separation(asked)
    print(f"{time.perf_counter() - begun:.0f} s")


def separation(asked: argparse.Namespace) -> None:
    scenario = feeder_sim.load_scenario(asked.scenario)
    how = {"share": asked.share, "seconds": asked.seconds, "threads": asked.threads}
    predictions = {"greedy by gradient": partial(_prediction, file=None)}
    if asked.map:
        predictions["greedy by map"] = partial(_prediction, file=asked.map)
    found = compare(scenario, range(asked.seeds), predictions=predictions, **how)
    for rate in found.rates:
        print(f"{rate.name:<18} {text(Statistic.of(rate.per_minute.tolist()))} picks per minute, ", end="")
        print(f"{rate.picked.mean():.1f} picked and {rate.lost.mean():.1f} lost in {60.0 * rate.minutes.mean():.1f} s")
    for other in range(len(found.rates) - 1):
        print(f"{found.rates[-1].name} - {found.rates[other].name:<18} {text(found.difference(-1, other))}")


def _prediction(feeder: feeder_sim.Feeder, file: Path | None) -> Prediction:
    """By a drift map, or by the gradient where there is none."""
    return MapDrift(feeder.scene, load_map(file)) if file else GradientDrift(feeder.scene)


def text(value: Statistic) -> str:
    return f"{value.mean:.1f} +- {value.se:.1f} (SE, n = {value.n})"


def fit(asked: argparse.Namespace) -> None:
    found = fit_pulses(asked.plate, asked.fit, asked.seeds, drift_map=load_map(asked.map) if asked.map else None)
    print(
        f"{len(found.way)} pulses of {asked.fit:g} m/s, {found.way_mm:.2f} mm each: share {found.share:.3f}, ", end=""
    )
    print(f"correlation {found.correlation:.3f}, {100.0 * found.left:.0f} % of the way left")


def letter(asked: argparse.Namespace) -> None:
    first = feeder_sim.Feeder(letter_scenario(asked.plate, asked.letter))
    path, prediction = letter_path(asked.letter), _prediction(first, asked.map)
    ways = []
    for seed in range(asked.seeds):
        way = steer(first.again(seed), path, prediction=prediction)
        ways.append(way)
        print(
            f"seed {seed}: {'arrived' if way.arrived else 'gave up'} after {way.time:.1f} s, {len(way.stages)} pulses; "
            f"deviation {way.mean_deviation_mm:.2f} mm, at most {way.largest_deviation_mm:.2f} mm; "
            f"path missed by {way.missed_mm:.2f} mm at most",
            flush=True,
        )
    for name, values in (
        ("mean deviation [mm]", [way.mean_deviation_mm for way in ways]),
        ("largest deviation [mm]", [way.largest_deviation_mm for way in ways]),
        ("path missed [mm]", [way.missed_mm for way in ways]),
        ("time [s]", [way.time for way in ways]),
    ):
        print(f"{name:<24} {np.mean(values):.2f}, {min(values):.2f} to {max(values):.2f}")
    print(f"{ways[0].length_mm:.0f} mm; arrived: {sum(way.arrived for way in ways)} of {len(ways)}")
    if asked.picture:
        from feeder_sim.plots.letter import letter_picture

        letter_picture(first.scene, ways[0], asked.picture)


if __name__ == "__main__":
    main()
