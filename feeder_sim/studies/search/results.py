"""What a search leaves in its folder.

search.toml     what was asked
scenario.toml   the scenario that the search began with, with all its defaults
journal.jsonl   measures of every seed that is done
optuna.log      Optuna's journal of the trials
trials.csv      one row per trial: its values, mean and standard error of the measure, seeds, whether it was stopped,
                    and why it has no mean, if it has none: it is not allowed, or a seed has no value
check.csv       one row per fresh seed: the measure of the scenario as it is, and of the best recipe; none before that
best.toml       the best recipe; runs as it is
history.png     the trials in order, and the check with fresh seeds
"""

from __future__ import annotations

import csv
import io
import itertools
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from feeder_sim.jobs.cautions import most_frequent
from feeder_sim.jobs.folder import WorkFolder
from feeder_sim.jobs.identity import content_hash
from feeder_sim.jobs.question_file import question_toml, read_question
from feeder_sim.measures.statistic import Statistic, finite_or_none
from feeder_sim.scenario import Scenario
from feeder_sim.studies.search.proposals import LOG
from feeder_sim.studies.search.search import Checked, Search
from feeder_sim.studies.search.trials import Aim
from feeder_sim.studies.sweep.design import Point, labels

QUESTION, TRIALS, CHECK, BEST, PICTURE = "search.toml", "trials.csv", "check.csv", "best.toml", "history.png"
COLUMNS = ("mean", "se", "seeds", "stopped", "refused")  # of a trial, after its number and its values
CHECKED = ("seed", "present", "best")


@dataclass(frozen=True)
class Question:
    """What is asked, as the folder keeps it.

    Attributes:
        over: an axis each, as the command line has it; see `feeder_sim.studies.sweep.design`.
        measure: that is to be large or small.
        maximise: whether it is to be large.
        seeds: of a trial, at most.
        sampler: of Optuna.
        screen: hash of the drift map that proposes recipes to begin with; "" for none.
        recipes: that it walks; 0 for none.
    """

    over: tuple[str, ...]
    measure: str
    maximise: bool
    seeds: int
    sampler: str
    screen: str = ""
    recipes: int = 0

    @staticmethod
    def of(over: Sequence[str], aim: Aim, sampler: str, screen: Path | None, recipes: int) -> Question:
        """What is asked with the file of a drift map, which walks so many recipes, or without one.

        Raises:
            InputError: the file cannot be read.
        """
        screened = (content_hash(screen), recipes) if screen is not None else ()
        return Question(tuple(over), aim.measure, aim.largest, aim.seeds, sampler, *screened)

    @property
    def same(self) -> str:
        """What makes it this question: all of it, since a search with other words takes another way."""
        return str(self)

    @property
    def aim(self) -> Aim:
        return Aim(self.measure, self.maximise, self.seeds)

    def as_toml(self) -> str:
        """As a text that `of_toml` reads."""
        return question_toml(self)

    @staticmethod
    def of_toml(path: Path) -> Question:
        """From a folder of a search.

        Raises:
            InputError: the file is missing or holds no question.
        """
        return read_question(path, Question((), "", True, 2, ""), "search")


def search_folder(path: Path, asked: Question, scenario: Scenario) -> WorkFolder:
    """The folder of a search.

    Raises:
        InputError: it holds something else, or another question.
    """
    return WorkFolder(path, QUESTION, asked.as_toml(), scenario, same=asked.same, own=(LOG,))


@dataclass(frozen=True)
class Tried:
    """A trial as a row of the table.

    Attributes:
        number: of the trial.
        point: its values.
        found: the measure over its seeds; none where one of them has no value, as such a recipe does not count.
        seeds: that it has had.
        stopped: whether it was given up before it had all its seeds.
        refused: why the recipe does not count: it is not allowed, or a seed has no value; "" where it does.
    """

    number: int
    point: Point
    found: Statistic
    seeds: int
    stopped: bool
    refused: str = ""

    def is_whole(self, aim: Aim) -> bool:
        """Whether it has all its seeds, and a value in each."""
        return self.seeds == aim.seeds and not math.isnan(self.found.mean)


def tried(found: Search) -> list[Tried]:
    """The trials of a search as rows."""
    rows = []
    for trial in found.trials:
        values = trial.values(found.aim)
        statistic = Statistic.of(values if not math.isnan(trial.mean(found.aim)) else [])
        rows.append(Tried(trial.number, trial.point, statistic, len(values), trial.stopped, trial.why_none(found.aim)))
    return rows


def running_best(trials: Sequence[Tried], aim: Aim) -> list[float]:
    """The best mean up to each trial, of those that have all their seeds; NaN before the first of them."""

    def better(best: float, trial: Tried) -> float:
        mean = trial.found.mean
        return mean if trial.is_whole(aim) and aim.better(mean, best) else best

    return list(itertools.accumulate(trials, better, initial=math.nan))[1:]


def write_search(folder: WorkFolder, found: Search) -> None:
    """Write the tables of the trials and of the check, and the best recipe, in place of those before."""
    keys = [parameter.key for parameter in found.space.parameters]
    rows = [
        {"trial": row.number}
        | labels(row.point)
        | {"mean": row.found.mean, "se": row.found.se, "seeds": row.seeds}
        | {"stopped": int(row.stopped), "refused": row.refused}
        for row in tried(found)
    ]
    folder.write(TRIALS, _csv(["trial", *keys, *COLUMNS], rows))
    present, best = (checked.values if checked else () for checked in (found.present, found.best))
    pairs = itertools.zip_longest(present, best, fillvalue=math.nan)
    checks = [dict(zip(CHECKED, (seed, *pair), strict=True)) for seed, pair in enumerate(pairs)]
    folder.write(CHECK, _csv(CHECKED, checks))
    if found.best and found.best.point:
        folder.write(BEST, folder.carried(found.space.changed(found.best.point)).encode())


def _csv(columns: Sequence[str], rows: Iterable[dict[str, Any]]) -> bytes:
    """A table; an empty field is no value."""
    text = io.StringIO()
    writer = csv.DictWriter(text, columns, lineterminator="\n")
    writer.writeheader()
    for row in rows:
        writer.writerow({key: finite_or_none(v) if isinstance(v, float) else v for key, v in row.items()})
    return text.getvalue().encode()


def as_json_object(found: Search) -> dict[str, Any]:
    """What was found, as JSON takes it."""
    low, high = found.gain.interval
    gain = found.gain.as_dict() | {"low": finite_or_none(low), "high": finite_or_none(high)}
    return {
        "measure": found.aim.measure,
        "maximise": found.aim.largest,
        "trials": len(found.trials),
        "stopped": sum(trial.stopped for trial in found.trials),
        "without_value": {"trials": len(found.without_value), "mostly": most_frequent(found.without_value)},
        "complete": found.complete,
        "present": _checked(found.present) if found.present else None,
        "best": _checked(found.best) | {"values": labels(found.best.point or {})} if found.best else None,
        "gain": gain,
        "cautions": [caution.as_dict() for caution in found.cautions],
    }


def _checked(checked: Checked) -> dict[str, Any]:
    """A recipe with fresh seeds: `n` of them have a value."""
    return checked.found.as_dict() | {"seeds": len(checked.values), "cautions": list(checked.cautions)}
