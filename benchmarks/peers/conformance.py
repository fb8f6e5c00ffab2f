"""The conformance set: make it, run the engines of this folder on it, judge the results of any engine.

    python benchmarks/peers/conformance.py --results FILE.csv ... [--table FILE.md]
    python benchmarks/peers/conformance.py --run FILE.csv [--quick] [--only NAME] [--table FILE.md]
    python benchmarks/peers/conformance.py --remake
    python benchmarks/peers/conformance.py --check

The first judges results, with exit code 1 if anything is off; the second runs what is installed, and judges that; the
third makes conformance.csv again; the last compares its closed forms with the code.
README.md beside this file states the cases and the format.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from pathlib import Path

sys.path.append(str(Path(__file__).parents[1]))

from conformance_set.cases import CASES
from conformance_set.files import read_results, read_set, write_results, write_set
from conformance_set.judge import Result, table

from feeder_sim.errors import FeederSimError, not_written

FOLDER = Path(__file__).parent
SET = FOLDER / "conformance.csv"


def run(path: Path, cases: Sequence[str], *, quick: bool, only: str | None) -> list[Result]:
    """Run every engine that is installed on some cases; the file grows with each case."""
    sys.path.insert(0, str(FOLDER))
    from conformance_cases import results_of
    from conformance_set.own import NAMES, own_results
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
        where = f"{r.case:<16} {r.quantity:<24} {r.engine:<26} {r.setting:>4}"
        print(f"{time.perf_counter() - began:5.0f} s  {where}  {what}", file=sys.stderr, flush=True)
    return results


def remake() -> None:
    """Compute the ensembles and write the set."""
    from conformance_set.own import remade_rows

    write_set(remade_rows(), SET)


def check() -> int:
    """Compare the rows that need no simulation with the code."""
    from conformance_set.cases import MEASURED, closed_rows, measured_rows, zero_rows

    stored = {(row.case, row.quantity, row.basis): row for row in read_set(SET)}
    wrong = 0
    nothing = dict.fromkeys(MEASURED, 0.0)
    for row in closed_rows() + zero_rows(0.0) + measured_rows(nothing):
        kept = stored.get((row.case, row.quantity, row.basis))
        pairs = [] if kept is None else [(kept.right, row.right), (kept.low, row.low), (kept.high, row.high)]
        if kept is None or any(abs(a - b) > 1e-5 * row.scale for a, b in pairs):
            print(f"{SET.name}: {row.case}, {row.quantity}: differs from the code")
            wrong += 1
    print(f"{wrong} rows differ")
    return int(wrong > 0)


def judge(results: Sequence[Result], target: Path | None) -> int:
    """Print the table, and write it where wanted."""
    text = table(read_set(SET), results)
    print(text, end="")
    if target:
        try:
            target.write_text(text, encoding="utf-8")
        except OSError as error:
            raise not_written(target, error) from error
    return int("**" in text)


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    task = parser.add_mutually_exclusive_group(required=True)
    task.add_argument("--results", type=Path, nargs="+", metavar="FILE", help="judge the results in CSV files")
    task.add_argument("--run", type=Path, metavar="FILE", help="run the engines installed, write and judge")
    task.add_argument("--remake", action="store_true", help="make conformance.csv again")
    task.add_argument("--check", action="store_true", help="compare conformance.csv with the code")
    parser.add_argument("--table", type=Path, metavar="FILE", help="write the table as Markdown, too")
    parser.add_argument("--quick", action="store_true", help="with --run: few settings and seeds, about a minute")
    parser.add_argument("--only", metavar="NAME", help="with --run: engines whose name holds this")
    parser.add_argument("--case", nargs="+", choices=CASES, help="with --run: these cases only")
    options = parser.parse_args(arguments)
    if not options.run and (options.quick or options.only or options.case):
        parser.error("--quick, --only and --case belong to --run")
    if options.table and (options.remake or options.check):
        parser.error("--table belongs to --results or --run")
    try:
        if options.remake:
            remake()
            return 0
        if options.check:
            return check()
        if options.run:
            results = run(options.run, options.case or CASES, quick=options.quick, only=options.only)
        else:
            rows = read_set(SET)
            results = [result for path in options.results for result in read_results(path, rows)]
        return judge(results, options.table)
    except FeederSimError as error:
        print(error, file=sys.stderr)
        return error.exit_code


if __name__ == "__main__":
    sys.exit(main())
