"""A drift map against full runs: on plates that it was not made from, and where it begins to be wrong.

    python benchmarks/drift_map.py [--map FILE] [--map-seeds 1000] [--seeds 200] [--quick]
        [--only laws plates borders balls] [--pictures FOLDER]

Makes the map of an M2.5 nut on 3 mm of aluminium, unless the file is there. Then tables as docs/drift_map.md has them.
That of balls is made by a map of its own.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from feeder_sim.plots.drift_map import draw_borders, draw_laws
from feeder_sim.run.prepare import prepare
from feeder_sim.scenario import Drive, Scenario, Strip, load_scenario
from feeder_sim.studies.chart.by_drift_map import map_around
from feeder_sim.studies.chart.cases import CASES
from feeder_sim.studies.chart.methods import DEFAULT_STEPS, METHODS
from feeder_sim.studies.chart.points import scenario_of
from feeder_sim.studies.drift_map.borders import BorderPoint, crowds, high_hops_on_plate, high_hops_on_strip, ways
from feeder_sim.studies.drift_map.comparison import (
    compare_gathering,
    compare_passage,
    compare_transport,
    gathering_scenario,
)
from feeder_sim.studies.drift_map.drift_map import DriftMap
from feeder_sim.studies.drift_map.files import load_map, save_map
from feeder_sim.studies.drift_map.making import SEEDS, make_map

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
    drift_map = make_map(nut, Strip(thickness_mm=3.0), seeds=seeds, progress=lambda x: print(f"\r{x:.0%}", end=""))
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
    case = next(case for case in CASES if case.name == "chladni_plate")
    ball = scenario_of(case, METHODS[0], DEFAULT_STEPS)
    print("\n| time (s) | way (mm), full runs | map | spread of full runs (mm) | map |\n|---|---|---|---|---|")
    for at in ways(map_around(prepare(ball), map_seeds), ball, seeds):
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
        strip = high_hops_on_strip(drift_map, scenario("drift_4750hz"), max(12, seeds // 4), note=note)
        print("\nhigh hops, plate at 2646 Hz: | m/s | hop over radius |")
        plate = high_hops_on_plate(drift_map, PLATE, 2 * seeds, note=note)
        print("\ncrowds, plate at 2646 Hz: | parts | |")
        crowd = crowds(drift_map, PLATE, 2 * seeds, note=note)
        if options.pictures:
            draw_borders(strip, plate, crowd, options.pictures / "drift_map_borders.png")


if __name__ == "__main__":
    main()
