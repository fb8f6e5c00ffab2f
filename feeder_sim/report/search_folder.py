"""The folder of a search, read back: what was asked, the trials, the best recipe and its check with fresh seeds."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from feeder_sim.measures.statistic import Statistic
from feeder_sim.report.question_folder import Line, TableFile, number_in, scenario_of, value_in
from feeder_sim.scenario import Scenario, load_scenario
from feeder_sim.scenario.changes import value_at
from feeder_sim.studies.search.results import BEST, CHECK, CHECKED, COLUMNS, QUESTION, TRIALS, Question, Tried
from feeder_sim.studies.search.search import Checked, Search
from feeder_sim.studies.search.space import Space
from feeder_sim.studies.sweep.design import Point, labels


@dataclass(frozen=True)
class SearchTable:
    """A search on disk.

    Attributes:
        folder: that holds it.
        question: what was asked.
        found: the space, the aim and the check with fresh seeds; its trials are in `trials`.
        trials: in order.
        text: of the scenario.
    """

    folder: Path
    question: Question
    found: Search
    trials: tuple[Tried, ...]
    text: str

    @property
    def scenario(self) -> Scenario:
        """That the search began with."""
        return self.found.space.scenario

    @property
    def keys(self) -> list[str]:
        """What was changed."""
        return [parameter.key for parameter in self.found.space.parameters]

    @property
    def present(self) -> Point:
        """The recipe of the file, also where it lies outside of what was searched."""
        return self.found.space.present or _point_of(self.scenario, self.keys)

    @property
    def best_is_present(self) -> bool:
        """Whether the best recipe is that of the file."""
        best = self.found.best
        return best is not None and _as_read(best.point or {}) == _as_read(self.present)

    @property
    def first(self) -> Tried | None:
        """The trial with the best mean, of those that have all their seeds."""
        pick = max if self.found.aim.largest else min
        return pick(self._whole, key=lambda trial: trial.found.mean, default=None)

    @property
    def leader(self) -> Tried | None:
        """The trial of the best recipe; before the check the one with the best mean."""
        if self.found.best is None:
            return self.first
        wanted = _as_read(self.found.best.point or {})
        return next((trial for trial in self._whole if _as_read(trial.point) == wanted), None)

    @property
    def _whole(self) -> list[Tried]:
        return [trial for trial in self.trials if trial.is_whole(self.found.aim)]


def read_search(folder: Path) -> SearchTable:
    """Read the folder of a search.

    Raises:
        InputError: a file of it is missing or cannot be read, or its tables are not those of the question.
    """
    scenario, text = scenario_of(folder, (QUESTION, TRIALS, CHECK, BEST))
    question = Question.of_toml(folder / QUESTION)
    space = Space.of(scenario, question.over)
    keys = tuple(parameter.key for parameter in space.parameters)
    table = TableFile(folder / TRIALS)
    if table.head != ("trial", *keys, *COLUMNS):
        raise table.refused(f"trial, a column per key that was searched ({', '.join(keys)}), then {', '.join(COLUMNS)}")
    trials = table.rows(lambda line: _trial(line, keys))
    found = Search(space, question.aim)
    if (folder / CHECK).is_file():
        found.present, found.best = _check(folder, keys)
    found.complete = found.present is not None
    return SearchTable(folder, question, found, trials, text)


def _trial(line: Line, keys: tuple[str, ...]) -> Tried:
    mean, se, seeds, stopped = (number_in(line[name]) for name in COLUMNS[:4])
    n = 0 if math.isnan(mean) else int(seeds)
    found = Statistic(mean, se * math.sqrt(n), se, n)
    point = {key: value_in(line[key]) for key in keys}
    return Tried(int(line["trial"] or ""), point, found, int(seeds), bool(int(stopped)), line["refused"] or "")


def _check(folder: Path, keys: tuple[str, ...]) -> tuple[Checked | None, Checked | None]:
    """The recipe of the file and the best one with fresh seeds; None where the search has not come so far."""
    table = TableFile(folder / CHECK)
    if table.head != CHECKED:
        raise table.refused(", ".join(CHECKED))
    pairs = table.rows(lambda line: (number_in(line["present"]), number_in(line["best"])))
    if not pairs:
        return None, None
    present, best = (tuple(values) for values in zip(*pairs, strict=True))
    if all(math.isnan(value) for value in best):
        return Checked(None, present), None
    return Checked(None, present), Checked(_point_of(load_scenario(folder / BEST), keys), best)


def _point_of(scenario: Scenario, keys: tuple[str, ...] | list[str]) -> Point:
    """The values of keys in a scenario."""
    raw = scenario.model_dump()
    return {key: value_at(raw, key) for key in keys}


def _as_read(point: Point) -> Point:
    """A point as a table gives it back."""
    return {key: value_in(str(value)) for key, value in labels(point).items()}
