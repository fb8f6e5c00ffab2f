"""A run that was recorded, as the result it was."""

from __future__ import annotations

import contextlib
import json
import tomllib
from functools import cached_property
from pathlib import Path
from typing import Any

from feeder_sim.api.result import Result
from feeder_sim.errors import InputError, path_of_user
from feeder_sim.records.files import SCENE
from feeder_sim.records.recording import PlateRecord, Recording
from feeder_sim.records.seed import Status
from feeder_sim.records.trajectory_file import export_recording
from feeder_sim.run.recorded_run import RESOLVED, RecordedRun
from feeder_sim.run.run_folder import SUMMARY
from feeder_sim.scenario import Scenario
from feeder_sim.scene.prepared import Prepared
from feeder_sim.studies.ask import kind_of


def open(run: str | Path) -> OpenedRun:
    """Open a run that was recorded, also one that was interrupted or has failed.

    The scene is prepared once it is needed, as for measures, which are computed again from the frames.

    Args:
        run: its folder, or a file that `feeder-sim export` made of it.

    Raises:
        InputError: there is no run, as in the folder of a sweep, or a file of it cannot be read.
    """
    path = path_of_user(run, "open")
    if path.is_dir() and not (path / SCENE).is_file():
        _refuse_question(path)
    return OpenedRun(RecordedRun.open(path))


def _refuse_question(folder: Path) -> None:
    """Say what a folder is that holds a question of many runs, and what reads it."""
    if kind := kind_of(folder):
        shows = "feeder_sim.open_study reads it, `feeder-sim report` shows it"
        raise InputError(f"is the folder of {kind.kind}, which keeps no run: {shows}", file=folder)


class OpenedRun(Result):
    """The result of a run that was recorded.

    If a file that its scenario reads is missing or has changed, or if the scenario is refused, as with a shape of a
    package that is not installed, frames, impacts, plots of paths and the stored summary can be had. All else is an
    `InputError` that says so.

    Attributes:
        recording: what its files hold.
        stored_summary: summary.json beside them, as it was last written; None without one.
    """

    recording: Recording
    stored_summary: dict[str, Any] | None
    _run: RecordedRun

    def __init__(self, run: RecordedRun) -> None:
        state = {
            "recording": run.recording,
            "seeds": run.recording.started_seeds,
            "wall_s": run.recording.wall_s,
            "stored_summary": _stored(run.folder / SUMMARY),
            "_run": run,
        }
        for name, value in state.items():
            object.__setattr__(self, name, value)  # it is frozen

    @property
    def scenario(self) -> Scenario:
        return self._run.scenario

    @cached_property
    def prepared(self) -> Prepared:
        without = "so that only frames, impacts and the stored summary can be had"
        try:
            changed = self._run.changed_inputs
        except InputError as error:
            if error.file == self._run.folder / RESOLVED:  # the scenario itself is refused
                raise
            raise InputError(f"{error.problem}, {without}", file=error.file) from error
        if changed:
            problem = f"has another content than when this was run, {without}"
            raise InputError(problem, file=self.recording.path, key=changed[0])
        return self._run.prepared

    @property
    def title(self) -> str:
        return str(self._written.get("title", ""))

    @property
    def part_kinds(self) -> tuple[str, ...]:
        with contextlib.suppress(InputError):
            return super().part_kinds
        return tuple(part.get("name", part["shape"]) for part in self._written["part"] for _ in range(part["count"]))

    @cached_property
    def _written(self) -> dict[str, Any]:
        """The scenario as it was written, which may be refused here."""
        return tomllib.loads(self.recording.scenario_text)

    @property
    def interrupted(self) -> bool:
        return any(status == Status.UNFINISHED for status in self.recording.status)

    @property
    def plate(self) -> PlateRecord:
        return self.recording.plate

    @property
    def part_names(self) -> tuple[str, ...]:
        return tuple(part.name for part in self.recording.parts)

    def to_hdf5(self, path: str | Path) -> None:
        export_recording(self.recording, path_of_user(path, "path"))

    def summary(self) -> dict[str, Any]:
        """As of any result; the stored one if measures cannot be had.

        Raises:
            InputError: neither can be had.
        """
        try:
            return super().summary()
        except InputError:
            if self.stored_summary is None:
                raise
            return self.stored_summary


def _stored(path: Path) -> dict[str, Any] | None:
    """A summary that was stored; None without a readable one."""
    with contextlib.suppress(OSError, ValueError, RecursionError):
        summary = json.loads(path.read_text(encoding="utf-8"))
        return summary if isinstance(summary, dict) else None
    return None
