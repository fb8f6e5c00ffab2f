"""Two recorded runs against each other: every measure with the interval of its difference, and what was set otherwise.

With the same seeds in both runs the differences of the values of every seed are taken (paired); else the interval is
that of Welch, with the degrees of freedom of Satterthwaite. Both are Student's t intervals of 95 %. Sources: B. L.
Welch, Biometrika 34 (1947) 28; F. E. Satterthwaite, Biometrics Bulletin 2 (1946) 110.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from feeder_sim.errors import LONGEST_VALUE, InputError, printable, shortened
from feeder_sim.measures.catalogue import values_of_seed
from feeder_sim.measures.statistic import Statistic, half_interval
from feeder_sim.notebook import counted
from feeder_sim.records.recording import Recording
from feeder_sim.records.seed import Status
from feeder_sim.run.recorded_run import RecordedRun
from feeder_sim.scenario import Scenario
from feeder_sim.scenario.engine_choice import TRACKED
from feeder_sim.studies.study import Answer, Record


@dataclass(frozen=True)
class MeasuredRun:
    """A recorded run.

    Attributes:
        path: as it was given.
        scenario: that was run.
        recording: what was recorded.
        values: all measures of every seed; NaN where a seed has no value.
    """

    path: Path
    scenario: Scenario
    recording: Recording
    values: tuple[dict[str, float], ...]

    @property
    def names(self) -> list[str]:
        """Of the measures that at least one seed has a value of, in the order of the summary."""
        finite_names = (name for values in self.values for name, value in values.items() if math.isfinite(value))
        return list(dict.fromkeys(finite_names))

    def of(self, name: str) -> list[float]:
        """One measure of every seed."""
        return [values.get(name, math.nan) for values in self.values]

    @property
    def seeds(self) -> tuple[int, int]:
        """Root of the random numbers, and number of seeds: what makes the seeds of two runs the same."""
        return self.scenario.run.seed, self.scenario.run.seeds

    def count(self, *status: Status) -> int:
        """Number of seeds that ended in one of these ways."""
        return sum(seed_status in status for seed_status in self.recording.status)


def measured_run(path: Path, progress: Callable[[float], None] | None = None) -> MeasuredRun:
    """Read a run folder, or a file that `export` made of it, and measure every seed.

    Raises:
        InputError: it cannot be read, or a file that its scenario reads is missing or no longer the same.
    """
    run = RecordedRun.open(path)
    run.check_inputs()
    try:
        prepared = run.prepared
    except InputError as error:
        raise InputError(error.problem, file=error.file or path, key=error.key) from error
    values = []
    for number, seed in enumerate(run.recording.records):
        values.append(values_of_seed(prepared, seed))
        if progress:
            progress((number + 1) / len(run.recording.records))
    return MeasuredRun(path, run.scenario, run.recording, tuple(values))


@dataclass(frozen=True)
class Difference:
    """The second mean minus the first, of one measure.

    Attributes:
        name: of the measure, with its unit.
        first, second: of the values of the seeds.
        difference: of the means; of pairs of seeds where they are paired. NaN where a run has no value.
        low, high: 95 % interval of it; NaN where there are too few seeds.
        pairs: number of pairs of seeds that both have a value; None where the runs are not paired.
    """

    name: str
    first: Statistic
    second: Statistic
    difference: float
    low: float
    high: float
    pairs: int | None


@dataclass(frozen=True, repr=False)
class Comparison(Answer):
    """Two measured runs.

    Attributes:
        first, second: the runs, with all measures of every seed.
    """

    first: MeasuredRun
    second: MeasuredRun

    @property
    def paired(self) -> bool:
        """Whether the runs have the same seeds; those of a camera are nobody's."""
        is_tracked = TRACKED.name in (self.first.recording.engine, self.second.recording.engine)
        return self.first.seeds == self.second.seeds and not is_tracked

    @cached_property
    def differences(self) -> list[Difference]:
        """Of all measures that both runs have."""
        both = [name for name in self.first.names if name in self.second.names]
        return [difference(name, self.first.of(name), self.second.of(name), paired=self.paired) for name in both]

    @property
    def only(self) -> tuple[list[str], list[str]]:
        """Measures that only the first run has, and those that only the second has."""
        first, second = self.first.names, self.second.names
        return [name for name in first if name not in second], [name for name in second if name not in first]

    @cached_property
    def settings(self) -> dict[str, tuple[Any, Any]]:
        """What differs in the scenarios, by its dotted key; None where a scenario does not have it.

        Files are compared by their content, whatever their names: they differ by the begin of their SHA-256.
        """
        tables = []
        for run in (self.first, self.second):
            table = dict(_flat(run.scenario.model_dump(mode="json", exclude_none=True)))
            table |= {key: f"{Path(table[key]).name} ({sha[:12]})" for key, sha in run.recording.inputs.items()}
            tables.append(table | {"engine in use": run.recording.engine})
        different = _different(*tables)
        inputs = self.first.recording.inputs, self.second.recording.inputs
        return {key: values for key, values in different.items() if key not in inputs[0] or _differ(key, *inputs)}

    @property
    def versions(self) -> dict[str, tuple[Any, Any]]:
        """Libraries, and this package, of which the runs had different versions."""
        return _different(self.first.recording.libraries, self.second.recording.libraries)

    def table(self) -> list[Record]:
        """A row per measure: means, their difference, and its 95 % interval."""
        return [
            {
                "measure": row.name,
                "first": row.first.mean,
                "second": row.second.mean,
                "difference": row.difference,
                "low": row.low,
                "high": row.high,
                "n_first": row.first.n,
                "n_second": row.second.n,
                "pairs": math.nan if row.pairs is None else row.pairs,
            }
            for row in self.differences
        ]

    def _line(self) -> str:
        how = "paired by seed" if self.paired else "Welch"
        settings = counted(len(self.settings), "setting")
        return f"Comparison: {counted(len(self.differences), 'measure')}, {how}; {settings} otherwise"


