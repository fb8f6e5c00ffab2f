"""A measure of one's own: a function that makes a number of a seed.

def highest_mm(prepared, seed):
return 1e3 * seed.frames.position[:, :, 2].max()
"""

from __future__ import annotations

import hashlib
import inspect
import math
from collections.abc import Callable, Iterable, Sequence
from numbers import Real
from typing import Any

from feeder_sim.errors import InputError, quoted
from feeder_sim.measures.protocol import Measure, labelled
from feeder_sim.measures.statistic import Statistic
from feeder_sim.records.seed import Seed
from feeder_sim.scene.prepared import Prepared

Function = Callable[[Prepared, Seed], float]


class FunctionMeasure(Measure[dict[str, Statistic], float]):
    """The mean over seeds of what a function makes of each.

    Args:
        function: of a prepared scenario and a seed with all its frames; NaN where the seed has no value.
        name: of the measure, with its unit; default: that of the function.
    """

    def __init__(self, function: Function, name: str = "") -> None:
        self._function, self._name = function, name or getattr(function, "__name__", "")

        self.headline = (self._name,)

    @property
    def name(self) -> str:
        return self._name

    def applies(self, prepared: Prepared) -> bool:
        return True

    def reader(self, prepared: Prepared) -> Callable[[Seed], float]:
        def read(seed: Seed) -> float:
            try:
                value = self._function(prepared, seed)
            except Exception as error:  # of any kind: it is the code of somebody else
                raise InputError(f"fails with {type(error).__name__}: {error}", key=f"measures: {self.name}") from error
            if not isinstance(value, Real):
                raise InputError(f"makes {quoted(value)} of a seed, must be a number", key=f"measures: {self.name}")
            return float(value)

        return read

    def findings(self, prepared: Prepared, readings: Sequence[float]) -> dict[str, Statistic]:
        return {self.name: Statistic.of(readings)}

    def lines(self, prepared: Prepared, findings: dict[str, Statistic]) -> list[str]:
        statistic = findings[self.name]
        spread = f" +- {statistic.se:.2g} (SE)" if math.isfinite(statistic.se) else ""
        return [labelled(self.name, f"{statistic.mean:.4g}{spread}, n = {statistic.n}")]

    @property
    def identity(self) -> str:
        """What its numbers depend on: its source, as far as it can be seen."""
        try:
            return f"{self.name} {inspect.getsource(self._function)}"
        except (OSError, TypeError):
            return f"{self.name} {self._function!r}"


def as_measure(candidate: Any, name: str = "") -> Measure[Any, Any]:
    """A measure, or a function as one.

    Args:
        candidate: a measure, its class, or a function of a prepared scenario and a seed.
        name: of a function that is to have another name than its own.

    Raises:
        InputError: it is none of them.
    """
    if isinstance(candidate, type) and issubclass(candidate, Measure):
        candidate = candidate()
    if isinstance(candidate, Measure):
        return candidate
    if not callable(candidate) or not (name or getattr(candidate, "__name__", "<").isidentifier()):
        allowed = "a function with a name, of a prepared scenario and a seed"
        raise InputError(f"has {quoted(candidate)}, must be {allowed}", key="measures")
    return FunctionMeasure(candidate, name)


def as_measures(candidates: Iterable[Any]) -> tuple[Measure[Any, Any], ...]:
    """Measures of one's own, each of another name.

    Raises:
        InputError: one is no measure, or has the name of another.
    """
    measures = tuple(as_measure(entry) for entry in candidates)
    names = [measure.name for measure in measures]
    if twice := next((name for name in names if names.count(name) > 1), None):
        raise InputError(f"has {twice} twice, must be measures of different names", key="measures")
    return measures


def identity_of_measures(measures: Sequence[Measure[Any, Any]]) -> str:
    """A short text that differs where measures of one's own do; "" without any."""
    if not measures:
        return ""
    text = "\n".join(getattr(measure, "identity", measure.name) for measure in measures)
    return f"+{hashlib.sha256(text.encode()).hexdigest()[:8]}"
