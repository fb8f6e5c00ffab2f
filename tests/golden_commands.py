"""Commands whose output is stored in tests/golden, and how it is made again.

    python tests/golden_commands.py FOLDER

runs them all in a new folder, and writes commands.json beside the folders that they leave. The runs are of a ball on a
piston for half a second, whose numbers other processors give to round-off.
"""

from __future__ import annotations

import json
import math
import shutil
import sys
from pathlib import Path
from typing import Any

from command_line import feeder_sim
from conftest import REPOSITORY

GOLDEN = Path(__file__).parent / "golden"
FOLDERS = ("run", "sweep", "uncertainty", "optimise", "map")
COMMANDS = (
    "check ball.toml",
    "check separation_100",
    "run ball.toml --out run",
    "run ball.toml --out other --set drive[0].amplitude_um=240",
    "run ball.toml --dry-run",
    "compare run other",
    "report run --out run.html",
    "sweep ball.toml --vary drive[0].amplitude_um=200,240 --inputs 2 --out sweep",
    "report sweep --out sweep.html",
    "uncertainty ball.toml --inputs 4 --indices --out uncertainty",
    "report uncertainty --out uncertainty.html",
    "optimise ball.toml --maximise flight_height_mm --over drive[0].amplitude_um=200:260 --trials 4 --check-seeds 4 "
    "--out optimise",
    "report optimise --out optimise.html",
    "map drift_8775hz --frequency 8775 --amplitude 1 --seeds 2 --set run.duration_s=0.2 --out map",
    "modes MODELS/plate_180/modes.h5",
    "modes MODELS/plate_180_piezos/modes.h5 --volts 100 --near 0,0",
    "response MODELS/plate_180_piezos/modes.h5 --actuator front --from 2000 --to 3500",
    "sequence MODELS/strip_160/plate.toml --from -75 --to 0",
    "wave wave_gather",
    "part MODELS/screw/screw.stl --drops 0",
    "list",
    "new made",
)
# What differs from one run, machine or version to the next.
VARYING = (
    "wall",
    "time_left",
    "seconds",
    "versions",
    "libraries",
    "created",
    "cost",
    "processor",
    "size",
    "estimate",
    "real_time",
    "bytes",
)


def outputs(folder: Path) -> dict[str, Any]:
    """Run all commands in a folder; what each prints as JSON."""
    shutil.copy(GOLDEN / "ball.toml", folder)
    found = {}
    for command in COMMANDS:
        words = command.replace("MODELS", str(REPOSITORY / "models")).split()
        done = feeder_sim(*words, "--json", cwd=folder)
        assert done.returncode == 0, (command, done.stderr)
        found[command] = lasting(json.loads(done.stdout), str(folder))
    return found


def lasting(value: Any, folder: str) -> Any:
    """JSON without what varies, and without the paths of a folder and of the repository."""
    if isinstance(value, dict):
        kept = (key for key in value if not any(word in key for word in VARYING))
        return {lasting(key, folder): lasting(value[key], folder) for key in kept}
    if isinstance(value, list):
        return [lasting(each, folder) for each in value]
    return value.replace(folder, "FOLDER").replace(str(REPOSITORY), "HERE") if isinstance(value, str) else value


def differences(now: Any, then: Any, at: str = "") -> list[str]:
    """Where two JSON values differ by more than round-off."""
    if isinstance(now, dict) and isinstance(then, dict):
        other = [f"{at}.{key}: only one has it" for key in now.keys() ^ then.keys()]
        return other + [d for key in now.keys() & then.keys() for d in differences(now[key], then[key], f"{at}.{key}")]
    if isinstance(now, list) and isinstance(then, list) and len(now) == len(then):
        return [d for i, (a, b) in enumerate(zip(now, then, strict=True)) for d in differences(a, b, f"{at}[{i}]")]
    numbers = all(isinstance(v, int | float) and not isinstance(v, bool) for v in (now, then))
    if numbers and math.isclose(now, then, rel_tol=1e-6, abs_tol=1e-9):
        return []
    return [] if now == then else [f"{at}: {now!r}, was {then!r}"]


def main() -> None:
    folder = Path(sys.argv[1]).resolve()
    folder.mkdir()
    (GOLDEN / "commands.json").write_text(json.dumps(outputs(folder), indent=1, sort_keys=True) + "\n")
    for name in FOLDERS:
        shutil.rmtree(GOLDEN / name, ignore_errors=True)
        shutil.copytree(folder / name, GOLDEN / name, ignore=shutil.ignore_patterns("*.png", "*.rrd", ".lock*"))


if __name__ == "__main__":
    main()
