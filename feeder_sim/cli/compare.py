"""The command `compare`: two recorded runs, measure by measure, and what was set otherwise in them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from feeder_sim.cli.terminal import progress_bar

if TYPE_CHECKING:
    from feeder_sim.studies.compare import Comparison, Difference, MeasuredRun

Run = Annotated[Path, typer.Argument(help="Run folder, or a file exported from it.", show_default=False)]


def compare(
    first: Run,
    second: Run,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout.")] = False,
) -> None:
    """Compare two recorded runs: differences of all measures with 95 % intervals, of settings and of versions."""
    from feeder_sim.studies.compare import Comparison, in_words, measured_run

    with progress_bar("measuring the seeds") as progress:
        runs = [
            measured_run(path, lambda share, before=number: progress(0.5 * (before + share)))  # type: ignore[misc]
            for number, path in enumerate((first, second))
        ]
    comparison = Comparison(*runs)
    print(json.dumps(_as_json(comparison)) if as_json else in_words(comparison))


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
