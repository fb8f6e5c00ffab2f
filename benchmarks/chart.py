"""The chart of docs/choosing.md, with every number and picture of that page.

    python benchmarks/chart.py [--quick] [--only own|command|peers|maps|page]

own     the methods of this package on the scenes of chart_scenes.py: own.csv
command the study of one scenario, as `feeder-sim chart` makes it: drift_8775hz.png, .csv
peers   other simulators on those they can be given (benchmarks/peers), in an environment of their own, .venv-peers,
        which the first call makes: peers.csv
maps    where each engine fails (stability_maps.py): stability.csv, stability_ENGINE.png
page    pictures, and the tables of the page, from these files

`--quick` takes few seeds, and writes to a folder chart_quick beside, never to the page. chart.toml says which commit
and machine made the files, and what the engines gave then: tests/unit/test_chart.py says when they give something else.
"""

from __future__ import annotations

import csv
import datetime
import itertools
import platform
import shutil
import subprocess
import sys
import tempfile
import venv
from collections.abc import Iterable, Sequence
from enum import StrEnum
from importlib.metadata import version
from pathlib import Path
from typing import Annotated

import stability_maps
import tomli_w
import typer
from chart_page import draw, own_rows, read_rows, write_page
from chart_scenes import MAPPED, SCENES, STUDY_SEEDS, Row, drift_map_rows, engine_values

from feeder_sim.studies.chart.settings import METHODS

ROOT = Path(__file__).parents[1]
PEERS = Path(__file__).parent / "peers"
ENVIRONMENT = ROOT / ".venv-peers"
NAMES = [scene.name for scene in SCENES]
MADE, SHOWN = "chart.toml", "drift_8775hz"
DISTRIBUTIONS = ("feeder-sim", "mujoco", "numpy", "numba")


class Part(StrEnum):
    """What can be made by itself."""

    OWN = "own"
    COMMAND = "command"
    PEERS = "peers"
    MAPS = "maps"
    PAGE = "page"


def write_own(path: Path, scenes: Sequence[str], *, quick: bool) -> None:
    """Run the methods of this package on scenes; the file grows with each setting, rows of other scenes are kept."""
    rows = [row for row in own_rows(path) if row.scene not in scenes] if path.exists() else []
    made = [scene.rows(quick) for scene in SCENES if scene.name in scenes]
    if MAPPED.keys() & set(scenes):
        made.append(row for row in drift_map_rows(quick) if row.scene in scenes)
    for row in itertools.chain(*made):
        rows.append(row)
        write_rows(sorted(rows, key=lambda row: NAMES.index(row.scene)), path)
        numbers = f"{row.error:8.3g} %  cost {row.cost:6.3g}"
        print(f"{row.scene:<12} {row.method:<11} {row.setting:<20} {numbers}", flush=True)


def run_command(folder: Path, *, quick: bool) -> None:
    """The study of one scenario that the page shows, by the command that it tells."""
    scenario = ROOT / "scenarios" / f"{SHOWN}.toml"
    methods = itertools.chain(*(("--method", method) for method in METHODS))
    with tempfile.TemporaryDirectory() as place:
        arguments = ["--seeds", str(4 if quick else STUDY_SEEDS), *methods, "--out", f"{place}/chart"]
        subprocess.run([sys.executable, "-m", "feeder_sim", "chart", str(scenario), *arguments], check=True)
        for suffix in (".png", ".csv"):
            shutil.copy(Path(place, "chart", f"chart{suffix}"), folder / f"{SHOWN}{suffix}")


def write_rows(rows: Iterable[Row], path: Path) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, Row.__dataclass_fields__, lineterminator="\n")
        writer.writeheader()
        writer.writerows(row.as_dict() for row in rows)


def run_peers(table: Path, *, quick: bool) -> None:
    """Run the other simulators and write their table."""
    python = str(ENVIRONMENT / "bin" / "python")
    if not Path(python).exists():
        venv.create(ENVIRONMENT, with_pip=True)
        packages = ["-e", str(ROOT), "-r", str(PEERS / "requirements.txt")]
        subprocess.run([python, "-m", "pip", "install", "--quiet", *packages], check=True)
    few = ["--quick"] if quick else []
    subprocess.run([python, str(PEERS / "run.py"), "--out", str(table), *few], check=True)


def made() -> dict[str, object]:
    """Commit, day, machine and versions, and what the engines give."""
    commit = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"], cwd=ROOT, check=True, capture_output=True, text=True
    )
    return {
        "commit": commit.stdout.strip(),
        "day": datetime.datetime.now(datetime.UTC).date(),
        "machine": _processor(),
        "python": platform.python_version(),
        "versions": {name: version(name) for name in DISTRIBUTIONS},
        "values": engine_values(),
    }


def _processor() -> str:
    info = Path("/proc/cpuinfo")
    lines = info.read_text(encoding="utf-8").splitlines() if info.exists() else []
    return next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), platform.machine())


def main(
    quick: Annotated[bool, typer.Option("--quick", help="few seeds")] = False,
    scene: Annotated[list[str] | None, typer.Option("--scene", help=f"with `own`, of {', '.join(NAMES)} [all]")] = None,
    only: Annotated[list[Part] | None, typer.Option("--only", help="make these; repeatable [all]")] = None,
) -> None:
    folder = Path(__file__).parent / ("chart_quick" if quick else "chart")
    folder.mkdir(exist_ok=True)
    parts = only or list(Part)
    if Part.OWN in parts:
        (folder / MADE).write_text(tomli_w.dumps(made()), encoding="utf-8")
        write_own(folder / "own.csv", scene or NAMES, quick=quick)
    if Part.COMMAND in parts:
        run_command(folder, quick=quick)
    if Part.PEERS in parts:
        run_peers(folder / "peers.csv", quick=quick)
    if Part.MAPS in parts:
        stability_maps.main(quick=quick, out=folder)
    if Part.PAGE in parts:
        rows = read_rows(folder)
        draw(rows, folder)
        if not quick:
            write_page(rows, folder, ROOT / "docs" / "choosing.md")


if __name__ == "__main__":
    typer.run(main)
