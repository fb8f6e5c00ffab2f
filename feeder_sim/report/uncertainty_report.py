"""The report of uncertain inputs: what each may be, how far results spread, what they hang on, and what limits that."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from feeder_sim.errors import InputError
from feeder_sim.jobs.folder import SCENARIO
from feeder_sim.report.measure_tables import TELLING, TILES, in_order
from feeder_sim.report.page import Block, Folded, Page, Section, Table, Text, Tile
from feeder_sim.report.provenance import foot, repeated
from feeder_sim.report.scenario_tables import scenario_blocks
from feeder_sim.report.uncertainty_pictures import inputs_picture, shares_picture, spread_picture
from feeder_sim.report.words import between, key_label, measure_label, number, split_unit, value_text
from feeder_sim.scenario import Uncertain
from feeder_sim.studies.study import text_of
from feeder_sim.studies.uncertainty.indices import Index
from feeder_sim.studies.uncertainty.linear_shares import LinearShares
from feeder_sim.studies.uncertainty.uncertainty import DRAWS, TABLE, Uncertainty, UncertaintyQuestion

MOST_COLUMNS = 7  # inputs and measures in the table of the draws; all of them would not fit the page
MOST_ROWS = 2000  # of that table
FEW_DRAWS = 20  # below it not even one draw lies beyond each end of 90 %
FEW_FOR_INDICES = 64  # draws, each (inputs + 2) times
WIDE = 0.3  # of the interval of an index, on each side, that tells nothing apart
MOSTLY = 0.9  # of the variance that straight lines explain where they tell what the result hangs on
MOST_CAUSES = 5  # of failures, one by one

Linear = dict[str, LinearShares]  # of every measure that has some
Indices = dict[str, list[Index]]  # the same


def uncertainty_page(folder: Path, *, progress: Callable[[float], None] | None = None) -> Page:
    """The page of uncertain inputs; `progress` is called with the fraction done.

    Raises:
        InputError: the folder cannot be read.
    """
    tell = progress or (lambda _: None)
    asked, text = Uncertainty.read(folder), text_of(folder / SCENARIO)
    found, question = asked, asked.question
    measures = in_order(found.measures, question.measure or "")
    shown = question.measure if question.measure in measures else found.main()
    indices, trouble = _indices(asked, measures)
    tell(0.3)
    pictures: list[Block] = [spread_picture(found, shown, question.measured)] if shown else []
    tell(0.7)
    hangs: list[Block] = [inputs_picture(found, shown)] if shown else []
    linear = {measure: told for measure in measures if (told := found.linear_shares(measure))}
    if shown in linear or shown in indices:
        hangs.append(shares_picture(linear.get(shown), indices.get(shown, []), shown))
    tell(1.0)
    sections = (
        Section("What was uncertain", (_inputs(asked), _effort(asked))),
        Section("Results", (*pictures, *_of_measured(asked, shown))),
        Section("All measures", tuple(_measures(asked, measures))),
        Section("What it hangs on", (*hangs, *_share_tables(measures, linear, indices))),
        Section("The draws", tuple(_draws(asked, measures))),
        Section("Cautions", tuple(_cautions(asked, shown, linear, indices, trouble)) or (Text("None known."),)),
        Section("The scenario", scenario_blocks(asked.scenario, text)),
        Section(
            "How to repeat it",
            repeated(folder, asked.question.command(folder / SCENARIO), (UncertaintyQuestion.file, DRAWS, TABLE)),
        ),
    )
    return Page(
        title=f"Uncertain inputs: {asked.scenario.title or folder.resolve().name}",
        subtitle=_subtitle(asked),
        tiles=tuple(_tiles(asked, measures, shown)),
        notices=tuple(_notices(asked)),
        sections=tuple(section for section in sections if section.blocks),
        foot=foot(),
    )


def _indices(asked: Uncertainty, measures: Sequence[str]) -> tuple[Indices, str]:
    """Sobol indices where they can be told, and why not where a library is missing."""
    try:
        return {measure: told for measure in measures if (told := asked.indices(measure))}, ""
    except InputError as error:
        return {}, error.problem


def _subtitle(asked: Uncertainty) -> str:
    inputs = len(asked.scenario.uncertain or {})
    seeds = asked.question.seeds
    of_each = f"{seeds} seeds" if seeds > 1 else "one seed"
    return f"{len(asked.draws)} draws of {inputs} uncertain input{'s' if inputs > 1 else ''}, {of_each} of each."


def _notices(asked: Uncertainty) -> Iterator[Text]:
    """What a reader has to know first: that it is not whole."""
    if not asked.complete:
        wanted = len(asked.draws) * asked.question.seeds
        yield Text(f"{len(asked.done)} of {wanted} runs are there: the study has not ended.", "caution")
    if asked.failed:
        yield Text(f"{_of_runs(asked)} failed. They do not count; the causes are listed under Cautions.", "failure")


def _of_runs(asked: Uncertainty) -> str:
    return f"{len(asked.failed)} of {len(asked.done)} runs"


def _tiles(asked: Uncertainty, measures: Sequence[str], shown: str) -> Iterator[Tile]:
    """The measure that is shown, then medians of other telling ones."""
    for measure in [name for name in dict.fromkeys((shown, *measures)) if name and name in (shown, *TELLING)][:TILES]:
        spread = asked.spread(measure)
        label, unit = split_unit(measure)
        note = f"{spread.of_runs} {between(spread.low, spread.high)}"
        if spread.is_told:
            note += f", of means {between(spread.inputs_low, spread.inputs_high)}"
        yield Tile(f"median {label}", number(spread.median, 3), unit, note)


def _inputs(asked: Uncertainty) -> Table:
    """Every uncertain input, and what it may be."""
    rows = [
        (key, split_unit(key)[1], _may_be(uncertain), ", ".join(uncertain.also))
        for key, uncertain in (asked.scenario.uncertain or {}).items()
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


def _effort(asked: Uncertainty) -> Table:
    """How many draws and seeds there are."""
    question, count = asked.question, len(asked.draws)
    draws = f"{count}, a scrambled Sobol sequence"
    if question.indices:
        draws = f"{count} = {question.inputs} x ({len(asked.scenario.uncertain or {})} inputs + 2), for Sobol indices"
    rows = (("draws", draws), ("seeds of each draw", str(question.seeds)), ("runs that are done", str(len(asked.done))))
    return Table("", ("what", "how many"), rows)


def _of_measured(asked: Uncertainty, shown: str) -> Iterator[Text]:
    """Where the measured value lies."""
    measured = asked.question.measured
    if not shown or measured is None:
        return
    spread = asked.spread(shown)
    runs = [value for row in asked.values(shown) for value in row]
    below = sum(value < measured for value in runs)
    value = f"{number(measured, 6)} {split_unit(shown)[1]}".rstrip()
    interval = f"{spread.of_runs}, {between(spread.low, spread.high)}"
    where = f"within the {interval}" if spread.low <= measured <= spread.high else f"outside of the {interval}"
    yield Text(f"The measured value, {value}, lies {where}; {below} of {len(runs)} runs are below it.", "note")


def _measures(asked: Uncertainty, measures: Sequence[str]) -> Iterator[Block]:
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
    yield _table_of(asked, [measure for measure in measures if measure not in nested] or nested)
    if 0 < len(nested) < len(measures):
        yield Folded(f"{len(nested)} measures in detail, such as those of stages", (_table_of(asked, nested),))


def _table_of(asked: Uncertainty, measures: Sequence[str]) -> Table:
    rows = []
    for measure in measures:
        spread = asked.spread(measure)
        means = spread.not_told or between(spread.inputs_low, spread.inputs_high)
        intervals = number(spread.median, 3), between(spread.low, spread.high), means
        scatter = number(spread.sd_inputs, 2), number(spread.sd_seeds, 2)
        rows.append((measure_label(measure), *intervals, *scatter, str(spread.draws)))
    head = ("measure", "median", "90 % of runs", "90 % of means", "SD over inputs", "SD over seeds", "draws")
    return Table("", head, tuple(rows), numbers_from=1)


def _share_tables(measures: Sequence[str], linear: Linear, indices: Indices) -> Iterator[Block]:
    """Shares of the inputs: of the most telling measure as a table, of the others folded."""
    tables = [_share_table(m, linear.get(m), indices.get(m, [])) for m in measures if m in linear or m in indices]
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


def _share_table(measure: str, linear: LinearShares | None, indices: Sequence[Index]) -> Table:
    columns: list[tuple[str, list[str]]] = [("input", [i.key for i in (linear.inputs if linear else indices)])]
    if linear:
        columns.append(("straight line", [_with_interval(i.share, i.interval) for i in linear.inputs]))
    if indices:
        columns.append(("first order", [_with_interval(i.first, i.first_interval) for i in indices]))
        columns.append(("total", [_with_interval(i.total, i.total_interval) for i in indices]))
    rows = list(zip(*(column for _, column in columns), strict=True))
    if linear:
        explained = _with_interval(linear.explained, linear.explained_interval)
        rows.append(("all of them", explained, *("" for _ in columns[2:])))
    return Table(measure_label(measure), tuple(name for name, _ in columns), tuple(rows), numbers_from=1)


def _with_interval(value: float, half: float) -> str:
    return f"{value:.2f} ± {half:.2f}"


def _draws(asked: Uncertainty, measures: Sequence[str]) -> Iterator[Block]:
    """All runs with the values of their inputs, folded, as far as a page should hold them."""
    keys = list(asked.scenario.uncertain or {})
    listed = measures[: max(1, MOST_COLUMNS - len(keys))]
    rows = tuple(
        (
            *(value_text(draw[key], 4) for key in keys),
            str(seed.seed),
            *("failed" if seed.failure else number(seed.values.get(name, math.nan)) for name in listed),
        )
        for draw, seed in asked.done[:MOST_ROWS]
    )
    head = (*(key_label(key) for key in keys), "seed", *(measure_label(name) for name in listed))
    yield Folded(f"All {len(asked.done)} runs with their inputs", (Table("", head, rows, len(keys)),))
    left = [f"{len(asked.done) - MOST_ROWS} more runs"] if len(asked.done) > MOST_ROWS else []
    left += [f"{len(measures) - len(listed)} more measures"] if len(measures) > len(listed) else []
    if left:
        yield Text(f"{' and '.join(left)} are not listed here; {DRAWS} has them.", "note")


def _cautions(asked: Uncertainty, shown: str, linear: Linear, indices: Indices, trouble: str) -> Iterator[Text]:
    """Failures, and what else limits the results."""
    yield from _failures(asked)
    question, found = asked.question, asked
    if question.measure and question.measure != shown:
        yield Text(f"No run has a value of {question.measure}, which was asked for.", "caution")
    few = 2 * question.inputs if question.indices else question.inputs  # that are independent of each other
    if few < FEW_DRAWS:
        text = "few draws: the ends of the 90 % intervals are little more than the smallest and the largest value."
        yield Text(f"These are {text} --inputs asks for more.", "caution")
    if question.seeds == 1:
        yield Text("With one seed of each draw the scatter over inputs and over seeds cannot be told apart.", "caution")
    if shown:
        yield from _cautions_of(asked, shown)
    if shown in linear and linear[shown].explained + linear[shown].explained_interval < MOSTLY:
        text = "does not go in a straight line with the inputs, or they act together: the shares are not all of it."
        yield Text(f"{measure_label(shown)} {text}{'' if question.indices else ' --indices asks for more.'}", "caution")
    if trouble:
        yield Text(f"Sobol indices are not here: computing them {trouble}", "caution")
    elif question.indices and not found.complete:
        yield Text("Sobol indices can be told only when all draws are done.", "note")
    elif question.indices and shown and shown not in indices:
        yield Text(f"{measure_label(shown)} has no Sobol indices: the inputs change it no more than the seeds do, or "
                   "a draw has no value of it.", "caution")  # fmt: skip
    elif shown in indices:
        widest = max(half for i in indices[shown] for half in (i.first_interval, i.total_interval))
        if widest > WIDE:
            more = (
                f"; {FEW_FOR_INDICES} or more --inputs make them narrower" if question.inputs < FEW_FOR_INDICES else ""
            )
            yield Text(f"The intervals of the Sobol indices are wide, up to ± {widest:.2f}{more}.", "caution")
    yield Text(
        "All intervals hold only if the inputs are as uncertain as said above, and independent of each other.", "note"
    )


def _failures(asked: Uncertainty) -> Iterator[Text]:
    """Why runs have failed, the most frequent causes first."""
    causes = Counter(seed.failure for seed in asked.failed).most_common()
    if causes:
        listed = "; ".join(f"{cause} ({n})" if n > 1 else cause for cause, n in causes[:MOST_CAUSES])
        more = f"; and {len(causes) - MOST_CAUSES} more" if len(causes) > MOST_CAUSES else ""
        yield Text(f"{_of_runs(asked)} failed: {listed}{more}.", "failure")


def _cautions_of(asked: Uncertainty, measure: str) -> Iterator[Text]:
    """What limits the measure that is shown."""
    label, spread = measure_label(measure), asked.spread(measure)
    held, ended = sum(len(row) for row in asked.values(measure)), len(asked.done) - len(asked.failed)
    if held < ended:
        text = "have no value, as where a part does not come so far in time. The intervals are those of the others."
        yield Text(f"{label}: {ended - held} of {ended} runs {text}", "caution")
    if spread.not_told:
        yield Text(f"{label}: draws differ no more than seeds of the same draw do. The inputs hardly change it, or "
                   "more seeds are needed to see it.", "note")  # fmt: skip
