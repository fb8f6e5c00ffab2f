"""The report of a search: the best recipe beside that of the file, with fresh seeds, the trials, and what limits it."""

from __future__ import annotations

import math
import shlex
from collections.abc import Iterator
from pathlib import Path

from feeder_sim.document.document import Block, Folded, Section, Table, Text, Tile
from feeder_sim.document.words import key_label, measure_label, number, split_unit, value_text, with_error
from feeder_sim.jobs.folder import SCENARIO
from feeder_sim.measures.statistic import Statistic, half_interval
from feeder_sim.notebook import counted
from feeder_sim.report.content import Content
from feeder_sim.report.measure_tables import statistic_cells
from feeder_sim.scenario.changes import labels
from feeder_sim.studies.search.optimise import BEST, TRIALS, Search
from feeder_sim.studies.search.space import Parameter
from feeder_sim.studies.sweep.design import Point

MOST_ROWS = 2000  # of the table of the trials
CHECK_HEAD = ("recipe", "mean", "SE", "95 % interval", "n")


def search_content(search: Search, folder: Path) -> Content:
    """What the page of a search has of its own."""
    figures, question = search.figures(search.aim.measure), search.question
    updates = {"trials": max(1, len(search.trials)), "budget_s": None, "screen": None, "recipes": 256}
    usual = type(question).model_fields["check_seeds"].default
    updates |= {"check_seeds": len(search.present.values) if search.present else usual}
    return Content(
        title="Best recipe",
        subtitle=f"Search for the {_aim(search)}: {counted(len(search.trials), 'recipe')} tried over "
        f"{counted(len(search.keys), 'key')}.",
        sections=(
            Section("The best recipe", tuple(_best(search, folder))),
            Section("The course of the search", (*figures, *_trials(search))),
        ),
        command=question.model_copy(update=updates).command(folder / SCENARIO),
        question=(_keys_table(search),),
        tiles=tuple(_tiles(search)),
        notices=tuple(_notices(search)),
        more="A search that began with --screen takes the same way only with that option.",
    )


def _aim(search: Search) -> str:
    """What was searched for, in words."""
    return f"{'largest' if search.aim.largest else 'smallest'} {measure_label(search.aim.measure)}"


def _notices(search: Search) -> Iterator[Text]:
    """What a reader has to know first: that there is no best recipe, or none that is checked."""
    measure = measure_label(search.aim.measure)
    if not search.complete:
        yield Text(
            "The search has not come to its end: no recipe has been checked with fresh seeds. The best of many noisy "
            "means is too good to be true. The same command goes on.",
            "warning",
        )
    elif search.best is None:
        yield Text(f"No recipe has {measure} in all its seeds, so that there is no best one.", "failure")


def _tiles(search: Search) -> Iterator[Tile]:
    """The recipe of the file, the best one, and their difference."""
    unit = split_unit(search.aim.measure)[1]
    for label, checked in (("recipe of the file", search.present), ("best recipe", search.best)):
        if checked is not None and checked.statistic.n:
            yield Tile(label, *_mean_and_note(checked.statistic, unit, "fresh seeds"))
    improvement = search.gain
    if improvement.n > 1:
        text, reach = with_error(improvement.mean, half_interval(improvement.se, improvement.n))
        yield Tile("difference", _signed(text), unit, f"± {reach} (95 %), seed by seed")
    leader = search.leader
    if not search.complete and leader is not None:
        yield Tile("best trial, not checked", *_mean_and_note(leader.statistic, unit, "seeds"))
    stopped = sum(trial.stopped for trial in search.trials)
    yield Tile("recipes tried", str(len(search.trials)), "", f"{stopped} stopped early")


def _mean_and_note(result: Statistic, unit: str, seeds: str) -> tuple[str, str, str]:
    """Value, unit and note of a tile."""
    half = half_interval(result.se, result.n)
    mean, reach = with_error(result.mean, half)
    return (mean, unit, f"± {reach} (95 %), {result.n} {seeds}") if half > 0.0 else (mean, unit, f"{result.n} {seeds}")


def _signed(text: str) -> str:
    return text if text.startswith("-") else f"+{text}"


def _keys_table(search: Search) -> Table:
    """Every key that was changed, and what it could be."""
    rows = [(p.key, split_unit(p.key)[1], _could_be(p)) for p in search.space.parameters]
    return Table("", ("key", "unit", "could be"), tuple(rows))


