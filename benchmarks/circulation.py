"""Which way nuts run on a quasi-travelling wave: circulation over amplitude, for both senses of the wave and none.

    python benchmarks/circulation.py [--seeds 8] [--amplitudes 0.5 1.25 ...] [--phases 90 -90 0] [--picture FILE]

Eight nuts start at places along the track of the crest; their speed along it, counter-clockwise, is the mean over the
last three of four seconds. The amplitude is that at the plate's corner, where it is largest.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

from feeder_sim.measures.circulation import circulation, stage_waves
from feeder_sim.measures.statistic import Statistic
from feeder_sim.plate.wave import Track
from feeder_sim.run.simulation import simulate
from feeder_sim.scenario import Scenario, load_scenario
from feeder_sim.scenario.tables import validated
from feeder_sim.scene.scene import build_scene

SCENARIO = Path(__file__).parents[1] / "scenarios" / "wave_circulation.toml"
AMPLITUDES = [0.5, 1.0, 1.25, 1.5, 1.75, 2.0, 3.0, 5.0]
PLACES = 8
DURATION_S, COUNTED_FROM_S = 4.0, 1.0


def track() -> Track:
    """Of the crest of the scenario's wave."""
    found = stage_waves(build_scene(load_scenario(SCENARIO)))[0].track
    assert found is not None
    return found


def on_track(crest: Track, amplitude: float, phase: float, seeds: int) -> Scenario:
    """Nuts at places along the track, too far apart to meet, on the wave at another amplitude [um] and phase [deg]."""
    raw = load_scenario(SCENARIO).model_dump(exclude_none=True)
    first, second = raw["schedule"]["stage"][0]["drive"]
    first["amplitude_um"] = second["amplitude_um"] = amplitude
    second["phase_deg"] = phase
    raw["schedule"]["stage"][0]["duration_s"] = DURATION_S
    anyhow = {"drop_height_mm": [0.05, 0.3], "yaw_deg": [0.0, 360.0]}
    places = 1e3 * crest.points[:: len(crest.points) // PLACES]
    nut = {"shape": "hex_nut", "size": "M2.5"}
    raw["part"] = [nut | {"start": anyhow | {"position_mm": place.tolist()}} for place in places]
    raw["run"]["seeds"] = seeds
    return validated(raw, Scenario, SCENARIO)


def mean_speed(crest: Track, amplitude: float, phase: float, seeds: int) -> Statistic:
    """Circulation [mm/s] over seeds."""
    seen = simulate(on_track(crest, amplitude, phase, seeds))
    return Statistic.of(
        1e3 * circulation(seen.scene, crest, frames, COUNTED_FROM_S, DURATION_S) for frames in seen.trajectories
    )


def draw(amplitudes: list[float], found: dict[float, list[Statistic]], picture: Path) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.4, 4.0), layout="constrained")
    axes = figure.add_subplot()
    axes.axhline(0.0, color="0.7", linewidth=0.8)
    for (phase, row), colour in zip(found.items(), ("#be3434", "#3a60be", "0.4"), strict=False):
        mean, error = np.array([[s.mean, 1.96 * s.se] for s in row]).T
        axes.errorbar(amplitudes, mean, yerr=error, fmt="o-", markersize=3, color=colour, label=f"{phase:+g} deg")
    axes.set(xscale="log", xlabel="amplitude at the corner (µm)", ylabel="circulation, counter-clockwise (mm/s)")
    axes.set_xticks(amplitudes, [f"{a:g}" for a in amplitudes])
    axes.minorticks_off()
    axes.legend(fontsize=8, title="phase, 95 % intervals", title_fontsize=8)
    figure.savefig(picture, dpi=150)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=8)
    parser.add_argument("--amplitudes", type=float, nargs="+", default=AMPLITUDES)
    parser.add_argument("--phases", type=float, nargs="+", default=[90.0, -90.0, 0.0])
    parser.add_argument("--picture", type=Path)
    arguments = parser.parse_args()
    print("circulation in mm/s, mean +- SE; the crest runs counter-clockwise at +90 degrees\n")
    print("| amplitude (um) | " + " | ".join(f"{phase:+g} deg" for phase in arguments.phases) + " |")
    print("|---" * (1 + len(arguments.phases)) + "|")
    crest = track()
    found: dict[float, list[Statistic]] = {phase: [] for phase in arguments.phases}
    for amplitude in arguments.amplitudes:
        for phase in arguments.phases:
            found[phase].append(mean_speed(crest, amplitude, phase, arguments.seeds))
        cells = [f"{row[-1].mean:+.3f} +- {row[-1].se:.3f}" for row in found.values()]
        print(f"| {amplitude:g} | " + " | ".join(cells) + " |", flush=True)
    if arguments.picture:
        draw(arguments.amplitudes, found, arguments.picture)
    return 0


if __name__ == "__main__":
    sys.exit(main())
