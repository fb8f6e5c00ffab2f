"""What a search leaves in its folder.

search.toml     what was asked
scenario.toml   the scenario that the search began with, with all its defaults
journal.jsonl   measures of every seed that is done
optuna.log      Optuna's journal of the trials
trials.csv      one row per trial: its values, mean and standard error of the measure, seeds, whether it was stopped,
                    and why it is not allowed, if it is not
best.toml       the best recipe; runs as it is
history.png     the trials in order, and the check with fresh seeds
"""

from __future__ import annotations

import csv
import io
import math
from typing import Any

from feeder_sim.jobs.folder import WorkFolder
from feeder_sim.measures.statistic import Statistic
from feeder_sim.studies.search.search import Checked, Search
from feeder_sim.studies.sweep.design import labels

QUESTION, TRIALS, BEST, PICTURE = "search.toml", "trials.csv", "best.toml", "history.png"


def write_search(folder: WorkFolder, found: Search) -> None:
    """Write the table of the trials, and the best recipe, in place of those before."""
    text = io.StringIO()
    keys = [parameter.key for parameter in found.space.parameters]
    writer = csv.DictWriter(text, ["trial", *keys, "mean", "se", "seeds", "stopped", "refused"], lineterminator="\n")
    writer.writeheader()
    for trial in found.trials:
        values = trial.values(found.aim)
        statistic = Statistic.of(values if not math.isnan(trial.mean(found.aim)) else [])
        row: dict[str, Any] = {"trial": trial.number} | labels(trial.point)
        row |= {"mean": statistic.mean, "se": statistic.se, "seeds": len(values), "stopped": int(trial.stopped)}
        row["refused"] = trial.refused
        writer.writerow({key: "" if isinstance(v, float) and math.isnan(v) else v for key, v in row.items()})
    folder.write(TRIALS, text.getvalue().encode())
    if found.best and found.best.point:
        folder.write(BEST, folder.carried(found.space.changed(found.best.point)).encode())


def as_json_object(found: Search) -> dict[str, Any]:
    """What was found, as JSON takes it."""
    low, high = found.gain.interval
    gain = found.gain.as_dict() | {name: v if math.isfinite(v) else None for name, v in (("low", low), ("high", high))}
    return {
        "measure": found.aim.measure,
        "maximise": found.aim.largest,
        "trials": len(found.trials),
        "stopped": sum(trial.stopped for trial in found.trials),
        "complete": found.complete,
        "present": _checked(found.present) if found.present else None,
        "best": _checked(found.best) | {"values": labels(found.best.point or {})} if found.best else None,
        "gain": gain,
    }


def _checked(checked: Checked) -> dict[str, Any]:
    """A recipe with fresh seeds: `n` of them have a value."""
    return checked.found.as_dict() | {"seeds": len(checked.values)}
