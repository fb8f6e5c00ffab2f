"""A scenario with uncertain inputs: its measures with intervals over the inputs and over the seeds, apart.

The folder holds

    uncertainty.toml    what was asked
    scenario.toml       the scenario, with all its defaults
    journal.jsonl       measures of every seed that is done
    draws.csv           one row per draw and seed: the inputs, then the measures
    uncertainty.csv     one row per measure, see `COLUMNS`
    inputs.csv          one row per measure and input: on which inputs it hangs, see `SHARES`
    uncertainty.png     a picture of one measure
"""

from __future__ import annotations

import csv
import io
import math
import threading
import tomllib
from collections.abc import Callable, Sequence
from dataclasses import astuple, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from feeder_sim.errors import InputError, quoted
from feeder_sim.jobs.folder import WorkFolder
from feeder_sim.jobs.workers import Workers
from feeder_sim.measures.statistic import Statistic, finite_or_none
from feeder_sim.scenario import Scenario
from feeder_sim.studies.sweep.case import Effort
from feeder_sim.studies.sweep.cases import Cases, Sweep, run_cases
from feeder_sim.studies.sweep.design import labels
from feeder_sim.studies.sweep.table import main_measure
from feeder_sim.studies.uncertainty.draws import Draw, draws_of
from feeder_sim.studies.uncertainty.indices import Index, saltelli_draws, sobol_indices
from feeder_sim.studies.uncertainty.linear_shares import LinearShares, linear_shares
from feeder_sim.studies.uncertainty.spread import Spread, spread_of

QUESTION, DRAWS, TABLE, PICTURE = "uncertainty.toml", "draws.csv", "uncertainty.csv", "uncertainty.png"
INPUTS = "inputs.csv"
# low, high: 90 % interval of one run, inputs and seeds together; inputs_low, inputs_high: of the mean over the seeds,
# empty where sd_inputs is 0 because the inputs are not told apart from the seeds.
COLUMNS = (
    *("measure", "mean", "se", "median", "low", "high", "inputs_low", "inputs_high", "sd_inputs", "sd_seeds"),
    *("draws", "failed"),
)
# Shares of the variance over the inputs, each with half its 95 % interval; empty where they are not told.
SHARES = (
    *("measure", "input", "linear", "linear_interval"),
    *("first_order", "first_order_interval", "total", "total_interval"),
)


@dataclass(frozen=True)
class Propagation:
    """What uncertain inputs come to.

    Attributes:
        scenario: with the uncertain inputs.
        draws: values of the inputs.
        swept: one case per draw.
        saltelli: whether the draws are such that indices can be told.
    """

    scenario: Scenario
    draws: tuple[Draw, ...]
    swept: Sweep
    saltelli: bool

    @cached_property
    def measures(self) -> tuple[str, ...]:
        """Names of all measures that have a value."""
        names = dict.fromkeys(n for case in self.swept.cases for seed in case.done.values() for n in seed.values)
        return tuple(name for name in names if self.spread(name).draws)

    def values(self, measure: str) -> list[list[float]]:
        """The values of a measure: of the seeds of each draw; those that have none left out."""
        effort = self.swept.cases.effort
        rows = [[seed.values.get(measure, math.nan) for seed in case.seeds(effort)] for case in self.swept.cases]
        return [[value for value in row if math.isfinite(value)] for row in rows]

    def spread(self, measure: str) -> Spread:
        """How far a measure spreads."""
        return spread_of(self.values(measure))

    def linear_shares(self, measure: str) -> LinearShares | None:
        """What a straight line in each input explains of a measure; None where that cannot be told."""
        group = len(self.scenario.uncertain or {}) + 2 if self.saltelli else 1
        return linear_shares(self.scenario, self.draws, self.values(measure), group)

    def indices(self, measure: str) -> list[Index]:
        """Sobol indices of a measure by every input; empty where they cannot be told."""
        if not (self.saltelli and self.swept.complete):
            return []
        found = sobol_indices(self.scenario, self.values(measure))
        return [index for index in found if math.isfinite(index.total)]

    @cached_property
    def shares(self) -> list[dict[str, Any]]:
        """A row per measure and input: on which inputs it hangs, by column; see `SHARES`."""
        return [row for measure in self.measures for row in self._shares_of(measure)]

    def _shares_of(self, measure: str) -> list[dict[str, Any]]:
        linear, indices = self.linear_shares(measure), {index.key: index for index in self.indices(measure)}
        rows = []
        for place, key in enumerate(self.scenario.uncertain or {}):
            line, index = linear.inputs[place] if linear else None, indices.get(key)
            numbers = (line.share, line.interval) if line else (math.nan,) * 2
            numbers += astuple(index)[1:] if index else (math.nan,) * 4
            finite = [finite_or_none(value) for value in numbers]
            rows.append(dict(zip(SHARES, (measure, key, *finite), strict=True)))
        return rows

    def main(self) -> str:
        """The measure to show where none is asked for."""
        return main_measure(self.measures, self.swept.rows)

    def rows(self) -> list[dict[str, Any]]:
        """The table: one row per measure, by column."""
        failed = sum(bool(s.failure) for case in self.swept.cases for s in case.seeds(self.swept.cases.effort))
        rows = []
        for measure in self.measures:
            spread, mean = self.spread(measure), Statistic.of(v for row in self.values(measure) for v in row).mean
            numbers = {"mean": mean} | {name: getattr(spread, name) for name in COLUMNS[2:10]}
            finite = {name: finite_or_none(value) for name, value in numbers.items()}
            rows.append({"measure": measure} | finite | {"draws": spread.draws, "failed": failed})
        return rows


