"""The command `map`: transport speed of a part over drive frequency and amplitude."""

from __future__ import annotations

import csv
import io
import json
import math
from dataclasses import asdict, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from feeder_sim.cli.files import naming, scenario_of
from feeder_sim.cli.terminal import notify, progress_bar, stop_on_signal
from feeder_sim.errors import InputError, Interrupted, not_written, quoted

if TYPE_CHECKING:
    from feeder_sim.studies.speed_map import MapPoint

MOST_VALUES = 1000  # of a list
DATA, PICTURE = "map.csv", "map.png"


def map_(
    scenario_file: Annotated[
        Path, typer.Argument(help="Scenario file (TOML) of one part on a strip.", show_default=False)
    ],
    frequency: Annotated[
        str,
        typer.Option(
            "--frequency", help="Drive frequencies [Hz]: LOW:HIGH:COUNT, COUNTlog for equal ratios, or A,B,C."
        ),
    ] = "2500:10000:40",
    amplitude: Annotated[str, typer.Option("--amplitude", help="Amplitudes [um], likewise.")] = "0.3:6:40log",
    seeds: Annotated[int, typer.Option("--seeds", min=1, max=10_000, help="Seeds of every point.")] = 12,
    out: Annotated[Path, typer.Option("--out", help="Folder for data and picture; the same map goes on there.")] = Path(
        "map"
    ),
    mark: Annotated[
        list[str] | None,
        typer.Option("--mark", help="Measured point to draw: frequency [Hz], amplitude [um], speed [mm/s]."),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout.")] = False,
) -> None:
    """Map the transport speed of a part over drive frequency and amplitude; done points are kept."""
    frequencies, amplitudes = values_of(frequency, "--frequency"), values_of(amplitude, "--amplitude")
    marks = [mark_of(text) for text in mark or ()]
    scenario = scenario_of(scenario_file, None, None, None)
    with naming(scenario_file):
        from feeder_sim.records.own_files import locked
        from feeder_sim.studies.speed_map import JOURNAL, check_mapped, speed_map

        check_mapped(scenario)
        _own_folder(out, JOURNAL)
        with (
            locked(out),
            stop_on_signal() as stop,
            progress_bar(scenario.title or scenario_file.stem, stop) as progress,
        ):
            points = speed_map(
                scenario,
                frequencies,
                amplitudes,
                seeds=seeds,
                journal=out / JOURNAL,
                progress=progress,
                stop=stop,
                notify=notify,
            )
            _write(points, out, scenario.title or scenario_file.stem, marks)
    complete = len(points) == len(frequencies) * len(amplitudes)
    _print(points, out, as_json)
    if not complete:
        raise Interrupted(f"interrupted; what was computed is in {out}, the same command goes on")


def values_of(text: str, key: str) -> list[float]:
    """The values of LOW:HIGH:COUNT, with "log" at the count for equal ratios, or of numbers with commas between.

    Raises:
        InputError: it is written otherwise, or a value is not above 0.
    """
    import numpy as np

    allowed = "LOW:HIGH:COUNT, LOW:HIGH:COUNTlog, or numbers above 0 with commas between, none of them twice"
    try:
        if ":" in text:
            low, high, number = text.split(":")
            log = "log" in number
            ends, count = (float(low), float(high)), int(number.replace("log", "", 1))
            if not (0.0 < ends[0] < ends[1] < math.inf and 2 <= count <= MOST_VALUES):
                raise ValueError
            values = (np.geomspace if log else np.linspace)(*ends, count).tolist()
        else:
            values = sorted(float(part) for part in text.split(","))
            if not (values[0] > 0.0 and values[-1] < math.inf and len(set(values)) == len(values) <= MOST_VALUES):
                raise ValueError
    except ValueError:
        raise InputError(f"is {quoted(text)}, allowed is {allowed}", key=key) from None
    return [float(f"{value:.6g}") for value in values]


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


def _own_folder(folder: Path, journal: str) -> None:
    """Make the folder of a map, or take one that holds a map already.

    Raises:
        InputError: it is a file, or holds something else.
    """
    if folder.exists() and not folder.is_dir():
        raise InputError("is a file, allowed is a folder", file=folder, key="--out")
    if folder.is_dir() and any(folder.iterdir()) and not (folder / journal).is_file():
        raise InputError("holds other files, allowed is a new folder or that of a map", file=folder, key="--out")
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise not_written(folder, error) from error


def _write(points: list[MapPoint], folder: Path, title: str, marks: list[tuple[float, float, float]]) -> None:
    """Write the table and draw the picture."""
    from feeder_sim.plots.speed_map import draw_speed_map
    from feeder_sim.records.whole_file import write_whole
    from feeder_sim.studies.speed_map import MapPoint, without_nan

    text = io.StringIO()
    writer = csv.DictWriter(text, [field.name for field in fields(MapPoint)], lineterminator="\n")
    writer.writeheader()
    writer.writerows(without_nan(asdict(point)) for point in points)
    write_whole(folder / DATA, text.getvalue().encode())
    if points:
        draw_speed_map(points, folder / PICTURE, title=title, marks=marks)


def _print(points: list[MapPoint], folder: Path, as_json: bool) -> None:
    from feeder_sim.studies.speed_map import without_nan

    if as_json:
        print(json.dumps({"folder": str(folder), "points": [without_nan(asdict(point)) for point in points]}))
        return
    arrived = [point for point in points if point.n]
    print(f"{len(points)} points, {len(arrived)} with arrivals, {sum(p.failed for p in points)} failed seeds")
    if arrived:
        fastest = max(arrived, key=lambda point: point.mean)
        where = f"{fastest.frequency_hz:g} Hz, {fastest.amplitude_um:g} um"
        print(f"fastest: {fastest.mean:.3f} +- {fastest.se:.3f} mm/s at {where}, n = {fastest.n} of {fastest.seeds}")
    print(f"written to {folder}")
