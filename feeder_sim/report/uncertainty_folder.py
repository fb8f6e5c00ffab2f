"""The folder of uncertain inputs, read back: what was asked, and all draws with what their seeds have come to."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from feeder_sim.errors import InputError
from feeder_sim.jobs.folder import JOURNAL
from feeder_sim.jobs.journal import read_journal
from feeder_sim.jobs.task import SeedValues
from feeder_sim.report.question_folder import Line, TableFile, number_in, scenario_of, value_in
from feeder_sim.scenario import Scenario
from feeder_sim.studies.sweep.case import Case, Effort
from feeder_sim.studies.sweep.cases import Cases, Sweep
from feeder_sim.studies.uncertainty.draws import Draw
from feeder_sim.studies.uncertainty.propagate import DRAWS, QUESTION, Propagation
from feeder_sim.studies.uncertainty.question import Question

NO_REASON = "why is not known"


@dataclass(frozen=True)
class Uncertainty:
    """Uncertain inputs on disk.

    Attributes:
        folder: that holds them.
        question: what was asked.
        found: what they have come to; draws of which no seed is done have no values.
        text: of the scenario.
    """

    folder: Path
    question: Question
    found: Propagation
    text: str

    @property
    def scenario(self) -> Scenario:
        """With the uncertain inputs."""
        return self.found.scenario

    @property
    def done(self) -> list[tuple[Draw, SeedValues]]:
        """All seeds that are done, with the values of their draw, in order."""
        cases = self.found.swept.cases
        pairs = zip(self.found.draws, cases, strict=True)
        return [(draw, seed) for draw, case in pairs for seed in case.seeds(cases.effort)]

    @property
    def failed(self) -> list[SeedValues]:
        """The seeds that ended without any value."""
        return [seed for _, seed in self.done if seed.failure]


def read_uncertainty(folder: Path) -> Uncertainty:
    """Read the folder of uncertain inputs.

    Raises:
        InputError: a file of it is missing or cannot be read, or no seed is done.
    """
    scenario, text = scenario_of(folder, (QUESTION, DRAWS, f"{JOURNAL}.jsonl"))
    question = Question.of_toml(folder / QUESTION)
    keys = tuple(dict.fromkeys(k for key, inner in (scenario.uncertain or {}).items() for k in (key, *inner.also)))
    table = TableFile(folder / DRAWS)
    if not keys or table.head[: len(keys) + 1] != (*keys, "seed"):
        raise table.refused(f"a column per uncertain input of the scenario ({', '.join(keys) or 'none'}), then seed")
    measures = table.head[len(keys) + 1 :]
    rows = table.rows(lambda line: _row(line, keys, measures))
    if not rows:
        raise InputError("holds no draw, allowed is a folder with at least one that is done", file=folder / DRAWS)
    empty = any(not seed.values for _, seed in rows)
    causes = _causes(folder / f"{JOURNAL}.jsonl") if empty else {}
    count = question.draws(scenario)
    draws: list[Draw] = [{} for _ in range(count)]
    cases = [Case(scenario, "", number, count) for number in range(count)]
    for draw, seed in rows:
        failure = "" if seed.values else causes.get(seed.seed, NO_REASON)
        draws[seed.seed % count] = draw
        cases[seed.seed % count].take((SeedValues(seed.seed, seed.values, 0.0, failure),))
    effort = Effort(question.seeds, measure=question.measure)
    swept = Sweep(Cases(({},), (tuple(cases),), effort), all(case.is_done(effort) for case in cases))
    return Uncertainty(folder, question, Propagation(scenario, tuple(draws), swept, question.indices), text)


def _row(line: Line, keys: tuple[str, ...], measures: tuple[str, ...]) -> tuple[Draw, SeedValues]:
    """A line of the table: the values of a draw, and a seed of it."""
    values = {name: number_in(line[name]) for name in measures}
    if all(math.isnan(value) for value in values.values()):
        values = {}
    return {key: value_in(line[key]) for key in keys}, SeedValues(int(line["seed"] or ""), values, 0.0)


def _causes(journal: Path) -> dict[int, str]:
    """Why seeds have failed, which the table does not say, "" for those that have not; what was written last counts."""
    return {int(entry["seed"]): str(entry["failure"]) for entry in read_journal(journal) if "failure" in entry}
