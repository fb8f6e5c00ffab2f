"""A drift map against full runs: on plates that it was not made from, and where it begins to be wrong.

    python benchmarks/drift_map.py [--map FILE] [--map-seeds 1000] [--seeds 200] [--quick]
        [--only laws plates borders balls] [--pictures FOLDER]

Makes the map of an M2.5 nut on 3 mm of aluminium, unless the file is there. Then tables as docs/drift_map.md has them.
That of balls is made by a map of its own.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from drift_map_errors import (
    BorderPoint,
    compare_gathering,
    compare_passage,
    compare_transport,
    crowds,
    gathering_scenario,
    high_hops_on_plate,
    high_hops_on_strip,
    map_around,
    steered_ball,
    ways,
)

from feeder_sim.constants import GRAVITY
from feeder_sim.document.figure import empty_figure
from feeder_sim.pool.work import Work
from feeder_sim.scenario import Drive, Scenario, Strip, load_scenario
from feeder_sim.studies.drift_map.drift_map import DriftMap
from feeder_sim.studies.drift_map.files import load_map, save_map
from feeder_sim.studies.drift_map.making import SEEDS, make_map

MIDDLE = slice(8, 20)  # of 24 bins: 30 to 75 degrees from the antinode
NEAR_ANTINODE = slice(0, 6)
COLOURS = ("#3a60be", "#3a8a5a", "#e08a1e", "#be3434", "#7a4aa0", "#555555")


def draw_laws(drift_map: DriftMap, path: Path, *, title: str) -> None:
    """Draw drift and diffusion without units over the velocity amplitude, a curve for each frequency."""
    angle = (np.arange(drift_map.drift.shape[2]) + 0.5) * 0.5 * math.pi / drift_map.drift.shape[2]
    share = drift_map.drift[..., MIDDLE] / np.sin(angle[MIDDLE])
    error = np.sqrt((drift_map.drift_se[..., MIDDLE] ** 2).sum(axis=2)) / share.shape[2]
    spread = 0.5 * (drift_map.along + drift_map.across)[..., NEAR_ANTINODE].mean(axis=2)
    figure = empty_figure(9.0, 4.0)
    left, right = figure.subplots(1, 2)
    for i, frequency in enumerate(drift_map.frequency):
        throws = 2.0 * math.pi * frequency * drift_map.speed / GRAVITY > 1.0
        how = {"color": COLOURS[i % len(COLOURS)], "marker": "o", "markersize": 3, "label": f"{frequency:g} Hz"}
        speed = drift_map.speed[throws]
        left.errorbar(speed, share[i].mean(axis=1)[throws], 2.0 * error[i][throws], capsize=2, **how)
        right.plot(speed, spread[i][throws], **how)
    left.set(xscale="log", ylim=(0.0, 2.0), ylabel="drift / (ω s h/2)", title="30° to 75° from the antinode")
    right.set(xscale="log", yscale="log", ylabel="diffusion D g / V³", title="near the antinode")
    for axes in (left, right):
        axes.set(xlabel="velocity amplitude V of the antinode (m/s)")
        axes.grid(True, alpha=0.3)
    left.legend(fontsize=8)
    figure.suptitle(title)
    figure.savefig(path, dpi=150)


def draw_borders(
    strip: Sequence[BorderPoint], plate: Sequence[BorderPoint], crowd: Sequence[BorderPoint], path: Path
) -> None:
    """Draw the error over the velocity amplitude, and the gathering over time by full runs and by the map."""
    figure = empty_figure(12.0, 4.0)
    error, alone, many = figure.subplots(1, 3)
    for points, label, colour in ((strip, "transport speed, strip", "#3a60be"), (plate, "gathered, plate", "#be3434")):
        speeds = [p.setting for p in points]
        off, se = ([getattr(p.agreement, name) for p in points] for name in ("error_percent", "error_se_percent"))
        error.errorbar(speeds, off, 2.0 * np.array(se), fmt="o-", color=colour, capsize=3, label=label)
    error.axhline(0.0, color="0.6", linewidth=0.8)
    error.set(
        xscale="log", xlabel="velocity amplitude of the highest antinode (m/s)", ylabel="map over full runs - 1 (%)"
    )
    error.set_ylim(-60, 60)
    error.legend(fontsize=8)
    for axes, points, text in ((alone, plate, "{:.2f} m/s"), (many, crowd, "{:.0f} parts")):
        for i, p in enumerate(points):
            if p.gathering is not None:
                colour = COLOURS[i % len(COLOURS)]
                axes.plot(p.gathering.time, p.gathering.full, color=colour, label=text.format(p.setting))
                axes.plot(p.gathering.time, p.gathering.walked, color=colour, linestyle="--")
        axes.set(xlabel="time (s)", ylabel="share within 5 mm of nodal lines", ylim=(0.0, 1.0))
        axes.legend(fontsize=7)
        axes.grid(True, alpha=0.3)
    alone.set_title("one part at a time; dashed: map", fontsize=9)
    many.set_title("many parts at once; dashed: map", fontsize=9)
    figure.savefig(path, dpi=150)


ROOT = Path(__file__).resolve().parents[1]
PLATE = ROOT / "models" / "plate_180" / "modes.h5"
PARTS_OF_SCRIPT = ("laws", "plates", "borders", "balls")
OF_MAP = ("laws", "plates", "borders")


def scenario(name: str) -> Scenario:
    return load_scenario(ROOT / "scenarios" / f"{name}.toml")


def the_map(path: Path, seeds: int) -> DriftMap:
    nut = scenario("drift_4750hz")
    if path.exists():
        return load_map(path, nut, 3e-3)
    drift_map = make_map(
        nut, Strip(thickness_mm=3.0), seeds=seeds, work=Work(progress=lambda x: print(f"\r{x:.0%}", end=""))
    )
    save_map(drift_map, path)
    print(f"\rmade of {drift_map.simulated_s:.0f} simulated s in {drift_map.processor_s:.0f} s of processor time")
    return drift_map


def plates(drift_map: DriftMap, seeds: int) -> None:
    print("| plate | number | full runs | map | map over full runs - 1 | speed-up |\n|---|---|---|---|---|---|")
    few = max(8, seeds // 4)
    strip = compare_transport(drift_map, scenario("transport_strip"), few)
    print(f"| strip of 160 mm, five modes {strip.line()}", flush=True)
    rectangle = compare_transport(drift_map, scenario("transport_rectangle"), few)
    print(f"| 160 x 120 mm, six modes {rectangle.line()}", flush=True)
    ring = compare_passage(drift_map, scenario("drift_2797hz_plate"), seeds)
    print(f"| 180 x 180 mm, ring mode at 2797 Hz {ring.line()}", flush=True)
    drive = Drive(frequency_hz=2646.0, voltage_vpp=20.0)
    gathering = compare_gathering(drift_map, gathering_scenario(PLATE, drive, 4.0), 2 * seeds)
    print(f"| 180 x 180 mm, 2646 Hz, 20 V {gathering.agreement.line()}", flush=True)


def note(point: BorderPoint) -> None:
    lost = ""
    if point.gathering is not None:
        lost = f" lost {100 * point.gathering.full_lost:.1f} %, {100 * point.gathering.walked_lost:.1f} % |"
    print(f"| {point.setting:.3g} | {point.hop:.2f} {point.agreement.line()}{lost}", flush=True)


def balls(map_seeds: int, seeds: int) -> None:
    """A ball that rolls on a plate of silicon; its map is for this drive only."""
    ball = steered_ball()
    print("\n| time (s) | way (mm), full runs | map | spread of full runs (mm) | map |\n|---|---|---|---|---|")
    for at in ways(map_around(ball, map_seeds), ball, seeds):
        print(at.line(), flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--map", type=Path, default=Path("drift_map.npz"), help="made if it is not there")
    parser.add_argument("--map-seeds", type=int, default=SEEDS, help=f"of each entry of the map [{SEEDS}]")
    parser.add_argument("--seeds", type=int, default=200, help="of full runs [200]")
    parser.add_argument("--quick", action="store_true", help="few seeds everywhere: does it all still work?")
    parser.add_argument("--only", nargs="+", choices=PARTS_OF_SCRIPT, default=PARTS_OF_SCRIPT)
    parser.add_argument("--pictures", type=Path, help="folder to draw to")
    options = parser.parse_args()
    seeds = 16 if options.quick else options.seeds
    map_seeds = 20 if options.quick else options.map_seeds
    if "balls" in options.only:
        balls(map_seeds, seeds)
    if not set(OF_MAP) & set(options.only):
        return
    drift_map = the_map(options.map, map_seeds)
    if "laws" in options.only and options.pictures:
        title = "An M2.5 nut on 3 mm of aluminium"
        draw_laws(drift_map, options.pictures / "drift_map_laws.png", title=title)
    if "plates" in options.only:
        plates(drift_map, seeds)
    if "borders" in options.only:
        print("\nhigh hops, strip at 4750 Hz: | m/s | hop over radius |")
        strip = high_hops_on_strip(drift_map, scenario("drift_4750hz"), max(12, seeds // 4), note)
        print("\nhigh hops, plate at 2646 Hz: | m/s | hop over radius |")
        plate = high_hops_on_plate(drift_map, PLATE, 2 * seeds, note)
        print("\ncrowds, plate at 2646 Hz: | parts | |")
        crowd = crowds(drift_map, PLATE, 2 * seeds, note)
        if options.pictures:
            draw_borders(strip, plate, crowd, options.pictures / "drift_map_borders.png")


if __name__ == "__main__":
    main()
