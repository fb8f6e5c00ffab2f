"""Peak memory and wall time of a recorded run of many short seeds, as the command line runs it.

python benchmarks/many_seeds.py [--seeds 1000 10000] [--duration 0.2]
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from pathlib import Path


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, nargs="+", default=[1000, 10_000])
    parser.add_argument("--duration", type=float, default=0.2, help="of a seed [s]")
    options = parser.parse_args()
    for seeds in options.seeds:
        with tempfile.TemporaryDirectory() as folder:
            words = ["run", "drift_8775hz", "--seeds", str(seeds), "--set", f"run.duration_s={options.duration}"]
            words += ["--set", "run.stop=time", "--json", "--out", str(Path(folder) / "run")]
            started = time.perf_counter()
            with (Path(folder) / "out").open("w") as out:
                place = [(os.POSIX_SPAWN_DUP2, out.fileno(), 1)]
                process = os.posix_spawn(
                    sys.executable, [sys.executable, "-m", "feeder_sim", *words], os.environ, file_actions=place
                )
                _, status, used = os.wait4(process, 0)
            if status:
                raise SystemExit(f"the run ended with {status}")
            wall = time.perf_counter() - started
            print(f"{seeds} seeds of {options.duration:g} s: {wall:.1f} s, {used.ru_maxrss / 1e3:.0f} MB", flush=True)


if __name__ == "__main__":
    main()
