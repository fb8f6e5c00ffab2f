"""What a folder holds, a run or a study, as a document."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from feeder_sim.document.document import Document
from feeder_sim.errors import InputError, path_of_user
from feeder_sim.records.trajectory_file import TRAJECTORY
from feeder_sim.report.run_report import run_document
from feeder_sim.report.study_report import study_document
from feeder_sim.studies.kinds import KINDS, kind_of


def document_of(
    folder: str | Path,
    *,
    screenshot: bool = False,
    progress: Callable[[float], None] | None = None,
    notify: Callable[[str], None] | None = None,
) -> Document:
    """A run, or a question asked of many runs, as a document: `html()` is a page, `text()` for a terminal.

    A notebook shows it as it is.

    Args:
        folder: of the run, or of the question; of a run also its trajectory file.
        screenshot: also take a picture of the replay, which takes seconds; of a run.
        progress: called with the fraction done.
        notify: takes a line for the user, such as that there is no graphics driver.

    Raises:
        InputError: the folder holds neither, or cannot be read, or a study has no replay to take a picture of.
    """
    path = path_of_user(folder, "folder")
    if not path.exists():
        raise InputError("no such folder", file=path)
    if kind := kind_of(path):
        if screenshot:
            problem = f"is not allowed for the folder of {kind.kind}, which keeps no recordings"
            raise InputError(problem, file=path, argument="screenshot")
        return study_document(path)
    if not (path / TRAJECTORY).is_file() and not (path.suffix == ".h5" and path.is_file()):
        allowed = f"a folder that holds {', '.join((TRAJECTORY, *(kind.file for kind in KINDS.values())))}"
        raise InputError(f"is no run and no question of many runs, allowed is {allowed}", file=path)
    return run_document(path, with_screenshot=screenshot, progress=progress, notify=notify)
