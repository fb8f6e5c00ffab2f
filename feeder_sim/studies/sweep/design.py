"""The points of a sweep: values of keys, crossed (grid), side by side (zip) or drawn from ranges (Sobol).

An axis is written as

    drive[0].amplitude_um=0.5:8:12        12 values from 0.5 to 8, evenly spaced
    drive[0].amplitude_um=0.5:8:log12     the same with a constant ratio
    part[0].material=steel,aluminium      values
    contact.friction=0.2:0.5              a range, for a Sobol sample; 0.2:0.5:log one of its logarithm
"""

from __future__ import annotations

import functools
import itertools
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from feeder_sim.errors import InputError, NotAllowed
from feeder_sim.plate.mode_file import ModeFile, read_mode_file
from feeder_sim.plate.response import oscillators
from feeder_sim.scenario import BendingPlate, Scenario
from feeder_sim.scenario.changes import changed_values, check_variable, full_key, path_of, read_value
from feeder_sim.scenario.tables import validated
from feeder_sim.scene.mode_cache import modes_of_plate

# Modes of the plate as values of a key: a key that ends in `.mode` takes the frequency of the drive along.
#
# The frequency is that of the measured resonance where the mode file has one, else the natural frequency.

MODE = ".mode"


def with_frequencies(scenario: Scenario, point: Mapping[str, Any], *, file: Path = Path("scenario")) -> dict[str, Any]:
    """What a point changes in a scenario: its values, and the frequencies that go with its modes.

    A drive whose frequency the point has itself keeps that one.

    Raises:
        InputError: the plate has no mode file, or no such mode; `file` names the scenario.
    """
    along: dict[str, Any] = {}
    for key, value in point.items():
        drive = key.removesuffix(MODE)
        if drive != key and f"{drive}.frequency_hz" not in point:
            plate = changed_values(scenario.model_dump(), point, file)["plate"]
            frequency = _frequency(mode_frequencies(plate), key, value)
            along |= {f"{drive}.frequency_hz": frequency, f"{drive}.natural_frequency_hz": None}
    return along | dict(point)


def mode_frequencies(plate: Any) -> tuple[float, ...]:
    """Where each mode of a plate is driven [Hz]; `plate` is the table of a scenario, checked or not.

    Raises:
        InputError: it has no mode file, and is not described with the frequency up to where it has modes.
    """
    if isinstance(plate, Mapping) and plate.get("kind") == "plate":
        return _described(plate)
    file = plate.get("mode_file") if isinstance(plate, Mapping) else None
    if not isinstance(file, str | Path):
        raise InputError("is missing, must be a mode file where modes are varied", key="plate.mode_file")
    try:
        state = Path(file).stat()
    except OSError:
        return _read(Path(file), 0, 0)  # which says what is wrong
    return _read(Path(file), state.st_mtime_ns, state.st_size)


@functools.lru_cache(8)
def _read(file: Path, changed: int, size: int) -> tuple[float, ...]:
    return _driven_at(read_mode_file(file))


def _described(plate: Mapping[str, Any]) -> tuple[float, ...]:
    """Of a plate that the scenario describes."""
    checked = validated(dict(plate), BendingPlate, Path("plate"))
    if checked.highest_frequency_hz is None:
        raise InputError("is missing, must be a number where modes are varied", key="plate.highest_frequency_hz")
    return _driven_at(modes_of_plate(checked.as_file(checked.highest_frequency_hz)))


def _driven_at(mode_file: ModeFile) -> tuple[float, ...]:
    return tuple(oscillators(mode_file).natural_frequency.tolist())


def _frequency(frequencies: tuple[float, ...], key: str, mode: Any) -> float:
    if not isinstance(mode, int) or not 1 <= mode <= len(frequencies):
        raise InputError(f"is {mode}, must be 1 to {len(frequencies)}, the modes of the plate", key=key)
    return frequencies[mode - 1]


MOST_POINTS = 20_000
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
# A count that is far too large is read all the same, so that it is refused by the limit.
_RANGE = re.compile(rf"({_NUMBER}):({_NUMBER})(?::(log)?(\d{{1,99}})?)?")
Point = dict[str, Any]  # a value for each varied key


@dataclass(frozen=True)
class Range:
    """Numbers from `low` to `high`, on a logarithmic scale or not."""

    low: float
    high: float
    log: bool = False

    def at(self, share: float) -> float:
        """The number a share of the way from low to high [1]; both ends are exact."""
        if share in (0.0, 1.0):
            return self.high if share else self.low
        if self.log:
            return math.exp(math.log(self.low) + share * math.log(self.high / self.low))
        return self.low + share * (self.high - self.low)


@dataclass(frozen=True)
class Axis:
    """What one key takes: values, or a range to draw from."""

    key: str
    values: tuple[Any, ...] = ()
    span: Range | None = None


def read_axis(text: str, argument: str = "vary") -> Axis:
    """An axis as the command line has it; `argument` is the one that holds it.

    Raises:
        InputError: it is not written as an axis is.
    """
    key, equals, values = text.partition("=")
    if not equals or not key.strip() or not values.strip():
        raise NotAllowed(text, "KEY=LOW:HIGH:COUNT, LOW:HIGH:logCOUNT or A,B,C", argument=argument)
    key = full_key(key.strip())
    check_variable(key)
    match = _RANGE.fullmatch(values.strip())
    if match is not None:
        low, high, log, count = float(match[1]), float(match[2]), match[3] is not None, match[4]
        span = _range(Range(low, high, log), key, argument)
        return spread(key, span, int(count), argument) if count else Axis(key, span=span)
    listed = read_value(values)
    if not isinstance(listed, list) or values.lstrip()[0] != "[":
        listed = [read_value(value) for value in _at_commas(values)]
    return listed_axis(key, listed, argument)


