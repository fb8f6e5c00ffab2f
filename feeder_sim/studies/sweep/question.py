"""What a sweep asks, as text that a folder keeps: axes, design, and how many seeds the answer takes."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from feeder_sim.errors import InputError, quoted
from feeder_sim.jobs.question_file import question_toml, read_question
from feeder_sim.scenario import Scenario
from feeder_sim.studies.sweep.case import FEWEST, MOST_SEEDS, Effort
from feeder_sim.studies.sweep.design import Axis, Point, grid, read_axis, side_by_side, sobol_sample


@dataclass(frozen=True)
class Question:
    """What is asked.

    Attributes:
        vary: an axis each, as the command line has it; see `feeder_sim.studies.sweep.design`.
        zipped: axes side by side in place of a grid.
        sobol: points of a Sobol sample in place of a grid; 0 for none.
        seeds: of every point; 0 for those of the scenario.
        measure: to show, and that `until_se` looks at; "" for the usual one.
        until_se: more seeds are run until the standard error is below this share of the mean [1]; 0 for no such rule.
        inputs: draws of the uncertain inputs, where the scenario has any.
        most_seeds: of a point, whatever `until_se` asks for; `seeds` where that is more.
    """

    vary: tuple[str, ...]
    zipped: bool = False
    sobol: int = 0
    seeds: int = 0
    measure: str = ""
    until_se: float = 0.0
    inputs: int = 16
    most_seeds: int = MOST_SEEDS

    @property
    def same(self) -> str:
        """What makes it this question: the points. More seeds or another measure are no other question."""
        return f"{self.vary} {self.zipped} {self.sobol}"

    @property
    def axes(self) -> list[Axis]:
        return [read_axis(text) for text in self.vary]

    def points(self, scenario: Scenario) -> list[Point]:
        """The points, in order.

        Raises:
            InputError: axes that do not make points.
        """
        if self.sobol and self.zipped:
            raise InputError("are both given, allowed is one of them", argument="zip, sobol")
        if self.sobol:
            return sobol_sample(self.axes, self.sobol, scenario.run.seed)
        return side_by_side(self.axes) if self.zipped else grid(self.axes)

    def effort(self, scenario: Scenario) -> Effort:
        """How many seeds each point gets.

        Raises:
            InputError: `until_se` without a measure to look at, or a number out of its limits.
        """
        for argument, number, least in (("seeds", self.seeds, 0), ("inputs", self.inputs, 2)):
            if number < least:
                raise InputError(f"is {number}, allowed is {max(1, least)} or more", argument=argument)
        if self.most_seeds < FEWEST:
            raise InputError(f"is {self.most_seeds}, allowed is {FEWEST} or more", argument="most_seeds")
        if self.until_se and not 0.0 < self.until_se < 1.0:
            raise InputError(f"is {self.until_se:g}, allowed is above 0 and below 1", argument="until_se")
        if self.until_se and not self.measure:
            raise InputError("is missing, allowed is the measure whose standard error is looked at", argument="measure")
        seeds = self.seeds or scenario.run.seeds
        return Effort(seeds, self.until_se or None, max(self.most_seeds, seeds), self.measure)

    def as_toml(self) -> str:
        """As a text that `of_toml` reads."""
        return question_toml(self)

    @staticmethod
    def of_toml(path: Path) -> Question:
        """From a folder of a sweep.

        Raises:
            InputError: the file is missing or holds no question.
        """
        return read_question(path, Question(()), "sweep")


def axis_texts(vary: Mapping[str, Any]) -> tuple[str, ...]:
    """Axes as the command line has them, from values by key: sequences of values, or such texts."""
    return tuple(f"{key}={values if isinstance(values, str) else _listed(key, values)}" for key, values in vary.items())


def _listed(key: str, values: Any) -> str:
    if not isinstance(values, Iterable):
        raise InputError(f"is {quoted(values)}, allowed is a sequence of values, or a text of them", key=str(key))
    try:
        return json.dumps([value.item() if isinstance(value, np.generic) else value for value in values])
    except TypeError as error:
        raise InputError(f"is {quoted(values)}, allowed are numbers, texts and tables", key=str(key)) from error
