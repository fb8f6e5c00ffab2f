"""Judging results of engines by the rows of the conformance set.

A value passes if it lies in the interval, widened by three of its standard errors. Few seeds that happen to be alike
have a standard error that is too small; with `n` it counts as no less than that of n seeds of the ensemble. A value by
chance without a standard error, or with one of more than a twentieth of the scale, decides nothing unless it fails.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from conformance_set.cases import Row

PASS, OFF, UNDECIDED = "pass", "off", "undecided"
WIDER, UNSURE = 3.0, 0.05  # standard errors that widen the interval; those larger than this, of the scale, say nothing


@dataclass(frozen=True)
class Result:
    """What an engine gave.

    Attributes:
        case, quantity, value: as in the set; NaN where the engine gave none.
        se: standard error; NaN for a value without chance.
        engine: its name.
        setting: steps per period, or per millisecond over a plate at rest; 0 if not said.
        n: number of seeds; 0 if not said.
        failure: why there is no value.
    """

    case: str
    quantity: str
    value: float
    se: float = math.nan
    engine: str = ""
    setting: int = 0
    n: int = 0
    failure: str = ""


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
