"""What is asked of uncertain inputs, as text that a folder keeps."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from feeder_sim.jobs.question_file import question_toml, read_question
from feeder_sim.scenario import Scenario


@dataclass(frozen=True)
class Question:
    """What is asked.

    Attributes:
        inputs: draws of the uncertain inputs; with `indices` so many times (inputs + 2).
        seeds: of every draw.
        indices: whether the draws are such that Sobol indices can be told.
        measure: to show; "" for the usual one.
        measured: a value of it from an experiment, in its unit; NaN for none.
    """

    inputs: int
    seeds: int
    indices: bool = False
    measure: str = ""
    measured: float = math.nan

    @property
    def same(self) -> str:
        """What makes it this question: the draws. More seeds or another measure are no other question."""
        return f"{self.inputs} {self.indices}"

    def draws(self, scenario: Scenario) -> int:
        """How many draws there are."""
        return self.inputs * (len(scenario.uncertain or {}) + 2) if self.indices else self.inputs

    def as_toml(self) -> str:
        """As a text that `of_toml` reads."""
        return question_toml(self)

    @staticmethod
    def of_toml(path: Path) -> Question:
        """From a folder of uncertain inputs.

        Raises:
            InputError: the file is missing or holds no question.
        """
        return read_question(path, Question(1, 1), "study of uncertain inputs")
