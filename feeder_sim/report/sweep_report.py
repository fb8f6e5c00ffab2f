"""The report of a sweep: what was varied, every measure over it with intervals, all values, and what limits them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from feeder_sim.plots.intervals import COLOURS, half_interval
from feeder_sim.plots.sweep_curves import MOST_CURVES, draw_sweep_curve, draw_sweep_map
from feeder_sim.report.measure_tables import FIRST, TILES, statistic_cells
from feeder_sim.report.page import Block, Folded, Page, Picture, Section, Table, Text, Tile
from feeder_sim.report.pictures import picture_of
from feeder_sim.report.provenance import foot, hash_of, version_rows
from feeder_sim.report.scenario_tables import scenario_blocks
from feeder_sim.report.sweep_folder import ASKED, BASE, Row, Sweep, Value, read_sweep
from feeder_sim.report.words import headed, number, split_unit, with_error, worded
from feeder_sim.scenario import parse_scenario

MOST_PICTURES = 8
MOST_ROWS = 3000  # of all tables of values together; more would make the page too large to mail


def sweep_page(folder: Path, *, progress: Callable[[float], None] | None = None) -> Page:
    """The page of a sweep; `progress` is called with the fraction done.

    Raises:
        InputError: the sweep cannot be read.
    """
    sweep = read_sweep(folder)
    scenario = parse_scenario(sweep.base_text, file=folder / BASE) if sweep.base_text else None
    title = str(
        sweep.asked.get("title")
        or (scenario.title if scenario else "")
        or sweep.asked.get("scenario")
        or folder.resolve().name
    )
    ordered = _ordered(sweep)
    drawn = [measure for measure in ordered if _varies(sweep.of(measure))][:MOST_PICTURES]
    pictures: list[Block] = []
    for i, measure in enumerate(drawn):
        pictures.append(_picture(sweep, measure))
        if progress:
            progress((i + 1) / len(drawn))
    base = scenario_blocks(scenario, sweep.base_text) if scenario else ()
    sections = (
        Section("What was asked", (_keys_table(sweep), *_options(sweep.asked))),
        Section("Curves" if len(sweep.keys) != 2 else "Maps", tuple(pictures)),
        Section("All measures", (_extremes(sweep, ordered), *_values(sweep, ordered))),
        Section("Cautions", tuple(_cautions(sweep, ordered, drawn))),
        Section("The scenario that was varied", base),
        Section("How it was computed, and how to repeat it", _provenance(sweep)),
    )
    return Page(
        title=f"Sweep: {title}",
        subtitle=_subtitle(sweep),
        tiles=tuple(_tiles(sweep, ordered)),
        notices=(),
        sections=tuple(section for section in sections if section.blocks),
        foot=foot(),
    )


def _ordered(sweep: Sweep) -> list[str]:
    """Measures, the most telling ones first, those of single stages last."""
    rank = {name: i for i, name in enumerate(FIRST)}
    return sorted(sweep.measures, key=lambda name: (rank.get(name, len(rank)), "[" in name or "." in name))


def _varies(rows: Sequence[Row]) -> bool:
    return len({row.statistic.mean for row in rows}) > 1


def key_label(key: str) -> str:
    """A key of a scenario as the label of an axis: its path, and its unit in brackets."""
    path, _, last = key.rpartition(".")
    return f"{path}.{headed(last)}" if path else headed(last)


def _value(value: Value) -> str:
    return number(value, 6) if isinstance(value, float) else value


def _at(sweep: Sweep, row: Row) -> str:
    """A point in words."""
    texts = []
    for key, value in zip(sweep.keys, row.point, strict=True):
        name, unit = split_unit(key.rpartition(".")[2])
        texts.append(f"{name} {_value(value)}{f' {unit}' if unit else ''}")
    return ", ".join(texts)


def _subtitle(sweep: Sweep) -> str:
    keys = " and ".join(sweep.keys) if len(sweep.keys) < 3 else f"{len(sweep.keys)} keys"
    points = len(sweep.points)
    return f"{points} point{'s' if points != 1 else ''} over {keys}; a mean over several seeds at each."


def _tiles(sweep: Sweep, ordered: Sequence[str]) -> Iterator[Tile]:
    """Where the most telling measures are largest."""
    for measure in [name for name in ordered if name in FIRST and _varies(sweep.of(name))][:TILES]:
        row = max(sweep.of(measure), key=lambda row: row.statistic.mean)
        label, unit = split_unit(measure)
        mean, half = with_error(row.statistic.mean, half_interval(row.statistic.se, row.statistic.n))
        spread = f"± {half} (95 %), " if half and row.statistic.n > 2 else ""
        text = mean if row.statistic.n > 2 else number(row.statistic.mean)
        yield Tile(f"largest {label}", text, unit, f"{spread}at {_at(sweep, row)}")


def _keys_table(sweep: Sweep) -> Table:
    """Every varied key with its values."""
    rows = []
    for i, key in enumerate(sweep.keys):
        values = list(dict.fromkeys(point[i] for point in sweep.points))
        shown = ", ".join(_value(value) for value in values)
        if len(values) > 12:
            numbers = [value for value in values if isinstance(value, float)]
            shown = f"{_value(min(numbers))} to {_value(max(numbers))}" if numbers else f"{shown[:100]}..."
        rows.append((key, split_unit(key)[1], str(len(values)), shown))
    return Table("", ("varied key", "unit", "values", "which"), tuple(rows))


def _options(asked: Mapping[str, Any]) -> tuple[Block, ...]:
    """What else sweep.toml says."""
    rows = tuple(
        (split_unit(key)[0], worded(value)) for key, value in asked.items() if key not in ("vary", "title", "version")
    )
    return (Table("", ("option", "value"), rows),) if rows else ()


def _picture(sweep: Sweep, measure: str) -> Picture:
    """A measure over the varied keys."""
    rows, label = sweep.of(measure), headed(measure)
    statistics = [row.statistic for row in rows]
    columns = [[row.point[i] for row in rows] for i in range(len(sweep.keys))]
    few = min(range(len(columns)), key=lambda i: len(set(columns[i])))

    def draw_one(figure: Any) -> None:
        axes = figure.add_subplot()
        draw_sweep_curve(axes, columns[0], statistics)
        axes.set(xlabel=key_label(sweep.keys[0]), ylabel=label)

    def draw_family(figure: Any) -> None:
        axes = figure.add_subplot()
        for i, value in enumerate(dict.fromkeys(columns[few])):
            chosen = [k for k, row in enumerate(rows) if row.point[few] == value]
            named = f"{key_label(sweep.keys[few])} = {_value(value)}"
            over = [columns[1 - few][k] for k in chosen]
            draw_sweep_curve(axes, over, [statistics[k] for k in chosen], colour=COLOURS[i % len(COLOURS)], label=named)
        axes.set(xlabel=key_label(sweep.keys[1 - few]), ylabel=label)
        axes.legend(loc="best")

    def draw_map(figure: Any) -> None:
        axes = figure.add_subplot()
        draw_sweep_map(axes, columns[0], columns[1], statistics, label=label)
        axes.set(xlabel=key_label(sweep.keys[0]), ylabel=key_label(sweep.keys[1]))

    def draw_clouds(figure: Any) -> None:
        for i, axes in enumerate(figure.subplots(math.ceil(len(columns) / 3), 3, squeeze=False).ravel()):
            if i >= len(columns):
                axes.set_axis_off()
                continue
            draw_sweep_curve(axes, columns[i], statistics)
            for line in axes.lines:
                line.set_linewidth(0.0)
            axes.set(xlabel=key_label(sweep.keys[i]), ylabel=label if i % 3 == 0 else "")

    intervals = f"{label}: mean over the seeds; bars are 95 % intervals of the mean."
    over = " and ".join(sweep.keys)
    alt = f"{label} over {over}, {len(rows)} points."
    if len(columns) == 1:
        return picture_of(draw_one, height=3.0, alt=alt, caption=intervals)
    if len(columns) == 2 and len(set(columns[few])) <= MOST_CURVES:
        return picture_of(draw_family, height=3.2, alt=alt, caption=intervals)
    if len(columns) == 2:
        widest = max((half_interval(s.se, s.n) for s in statistics if s.n > 1), default=math.nan)
        sure = f" The 95 % intervals are at most ± {number(widest, 2)}." if math.isfinite(widest) else ""
        return picture_of(draw_map, height=4.0, alt=alt, caption=f"{label}: mean over the seeds.{sure} Grey: no value.")
    height = 2.6 * math.ceil(len(columns) / 3)
    return picture_of(draw_clouds, height=height, alt=alt, caption=f"{intervals} Each panel has all points.")


def _extremes(sweep: Sweep, ordered: Sequence[str]) -> Table:
    """Smallest and largest mean of every measure."""
    rows: list[tuple[str, ...]] = []
    for measure in ordered:
        held, (words, unit) = sweep.of(measure), split_unit(measure)
        if not held:
            rows.append((words, unit, "no value", "", "", "", "0"))
            continue
        low, high = (pick(held, key=lambda row: row.statistic.mean) for pick in (min, max))
        cells = [text for row in (low, high) for text in (_with_se(row), _at(sweep, row))]
        rows.append((words, unit, *cells, str(len(held))))
    head = ("measure", "unit", "smallest mean", "at", "largest mean", "at", "points")
    return Table("", head, tuple(rows))


def _with_se(row: Row) -> str:
    mean, se = with_error(row.statistic.mean, row.statistic.se)
    return f"{mean} ± {se}" if se not in ("", "0") else mean


def _values(sweep: Sweep, ordered: Sequence[str]) -> Iterator[Block]:
    """All values, a folded table for each measure, as far as a page should hold them."""
    left = MOST_ROWS
    head = (*(key_label(key) for key in sweep.keys), "mean", "SE", "95 % interval", "n", "failed")
    failed = sweep.failed
    for number_of, measure in enumerate(ordered):
        rows = [row for row in sweep.rows if row.measure == measure]
        left -= len(rows)
        if left < 0:
            yield Text(
                f"The tables of {len(ordered) - number_of} more measures are left out here; sweep.csv has them.", "note"
            )
            return
        cells = tuple(
            (
                *(_value(value) for value in row.point),
                *statistic_cells(row.statistic.as_dict()),
                str(failed.get(row.point, 0)),
            )
            for row in rows
        )
        yield Folded(f"{headed(measure)}: all {len(rows)} points", (Table("", head, cells, len(sweep.keys)),))


def _cautions(sweep: Sweep, ordered: Sequence[str], drawn: Sequence[str]) -> Iterator[Text]:
    """Failures, points without an interval, and what the largest of many means is worth."""
    failed = sweep.failed
    if failed:
        yield Text(
            f"{sum(failed.values())} seeds failed, at {len(failed)} of {len(sweep.points)} points; they do not count "
            "in the means. The tables say where.",
            "failure",
        )
    planned = math.prod(len(entry.get("values", ())) for entry in _vary(sweep.asked)) if _vary(sweep.asked) else 0
    if len(sweep.points) < planned and sweep.asked.get("method", "grid") == "grid":
        yield Text(f"{len(sweep.points)} of {planned} points are there: the sweep has not ended.", "caution")
    alone = sum(row.statistic.n == 1 for row in sweep.rows)
    if alone:
        yield Text(f"{alone} values come from a single seed and have no interval.", "caution")
    if len(sweep.points) > 1:
        yield Text(
            "The largest of many means is too large on average, the smallest too small: check a winner with fresh "
            "seeds (`--seed`) before relying on its value.",
            "note",
        )
    more = len([m for m in ordered if _varies(sweep.of(m))]) - len(drawn)
    if more > 0:
        yield Text(f"{more} more measures that change over the sweep are in the tables only.", "note")


def _vary(asked: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """The varied keys of sweep.toml, as far as it is what it should be."""
    vary = asked.get("vary")
    return [entry for entry in vary if isinstance(entry, Mapping)] if isinstance(vary, list) else []


def _provenance(sweep: Sweep) -> tuple[Block, ...]:
    """Versions, hashes, what was asked word for word, and where the data are."""
    files = [(name, hash_of(sweep.folder / name)) for name in (ASKED, BASE) if (sweep.folder / name).is_file()]
    asked = (sweep.folder / ASKED).read_text(encoding="utf-8") if (sweep.folder / ASKED).is_file() else ""
    blocks: list[Block] = []
    command = sweep.asked.get("command")
    if isinstance(command, str):
        blocks += [Text("This asks the same again:"), Text(command, "code")]
    blocks.append(Table("The sweep", ("what", "value"), (("folder", str(sweep.folder)),)))
    blocks.append(Table("Versions of what made this page", ("library", "version"), version_rows()))
    if files:
        blocks.append(Table("Inputs (SHA-256)", ("input", "hash"), tuple(files)))
    if asked:
        blocks.append(Folded(f"What was asked, word for word ({ASKED})", (Text(asked, "code"),)))
    return tuple(blocks)
