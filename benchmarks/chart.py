"""Run the other simulators (benchmarks/peers) and write the table of their points.

    python benchmarks/chart.py [--quick] [--out benchmarks/chart]

They get a virtual environment of their own, .venv-peers, made on the first call. Writes peers.csv to the folder, with a
row per case, simulator and setting; see benchmarks/peers/README.md. Takes about seven minutes on one core.
"""

from __future__ import annotations

import argparse
import subprocess
import venv
from pathlib import Path

ROOT = Path(__file__).parents[1]
PEERS = Path(__file__).parent / "peers"
ENVIRONMENT = ROOT / ".venv-peers"


def run_peers(table: Path, *, quick: bool) -> None:
    """Run the other simulators and write their table."""
    python = str(ENVIRONMENT / "bin" / "python")
    if not Path(python).exists():
        venv.create(ENVIRONMENT, with_pip=True)
        packages = ["-e", str(ROOT), "-r", str(PEERS / "requirements.txt")]
        subprocess.run([python, "-m", "pip", "install", "--quiet", *packages], check=True)
    few = ["--quick"] if quick else []
    subprocess.run([python, str(PEERS / "run.py"), "--out", str(table), *few], check=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="fewer settings and seeds")
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "chart", help="folder")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    run_peers(arguments.out / "peers.csv", quick=arguments.quick)


if __name__ == "__main__":
    main()
