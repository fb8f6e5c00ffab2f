"""A run folder: finished, interrupted, killed or failed. It is the only way in to a run on disk.

Measures are computed again from what is recorded; a run that was killed has no summary.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

from feeder_sim.errors import FeederSimError, InputError
from feeder_sim.records.files import locked
from feeder_sim.records.recording import Recording
from feeder_sim.records.seed import Status
from feeder_sim.records.trajectory_file import read_recording
from feeder_sim.run.prepare import prepare
from feeder_sim.run.provenance import changed_inputs, library_versions
from feeder_sim.run.simulation import Result
from feeder_sim.scenario import Scenario, parse_scenario
from feeder_sim.scenario.engine_choice import TRACKED
from feeder_sim.scene.prepared import Prepared

RESOLVED = "scenario.toml"  # its name in a run folder


@dataclass(frozen=True)
class RecordedRun:
    """A run on disk. What it needs of the scenario is made when it is asked for.

    Attributes:
        recording: what is recorded of it.
    """

    recording: Recording

    @staticmethod
    def open(path: Path) -> RecordedRun:
        """Read a run folder, or a file that `export` made of it.

        Raises:
            InputError: no run there, or it cannot be read.
        """
        return RecordedRun(read_recording(path))

    @property
    def folder(self) -> Path:
        """Of the run."""
        return self.recording.path.parent

    @cached_property
    def scenario(self) -> Scenario:
        """What was run.

        Raises:
            InputError: it is refused here, as with a shape of a package that is not installed.
        """
        return parse_scenario(self.recording.scenario_text, file=self.folder / RESOLVED)

    @cached_property
    def changed_inputs(self) -> list[str]:
        """Keys of the files whose content is no longer that of the run.

        Raises:
            InputError: a file is missing.
        """
        return changed_inputs(self.recording.inputs, self.scenario)

    def check_inputs(self) -> None:
        """Refuse a run whose files are no longer those that it has read.

        Raises:
            InputError: a file is missing or has another content.
        """
        if changed := self.changed_inputs:
            raise InputError(f"was begun with another content of {changed[0]}, must be the same one", file=self.folder)

    @cached_property
    def changed_versions(self) -> dict[str, tuple[str, str]]:
        """Libraries that have another version now: then and now, by their names."""
        now = library_versions()
        then = sorted(self.recording.libraries.items())
        return {name: (version, now.get(name, "missing")) for name, version in then if now.get(name) != version}

    @cached_property
    def prepared(self) -> Prepared:
        """The scenario, prepared again.

        Raises:
            InputError: a file that it reads is missing, or it cannot be built.
        """
        prepared = prepare(self.scenario)
        return replace(prepared, engine=TRACKED) if self.is_tracked else prepared

    @property
    def is_tracked(self) -> bool:
        """Whether a camera has seen it, and nothing was computed."""
        return self.recording.engine == TRACKED.name

    @cached_property
    def result(self) -> Result:
        """As the run itself would have it; errors as for `prepared`."""
        return Result(self.prepared, self.recording.started_seeds, self.recording.wall_s)

    @property
    def is_running(self) -> bool:
        """Whether a process still writes into the folder; nobody else can where this one cannot."""
        if Status.UNFINISHED not in self.recording.status:
            return False
        try:
            with locked(self.folder):
                return False
        except FeederSimError as error:
            return isinstance(error, InputError) and "is in use" in error.problem

    @property
    def ended(self) -> int:
        """Number of seeds that ran to their end."""
        return sum(status in (Status.DONE, Status.LEFT_PLATE) for status in self.recording.status)

    @property
    def failed(self) -> list[int]:
        """Indices of the seeds that were stopped since their state was not valid."""
        return [index for index, status in enumerate(self.recording.status) if status == Status.DIVERGED]
