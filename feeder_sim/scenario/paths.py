"""The files that a scenario reads: which they are, and the same scenario with other names for them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from feeder_sim.scenario.plate import ModePlate, Rectangle
from feeder_sim.scenario.schedule import Pick, Stage

if TYPE_CHECKING:
    from feeder_sim.scenario.scenario import Scenario

Change = Callable[[Path], Path]


def input_files(scenario: Scenario) -> dict[str, Path]:
    """The files that a scenario reads, by its keys: mode file, meshes of parts, their pieces, shapes of grippers."""
    files: dict[str, Path] = {}
    if isinstance(scenario.plate, Rectangle | ModePlate) and scenario.plate.mode_file is not None:
        files["plate.mode_file"] = scenario.plate.mode_file
    for i, part in enumerate(scenario.part):
        files |= {f"part[{i}].{key}": file for key, file in part.files.items()}
    picks = scenario.schedule.picks if scenario.schedule else ()
    return files | {f"{key}.shape": pick.shape for key, pick in picks if pick.shape is not None}


def with_files(scenario: Scenario, change: Change) -> Scenario:
    """The scenario with another name for each of its files; pieces that lie beside their mesh are named, too."""
    plate, schedule = scenario.plate, scenario.schedule
    if isinstance(plate, Rectangle | ModePlate) and plate.mode_file is not None:
        plate = plate.model_copy(update={"mode_file": change(plate.mode_file)})
    parts = [part.model_copy(update={k: change(file) for k, file in part.files.items()}) for part in scenario.part]
    if schedule is not None:
        groups = {
            group: tuple(_stage_with(stage, change) for stage in getattr(schedule, group))
            for group in ("prepare", "stage")
        }
        schedule = schedule.model_copy(update=groups)
    return scenario.model_copy(update={"plate": plate, "part": tuple(parts), "schedule": schedule})


def _stage_with(stage: Stage, change: Change) -> Stage:
    """The stage with other names for the shapes of its grippers."""
    if isinstance(stage.pick, Pick):
        return stage.model_copy(update={"pick": _pick_with(stage.pick, change)})
    return stage.model_copy(update={"pick": tuple(_pick_with(pick, change) for pick in stage.picks) or None})


def _pick_with(pick: Pick, change: Change) -> Pick:
    return pick if pick.shape is None else pick.model_copy(update={"shape": change(pick.shape)})
