"""Tables that a spreadsheet has written with another separator than the comma."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import pytest
from conftest import refusal

from feeder_sim.comma_separated import check_commas
from feeder_sim.plate.imported.shapes_csv import read_shapes_csv
from feeder_sim.plate.waveform import read_waveform


@pytest.mark.parametrize(("separator", "word"), [(";", "semicolons"), ("\t", "tabs"), ("|", "bars"), (" ", "spaces")])
def test_another_separator_is_named(separator: str, word: str) -> None:
    text = "# remarks, with commas; semicolons\n\n" + separator.join(["x_mm", "y_mm", "mode_1"])
    for read in (check_commas, read_shapes_csv, partial(read_waveform, arm=0.1)):
        expected = f"own.csv: has {word} between its columns, must be commas, and points in numbers"
        assert refusal(read, text, Path("own.csv")) == expected


@pytest.mark.parametrize("text", ["", "# a;b", "t_ms", "t_ms, x_um", "a, b;c"])
def test_other_tables_are_left_to_their_readers(text: str) -> None:
    check_commas(text, Path("own.csv"))
