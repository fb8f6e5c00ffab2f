"""Tracks of parts that a camera has seen from above, from a table of another program.

A row is one part in one frame: time, part, x, y and perhaps an angle. Columns are known by their names:

    time     t_s, time_s, t, time [s]; t_ms, time_ms; frame, of which `fps` makes times
    part     part, particle, id, track, track_id, object
    x, y     x_mm, x_m, x_cm, x_um: in the axes of the plate; x, x_px: pixels, of which `mm_per_pixel` makes lengths
    angle    angle_deg, angle_rad, theta_deg, theta_rad: about z, counter-clockwise seen from above; may be missing

The y of pixels points down, as in images, and `origin_px` is the middle of the plate. TrackPy writes x, y, frame and
particle, scripts with OpenCV mostly t, id, x and y.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from feeder_sim.comma_separated import check_commas
from feeder_sim.errors import InputError, cause_of

MOST_BYTES = 500_000_000
TIMES: Mapping[str, float | None] = {
    "t_s": 1.0,
    "time_s": 1.0,
    "t": 1.0,
    "time": 1.0,
    "t_ms": 1e-3,
    "time_ms": 1e-3,
    "frame": None,
}
PARTS = ("part", "particle", "id", "track", "track_id", "object")
LENGTHS: Mapping[str, float | None] = {"_mm": 1e-3, "_m": 1.0, "_cm": 1e-2, "_um": 1e-6, "": None, "_px": None}
ANGLES = {
    f"{name}_{unit}": size for name in ("angle", "theta") for unit, size in (("deg", math.pi / 180.0), ("rad", 1.0))
}
GAP = 1.5  # intervals between two frames, from which one is missing


@dataclass(frozen=True)
class Camera:
    """How a film was taken, as far as its table does not say it.

    Attributes:
        fps: frames per second, where the table has frames in place of times.
        mm_per_pixel: where places are pixels.
        origin_px: pixel over the middle of the plate.
        longest_gap_s: for which a part may be missing; straight lines fill such gaps.
    """

    fps: float | None = None
    mm_per_pixel: float | None = None
    origin_px: tuple[float, float] = (0.0, 0.0)
    longest_gap_s: float = 0.0


@dataclass(frozen=True)
class Track:
    """One part, as it was seen.

    Attributes:
        part: its name in the table.
        time: [s], shape (n,), rising.
        place: x and y of its middle in the axes of the plate [m], shape (n, 2).
        angle: about z, without jumps of a turn [rad], shape (n,); NaN where the table has none.
    """

    part: str
    time: NDArray[np.float64]
    place: NDArray[np.float64]
    angle: NDArray[np.float64]


def read_tracks(file: Path, camera: Camera = Camera()) -> tuple[Track, ...]:
    """The tracks of a table, in the order in which their parts come in it.

    Raises:
        InputError: it cannot be read, a column or what makes its unit is missing, a value is no number, times of a part
            go back, or it is missing for longer than it may.
    """
    names, rows = _rows(file)
    columns = _Columns.of(names, camera, file)
    by_part: dict[str, list[tuple[int, list[float]]]] = {}
    for line, row in rows:
        if len(row) != len(names):
            raise InputError(f"has {len(row)} values, must be {len(names)}", file=file, key=f"line {line}")
        by_part.setdefault(row[columns.part].strip(), []).append((line, columns.values(row, line, file)))
    if not by_part:
        raise InputError("has no rows", file=file)
    tracks = [_track(part, seen, file) for part, seen in by_part.items()]
    interval = interval_of(tracks)
    return tuple(_filled(track, interval, camera.longest_gap_s, file) for track in tracks)


def _rows(file: Path) -> tuple[list[str], list[tuple[int, list[str]]]]:
    """Names of the columns, and the other lines with their numbers."""
    try:
        if file.stat().st_size > MOST_BYTES:
            raise InputError(f"is larger than {MOST_BYTES // 10**6} MB", file=file)
        text = file.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"cannot be read: {cause_of(error)}", file=file) from error
    check_commas(text, file)
    reader = csv.reader(io.StringIO(text))
    lines = ((reader.line_num, row) for row in reader if any(row) and not row[0].startswith("#"))
    _, names = next(lines, (0, []))
    return [name.strip().lower() for name in names], list(lines)


@dataclass(frozen=True)
class _Columns:
    """Where a table has what, and what makes SI units of it: seconds, metres, radians."""

    part: int
    numbers: tuple[int, ...]  # time, x, y and perhaps an angle
    scale: tuple[float, ...]
    shift: tuple[float, ...]

    @staticmethod
    def of(names: list[str], camera: Camera, file: Path) -> _Columns:
        if not names:
            raise InputError("is empty", file=file)
        time = _one_of(TIMES, names, "time", file)
        places = [_one_of([f"{axis}{unit}" for unit in LENGTHS], names, axis, file) for axis in "xy"]
        if places[0][1:] != places[1][1:]:
            raise InputError(f"is in another unit than {places[0]}, must be the same", file=file, key=places[1])
        second = TIMES[time] or 1.0 / _known(camera.fps, time, "fps", file)
        metre, origin = LENGTHS[places[0][1:]], (0.0, 0.0)
        signs = 1.0, 1.0
        if metre is None:
            metre = 1e-3 * _known(camera.mm_per_pixel, places[0], "mm_per_pixel", file)
            signs, origin = (1.0, -1.0), camera.origin_px
        angles = [name for name in ANGLES if name in names][:1]
        return _Columns(
            names.index(_one_of(PARTS, names, "part", file)),
            tuple(names.index(name) for name in (time, *places, *angles)),
            (second, *(sign * metre for sign in signs), *(ANGLES[name] for name in angles)),
            (0.0, *origin, *(0.0 for _ in angles)),
        )

    def values(self, row: list[str], line: int, file: Path) -> list[float]:
        """Time, x, y and angle of a row."""
        values = []
        for column, scale, shift in zip(self.numbers, self.scale, self.shift, strict=True):
            try:
                value = float(row[column])
            except ValueError:
                value = math.nan
            if not math.isfinite(value):
                raise InputError(f"is {row[column]!r}, must be a number", file=file, key=f"line {line}")
            values.append(scale * (value - shift))
        return values if len(values) > 3 else [*values, math.nan]


def _one_of(known: Iterable[str], names: list[str], what: str, file: Path) -> str:
    known = list(known)
    present = [name for name in known if name in names]
    if len(present) != 1:
        problem = f"are {' and '.join(present)}, must be one of them" if present else "is missing"
        raise InputError(f"{problem}, must be {', '.join(known)}" if not present else problem, file=file, key=what)
    return present[0]


def _known(value: float | None, column: str, key: str, file: Path) -> float:
    if value is None:
        raise InputError(f"is needed for the column {column!r}, whose name has no unit", file=file, key=key)
    return value


def _track(part: str, seen: list[tuple[int, list[float]]], file: Path) -> Track:
    key = f"part {part}"
    if len(seen) < 2:
        raise InputError(f"has one row, on line {seen[0][0]}, must have 2 and more", file=file, key=key)
    for (_, (before, *_)), (line, (now, *_)) in pairwise(seen):
        if now <= before:
            problem = "is there twice" if now == before else "goes back"
            raise InputError(f"time {problem} on line {line}, from {before:g} to {now:g} s", file=file, key=key)
    values = np.array([row for _, row in seen])
    return Track(part, values[:, 0], values[:, 1:3], np.unwrap(values[:, 3]))


def _filled(track: Track, interval: float, longest: float, file: Path) -> Track:
    """A track whose gaps are filled by straight lines."""
    steps = np.diff(track.time)
    for row in np.flatnonzero(steps > GAP * interval):
        if steps[row] > longest:
            allowed = f"must be none longer than longest_gap_s, {longest:g} s"
            gap = f"has a gap of {steps[row]:.3g} s after {track.time[row]:.6g} s"
            problem = f"{gap}, {allowed}; shorter ones are filled by straight lines"
            raise InputError(problem, file=file, key=f"part {track.part}")
    frames = np.maximum(1, np.rint(steps / interval)).astype(int)
    if (frames == 1).all():
        return track
    pieces = [track.time[i] + steps[i] * np.arange(n) / n for i, n in enumerate(frames)]
    time = np.append(np.concatenate(pieces), track.time[-1])
    columns = [np.interp(time, track.time, each) for each in (*track.place.T, track.angle)]
    return Track(track.part, time, np.column_stack(columns[:2]), columns[2])


def interval_of(tracks: Iterable[Track]) -> float:
    """Time between two frames of a film [s]."""
    return float(np.median(np.concatenate([np.diff(track.time) for track in tracks])))