def spread(key: str, span: Range, count: int, argument: str) -> Axis:
    """So many values over a range, both ends among them."""
    if not 2 <= count <= MOST_POINTS:
        raise InputError(f"has {count} values, must be 2 to {MOST_POINTS}", key=key, argument=argument)
    return Axis(key, tuple(span.at(i / (count - 1)) for i in range(count)), span)


def listed_axis(key: str, values: Sequence[Any], argument: str) -> Axis:
    """The values of a list, none of them twice."""
    if not values or len({_comparable(value) for value in values}) < len(values) or None in values:
        raise InputError("has no value, or one twice; must be different values", key=key, argument=argument)
    return Axis(key, tuple(values))


def _comparable(value: Any) -> Any:
    """What is the same for the same values: 1 and 1.0 are one, but true is none of them."""
    if isinstance(value, Mapping):
        return frozenset((name, _comparable(entry)) for name, entry in value.items())
    if isinstance(value, list | tuple):
        return tuple(_comparable(entry) for entry in value)
    return isinstance(value, bool), value


def overlap(key: str, other: str) -> bool:
    """Whether two keys are the same, or one is within the value of the other."""
    short, long = sorted((path_of(key), path_of(other)), key=len)
    return long[: len(short)] == short


def check_apart(keys: Sequence[str]) -> None:
    """Refuse keys of which one would change what another has set.

    Raises:
        InputError: as said.
    """
    for key, other in itertools.combinations(keys, 2):
        if path_of(key) == path_of(other):
            raise InputError("is varied twice, must be once", key=key, argument="vary")
        if overlap(key, other):
            problem = f"is varied, and so is {other}: one is within the other, must be one of them"
            raise InputError(problem, key=key, argument="vary")


def grid(axes: Sequence[Axis]) -> list[Point]:
    """Every value of each axis with every value of the others; the last axis changes first."""
    _check_axes(axes)
    _check_number(math.prod(len(axis.values) for axis in axes))
    return [_point(axes, values) for values in itertools.product(*(axis.values for axis in axes))]


def side_by_side(axes: Sequence[Axis]) -> list[Point]:
    """The first values of all axes, then the second ones, and so on.

    Raises:
        InputError: the axes have different numbers of values.
    """
    _check_axes(axes)
    counts = {len(axis.values) for axis in axes}
    if len(counts) > 1:
        counted = ", ".join(f"{axis.key} {len(axis.values)}" for axis in axes)
        raise InputError(f"have different numbers of values ({counted}), must be the same", argument="vary, zip")
    _check_number(max(counts))
    return [_point(axes, values) for values in zip(*(axis.values for axis in axes), strict=True)]


def sobol_sample(axes: Sequence[Axis], count: int, seed: int = 0) -> list[Point]:
    """A scrambled Sobol sequence over the ranges (scipy.stats.qmc); of listed values each gets an equal share.

    Raises:
        InputError: an unlikely number of points.
    """
    from scipy.stats import qmc

    _check_axes(axes, ranges=True)
    _check_number(count)
    exponent = math.ceil(math.log2(count))
    shares = qmc.Sobol(len(axes), rng=seed).random_base2(exponent)[:count]
    return [
        _point(axes, [value_at_share(axis, share) for axis, share in zip(axes, row, strict=True)]) for row in shares
    ]


def value_at_share(axis: Axis, share: float) -> Any:
    """What an axis has a share of its way along [1]."""
    if axis.span is not None:
        return axis.span.at(float(share))
    return axis.values[min(int(share * len(axis.values)), len(axis.values) - 1)]


def _point(axes: Sequence[Axis], values: Sequence[Any]) -> Point:
    return {axis.key: value for axis, value in zip(axes, values, strict=True)}


def _range(span: Range, key: str, argument: str) -> Range:
    if not (math.isfinite(span.low) and math.isfinite(span.high) and span.low < span.high):
        problem = f"is {span.low:g}:{span.high:g}, must be LOW:HIGH with LOW below HIGH"
        raise InputError(problem, key=key, argument=argument)
    if span.log and span.low <= 0.0:
        problem = f"begins at {span.low:g}, must be above 0 on a logarithmic scale"
        raise InputError(problem, key=key, argument=argument)
    return span


def _check_axes(axes: Sequence[Axis], *, ranges: bool = False) -> None:
    check_apart([axis.key for axis in axes])
    if not axes:
        raise InputError("is missing, must be one or several keys with values", argument="vary")
    for axis in axes:
        if not axis.values and not ranges:
            raise InputError("has a range without a number of values, which only a Sobol sample takes", key=axis.key)


def _check_number(count: int) -> None:
    if not 1 <= count <= MOST_POINTS:
        raise InputError(f"has {count} points, must be 1 to {MOST_POINTS}", argument="vary")


def _at_commas(text: str) -> list[str]:
    """The text cut at commas outside of brackets."""
    parts, depth = [""], 0
    for character in text:
        depth += (character in "[{") - (character in "]}")
        if character == "," and depth == 0:
            parts.append("")
        else:
            parts[-1] += character
    return parts
