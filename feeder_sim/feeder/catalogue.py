"""The stages that a feeder can be told to run: those of its scenario, those it was given, and new ones like them.

The first ones decide which modes the plate has, and how fine the steps are. A later one may drive the same modes in any
way, but no others, and none faster, for its steps would have to be finer.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from feeder_sim.errors import InputError, NotAllowed, Unknown, check_type
from feeder_sim.run.prepare import prepare
from feeder_sim.scenario import Scenario, Stage, check_scenario, with_run
from feeder_sim.scenario.tables import validated
from feeder_sim.scene.prepared import Prepared

STAGE, FEEDER = Path("stage"), Path("Feeder")  # name what is given in code in messages


class Catalogue:
    """Stages by name and number, and the scene of all of them.

    Args:
        scenario: has a schedule; order and repetition of its stages do not matter.
        seed: in place of that of the scenario.
        stages: more of them.

    Attributes:
        prepared: the scene, before any stage.

    Raises:
        InputError: no schedule, two stages of one name, or anything that `prepare` refuses.
    """

    def __init__(self, scenario: Scenario, seed: int, stages: Sequence[Stage | Mapping[str, Any]]) -> None:
        check_scenario(scenario)
        check_type(stages, Sequence, "a list of stages", "stages")
        if scenario.schedule is None:
            raise InputError("is missing, must be a scenario with stages that a feeder can run", key="schedule")
        tables = [*scenario.schedule.stage, *(_checked(stage) for stage in stages)]
        self._scenario = with_run(scenario, file=FEEDER, seeds=1, seed=seed)
        self._by_hand = scenario.schedule.by_hand
        self._stages: list[Stage] = []
        for stage in tables:
            self._name(stage)
        self.prepared = self._prepared()

    def with_seed(self, seed: int) -> Catalogue:
        """The same stages, with other random numbers."""
        other = copy(self)
        other._stages = list(self._stages)
        other._scenario = with_run(self._scenario, file=FEEDER, seed=seed)
        scene = replace(self.prepared.scene, scenario=other.scenario((), by_hand=False))
        other.prepared = replace(self.prepared, scene=scene)
        return other

    @property
    def stages(self) -> tuple[Stage, ...]:
        """All stages, in the order of their numbers."""
        return tuple(self._stages)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all stages, in the order of their numbers."""
        return tuple(stage.name for stage in self._stages)

    def number(self, stage: Stage | Mapping[str, Any] | str | int) -> int:
        """Number of a stage; one that is new and can be run is added.

        Raises:
            InputError: there is none of this name or number, or it cannot be run.
        """
        if isinstance(stage, bool) or not isinstance(stage, Stage | Mapping | str | int | np.integer):
            raise NotAllowed(stage, "a stage: its name, number or table", key="stage")
        if isinstance(stage, str):
            if stage not in self.names:
                raise Unknown(stage, self.names, key="stage")
            return self.names.index(stage)
        if isinstance(stage, int | np.integer):
            if not 0 <= stage < len(self._stages):
                raise InputError(f"is {stage}, must be 0 to {len(self._stages) - 1}", key="stage")
            return int(stage)
        return self._number_of_table(_checked(stage))

    def scenario(self, sequence: Sequence[int], *, by_hand: bool) -> Scenario:
        """The scenario in which stages have come in some order; it is not checked."""
        assert self._scenario.schedule is not None
        names = self.names
        update = {
            "stage": tuple(self._stages),
            "cycles": 1,
            "sequence": tuple(names[i] for i in sequence),
            "by_hand": by_hand or self._by_hand,
        }
        return self._scenario.model_copy(update={"schedule": self._scenario.schedule.model_copy(update=update)})

    def _number_of_table(self, stage: Stage) -> int:
        """Number of a table that is known, but perhaps for its name, or can be added."""
        for number, existing in enumerate(self._stages):
            if stage == existing or (not stage.name and stage == existing.model_copy(update={"name": ""})):
                return number
        before = self.prepared
        self._name(stage)
        try:
            after = self._prepared()
            _check_unchanged(before, after)
        except InputError:
            self._stages.pop()
            raise
        self.prepared = after
        return len(self._stages) - 1

    def _name(self, stage: Stage) -> None:
        """Add a stage, with a name of its own."""
        name = stage.name or f"stage {len(self._stages) + 1}"
        if name in self.names:
            raise InputError(f'is "{name}", which another stage has, must be a name of its own', key="stage.name")
        self._stages.append(stage.model_copy(update={"name": name}))

    def _prepared(self) -> Prepared:
        """The scene of all stages, checked, before any of them."""
        scenario = self._scenario.model_dump()
        scenario["schedule"] |= {"stage": [stage.model_dump() for stage in self._stages], "sequence": None, "cycles": 1}
        prepared = prepare(validated(scenario, Scenario, FEEDER))
        return replace(prepared, scene=replace(prepared.scene, scenario=self.scenario((), by_hand=False)))


def _checked(stage: Stage | Mapping[str, Any]) -> Stage:
    """A stage as a scenario would take it.

    Raises:
        InputError: any key or value that is not allowed.
    """
    check_type(stage, Stage | Mapping, "a Stage, or a table of one", "stage")
    return stage if isinstance(stage, Stage) else validated(dict(stage), Stage, STAGE)


def _check_unchanged(before: Prepared, after: Prepared) -> None:
    """Refuse a stage that changes more of a scene than its drives."""
    old, new = before.scene, after.scene
    if old.surface.table.shape != new.surface.table.shape or not np.array_equal(old.surface.table, new.surface.table):
        raise InputError(
            "drives a mode that no other stage drives, must be the modes of the schedule and of Feeder(stages=...)",
            key="stage",
        )
    if (old.timestep, old.steps_per_frame) != (new.timestep, new.steps_per_frame):
        raise InputError(
            f"needs steps of {1e6 * new.timestep:.3g} us, must be those of {1e6 * old.timestep:.3g} us that the "
            "schedule and Feeder(stages=...) need",
            key="stage",
        )