def propagate(
    scenario: Scenario,
    *,
    inputs: int,
    seeds: int,
    indices: bool,
    workers: Workers,
    measure: str = "",
    journal: Path | None = None,
    stop: threading.Event | None = None,
    progress: Callable[[float], None] | None = None,
) -> Propagation:
    """Run a scenario at many draws of its uncertain inputs, each with seeds of its own.

    Args:
        scenario: with uncertain inputs.
        inputs: draws; with `indices` so many times (inputs + 2), a power of two.
        seeds: of every draw; two tell inputs and seeds apart, and `indices` take them.
        indices: draw them so that Sobol indices can be told.
        workers: run the seeds.
        measure: that every seed has to have; "" for any.
        journal: what is in it counts as done.
        stop: set it to end.
        progress: called with the share that is done.

    Raises:
        InputError: no input is uncertain, a value is not allowed, or SALib is missing.
    """
    check_propagated(scenario, inputs, seeds, indices)
    draws = saltelli_draws(scenario, inputs) if indices else draws_of(scenario, inputs)
    cases = Cases.at(scenario, [{}], draws, Effort(seeds, measure=measure), file=Path("scenario"))
    swept = run_cases(cases, workers, journal, stop=stop, progress=progress)
    return Propagation(scenario, tuple(draws), swept, indices)


def check_propagated(scenario: Scenario, inputs: int, seeds: int, indices: bool) -> None:
    """Refuse what cannot be propagated, before anything is written.

    Raises:
        InputError: as for `propagate`.
    """
    if not scenario.uncertain:
        raise InputError("is missing, allowed is a table with the inputs that are uncertain", key="[uncertain]")
    if indices and inputs & (inputs - 1):
        raise InputError(f"is {inputs}, allowed is a power of two with indices", argument="inputs")
    if indices and seeds < 2:
        problem = "is 1, allowed is 2 or more with indices: one seed does not tell how far seeds scatter"
        raise InputError(problem, argument="seeds")
    if indices:
        saltelli_draws(scenario, 2)  # refuses a library that is missing


def asked_in(folder: Path) -> int | None:
    """How many draws were asked for in a folder; None where nothing was.

    Raises:
        InputError: the file that says it cannot be read.
    """
    file = folder / QUESTION
    try:
        inputs = tomllib.loads(file.read_text(encoding="utf-8"))["inputs"]
    except (FileNotFoundError, NotADirectoryError):
        return None
    except (OSError, ValueError, KeyError) as error:
        raise InputError(f"does not say what was asked: {error}", file=file) from error
    if type(inputs) is not int or inputs < 2:
        raise InputError(f"is {quoted(inputs)}, allowed is a whole number of at least 2", file=file, key="inputs")
    return inputs


def write_propagation(folder: WorkFolder, found: Propagation) -> None:
    """Write the tables in place of those before."""
    folder.write(TABLE, _csv(COLUMNS, found.rows()).encode())
    folder.write(INPUTS, _csv(SHARES, found.shares).encode())
    rows = []
    for draw, case in zip(found.draws, found.swept.cases, strict=True):
        for seed in case.seeds(found.swept.cases.effort):
            values = {name: finite_or_none(value) for name, value in seed.values.items()}
            rows.append(labels(draw) | {"seed": seed.seed} | values)
    keys = [*found.draws[0], "seed", *found.measures]
    folder.write(DRAWS, _csv(keys, rows).encode())


def _csv(columns: Sequence[str], rows: Sequence[dict[str, Any]]) -> str:
    text = io.StringIO()
    writer = csv.DictWriter(text, columns, lineterminator="\n", extrasaction="ignore")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()
