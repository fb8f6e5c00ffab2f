"""Inputs that nobody knows exactly: what each may be, in place of one number.

[uncertain]
contact.restitution = { uniform = [0.2, 0.5], also = ["contact.part_restitution"] }
contact.friction = { normal = [0.3, 0.05] }
plate.rim = { choice = [true, false] }
"drive[0].amplitude_um" = { log_uniform = [0.8, 1.2] }      # a key with brackets needs quotes
contact.rolling_friction_um = { log_normal = [3.0, 0.5] }   # median, and standard deviation of the logarithm
draws = "posterior.csv"     # equally likely draws, a column per key; those of a row belong together (`joint`)
"""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping
from pathlib import Path
from statistics import NormalDist
from typing import Annotated, Any, Self

from pydantic import Field, ValidationInfo, model_validator

from feeder_sim.comma_separated import check_commas
from feeder_sim.errors import InputError, quoted
from feeder_sim.scenario.changes import full_key
from feeder_sim.scenario.tables import Table, read_text

Number = Annotated[float, Field(allow_inf_nan=False, strict=True)]
WIDEST = 10.0  # standard deviation of a logarithm
MOST_DRAWS = 10_000
REACH = 3.0  # standard deviations beyond which a normal distribution is cut off


def with_draws(value: Any, info: ValidationInfo) -> Any:
    """The table with a column of the file `draws` under each of its keys; the file is beside that of the scenario."""
    if not isinstance(value, Mapping) or not isinstance(value.get("draws"), str):
        return by_full_key(value)
    folder = Path((info.context or {}).get("folder", "."))
    columns = read_draws(folder / value["draws"])
    return {key: {"joint": draws} for key, draws in columns.items()} | by_full_key(
        {key: entry for key, entry in value.items() if key != "draws"}
    )


def read_draws(path: Path) -> dict[str, list[float]]:
    """Columns of a table of draws by key, as `feeder-sim calibrate` writes; those of a row belong together.

    Raises:
        InputError: it cannot be read, or a value is no number.
    """
    text = read_text(path)
    check_commas(text, path)
    rows = list(csv.reader(text.splitlines()))
    if len(rows) < 3:
        raise InputError(f"has {max(len(rows) - 1, 0)} draws, must have two and more below the line of keys", file=path)
    columns: dict[str, list[float]] = {key: [] for key in rows[0]}
    for number, row in enumerate(rows[1:], 2):
        if len(row) != len(columns):
            raise InputError(f"has {len(row)} values, must be {len(columns)}", file=path, key=f"line {number}")
        for key, field in zip(columns, row, strict=True):
            try:
                columns[key].append(float(field))
            except ValueError:
                raise InputError(
                    f"is {quoted(field)}, must be a number", file=path, key=f"line {number}, {key}"
                ) from None
    return columns


def by_full_key(value: Any) -> Any:
    """The table by dotted keys, also where they are written without quotes, so that TOML makes tables of them."""
    if not isinstance(value, Mapping):
        return value
    by_key: dict[str, Any] = {}
    for name, entry in value.items():
        if isinstance(entry, Mapping) and entry and all(isinstance(inner, Mapping) for inner in entry.values()):
            by_key |= {full_key(f"{name}.{key}"): inner for key, inner in by_full_key(entry).items()}
        else:
            by_key[full_key(str(name))] = entry
    return by_key


class Uncertain(Table):
    """What a value may be, under the dotted key of that value: `contact.friction = { uniform = [0.2, 0.4] }`; exactly
    one of the distributions. See [Questions](questions.md#uncertain-inputs).
    """

    uniform: tuple[Number, Number] | None = None
    log_uniform: tuple[Number, Number] | None = None
    normal: tuple[Number, Number] | None = None
    log_normal: tuple[Number, Number] | None = None
    choice: Annotated[tuple[Any, ...], Field(min_length=2, max_length=1000)] | None = None
    joint: Annotated[tuple[Number, ...], Field(min_length=2, max_length=MOST_DRAWS)] | None = None
    also: tuple[str, ...] = ()

    def at(self, share: float) -> Any:
        """The value below which a share of all lies [1]: draws are evenly spread shares."""
        if self.joint is not None:
            return self.joint[min(int(share * len(self.joint)), len(self.joint) - 1)]
        if self.choice is not None:
            return self.choice[min(int(share * len(self.choice)), len(self.choice) - 1)]
        if self.log_normal is not None:
            median, deviation = self.log_normal
            return median * math.exp(Uncertain(normal=(0.0, deviation)).at(share))
        if self.normal is not None:
            mean, deviation = self.normal
            below, above = 0.5 * math.erfc(REACH / math.sqrt(2.0)), 0.5 * math.erfc(-REACH / math.sqrt(2.0))
            return mean + deviation * NormalDist().inv_cdf(below + share * (above - below))
        low, high = self.ends
        if self.log_uniform is not None and 0.0 < share < 1.0:
            return math.exp(math.log(low) + share * math.log(high / low))
        return low + share * (high - low) if share < 1.0 else high

    @property
    def ends(self) -> tuple[float, float]:
        """The smallest and the largest value of what is no choice."""
        if self.joint is not None:
            return min(self.joint), max(self.joint)
        if self.normal is not None:
            return self.normal[0] - REACH * self.normal[1], self.normal[0] + REACH * self.normal[1]
        if self.log_normal is not None:
            factor = math.exp(REACH * self.log_normal[1])
            return self.log_normal[0] / factor, self.log_normal[0] * factor
        span = self.uniform or self.log_uniform
        assert span is not None  # the table's own check
        return span

    @property
    def extremes(self) -> tuple[Any, ...]:
        """Values that all have to be allowed."""
        return self.ends if self.choice is None else self.choice

    @model_validator(mode="after")
    def _one_distribution(self) -> Self:
        kinds = ("uniform", "log_uniform", "normal", "log_normal", "choice", "joint")
        distributions = [kind for kind in kinds if getattr(self, kind) is not None]
        if len(distributions) != 1:
            raise ValueError(f"exactly one of {', '.join(kinds)} is needed, here are {len(distributions)}")
        if self.log_normal is not None and not (self.log_normal[0] > 0.0 and 0.0 < self.log_normal[1] <= WIDEST):
            problem = f"a median above 0 and a standard deviation of the logarithm above 0, up to {WIDEST:g}"
            raise ValueError(f"log_normal is {list(self.log_normal)}, must be {problem}")
        if self.choice is None and self.joint is None and not self.ends[0] < self.ends[1]:
            allowed = "a standard deviation above 0" if self.normal else "[low, high] with low < high"
            raise ValueError(f"{distributions[0]} is {list(getattr(self, distributions[0]))}, must be {allowed}")
        if self.log_uniform is not None and self.log_uniform[0] <= 0.0:
            raise ValueError(f"log_uniform begins at {self.log_uniform[0]:g}, must be above 0")
        return self
