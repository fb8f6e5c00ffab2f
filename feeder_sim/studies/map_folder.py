"""The folder of a speed map: what was asked, a journal of the points that are done, the table, a picture.

map.toml        what was asked
scenario.toml   the scenario that was mapped, with all its defaults
journal.jsonl   the points that are done
map.csv         one row per point, see `MapPoint`
map.png         the picture
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

from feeder_sim.errors import InputError, quoted
from feeder_sim.jobs.folder import WorkFolder, usual_folder
from feeder_sim.scenario import Scenario
from feeder_sim.studies.speed_map import MapPoint, without_nan
from feeder_sim.studies.sweep.design import read_axis
from feeder_sim.studies.sweep.question import axis_texts

MAPS = Path("maps")
MOST_VALUES = 1000  # of a list
QUESTION, DATA, PICTURE = "map.toml", "map.csv", "map.png"


def values_of(text: str, argument: str) -> list[float]:
    """Numbers above 0, written as an axis of a sweep is; `argument` is the one that holds them.

    Raises:
        InputError: it is written otherwise, or a value is not above 0.
    """
    try:
        values = read_axis(f"{argument}={text}").values
    except InputError as error:
        raise InputError(error.problem, argument=argument) from None
    if not values or len(values) > MOST_VALUES or not all(isinstance(v, int | float) and v > 0 for v in values):
        problem = f"is {quoted(text)}, allowed is LOW:HIGH:COUNT, LOW:HIGH:logCOUNT or A,B,C, all above 0"
        raise InputError(problem, argument=argument)
    return sorted(float(f"{value:.6g}") if ":" in text else float(value) for value in values)


def text_of(values: str | Iterable[float], key: str) -> str:
    """Values as the command line has them, from such a text or from numbers.

    Raises:
        InputError: they are neither.
    """
    return axis_texts({key: values})[0].partition("=")[2]


def map_folder(
    path: Path | None, name: str, scenario: Scenario, frequency: str, amplitude: str, seeds: int
) -> WorkFolder:
    """The folder of a map: a given one, or one below `MAPS` by a name; the values as the command line has them."""
    import tomli_w

    asked = tomli_w.dumps({"frequency": frequency, "amplitude": amplitude, "seeds": seeds})
    same = f"{frequency} {amplitude}"
    return WorkFolder(path or usual_folder(MAPS, name, QUESTION, scenario, same), QUESTION, asked, scenario, same=same)


def write_points(folder: WorkFolder, points: Sequence[MapPoint]) -> None:
    """Write the table in place of the one before."""
    text = io.StringIO()
    writer = csv.DictWriter(text, [field.name for field in fields(MapPoint)], lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows_of(points))
    folder.write(DATA, text.getvalue().encode())


def rows_of(points: Sequence[MapPoint]) -> list[dict[str, Any]]:
    """The points by column; None where there is no number."""
    return [without_nan(asdict(point)) for point in points]
