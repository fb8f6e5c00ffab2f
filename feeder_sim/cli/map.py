"""The command `map`: transport speed of a part over drive frequency and amplitude."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from feeder_sim.cli.files import naming, naming_options, scenario_of
from feeder_sim.cli.options import AsJson, ScenarioFile, Seed, Set
from feeder_sim.cli.terminal import notify, progress_bar, stop_on_signal
from feeder_sim.errors import InputError, Interrupted, printable, quoted

if TYPE_CHECKING:
    from feeder_sim.studies.speed_map import MapPoint


def map_(
    scenario_file: ScenarioFile,
    frequency: Annotated[
        str,
        typer.Option("--frequency", help="Drive frequencies [Hz]: LOW:HIGH:COUNT, LOW:HIGH:logCOUNT or A,B,C."),
    ] = "2500:10000:40",
    amplitude: Annotated[str, typer.Option("--amplitude", help="Amplitudes [um], likewise.")] = "0.3:6:log40",
    settings: Set = None,
    seeds: Annotated[int, typer.Option("--seeds", min=1, max=10_000, help="Seeds of every point.")] = 12,
    seed: Seed = None,
    out: Annotated[Path | None, typer.Option("--out", help="Folder of the map [maps/NAME].")] = None,
    mark: Annotated[
        list[str] | None,
        typer.Option("--mark", help="Measured point to draw: frequency [Hz], amplitude [um], speed [mm/s]."),
    ] = None,
    workers: Annotated[int | None, typer.Option("--workers", min=1, help="Threads [one per core].")] = None,
    as_json: AsJson = False,
) -> None:
    """Map the transport speed of a part over drive frequency and amplitude; running the same again goes on."""
    from feeder_sim.studies.map_folder import PICTURE, map_folder, values_of, write_points

    with naming_options():
        frequencies, amplitudes = values_of(frequency, "frequency"), values_of(amplitude, "amplitude")
    marks = [mark_of(text) for text in mark or ()]
    scenario = scenario_of(scenario_file, None, None, seed, settings)
    with naming(scenario_file):
        from feeder_sim.plots.speed_map import draw_speed_map
        from feeder_sim.run.advice import not_drawn
        from feeder_sim.studies.speed_map import check_mapped, speed_map

        check_mapped(scenario)
        home = map_folder(out, scenario_file.stem, scenario, frequency, amplitude, seeds)
        title = scenario.title or scenario_file.stem
        for caution in not_drawn(scenario):
            notify(f"caution: {caution}")
        with home, stop_on_signal() as stop, progress_bar(title, stop) as progress:
            points = speed_map(
                scenario,
                frequencies,
                amplitudes,
                seeds=seeds,
                journal=home.journal,
                workers=workers,
                progress=progress,
                stop=stop,
                notify=notify,
            )
            write_points(home, points)
            if points:
                draw_speed_map(points, home.path / PICTURE, title=title, marks=marks)
    complete = len(points) == len(frequencies) * len(amplitudes)
    _print(points, home.path, as_json)
    if not complete:
        typer.echo("feeder-sim: not complete; what was computed is kept, the same command goes on", err=True)
        raise typer.Exit(Interrupted.exit_code)


def mark_of(text: str) -> tuple[float, float, float]:
    """A measured point: frequency [Hz], amplitude [um] and speed [mm/s].

    Raises:
        InputError: not three numbers above 0.
    """
    try:
        frequency, amplitude, speed = (float(part) for part in text.split(","))
        if not all(0.0 < value < math.inf for value in (frequency, amplitude, speed)):
            raise ValueError
    except ValueError:
        problem = f"is {quoted(text)}, allowed are three numbers above 0 such as 4750,1.0,1.44"
        raise InputError(problem, key="--mark") from None
    return frequency, amplitude, speed


def _print(points: list[MapPoint], folder: Path, as_json: bool) -> None:
    from feeder_sim.studies.map_folder import rows_of

    if as_json:
        print(json.dumps({"folder": str(folder), "points": rows_of(points)}))
        return
    arrived = [point for point in points if point.n]
    print(f"{len(points)} points, {len(arrived)} with arrivals, {sum(p.failed for p in points)} failed seeds")
    for line in _fastest(points):
        print(line)
    print(f"written to {printable(str(folder))}")


def _fastest(points: list[MapPoint]) -> Iterator[str]:
    """Where parts are fastest, as far as that can be told, and what it is worth."""
    from feeder_sim.measures.statistic import LARGEST_OF_MANY
    from feeder_sim.studies.speed_map import fastest_of

    best = fastest_of(points)
    if best is None:
        yield "fastest: not told, at no point at least half of the seeds arrive"
        return
    error = f" +- {best.se:.3f}" if math.isfinite(best.se) else ""
    where = f"{best.frequency_hz:g} Hz, {best.amplitude_um:g} um, n = {best.n} of {best.seeds}"
    yield f"fastest, where at least half of the seeds arrive: {best.mean:.3f}{error} mm/s at {where}"
    if len(points) > 1:
        yield LARGEST_OF_MANY
