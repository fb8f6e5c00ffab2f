"""Run the engines of this project and of this folder on the conformance set, and judge what they give.

    python benchmarks/peers/run_conformance.py --run FILE.csv [--quick] [--only NAME] [--case CASE ...]
    python benchmarks/peers/run_conformance.py --remake

The first runs what is installed; the second makes conformance/cases.csv again, with its ensembles. The set itself, its
format and its judge: conformance/README.md.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from pathlib import Path

sys.path.extend(
    str(Path(__file__).parents[2] / name) for name in ("benchmarks", "benchmarks/validation", "conformance")
)

from case_files import CASES, RIGHT_VALUES, ConformanceError, Result, read_set, write_results, write_set
from judge import table, write_table

from feeder_sim.errors import FeederSimError

FOLDER = Path(__file__).parent


def run(path: Path, cases: Sequence[str], *, quick: bool, only: str | None) -> list[Result]:
    """Run every engine that is installed on some cases; the file grows with each case."""
    sys.path.insert(0, str(FOLDER))
    from conformance_cases import results_of
    from own_engines import NAMES, own_results
    from plans import plan
    from run import MODULES, methods_installed

    results: list[Result] = []
    began = time.perf_counter()
    for engine, name in NAMES.items():
        if only is None or only.lower() in name.lower():
            for case in cases:
                results += _noted(own_results(engine, [case], quick=quick), began)
                write_results(results, path)
    for method in methods_installed(only, MODULES | {"warp_engines": "newton and mujoco-warp"}):
        for case in cases:
            for steps, seeds in plan(case, method, quick=quick):
                results += _noted(results_of(method, case, steps, seeds), began)
                write_results(results, path)
    return results


def _noted(results: list[Result], began: float) -> list[Result]:
    for r in results:
        what = r.failure or f"{r.value:.5g} +- {r.se:.2g}"
        where = f"{r.case:<17} {r.quantity:<24} {r.engine:<26} {r.setting:>4}"
        print(f"{time.perf_counter() - began:5.0f} s  {where}  {what}", file=sys.stderr, flush=True)
    return results


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    task = parser.add_mutually_exclusive_group(required=True)
    task.add_argument("--run", type=Path, metavar="FILE", help="run the engines installed, write and judge")
    task.add_argument("--remake", action="store_true", help="make conformance/cases.csv again")
    parser.add_argument("--table", type=Path, metavar="FILE", help="with --run: write the verdicts as Markdown, too")
    parser.add_argument("--quick", action="store_true", help="with --run: few settings and seeds, about two minutes")
    parser.add_argument("--only", metavar="NAME", help="with --run: engines whose name holds this")
    parser.add_argument("--case", nargs="+", choices=CASES, help="with --run: these cases only")
    options = parser.parse_args(arguments)
    if options.remake and (options.quick or options.only or options.case or options.table):
        parser.error("--quick, --only, --case and --table belong to --run")
    try:
        if options.remake:
            from own_engines import remade_rows

            write_set(remade_rows(), RIGHT_VALUES)
            return 0
        text = table(read_set(), run(options.run, options.case or CASES, quick=options.quick, only=options.only))
        print(text, end="")
        if options.table:
            write_table(text, options.table)
    except FeederSimError as error:
        print(error, file=sys.stderr)
        return error.exit_code
    except ConformanceError as error:
        print(error, file=sys.stderr)
        return 2
    return int("**" in text)


if __name__ == "__main__":
    sys.exit(main())
