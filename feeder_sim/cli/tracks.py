"""The command `tracks`: what a camera has seen of the parts of a scenario, as a run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from feeder_sim.cli.files import AsJson, ScenarioFile, Set, file_in_errors, options_in_errors, scenario_of
from feeder_sim.cli.report import print_result


def tracks(
    scenario_file: ScenarioFile,
    file: Annotated[Path, typer.Argument(metavar="TRACKS", help="Table of tracks (.csv).", show_default=False)],
    fps: Annotated[float | None, typer.Option("--fps", help="Frames per second, of a table with frames.")] = None,
    mm_per_pixel: Annotated[
        float | None, typer.Option("--mm-per-pixel", help="Scale of a table of pixels, whose y points down.")
    ] = None,
    origin_px: Annotated[
        tuple[float, float], typer.Option("--origin-px", help="Pixel over the middle of the plate.")
    ] = (0.0, 0.0),
    longest_gap: Annotated[
        float, typer.Option("--longest-gap-s", min=0.0, help="For which a part may be missing; filled by lines.")
    ] = 0.0,
    settings: Set = None,
    out: Annotated[Path | None, typer.Option("--out", help="Folder for the run [runs/TRACKS-001, -002, ...].")] = None,
    as_json: AsJson = False,
) -> None:
    """Record what a camera has seen of the parts of a scenario; `compare`, `report` and `replay` take it as a run."""
    from feeder_sim.records.tracks import Camera
    from feeder_sim.run.run_folder import check_free, fresh_folder, record_ended
    from feeder_sim.run.tracked import tracked

    scenario = scenario_of(scenario_file, None, None, None, settings)
    if out is not None:
        check_free(out)
    with file_in_errors(scenario_file), options_in_errors():
        prepared, seeds = tracked(scenario, file, Camera(fps, mm_per_pixel, origin_px, longest_gap))
    folder = out or fresh_folder(file.stem)
    with options_in_errors():
        result = record_ended(prepared, folder, seeds, replay=False)
    print_result(result, folder, as_json)
