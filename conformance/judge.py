"""Judge results of engines by the right values of the conformance set.

    python conformance/judge.py RESULTS.csv ... [--table FILE.md]
    python conformance/judge.py --motion CASE MOTION.csv [--every-step]

The first prints a table of verdicts, with exit code 1 if anything is off; the second prints the quantities of a
recorded motion as lines of such results. README.md beside this file has the formats of both.

A value passes if it lies in the interval, widened by three of its standard errors. Few seeds that happen to be alike
have a standard error that is too small; with `n` it counts as no less than that of n seeds of the ensemble. A value by
chance without a standard error, or with one of more than a twentieth of the scale, decides nothing unless it fails.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from case_files import ConformanceError, Result, Row, not_written, read_results, read_set
from motions import OBSERVERS, observed_file

PASS, OFF, UNDECIDED = "pass", "off", "undecided"
WIDER, UNSURE = 3.0, 0.05  # standard errors that widen the interval; those larger than this, of the scale, say nothing


@dataclass(frozen=True)
class Verdict:
    """A result judged by a row; `deviation` is in percent of the scale."""

    row: Row
    result: Result
    outcome: str
    deviation: float


def judged(row: Row, result: Result) -> Verdict:
    """The verdict on one result."""
    if not math.isfinite(result.value):
        return Verdict(row, result, OFF, math.nan)
    deviation = 100.0 * (result.value - row.right) / row.scale
    se = _standard_error(row, result)
    wider = 0.0 if math.isnan(se) else WIDER * se
    unsure = row.chance and not se <= UNSURE * row.scale
    if row.low - wider <= result.value <= row.high + wider:
        return Verdict(row, result, UNDECIDED if unsure else PASS, deviation)
    return Verdict(row, result, UNDECIDED if row.chance and math.isnan(se) else OFF, deviation)


def _standard_error(row: Row, result: Result) -> float:
    """Of a result, not less than the ensemble's own scatter allows; NaN for none."""
    if not row.chance or not result.n:
        return result.se
    least = row.seed_sd / math.sqrt(result.n)
    return least if math.isnan(result.se) else max(result.se, least)


# --- the table --------------------------------------------------------------------------------------------------------


def column_of(row: Row) -> str:
    """Where a row stands in the table: measurements have columns of their own."""
    return f"{row.case}, measured" if row.basis == "measurement" else row.case


def cell(rows: Sequence[Row], results: Sequence[Result]) -> str:
    """The verdict on one engine over the rows of one column, in words.

    An engine passes from the coarsest setting on from which every finer one passes too, with all quantities. Where its
    finest setting does not, the largest deviation there is given.
    """
    settings = sorted({result.setting for result in results})
    if not settings:
        return "-"
    outcomes = {setting: _at_setting(rows, results, setting) for setting in settings}
    finest = settings[-1]
    word, worst = outcomes[finest]
    if word == PASS:
        coarsest = finest
        for setting in reversed(settings):
            if outcomes[setting][0] != PASS:
                break
            coarsest = setting
        return "pass" if not coarsest else f"pass from {coarsest}" if coarsest < finest else f"pass at {coarsest}"
    at = f" at {finest}" if finest else ""
    if word == UNDECIDED:
        return f"undecided{at}"
    if worst is None:
        return f"**incomplete**{at}"
    if not math.isfinite(worst.deviation):
        return f"**{worst.result.failure or 'no value'}**{at}"
    digits = 0 if abs(worst.deviation) >= 10.0 else 1
    return f"**{worst.deviation:+.{digits}f} %** {worst.row.quantity.replace('_', ' ')}{at}"


def _at_setting(rows: Sequence[Row], results: Sequence[Result], setting: int) -> tuple[str, Verdict | None]:
    """The outcome over all rows at one setting, and the worst verdict; None where a quantity is missing."""
    verdicts = []
    for row in rows:
        found = [r for r in results if r.setting == setting and r.quantity == row.quantity]
        if not found:
            return OFF, None
        verdicts.append(judged(row, found[0]))
    for outcome in (OFF, UNDECIDED):
        those = [verdict for verdict in verdicts if verdict.outcome == outcome]
        if those:
            return outcome, max(those, key=_size)
    return PASS, max(verdicts, key=_size)


def _size(verdict: Verdict) -> float:
    return abs(verdict.deviation) if math.isfinite(verdict.deviation) else math.inf


def table(rows: Sequence[Row], results: Sequence[Result]) -> str:
    """Verdicts as a Markdown table, a row per case and a column per engine."""
    engines = list(dict.fromkeys(result.engine for result in results))
    lines = ["| case | " + " | ".join(engines) + " |", "|---" * (len(engines) + 1) + "|"]
    for column in dict.fromkeys(column_of(row) for row in rows):
        of_case = [row for row in rows if column_of(row) == column]
        cells = [
            cell(of_case, [r for r in results if r.engine == engine and r.case == of_case[0].case])
            for engine in engines
        ]
        lines.append(f"| `{of_case[0].case}`{column.removeprefix(of_case[0].case)} | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def passes(rows: Iterable[Row], results: Sequence[Result], engine: str) -> bool:
    """Whether an engine has results and all of them pass, at every setting."""
    of_quantity: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        of_quantity.setdefault((row.case, row.quantity), []).append(row)
    own = [result for result in results if result.engine == engine]
    verdicts = (judged(row, result) for result in own for row in of_quantity[result.case, result.quantity])
    return bool(own) and all(verdict.outcome == PASS for verdict in verdicts)


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("results", type=Path, nargs="*", metavar="RESULTS.csv", help="results of engines")
    parser.add_argument("--table", type=Path, metavar="FILE.md", help="write the table as Markdown, too")
    parser.add_argument("--motion", nargs=2, metavar=("CASE", "MOTION.csv"), help=f"CASE is {', '.join(OBSERVERS)}")
    parser.add_argument("--every-step", action="store_true", help="the motion has a row right after each impact")
    options = parser.parse_args(arguments)
    if bool(options.results) == bool(options.motion):
        parser.error("either RESULTS.csv or --motion is needed")
    if (options.motion and options.table) or (options.every_step and not options.motion):
        parser.error("--table belongs to RESULTS.csv, --every-step to --motion")
    try:
        if options.motion:
            name, path = options.motion
            numbers = observed_file(name, Path(path), every_step=options.every_step)
            print("case,quantity,value,se,failure")
            for quantity, value in numbers.items():
                print(f"{name},{quantity}," + (f"{value:.6g},," if math.isfinite(value) else ",,thrown off"))
            return 0
        rows = read_set()
        text = table(rows, [result for path in options.results for result in read_results(path, rows)])
        print(text, end="")
        if options.table:
            write_table(text, options.table)
    except ConformanceError as error:
        print(error, file=sys.stderr)
        return 2
    return int("**" in text)


def write_table(text: str, path: Path) -> None:
    """Write verdicts.

    Raises:
        ConformanceError: the file cannot be written.
    """
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise not_written(path, error) from error


if __name__ == "__main__":
    sys.exit(main())
