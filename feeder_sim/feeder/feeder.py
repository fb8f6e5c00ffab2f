"""A feeder that a program runs: it vibrates, looks at the parts, picks, and fills in new ones.

    with feeder_sim.Feeder(scenario).record("runs/loop") as feeder:
        while len(feeder.poses()):
            feeder.vibrate("gather" if crowded(feeder.poses()) else "separate")
            feeder.pick(feeder.poses().part[0])

Nothing is set back between two stages: parts fly on, and the plate rings down from one into the next.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from feeder_sim.errors import InputError, NotAllowed, check_type, check_whole, path_of_user
from feeder_sim.feeder.catalogue import Catalogue
from feeder_sim.feeder.poses import Poses, poses_of
from feeder_sim.measures.picking import pickable
from feeder_sim.measures.protocol import labelled
from feeder_sim.notebook import block, counted, line
from feeder_sim.records.seed import Cause, Status, parts_removed
from feeder_sim.run.compilation import compile_engine
from feeder_sim.run.open_run import OpenRun
from feeder_sim.run.prepare import prepare
from feeder_sim.run.run_folder import check_free, record_ended
from feeder_sim.run.simulation import Result
from feeder_sim.scenario import Pick, Scenario, Stage
from feeder_sim.scenario.tables import validated
from feeder_sim.scene.fits import check_pick
from feeder_sim.scene.scene import Scene
from feeder_sim.single_thread import single_threaded

MOST_LISTED = 8  # of the stages that have been run, in a notebook


class Feeder:
    """One plate with parts on it, at a time that goes on with every stage.

    Args:
        scenario: has a schedule, whose stages can be run by name or number, in any order; its order, cycles and number
            of seeds do not count. Stages that prepare the parts are run at once.
        seed: of all random numbers, in place of `run.seed`.
        stages: more that can be run, as tables or as what makes one.
        threads: that may be used, which does not change the result.

    Raises:
        InputError: anything about the scenario or a stage that is not allowed, or two stages of one name.
    """

    @single_threaded
    def __init__(
        self,
        scenario: Scenario,
        seed: int = 0,
        *,
        stages: Sequence[Stage | Mapping[str, Any]] = (),
        threads: int = 1,
    ) -> None:
        self._begin(Catalogue(scenario, seed, stages), check_whole(threads, "threads"))

    def _begin(self, catalogue: Catalogue, threads: int) -> None:
        self._catalogue, self._threads = catalogue, threads
        self._sequence: list[int] = []
        self._folder: Path | None = None
        self._replay, self._by_hand, self._closed, self._began = True, False, False, False
        compile_engine(catalogue.prepared)
        self._run = OpenRun(catalogue.prepared, threads=threads)
        self._run.run_stages(self._scene())

    @single_threaded
    def again(self, seed: int) -> Self:
        """A new feeder at time 0 that can run the same stages, without what it takes to make them ready."""
        fresh = self.__class__.__new__(self.__class__)
        fresh._begin(self._catalogue.with_seed(seed), self._threads)
        return fresh

    def __repr__(self) -> str:
        title = f" {self.scene.scenario.title!r}" if self.scene.scenario.title else ""
        there = f"{counted(len(self.poses()), 'part')} on the plate, {len(self.picked)} picked, {len(self.lost)} lost"
        closed = ", closed" if self._closed else ""
        return line(f"Feeder{title} at {self.time:.6g} s: {there}, {counted(len(self._sequence), 'stage')} run{closed}")

    def _repr_html_(self) -> str:
        last = ["..."] * (len(self._sequence) > MOST_LISTED) + list(self.sequence[-MOST_LISTED:])
        lines = [labelled("can run", ", ".join(self.stage_names)), labelled("has run", ", ".join(last) or "nothing")]
        folder = [labelled("recorded in", str(self._folder))] if self._folder else []
        return block(repr(self)[1:-1], [*lines, *folder])

    @property
    def time(self) -> float:
        """Simulated time since the start [s]."""
        return float(self._run.current().time[0])

    @property
    def scene(self) -> Scene:
        """The scene in SI units, with the stages that have been run."""
        return self._scene()

    @property
    def stage_names(self) -> tuple[str, ...]:
        """Names of all stages that can be run, in the order of their numbers."""
        return self._catalogue.names

    @property
    def stages(self) -> tuple[Stage, ...]:
        """All stages that can be run, in the order of their numbers."""
        return self._catalogue.stages

    @property
    def sequence(self) -> tuple[str, ...]:
        """Names of the stages that have been run, in order."""
        return tuple(self.stage_names[i] for i in self._sequence)

    @property
    def picked(self) -> NDArray[np.int64]:
        """Numbers of the parts picked so far, in order; after a refill a number may come again."""
        return parts_removed(self._run.removals, Cause.PICKED)

    @property
    def lost(self) -> NDArray[np.int64]:
        """Numbers of the parts lost over the edge of the plate so far, in order."""
        return parts_removed(self._run.removals, Cause.LOST)

    def poses(self) -> Poses:
        """Where the parts on the plate are now, and how they lie."""
        return poses_of(self._catalogue.prepared.scene, self._run.current())

    @single_threaded
    def vibrate(self, stage: Stage | Mapping[str, Any] | str | int | None = None, **values: Any) -> NDArray[np.int64]:
        """Run one stage: its drives, its pause, and its pick if it has one; returns the numbers of the parts picked.

        Args:
            stage: its name or number, or a table of a schedule as a `Stage` or as what makes one.
            values: such a table in keywords, instead of `stage`.

        Raises:
            InputError: there is no such stage, its table is not allowed, or it drives modes that no other stage drives;
                nothing has happened then. Also when no part is left.
            SimulationDiverged: a state that no part can have; the feeder cannot go on.
        """
        self._check_open()
        if (stage is None) == (not values):
            raise InputError("must be exactly one: a stage, or the values of one as keywords", key="vibrate")
        n_stages = len(self.stage_names)
        number = self._catalogue.number(validated(values, Stage, Path("stage")) if stage is None else stage)
        if self._run.status != Status.UNFINISHED:
            raise InputError("no part is left on the plate, must be a scenario with [refill] to go on", key="vibrate")
        if len(self.stage_names) > n_stages:
            self._run.widen(self._catalogue.prepared)
        if not self._began and self._folder is None:
            self._run.forget()
        before, self._began = len(self.picked), True
        self._sequence.append(number)
        self._run.run_stages(self._scene())
        return self.picked[before:]

    def pick(self, parts: ArrayLike) -> NDArray[np.int64]:
        """Take parts out of the scene, by one number or several; returns the numbers.

        Raises:
            InputError: a number that no part on the plate has, or one that comes twice; nothing is picked then.
        """
        self._check_open()
        there = self.poses().part
        try:
            chosen = np.atleast_1d(np.asarray(parts))
        except ValueError:  # lists of different lengths
            raise NotAllowed(parts, "the number of a part, or several", key="pick") from None
        if chosen.ndim != 1 or (chosen.size and not np.issubdtype(chosen.dtype, np.integer)):
            raise NotAllowed(parts, "the number of a part, or several", key="pick")
        missing = chosen[~np.isin(chosen, there)]
        if len(missing):
            raise InputError(f"is {missing[0]}, must be the numbers of the {len(there)} parts on the plate", key="pick")
        if len(np.unique(chosen)) < len(chosen):
            raise InputError("names a part twice, must be once", key="pick")
        if len(chosen):
            self._by_hand = True
            self._run.pick(chosen.astype(np.int64))
        return chosen.astype(np.int64)

    def pick_by(self, rule: Pick | Mapping[str, Any]) -> NDArray[np.int64]:
        """Pick all parts that a rule of a schedule allows now; returns their numbers.

        Args:
            rule: a `Pick`, or what makes one, such as {"clearance_mm": 10.0}.

        Raises:
            InputError: the rule is not allowed.
        """
        self._check_open()
        pick = checked_pick(rule)
        scene = self._catalogue.prepared.scene
        check_pick(scene, pick, "pick")
        return self.pick(pickable(scene, (pick,), self._run.current()))

    def refill(self, n: int) -> NDArray[np.int64]:
        """Let up to n new parts fall onto the plate, where `[refill]` of the scenario says; returns their numbers.

        Fewer come where there is no room, or where not so many parts of the scenario are off the plate.

        Raises:
            InputError: n is no whole number from 1 to that of all parts, or the scenario has no [refill].
        """
        self._check_open()
        requested = check_whole(n, "refill", most=len(self._catalogue.prepared.scene.parts))
        if self._catalogue.prepared.scenario.refill is None:
            raise InputError("is missing, must be a scenario that says where new parts come from", key="refill")
        self._by_hand = True
        return self._run.refill(requested)

    def record(self, folder: str | Path, *, replay: bool = True) -> Self:
        """Write all that is done from the start on into a run folder, when the feeder is closed; returns the feeder.

        Args:
            folder: made if missing; it must be empty.
            replay: also build the .rrd.

        Raises:
            InputError: a stage has been run already, or the folder is not empty.
        """
        self._check_open()
        if self._began:
            raise InputError("comes after a stage, must be before the first one", key="record")
        path = path_of_user(folder, "folder")
        check_free(path)
        self._folder, self._replay = path, replay
        return self

    def close(self) -> Result | None:
        """End the run; writes the run folder and returns its result if it is recorded.

        Raises:
            InputError: nothing was done, or the folder has been taken in the meantime.
            RecordingFailed: a file cannot be written.
        """
        if self._closed or self._folder is None:
            self._closed = True
            return None
        self._closed = True
        if not self._began:
            raise InputError("nothing to record, must be a feeder that has run a stage", key="record")
        return record_ended(prepare(self._resolved()), self._folder, [self._run.ended()], replay=self._replay)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None or self._began:
            self.close()

    def _resolved(self) -> Scenario:
        """The scenario of what was done, checked as one from a file is."""
        scenario = self._catalogue.scenario(self._sequence, by_hand=self._by_hand)
        return validated(scenario.model_dump(), Scenario, Path("Feeder"))

    def _scene(self) -> Scene:
        """The scene with all stages so far, those that have ended and those that have not begun."""
        scenario = self._catalogue.scenario(self._sequence, by_hand=self._by_hand)
        return replace(self._catalogue.prepared.scene, scenario=scenario).stopped(self._run.stops.tolist())

    def _check_open(self) -> None:
        if self._closed:
            raise InputError("is closed, must be a new one", key="Feeder")
        if self._run.status == Status.DIVERGED:
            raise InputError("has diverged, must be a new one", key="Feeder")


def checked_pick(rule: Pick | Mapping[str, Any]) -> Pick:
    """A rule as a scenario would take it.

    Raises:
        InputError: any key or value that is not allowed.
    """
    check_type(rule, Pick | Mapping, "a Pick, or a table of one", "pick")
    return rule if isinstance(rule, Pick) else validated(dict(rule), Pick, Path("pick"))
