"""Remake the chart of speed against accuracy, the model ladder and the stability maps, with other simulators beside.

    python benchmarks/chart.py [--quick] [--out benchmarks/chart] [--no-peers]

The other simulators (benchmarks/peers) get a virtual environment of their own, .venv-peers, made on the first call.
Exits with 1 unless the default of every case is on its front, and is the fastest of all methods within 5 % on both
drifts. Takes less than half an hour on two cores.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import venv
from pathlib import Path
from typing import Any

from feeder_sim.studies.chart.points import ALIKE

ROOT = Path(__file__).parents[1]
PEERS = Path(__file__).parent / "peers"
ENVIRONMENT = ROOT / ".venv-peers"
WITHIN_PERCENT = 5.0
REMADE = [f"{part}{end}" for part in ("methods", "ladder", "stability") for end in (".csv", ".json", ".png", ".svg")]
DRIFTS = ("drift_4750", "drift_8775")


def run_peers(out: Path, quick: bool) -> Path:
    """Run the other simulators; returns their table."""
    python = ENVIRONMENT / "bin" / "python"
    if not python.exists():
        venv.create(ENVIRONMENT, with_pip=True)
        install = [
            str(python),
            "-m",
            "pip",
            "install",
            "--quiet",
            "-e",
            str(ROOT),
            "-r",
            str(PEERS / "requirements.txt"),
        ]
        subprocess.run(install, check=True)
    table = out / "peers.csv"
    subprocess.run(
        [str(python), str(PEERS / "run.py"), "--out", str(table), *(["--quick"] if quick else [])], check=True
    )
    return table


def broken_claims(points: list[dict[str, Any]]) -> list[str]:
    """What the chart does not show although it should."""
    found = []
    for case in dict.fromkeys(point["case"] for point in points):
        here = [point for point in points if point["case"] == case and not point["failure"]]
        default = next((point for point in here if point["default"]), None)
        if default is None or not default["on_front"]:
            found.append(f"{case}: the default is not on the front")
        elif case in DRIFTS:
            near = [p for p in here if p["error_percent"] <= WITHIN_PERCENT and p["method"] != default["method"]]
            ahead = [p for p in near if ALIKE * p["wall_s_per_simulated_s"] < default["wall_s_per_simulated_s"]]
            found += [f"{case}: {p['method']}, {p['setting']} is ahead of the default" for p in ahead]
            if default["error_percent"] > WITHIN_PERCENT:
                found.append(f"{case}: the default is off by {default['error_percent']:.1f} %")
    return found


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="few seeds and coarse maps")
    parser.add_argument("--no-peers", action="store_true", help="the package alone")
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "chart")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    for name in REMADE:
        (arguments.out / name).unlink(missing_ok=True)
    command = [sys.executable, "-m", "feeder_sim", "chart", "--out", str(arguments.out)]
    if not arguments.no_peers:
        command += ["--peers", str(run_peers(arguments.out, arguments.quick))]
    if arguments.quick:
        command.append("--quick")
    subprocess.run(command, check=True)
    broken = broken_claims(json.loads((arguments.out / "methods.json").read_text()))
    for claim in broken:
        print(claim, file=sys.stderr)
    return int(bool(broken) and not arguments.quick)


if __name__ == "__main__":
    sys.exit(main())