def difference(name: str, first: list[float], second: list[float], *, paired: bool) -> Difference:
    """The difference of the means of a measure over seeds, and its interval.

    Args:
        name: of the measure.
        first: value of every seed of the first run; NaN where it has none.
        second: of the second run.
        paired: whether the seeds are the same, so that both lists have the same length.
    """
    a, b = (np.array(values, float) for values in (first, second))
    means = Statistic.of(first), Statistic.of(second)
    if paired:
        apart = b - a
        of_pairs = Statistic.of(apart.tolist())
        return Difference(name, *means, of_pairs.mean, *of_pairs.interval, of_pairs.n)
    apart_mean = means[1].mean - means[0].mean
    squares = [statistic.se**2 for statistic in means]
    error = math.sqrt(sum(squares))
    below = sum(square**2 / (statistic.n - 1) for square, statistic in zip(squares, means, strict=True) if square > 0.0)
    half = half_interval(error, 1.0 + (sum(squares) ** 2 / below if below else math.inf))
    return Difference(name, *means, apart_mean, apart_mean - half, apart_mean + half, None)


def _flat(value: Any, key: str = "") -> Iterator[tuple[str, Any]]:
    """Values by dotted keys; lists of numbers and texts stay whole."""
    if isinstance(value, dict):
        for name, entry in value.items():
            yield from _flat(entry, f"{key}.{name}" if key else name)
    elif isinstance(value, list) and value and isinstance(value[0], dict):
        for number, entry in enumerate(value):
            yield from _flat(entry, f"{key}[{number}]")
    else:
        yield key, value


def _different(first: Mapping[str, Any], second: Mapping[str, Any]) -> dict[str, tuple[Any, Any]]:
    keys = dict.fromkeys((*first, *second))
    return {key: (first.get(key), second.get(key)) for key in keys if _differ(key, first, second)}


def _differ(key: str, first: Mapping[str, Any], second: Mapping[str, Any]) -> bool:
    return bool(first.get(key) != second.get(key))


def in_words(comparison: Comparison) -> str:
    """All differences as lines of text."""
    runs = {"first": comparison.first, "second": comparison.second}
    lines = [f"{name:<7} {_described(run)}" for name, run in runs.items()]
    how = "paired by seed" if comparison.paired else "Welch's interval, for the seeds are not the same"
    lines += ["", f"second minus first, 95 % interval, {how}:"]
    longest = max((len(difference.name) for difference in comparison.differences), default=0)
    lines += [f"  {difference.name:<{longest}}  {_numbers(difference)}" for difference in comparison.differences]
    for (name, _), names in zip(runs.items(), comparison.only, strict=True):
        if names:
            lines.append(f"  only the {name} run has: {', '.join(names)}")
    for title, differing in (("settings", comparison.settings), ("versions", comparison.versions)):
        lines += ["", f"{title} that differ:" if differing else f"no {title} differ"]
        lines += [f"  {key}: {_text(values[0])} | {_text(values[1])}" for key, values in differing.items()]
    return "\n".join(lines)


def _described(run: MeasuredRun) -> str:
    seed, n = run.seeds
    seeds = f"{n} seeds from {seed}"
    for name, status in (("unfinished", Status.UNFINISHED), ("failed", Status.DIVERGED)):
        seeds += f", {run.count(status)} {name}" if run.count(status) else ""
    return printable(f"{run.path}: {shortened(run.scenario.title or 'no title')}, {seeds}")


def _numbers(difference: Difference) -> str:
    means = f"{_number(difference.first.mean)} | {_number(difference.second.mean)}"
    if not math.isfinite(difference.difference):
        return f"{means}, no difference can be had"
    text = f"{means}, {difference.difference:+.4g}"
    if math.isfinite(difference.low):
        text += f" ({difference.low:+.4g} to {difference.high:+.4g})"
    else:
        text += " (too few seeds for an interval)"
    n = f"{difference.first.n} and {difference.second.n}" if difference.pairs is None else f"{difference.pairs} pairs"
    return f"{text}, n = {n}"


def _number(value: float) -> str:
    return f"{value:.4g}" if math.isfinite(value) else "none"


def _text(value: Any) -> str:
    return "none" if value is None else shortened(printable(json.dumps(value)), LONGEST_VALUE)
