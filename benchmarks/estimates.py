"""Whether `feeder-sim check` estimates how long runs take: estimate over wall time, for crowds, meshes and a drift.

    python benchmarks/estimates.py [--only NAME]

Each run is made as the command makes it, with all cores. Exits with 1 when an estimate is off by more than a factor of
two.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from part_meshes import write_meshes

from feeder_sim.run.plan import make_plan
from feeder_sim.run.prepare import prepare
from feeder_sim.run.simulation import simulate
from feeder_sim.scenario import Scenario, load_scenario, with_run
from feeder_sim.scenario.tables import validated

ROOT = Path(__file__).resolve().parents[1]
FACTOR = 2.0
SEEDS, LONG_S = 4, 3.0


def scattered(part: dict[str, Any], title: str) -> Scenario:
    """Fifteen parts on the plate of 180 x 180 mm, driven at 2646 Hz."""
    raw = {
        "title": title,
        "plate": {"kind": "modes", "mode_file": str(ROOT / "models/plate_180/modes.h5")},
        "drive": [{"frequency_hz": 2646.0, "voltage_vpp": 120.0}],
        "part": [part | {"count": 15, "start": {"kind": "scattered"}}],
        "run": {"duration_s": LONG_S, "seeds": SEEDS, "frames_per_second": 100.0},
    }
    return validated(raw, Scenario, ROOT)


def cases(folder: Path) -> list[Scenario]:
    """Different scenarios, some with the meshes in a folder."""
    separation = load_scenario(ROOT / "scenarios" / "separation_100.toml")
    assert separation.schedule is not None
    one_cycle = separation.model_copy(update={"schedule": separation.schedule.model_copy(update={"cycles": 1})})
    drift = load_scenario(ROOT / "scenarios" / "drift_4750hz.toml")
    whole = drift.run.model_copy(update={"stop": "time"})  # else the estimate is an upper bound
    drift = drift.model_copy(update={"title": "drift", "run": whole})
    meshes = write_meshes(folder)
    return [
        with_run(one_cycle.model_copy(update={"title": "separation"}), seeds=2),
        *(scattered({"shape": "mesh", "file": str(file)}, name) for name, file in meshes.items()),
        scattered({"shape": "hex_nut", "size": "M2.5"}, "nuts"),
        drift,
    ]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", help="the case of this name")
    only = parser.parse_args().only
    off = []
    with tempfile.TemporaryDirectory() as folder:
        for scenario in cases(Path(folder)):
            if only and scenario.title != only:
                continue
            prepared = prepare(scenario)
            begun = time.perf_counter()
            plan = make_plan(prepared)
            trial = time.perf_counter() - begun
            needed = simulate(prepared).wall_s
            ratio = plan.estimated_wall_s / needed
            found = (
                f"estimate {plan.estimated_wall_s:7.2f} s (in {trial:.1f} s), run {needed:7.2f} s, ratio {ratio:.2f}"
            )
            print(f"  {scenario.title:<12} {found}", flush=True)
            if not 1.0 / FACTOR <= ratio <= FACTOR:
                off.append(scenario.title)
    return 1 if off else 0


if __name__ == "__main__":
    sys.exit(main())
