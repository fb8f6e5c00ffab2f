"""The report of uncertain inputs: what each may be, how far results spread, what they hang on, and what limits that."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path

from feeder_sim.document.document import Block, Folded, Section, Table, Text, Tile
from feeder_sim.document.words import between, key_label, measure_label, number, split_unit, value_text
from feeder_sim.errors import InputError
from feeder_sim.report.content import Content
from feeder_sim.report.measure_tables import TELLING, TILES, in_order
from feeder_sim.scenario import Uncertain
from feeder_sim.studies.uncertainty.indices import Index
from feeder_sim.studies.uncertainty.linear_shares import LinearShares
from feeder_sim.studies.uncertainty.uncertainty import DRAWS, Uncertainty, share_table

MOST_COLUMNS = 7  # inputs and measures in the table of the draws; all of them would not fit the page
MOST_ROWS = 2000  # of that table

Linear = dict[str, LinearShares]  # of every measure that has some
Indices = dict[str, list[Index]]  # the same


def uncertainty_content(study: Uncertainty, _: Path) -> Content:
    """What the page of uncertain inputs has of its own."""
    measures, question = in_order(study.measures, study.question.measure or ""), study.question
    main = question.measure if question.measure in measures else study.main()
    indices, trouble = _indices(study, measures)
    linear = {measure: shares for measure in measures if (shares := study.linear_shares(measure))}
    figures = study.figures(main) if main else []
    hints = (Text(f"Sobol indices are not here: computing them {trouble}", "warning"),) if trouble else ()
    inputs, seeds = len(study.scenario.uncertain or {}), question.seeds
    of_each = f"{seeds} seeds" if seeds > 1 else "one seed"
    return Content(
        title="Uncertain inputs",
        subtitle=f"{len(study.draws)} draws of {inputs} uncertain input{'s' if inputs > 1 else ''}, {of_each} of each.",
        sections=(
            Section("Results", (*figures[:1], *_of_measured(study, main))),
            Section("All measures", tuple(_measures(study, measures))),
            Section("What it depends on", (*hints, *figures[1:], *_share_tables(measures, linear, indices))),
            Section("The draws", tuple(_draws(study, measures))),
        ),
        question=(_inputs(study),),
        tiles=tuple(_tiles(study, measures, main)),
        notices=tuple(_notices(study)),
    )


def _indices(study: Uncertainty, measures: Sequence[str]) -> tuple[Indices, str]:
    """Sobol indices where they can be told, and why not where a library is missing."""
    try:
        return {measure: indices for measure in measures if (indices := study.indices(measure))}, ""
    except InputError as error:
        return {}, error.problem


def _notices(study: Uncertainty) -> Iterator[Text]:
    """What a reader has to know first: that it is not whole."""
    if not study.complete:
        requested = len(study.draws) * study.question.seeds
        yield Text(f"{len(study.done)} of {requested} runs are there: the study has not ended.", "warning")
    if study.failed:
        failed = f"{len(study.failed)} of {len(study.done)} runs failed"
        yield Text(f"{failed}. They do not count; the causes are listed under Warnings.", "failure")


def _tiles(study: Uncertainty, measures: Sequence[str], main: str) -> Iterator[Tile]:
    """The measure that is shown, then medians of other telling ones."""
    for measure in [name for name in dict.fromkeys((main, *measures)) if name and name in (main, *TELLING)][:TILES]:
        spread = study.spread(measure)
        label, unit = split_unit(measure)
        note = f"{spread.of_runs} {between(spread.low, spread.high)}"
        if spread.is_separated:
            note += f", of means {between(spread.inputs_low, spread.inputs_high)}"
        yield Tile(f"median {label}", number(spread.median, 3), unit, note)


def _inputs(study: Uncertainty) -> Table:
    """Every uncertain input, and what it may be."""
    rows = [
        (key, split_unit(key)[1], _may_be(uncertain), ", ".join(uncertain.also))
        for key, uncertain in (study.scenario.uncertain or {}).items()
    ]
    with_also = any(row[3] for row in rows)
    head = ("input", "unit", "may be", *(("the same for",) if with_also else ()))
    return Table("", head, tuple(row[: len(head)] for row in rows))


def _may_be(uncertain: Uncertain) -> str:
    """A distribution in words."""
    if uncertain.choice is not None:
        return f"one of {', '.join(value_text(value) for value in uncertain.choice)}"
    if uncertain.normal is not None:
        mean, deviation = (number(value, 6) for value in uncertain.normal)
        return f"{mean} ± {deviation} (normal, one standard deviation)"
    low, high = (number(value, 6) for value in uncertain.ends)
    return f"{low} to {high}, {'every ratio' if uncertain.log_uniform else 'all'} equally likely"


def _of_measured(study: Uncertainty, main: str) -> Iterator[Text]:
    """Where the measured value lies."""
    measured = study.question.measured
    if not main or measured is None:
        return
    spread = study.spread(main)
    runs = [value for row in study.values(main) for value in row]
    below = sum(value < measured for value in runs)
    value = f"{number(measured, 6)} {split_unit(main)[1]}".rstrip()
    interval = f"{spread.of_runs}, {between(spread.low, spread.high)}"
    location = f"within the {interval}" if spread.low <= measured <= spread.high else f"outside of the {interval}"
    yield Text(f"The measured value, {value}, lies {location}; {below} of {len(runs)} runs are below it.", "note")


def _measures(study: Uncertainty, measures: Sequence[str]) -> Iterator[Block]:
    """All measures: median, intervals, scatter over inputs and over seeds apart."""
    if not measures:
        yield Text("No measure has a value.")
        return
    yield Text(
        "90 % of runs: what a single experiment may give, inputs and chance together. 90 % of means: what the mean of "
        "many seeds may be, over the inputs alone; more seeds do not make it narrower. The standard deviations (SD) "
        "are those of the means over the inputs, and of the seeds at the same inputs."
    )
    nested = [measure for measure in measures if "[" in measure or "." in measure]
    yield _table_of(study, [measure for measure in measures if measure not in nested] or nested)
    if 0 < len(nested) < len(measures):
        yield Folded(f"{len(nested)} measures in detail, such as those of stages", (_table_of(study, nested),))


def _table_of(study: Uncertainty, measures: Sequence[str]) -> Table:
    rows = []
    for measure in measures:
        spread = study.spread(measure)
        means = spread.separation_reason or between(spread.inputs_low, spread.inputs_high)
        intervals = number(spread.median, 3), between(spread.low, spread.high), means
        scatter = number(spread.sd_inputs, 2), number(spread.sd_seeds, 2)
        rows.append((measure_label(measure), *intervals, *scatter, str(spread.draws)))
    head = ("measure", "median", "90 % of runs", "90 % of means", "SD over inputs", "SD over seeds", "draws")
    return Table("", head, tuple(rows), numbers_from=1)


def _share_tables(measures: Sequence[str], linear: Linear, indices: Indices) -> Iterator[Block]:
    """Shares of the inputs: of the most telling measure as a table, of the others folded."""
    valued = [m for m in measures if m in linear or m in indices]
    tables = [share_table(measure_label(m), linear.get(m), indices.get(m, [])) for m in valued]
    if not tables:
        return
    text = "Straight line: the share of the variance over the inputs that goes in a straight line with this input. "
    if indices:
        text += (
            "First order: the share that would go if this input were known. Total: the share that would stay if all "
        )
        text += "others were known. "
    yield Text(f"{text}± is half the 95 % interval.")
    yield tables[0]
    if tables[1:]:
        yield Folded(f"{len(tables) - 1} other measures", tuple(tables[1:]))


def _draws(study: Uncertainty, measures: Sequence[str]) -> Iterator[Block]:
    """All runs with the values of their inputs, folded, as far as a page should hold them."""
    keys = list(study.scenario.uncertain or {})
    listed = measures[: max(1, MOST_COLUMNS - len(keys))]
    rows = tuple(
        (
            *(value_text(draw[key], 4) for key in keys),
            str(seed.seed),
            *("failed" if seed.failure else number(seed.values.get(name, math.nan)) for name in listed),
        )
        for draw, seed in study.done[:MOST_ROWS]
    )
    head = (*(key_label(key) for key in keys), "seed", *(measure_label(name) for name in listed))
    yield Folded(f"All {len(study.done)} runs with their inputs", (Table("", head, rows, len(keys)),))
    remaining = [f"{len(study.done) - MOST_ROWS} more runs"] if len(study.done) > MOST_ROWS else []
    remaining += [f"{len(measures) - len(listed)} more measures"] if len(measures) > len(listed) else []
    if remaining:
        yield Text(f"{' and '.join(remaining)} are not listed here; {DRAWS} has them.", "note")
