"""The command `compare`: two recorded runs, measure by measure, and what was set otherwise in them."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from feeder_sim.cli.terminal import progress_bar
from feeder_sim.errors import LONGEST_VALUE, printable, shortened

if TYPE_CHECKING:
    from feeder_sim.studies.compare import Comparison, Difference, MeasuredRun

Run = Annotated[Path, typer.Argument(help="Run folder, or its trajectory.h5.", show_default=False)]


def compare(
    first: Run,
    second: Run,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout.")] = False,
) -> None:
    """Compare two recorded runs: differences of all measures with 95 % intervals, of settings and of versions."""
    from feeder_sim.studies.compare import Comparison, measured_run

    with progress_bar("measuring the seeds") as progress:
        runs = [
            measured_run(path, lambda done, before=number: progress(0.5 * (before + done)))  # type: ignore[misc]
            for number, path in enumerate((first, second))
        ]
    comparison = Comparison(*runs)
    print(json.dumps(_as_json(comparison)) if as_json else _in_words(comparison))


def _as_json(comparison: Comparison) -> dict[str, Any]:
    only = comparison.only
    return {
        "first": _run_as_json(comparison.first),
        "second": _run_as_json(comparison.second),
        "method": "paired by seed" if comparison.paired else "Welch",
        "measures": [_difference_as_json(difference) for difference in comparison.differences],
        "only_first": only[0],
        "only_second": only[1],
        "settings": {key: list(values) for key, values in comparison.settings.items()},
        "versions": {name: list(values) for name, values in comparison.versions.items()},
    }


def _run_as_json(run: MeasuredRun) -> dict[str, Any]:
    from feeder_sim.records.seed import Status

    seed, seeds = run.seeds
    counts = {"unfinished": Status.UNFINISHED, "failed": Status.DIVERGED}
    return {"path": str(run.path), "title": run.scenario.title, "seed": seed, "seeds": seeds} | {
        name: run.count(status) for name, status in counts.items()
    }


def _difference_as_json(difference: Difference) -> dict[str, Any]:
    from feeder_sim.measures.statistic import finite_or_none

    numbers = {name: getattr(difference, name) for name in ("difference", "low", "high")}
    return {
        "name": difference.name,
        "first": difference.first.as_dict(),
        "second": difference.second.as_dict(),
        **{name: finite_or_none(value) for name, value in numbers.items()},
        "pairs": difference.pairs,
    }


def _in_words(comparison: Comparison) -> str:
    runs = {"first": comparison.first, "second": comparison.second}
    lines = [f"{name:<7} {_described(run)}" for name, run in runs.items()]
    how = "paired by seed" if comparison.paired else "Welch's interval, for the seeds are not the same"
    lines += ["", f"second minus first, 95 % interval, {how}:"]
    longest = max((len(difference.name) for difference in comparison.differences), default=0)
    lines += [f"  {difference.name:<{longest}}  {_numbers(difference)}" for difference in comparison.differences]
    for (name, _), names in zip(runs.items(), comparison.only, strict=True):
        if names:
            lines.append(f"  only the {name} run has: {', '.join(names)}")
    for title, found in (("settings", comparison.settings), ("versions", comparison.versions)):
        lines += ["", f"{title} that differ:" if found else f"no {title} differ"]
        lines += [f"  {key}: {_text(values[0])} | {_text(values[1])}" for key, values in found.items()]
    return "\n".join(lines)


def _described(run: MeasuredRun) -> str:
    about = _run_as_json(run)
    seeds = f"{about['seeds']} seeds from {about['seed']}"
    for name in ("unfinished", "failed"):
        seeds += f", {about[name]} {name}" if about[name] else ""
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
