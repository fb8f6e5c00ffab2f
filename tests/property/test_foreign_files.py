"""Drawings and meshes as other programs write them: what is taken is what was drawn, all else is refused in time.

file = file_of("svg", 54)  # the file that a failure names
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Any

import foreign_dxf
import foreign_meshes
import foreign_svg
import pytest
from drawn_plates import Truth
from foreign_files import ForeignFile
from foreign_meshes import taken_volume, volume_difference
from independent_drawings import dxf_reading, svg_reading
from limited_reading import LimitedReader
from taken_plates import between, difference, plate_text, taken_plate

FILES = 300  # of each kind: 120 without fault, 90 odd ones, 90 hostile ones
SHOWN = 12  # failures
Make = Callable[[Random], ForeignFile]
KINDS: dict[str, tuple[Make, Callable[[Random, str], ForeignFile], tuple[str, ...], Make]] = {
    "dxf": (foreign_dxf.ordinary_dxf, foreign_dxf.odd_dxf, foreign_dxf.ODD, foreign_dxf.hostile_dxf),
    "svg": (foreign_svg.ordinary_svg, foreign_svg.odd_svg, foreign_svg.ODD, foreign_svg.hostile_svg),
    "mesh": (foreign_meshes.ordinary_mesh, foreign_meshes.odd_mesh, foreign_meshes.ODD, foreign_meshes.hostile_mesh),
}
READINGS: dict[str, Callable[[bytes, str | None], Truth]] = {"dxf": dxf_reading, "svg": svg_reading}


def file_of(kind: str, number: int) -> ForeignFile:
    """The same for the same arguments; of ten files four are ordinary, three odd and three hostile."""
    ordinary, odd, oddities, hostile = KINDS[kind]
    rng = Random(f"{kind} {number}")
    if number % 5 < 2:
        return ordinary(rng)
    if number % 10 in (2, 7, 9):
        return odd(rng, oddities[number // 5 % len(oddities)])
    return hostile(rng)


def written(file: ForeignFile, folder: Path) -> Path:
    """What the reader is given: a mesh, or a plate file beside its drawing."""
    path = folder / f"file{file.suffix}"
    path.write_bytes(file.content)
    if file.suffix not in (".dxf", ".svg"):
        return path
    (folder / "plate.toml").write_text(plate_text(file, path.name))
    return folder / "plate.toml"


def problem(file: ForeignFile, read: LimitedReader, compare: Callable[[Any, ForeignFile], str], folder: Path) -> str:
    """What is wrong with what became of a file; "" if nothing is."""
    answer = read(written(file, folder))
    if answer.failure:
        return answer.failure
    if answer.refusal:
        return f"is refused: {answer.refusal.replace(str(folder), '')}" if file.ordinary else ""
    return "" if file.truths is None else compare(answer.value, file)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="asks Linux for the memory of a process")
@pytest.mark.parametrize("kind", KINDS)
def test_what_is_taken_is_what_was_drawn(kind: str, tmp_path: Path) -> None:
    reader: Callable[[Path], Any] = taken_volume if kind == "mesh" else taken_plate
    compare: Callable[[Any, ForeignFile], str] = volume_difference if kind == "mesh" else difference
    (tmp_path / "warm").mkdir()
    read = LimitedReader(reader, written(file_of(kind, 0), tmp_path / "warm"))
    problems = []
    for number in range(FILES):
        file = file_of(kind, number)
        if text := problem(file, read, compare, tmp_path):
            problems.append(f"{kind} {number}, {file.said}: {text}")
    read.close()
    shown = "\n".join(problems[:SHOWN])
    assert not problems, f"{len(problems)} of {FILES} files, the first ones:\n{shown}"


@pytest.mark.slow
@pytest.mark.parametrize("kind", READINGS)
def test_another_reading_says_the_same_of_the_drawings(kind: str) -> None:
    """So that what is drawn stands in the file, and not only in the plan that the file was written from."""
    for number in range(FILES):
        file = file_of(kind, number)
        if file.ordinary:
            assert file.truths is not None
            reading = READINGS[kind](file.content, file.unit)
            assert between(reading, file.truths[0]) == "", f"{kind} {number}, {file.said}"


def test_a_file_of_each_kind_is_read(tmp_path: Path) -> None:
    """Plain ones, so that the slow test does not compare nothing."""
    drawing, mesh = file_of("dxf", 1), file_of("mesh", 1)
    assert drawing.ordinary and difference(taken_plate(written(drawing, tmp_path)), drawing) == ""
    assert mesh.ordinary and volume_difference(taken_volume(written(mesh, tmp_path)), mesh) == ""
