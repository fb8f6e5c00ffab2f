"""Remake the chart of speed against accuracy, the model ladder and the stability maps, with other simulators beside.

    python benchmarks/chart.py [--quick] [--out benchmarks/chart] [--no-peers] [--before COMMIT]

The other simulators (benchmarks/peers) get a virtual environment of their own, .venv-peers, made on the first call.
With --before the chart also shows the default of every case as an older commit of this repository computes it.
Exits with 1 unless the default of every case is on the front of full runs, and is the fastest of them within 5 % on
both drifts; drift maps and older commits do not count there. Takes about half an hour on two cores.
"""

from __future__ import annotations

import argparse
import csv
import json
import math
import os
import subprocess
import sys
import tempfile
import venv
from dataclasses import fields
from pathlib import Path
from typing import Any

from feeder_sim.studies.chart.by_drift_map import NAME as DRIFT_MAP
from feeder_sim.studies.chart.points import ALIKE, PEER_COLUMNS, Point, front, is_default

ROOT = Path(__file__).parents[1]
PEERS = Path(__file__).parent / "peers"
ENVIRONMENT = ROOT / ".venv-peers"
WITHIN_PERCENT = 5.0
REMADE = [f"{part}{end}" for part in ("methods", "ladder", "stability") for end in (".csv", ".json", ".png", ".svg")]
DRIFTS = ("drift_4750", "drift_8775")
OLDER = "default at "  # and the commit


# What the package of any commit is asked for; its rooms have had other names.
DEFAULTS = """
import json, math
try:
    from feeder_sim.studies.chart import cases, methods, points
except ImportError:
    from feeder_sim.chart import cases, methods, points
rows = []
for case in cases.CASES:
    for method in methods.METHODS:
        for setting in method.settings_for(case, quick=False):
            probe = points.Point(case.name, method.name, setting, 0.0, math.nan, 1, 0.0, 0.0, 1.0, "")
            if points.is_default(probe):
                p = (points._ensemble(case, method, setting, case.seeds[0]) if case.by_chance
                    else points._once(case, method, setting))
                rows.append({name: getattr(p, name) for name in ("case", "setting", "n", "failure")}
                    | {name: None if math.isnan(getattr(p, name)) else getattr(p, name)
                       for name in ("value", "se", "wall_s_per_simulated_s")})
print(json.dumps(rows))
"""


def run_peers(table: Path, quick: bool) -> None:
    """Run the other simulators and write their table."""
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
    subprocess.run(
        [str(python), str(PEERS / "run.py"), "--out", str(table), *(["--quick"] if quick else [])], check=True
    )


def default_before(commit: str) -> list[dict[str, Any]]:
    """The default of every case, computed by the package of an older commit, as rows of a table of simulators."""
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder) / "tree"
        git = ["git", "-C", str(ROOT), "worktree"]
        subprocess.run([*git, "add", "--detach", str(tree), commit], check=True, capture_output=True)
        try:
            found = subprocess.run(
                [sys.executable, "-c", DEFAULTS],
                check=True,
                cwd=folder,
                env=os.environ | {"PYTHONPATH": str(tree)},
                stdout=subprocess.PIPE,
                text=True,
            )
        finally:
            subprocess.run([*git, "remove", "--force", str(tree)], check=True, capture_output=True)
    label = {"method": OLDER + commit, "details": "of this package"}
    return [row | label for row in json.loads(found.stdout.splitlines()[-1])]


def broken_claims(rows: list[dict[str, Any]]) -> list[str]:
    """What the chart does not show although it should.

    Full runs count, which answer more than a drift map does, and what can be chosen, not an older commit.
    """
    names = [field.name for field in fields(Point)]
    known: list[dict[str, Any]] = [
        {name: math.nan if row[name] is None else row[name] for name in names} for row in rows
    ]
    points = [Point(**values) for values in known]
    full = [p for p in points if p.valid and p.method != DRIFT_MAP and not p.method.startswith(OLDER)]
    found = []
    for case in dict.fromkeys(point.case for point in points):
        here = [point for point in full if point.case == case]
        default = next((point for point in here if is_default(point)), None)
        if default is None or default not in front(here):
            found.append(f"{case}: the default is not on the front of full runs")
        elif case in DRIFTS:
            near = [p for p in here if p.error_percent <= WITHIN_PERCENT and p.method != default.method]
            ahead = [p for p in near if ALIKE * p.wall_s_per_simulated_s < default.wall_s_per_simulated_s]
            found += [f"{case}: {p.method}, {p.setting} is ahead of the default" for p in ahead]
            if default.error_percent > WITHIN_PERCENT:
                found.append(f"{case}: the default is off by {default.error_percent:.1f} %")
    return found


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="few seeds and coarse maps")
    parser.add_argument("--no-peers", action="store_true", help="the package alone")
    parser.add_argument("--before", metavar="COMMIT", help="also show the default of every case at this commit")
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "chart")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    for name in REMADE:
        (arguments.out / name).unlink(missing_ok=True)
    command = [sys.executable, "-m", "feeder_sim", "chart", "--out", str(arguments.out)]
    others: list[dict[str, Any]] = []
    if not arguments.no_peers:
        run_peers(arguments.out / "peers.csv", arguments.quick)
        with (arguments.out / "peers.csv").open(newline="", encoding="utf-8") as file:
            others += csv.DictReader(file)
    if arguments.before:
        others += default_before(arguments.before)
    with tempfile.TemporaryDirectory() as folder:
        if others:
            table = Path(folder) / "others.csv"
            with table.open("w", newline="", encoding="utf-8") as file:
                writer = csv.DictWriter(file, PEER_COLUMNS)
                writer.writeheader()
                writer.writerows(others)
            command += ["--peers", str(table)]
        if arguments.quick:
            command.append("--quick")
        subprocess.run(command, check=True)
    broken = broken_claims(json.loads((arguments.out / "methods.json").read_text()))
    for claim in broken:
        print(claim, file=sys.stderr)
    return int(bool(broken) and not arguments.quick)


if __name__ == "__main__":
    sys.exit(main())
