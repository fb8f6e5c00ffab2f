"""Experiments and priors as a user writes them.

[[experiment]]
scenario = "drift_4750hz.toml"
measure = "transport_speed_mm_s"
mean = 1.44
sd = 0.27                # of one run
n = 6
[[candidate]]            # that could be done next; mean is not known
scenario = "ball_558hz.toml"
measure = "flight_height_mm"
sd = 0.05
n = 10
[prior]
contact.restitution = { uniform = [0.05, 0.7], also = ["contact.part_restitution"] }
"drive[0].amplitude_um" = { log_normal = [1.0, 0.1], only = ["drift_8775hz"] }
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from feeder_sim.errors import InputError
from feeder_sim.scenario import Scenario, load_scenario
from feeder_sim.scenario.tables import Positive, Table, read_text
from feeder_sim.scenario.uncertain import Number, Uncertain

MOST_CONSTANTS = 6  # of which the posterior is found by draws from the prior


class Candidate(Table):
    """An experiment that can be done: what is measured in a scenario, how far one run scatters, and how many runs.

    Attributes:
        name: by default that of the file of its scenario.
        scenario: at the constants of which the priors say nothing.
        measure: of the scenario.
        sd: of one measured run, in the unit of the measure.
        n: measured runs.
    """

    name: str
    scenario: Scenario
    measure: Annotated[str, Field(strict=True, min_length=1)]
    sd: Positive
    n: Annotated[int, Field(strict=True, ge=1, le=1_000_000)] = 1


class Experiment(Candidate):
    """One that has been done; mean: over its runs."""

    mean: Number


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
    return raw


def _with_scenario(entry: Mapping[str, Any], path: Path, key: str) -> dict[str, Any]:
    name, changes = entry.get("scenario"), entry.get("set", {})
    if not isinstance(name, str):
        raise InputError("is missing, must be the file of a scenario", file=path, key=f"{key}.scenario")
    if not isinstance(changes, dict):
        raise InputError("must be a table of keys of the scenario", file=path, key=f"{key}.set")
    beside = path.parent / name
    file = beside if beside.exists() else Path(name)
    scenario = load_scenario(file).changed({"uncertain": None, **changes}, file=file)
    rest = {name: value for name, value in entry.items() if name not in ("scenario", "set")}
    return {"name": Path(name).stem, **rest, "scenario": scenario}
