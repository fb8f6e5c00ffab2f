"""What a search may change: numbers in ranges, and choices. A mode takes its frequency along, as in sweeps."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from feeder_sim.errors import InputError
from feeder_sim.scenario import Scenario
from feeder_sim.scenario.changes import value_at
from feeder_sim.studies.sweep.design import MODE, Axis, Point, Range, mode_frequencies, read_axis, with_frequencies

if TYPE_CHECKING:
    from optuna.trial import BaseTrial


AT_AN_END = 0.02  # of a range, or of its logarithm: as near to an end as this is at it


@dataclass(frozen=True)
class Parameter:
    """One key: a range of numbers, whole ones or not, or choices."""

    key: str
    span: Range | None
    whole: bool
    choices: tuple[Any, ...]

    @property
    def names(self) -> list[str]:
        """The choices as texts."""
        return [json.dumps(choice, default=str) for choice in self.choices]

    def end_near(self, value: Any) -> str:
        """Which end of its range a value lies at, "lower" or "upper"; "" for none."""
        if self.span is None:
            return ""
        low, high, here = (math.log(x) if self.span.log else x for x in (self.span.low, self.span.high, float(value)))
        share = (here - low) / (high - low)
        return "lower" if share < AT_AN_END else "upper" if share > 1.0 - AT_AN_END else ""

    def suggest(self, trial: BaseTrial) -> Any:
        """A value that Optuna proposes."""
        if self.span is None:
            return self.choices[self.names.index(str(trial.suggest_categorical(self.key, self.names)))]
        if self.whole:
            return trial.suggest_int(self.key, int(self.span.low), int(self.span.high), log=self.span.log)
        return trial.suggest_float(self.key, self.span.low, self.span.high, log=self.span.log)

    def at(self, share: float) -> Any:
        """The value that lies a share of the way along [1]; of choices each has an equal share."""
        if self.span is None:
            return self.choices[min(int(share * len(self.choices)), len(self.choices) - 1)]
        value = self.span.at(share)
        return round(value) if self.whole else value

    def holds(self, value: Any) -> bool:
        """Whether a value is among those allowed."""
        if self.span is None:
            return value in self.choices
        return isinstance(value, int | float) and self.span.low <= value <= self.span.high

    def proposed(self, value: Any) -> Any:
        """A value as Optuna keeps it."""
        return value if self.span else self.names[self.choices.index(value)]


@dataclass(frozen=True)
class Space:
    """All that a search may change in a scenario."""

    scenario: Scenario
    parameters: tuple[Parameter, ...]
    file: Path = Path("scenario")

    @staticmethod
    def of(scenario: Scenario, over: Sequence[str], file: Path = Path("scenario")) -> Space:
        """The space of axes as the command line has them; every end and choice is checked by itself.

        Args:
            scenario: what is changed.
            over: axes as texts, such as `drive[0].amplitude_um=1:5`.
            file: names the scenario in messages.

        Raises:
            InputError: a key or a value that is not allowed, or a mode that the plate does not have.
        """
        raw = scenario.model_dump()
        parameters = []
        for axis in (read_axis(text, "over") for text in over):
            now = value_at(raw, axis.key)
            is_integer = axis.key.endswith(MODE) or (isinstance(now, int) and not isinstance(now, bool))
            parameters.append(Parameter(axis.key, *_span_and_choices(axis, is_integer)))
        keys = [parameter.key for parameter in parameters]
        if not keys or len(set(keys)) < len(keys):
            raise InputError("is missing or names a key twice, must be each key once", argument="over")
        space = Space(scenario, tuple(parameters), file)
        for parameter in parameters:
            ends = (parameter.span.low, parameter.span.high) if parameter.span else parameter.choices
            for value in ends:
                space.changed({parameter.key: int(value) if parameter.whole else value})
        return space

    def suggest(self, trial: BaseTrial) -> Point:
        """A point that Optuna proposes."""
        return {parameter.key: parameter.suggest(trial) for parameter in self.parameters}

    def proposed(self, point: Point) -> dict[str, Any]:
        """A point as Optuna keeps it."""
        return {parameter.key: parameter.proposed(point[parameter.key]) for parameter in self.parameters}

    def changed(self, point: Point) -> Scenario:
        """The scenario at a point.

        Raises:
            InputError: a value that is not allowed.
        """
        return self.scenario.changed(with_frequencies(self.scenario, point, file=self.file), file=self.file)

    @property
    def present(self) -> Point | None:
        """The scenario itself as a point; None where it lies outside of the space."""
        raw = self.scenario.model_dump()
        point = {parameter.key: value_at(raw, parameter.key) for parameter in self.parameters}
        for key, value in point.items():
            if key.endswith(MODE) and value is None:
                point[key] = self._mode_at(float(value_at(raw, f"{key.removesuffix(MODE)}.frequency_hz")))
        inside = all(parameter.holds(point[parameter.key]) for parameter in self.parameters)
        return point if inside else None

    def _mode_at(self, frequency: float) -> int:
        """The mode that is driven nearest to a frequency [Hz]."""
        frequencies = mode_frequencies(self.scenario.plate.model_dump())
        return 1 + min(range(len(frequencies)), key=lambda mode: abs(frequencies[mode] - frequency))


def _span_and_choices(axis: Axis, is_integer: bool) -> tuple[Range | None, bool, tuple[Any, ...]]:
    if axis.values and axis.span:
        raise InputError("has a number of values, must be LOW:HIGH or LOW:HIGH:log", key=axis.key, argument="over")
    if axis.span is None:
        return None, False, axis.values
    if is_integer and not (axis.span.low.is_integer() and axis.span.high.is_integer()):
        raise InputError("has ends that are not whole, must be whole numbers", key=axis.key, argument="over")
    return axis.span, is_integer, ()