def _could_be(parameter: Parameter) -> str:
    if parameter.span is None:
        return f"one of {', '.join(_value({'': choice}, '') for choice in parameter.choices)}"
    span = f"{number(parameter.span.low, 6)} to {number(parameter.span.high, 6)}"
    return span + (", whole numbers" if parameter.whole else "") + (", by ratios" if parameter.span.log else "")


def _best(search: Search, folder: Path) -> Iterator[Block]:
    """The best recipe beside that of the file, and both with fresh seeds."""
    leader = search.leader
    best = search.best.point if search.best else leader.point if leader else None
    if best:
        head = "best recipe" if search.best else "best trial, not checked"
        rows = [
            (key, split_unit(key)[1], *(_value(point, key) for point in (search.present_point, best))) for key in best
        ]
        yield Table("", ("key", "unit", "recipe of the file", head), tuple(rows), numbers_from=2)
    if search.present is None:
        return
    recipes = [("recipe of the file", search.present.statistic)]
    recipes += [("best recipe", search.best.statistic)] if search.best else []
    cells: list[tuple[str, ...]] = [(label, *statistic_cells(statistic.as_dict())) for label, statistic in recipes]
    if search.best and search.gain.n:
        mean, *remaining = statistic_cells(search.gain.as_dict())
        cells.append(("difference, seed by seed", _signed(mean), *remaining))
    unit = measure_label(search.aim.measure)
    yield Table(f"{unit[:1].upper()}{unit[1:]} with fresh seeds", CHECK_HEAD, tuple(cells), numbers_from=1)
    yield from _verdict(search)
    if search.best:
        yield Text("This runs the best recipe:")
        yield Text(f"feeder-sim run {shlex.quote(str(folder / BEST))}", "code")


def _value(point: Point, key: str) -> str:
    value = labels({key: point[key]})[key]
    return "" if value is None else value_text(value, 4)


def _verdict(search: Search) -> Iterator[Text]:
    """Whether the best recipe is better, and what its mean in the search was worth."""
    leader = search.leader
    low, high = search.gain.interval
    if math.isnan(low):
        return
    worst_bound = low if search.aim.largest else -high  # the end of the interval towards what is not wanted
    best_bound = high if search.aim.largest else -low
    if search.best_is_present:
        yield Text("No recipe that was tried came out better than that of the file.", "note")
    elif worst_bound > 0.0:
        yield Text(
            "The best recipe is better than that of the file: the interval of the difference leaves 0 out.", "note"
        )
    elif best_bound < 0.0:
        yield Text("With fresh seeds the best recipe is worse than that of the file: it was chosen by luck.", "warning")
    else:
        yield Text(
            "The interval of the difference holds 0: it is not sure that the best recipe is better than that of the "
            "file. More --check-seeds, or more --seeds of a recipe, tell more.",
            "warning",
        )
    first = search.first
    if leader is not None and first is not None and first.number != leader.number:
        yield Text(
            f"Trial {first.number} had a better mean in the search, {number(first.statistic.mean)} over {first.seeds} "
            "seeds. With twice the seeds it came out worse, or a seed had no value.",
            "note",
        )
    if leader is not None:
        mean_then, _ = with_error(leader.statistic.mean, leader.statistic.se)
        yield Text(
            f"In the search it was trial {leader.number}, with a mean of {mean_then} over {leader.seeds} seeds. Chance "
            "has helped to choose it: only the mean with fresh seeds counts.",
            "note",
        )


def _trials(search: Search) -> Iterator[Block]:
    """All trials, folded, as far as a page should hold them."""
    if not search.trials:
        return
    rows = tuple(
        (
            str(trial.number),
            trial.outcome,
            *(_value(trial.point, key) for key in search.keys),
            *(with_error(trial.statistic.mean, trial.statistic.se)),
            str(trial.seeds),
        )
        for trial in search.trials[:MOST_ROWS]
    )
    head = ("trial", "what became of it", *(key_label(key) for key in search.keys), "mean", "SE", "seeds")
    table = Table(measure_label(search.aim.measure), head, rows, numbers_from=2)
    yield Folded(f"All {len(search.trials)} trials", (table,))
    if len(search.trials) > MOST_ROWS:
        yield Text(f"{len(search.trials) - MOST_ROWS} more are not listed here; {TRIALS} has them.", "note")
