"""Experiments and priors as a user writes them.

[[experiment]]
scenario = "drift_4750hz.toml"
measure = "transport_speed_mm_s"
mean = 1.44
sd = 0.27                # of one run
n = 6
[[experiment]]           # or the runs one by one
scenario = "drift_8775hz.toml"
values = { transport_speed_mm_s = [4.9, 3.7, 3.9] }
[[experiment]]           # or what a camera has seen
scenario = "my_plate.toml"
tracks = "tracks.csv"
[[candidate]]            # that could be done next; mean is not known
scenario = "ball_558hz.toml"
measure = "flight_height_mm"
sd = 0.05
n = 10
[answer]                 # what it is for: candidates are judged by what they leave of its interval
scenario = "separation_100.toml"
measure = "picked"
[prior]
contact.restitution = { uniform = [0.05, 0.7], also = ["contact.part_restitution"] }
"drive[0].amplitude_um" = { log_normal = [1.0, 0.1], only = ["drift_8775hz"] }
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, model_validator

from feeder_sim.errors import InputError
from feeder_sim.measures.catalogue import values_of_seed
from feeder_sim.measures.statistic import Statistic
from feeder_sim.records.tracks import Camera
from feeder_sim.run.tracked import tracked
from feeder_sim.scenario import Scenario, load_scenario
from feeder_sim.scenario.tables import Positive, Table, read_text, validated
from feeder_sim.scenario.uncertain import Number, Uncertain
from feeder_sim.scene.timetable import timetable
from feeder_sim.studies.sweep.cases import check_measure

# What is compared of tracks, as far as they have it; where no transport speed is measured, drift velocities.
SPEED, VELOCITIES = "transport_speed_mm_s", ("drift_velocity_x_mm_s", "drift_velocity_y_mm_s")
SCATTER = ("wander_mm", "turning_deg")
MOST_CONSTANTS = 6  # of which the posterior is found by draws from the prior


Name = Annotated[str, Field(strict=True, min_length=1)]
Runs = Annotated[int, Field(strict=True, ge=1, le=1_000_000)]

Values = Annotated[tuple[float, ...], Field(min_length=1, max_length=100_000)]


class Candidate(Table):
    """An experiment that can be done: what is measured in a scenario, how far one run scatters, and how many runs.

    Attributes:
        name: by default that of the file of its scenario.
        scenario: at the constants of which the priors say nothing.
        measure: of the scenario.
        sd: of one measured run, in the unit of the measure.
        n: measured runs.
        minutes: that one of them takes; by default that of its scenario at most.
    """

    name: str
    scenario: Scenario
    measure: Name
    sd: Positive
    n: Runs = 1
    minutes: Positive | None = None

    @property
    def cost(self) -> tuple[int, float]:
        """Parts that are put down, and minutes."""
        minutes = timetable(self.scenario).duration / 60.0 if self.minutes is None else self.minutes
        return self.n * self.scenario.n_parts, self.n * minutes

    @property
    def statistics(self) -> dict[str, Statistic]:
        """What its runs give, by measure."""
        return {self.measure: Statistic(math.nan, self.sd, self.sd / math.sqrt(self.n), self.n)}


class Experiment(Table):
    """One that has been done: the mean over n runs with the scatter of one, or the values of every run.

    Attributes:
        name, scenario: as for a candidate.
        measure, mean, sd, n: as for a candidate, and the mean over its runs; None where there are values.
        values: of every run, by measure; NaN where a run has none.
    """

    name: str
    scenario: Scenario
    measure: Name | None = None
    mean: Number | None = None
    sd: Positive | None = None
    n: Runs = 1
    values: dict[str, Values] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _is_whole(self) -> Experiment:
        given = [value is not None for value in (self.measure, self.mean, self.sd)]
        if any(given) == bool(self.values) or any(given) != all(given):
            raise ValueError("must have measure, mean and sd, or values, or tracks")
        for measure, statistic in self.statistics.items():
            if not math.isfinite(statistic.mean):
                raise ValueError(f"has no number of {measure} in values")
        return self

    @property
    def statistics(self) -> dict[str, Statistic]:
        """What its runs give, by measure."""
        if self.values:
            return {measure: Statistic.of(values) for measure, values in self.values.items()}
        assert self.measure is not None and self.mean is not None and self.sd is not None  # by the check above
        return {self.measure: Statistic(self.mean, self.sd, self.sd / math.sqrt(self.n), self.n)}


class Answer(Table):
    """What the constants are for: a measure of another scenario.

    Attributes:
        name: by default that of the file of its scenario.
        scenario, measure: of it.
    """

    name: str
    scenario: Scenario
    measure: Name

    @property
    def statistics(self) -> dict[str, Statistic]:
        """Nobody has measured it."""
        return {self.measure: Statistic.of([])}


class Tracks(Table):
    """A table of tracks, and how the camera has seen them; see feeder_sim.records.tracks."""

    tracks: Name
    fps: Positive | None = None
    mm_per_pixel: Positive | None = None
    origin_px: tuple[Number, Number] = (0.0, 0.0)
    longest_gap_s: Annotated[float, Field(ge=0, le=1e6)] = 0.0

    @property
    def camera(self) -> Camera:
        return Camera(self.fps, self.mm_per_pixel, self.origin_px, self.longest_gap_s)


class Prior(Uncertain):
    """What a constant may be before anything is measured; only: names of the experiments that it belongs to, or all."""

    only: tuple[str, ...] = ()


def read_experiments(path: Path) -> dict[str, Any]:
    """The tables of a file, with the scenarios that it names in place of their files.

    Raises:
        InputError: it or a scenario cannot be read, or a key of `set` is not allowed.
    """
    try:
        raw = tomllib.loads(read_text(path))
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"is no TOML: {error}", file=path) from error
    for kind in ("experiment", "candidate"):
        entries = raw.get(kind, [])
        if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
            raise InputError(f"must be tables, [[{kind}]]", file=path, key=kind)
        raw[kind] = [_with_scenario(entry, path, f"{kind}[{i}]") for i, entry in enumerate(entries)]
    if "answer" in raw:
        if not isinstance(raw["answer"], dict):
            raise InputError("must be a table, [answer]", file=path, key="answer")
        raw["answer"] = _with_scenario(raw["answer"], path, "answer")
    return raw


def _with_scenario(entry: Mapping[str, Any], path: Path, key: str) -> dict[str, Any]:
    name, changes = entry.get("scenario"), entry.get("set", {})
    if not isinstance(name, str):
        raise InputError("is missing, must be the file of a scenario", file=path, key=f"{key}.scenario")
    if not isinstance(changes, dict):
        raise InputError("must be a table of keys of the scenario", file=path, key=f"{key}.set")
    file = _beside(path, name)
    scenario = load_scenario(file).changed({"uncertain": None, **changes}, file=file)
    rest = {name: value for name, value in entry.items() if name not in ("scenario", "set", *Tracks.model_fields)}
    if "tracks" in entry:
        scenario, rest["values"] = _of_tracks(entry, scenario, path, key)
        rest.pop("measure", None)
    return {"name": Path(name).stem, **rest, "scenario": scenario}


def _beside(path: Path, name: str) -> Path:
    """A file named in another one: beside it, or from where the command runs."""
    return path.parent / name if (path.parent / name).exists() else Path(name)


def _of_tracks(
    entry: Mapping[str, Any], scenario: Scenario, path: Path, key: str
) -> tuple[Scenario, dict[str, list[float]]]:
    """The scenario as a camera has seen it, and what the measures give of every run that it saw."""
    given = {name: value for name, value in entry.items() if name in Tracks.model_fields}
    table = validated(given, Tracks, path)
    prepared, seeds = tracked(scenario, _beside(path, table.tracks), table.camera)
    readings = [values_of_seed(prepared, seed) for seed in seeds]
    has_speed = any(math.isfinite(reading.get(SPEED, math.nan)) for reading in readings)
    measures = entry.get("measure", ((SPEED,) if has_speed else VELOCITIES) + SCATTER)
    values = {}
    for measure in [measures] if isinstance(measures, str) else measures:
        check_measure(measure, readings[0], f"{key}.measure")
        of_runs = [reading[measure] for reading in readings]
        if any(math.isfinite(value) for value in of_runs):
            values[measure] = of_runs
    return prepared.scenario, values
