"""A run folder as it was left: finished, interrupted, killed or failed; what it holds, and what is to be said about it.

Measures are computed again from the trajectory, of which every run has one; a run that was killed has no summary.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from feeder_sim.errors import FeederSimError, InputError
from feeder_sim.records.files import locked
from feeder_sim.records.recording import Recording
from feeder_sim.records.seed import Status
from feeder_sim.records.trajectory_file import read_recording
from feeder_sim.run.prepare import prepare
from feeder_sim.run.provenance import changed_inputs, library_versions
from feeder_sim.run.run_folder import RESOLVED
from feeder_sim.run.simulation import Result
from feeder_sim.scenario import Scenario, parse_scenario


@dataclass(frozen=True)
class Recorded:
    """A run on disk.

    Attributes:
        folder: of the run.
        recording: its trajectory.
        result: as the run itself would have it.
        running: whether a process still writes into the folder.
        other_versions: a line where the run was made with other libraries than those that are here now, else "".
        changed_inputs: a line for each file whose content is no longer that of the run.
    """

    folder: Path
    recording: Recording
    result: Result
    running: bool
    other_versions: str
    changed_inputs: tuple[str, ...]

    @property
    def ended(self) -> int:
        """Number of seeds that ran to their end."""
        return sum(status in (Status.DONE, Status.LEFT_PLATE) for status in self.recording.status)

    @property
    def failed(self) -> list[int]:
        """Indices of the seeds that were stopped since their state was not valid."""
        return [index for index, status in enumerate(self.recording.status) if status == Status.DIVERGED]


def recorded_run(run: Path) -> Recorded:
    """Read a run folder, or a file that `export` made of it.

    Raises:
        InputError: no run there, it cannot be read, or a file that its scenario reads is gone.
    """
    recording = read_recording(run)
    folder = recording.path.parent
    scenario = parse_scenario(recording.scenario_text, file=folder / RESOLVED)
    prepared = prepare(scenario)
    result = Result(prepared, recording.started_seeds, recording.wall_s)
    running = result.interrupted and _in_use(folder)
    return Recorded(
        folder, recording, result, running, _other_versions(recording), _changed_inputs(recording, scenario)
    )


def _other_versions(recording: Recording) -> str:
    now = library_versions()
    then = {name: version for name, version in recording.libraries.items() if now.get(name) != version}
    named = ", ".join(f"{name} {version} (now {now.get(name, 'missing')})" for name, version in sorted(then.items()))
    return f"The run was made with other versions than those that measured it for this page: {named}." if named else ""


def _changed_inputs(recording: Recording, scenario: Scenario) -> tuple[str, ...]:
    return tuple(
        f"The file of {key} has changed since the run; measures that depend on it may be wrong."
        for key in changed_inputs(recording.inputs, scenario)
    )


def _in_use(folder: Path) -> bool:
    """Whether another process writes into a folder; nobody else can where this one cannot."""
    try:
        with locked(folder):
            return False
    except FeederSimError as error:
        return isinstance(error, InputError) and "is in use" in error.problem
