"""Tables of comma-separated values that another program has written: what stands between their columns."""

from __future__ import annotations

from pathlib import Path

from feeder_sim.errors import InputError

SEPARATORS = {";": "semicolons", "\t": "tabs", "|": "bars", " ": "spaces"}  # the likeliest first


def check_commas(text: str, file: str | Path) -> None:
    """Refuse a table whose columns are named with something else than commas between them; `file` is for the message.

    Names of columns stand in the first line that is not empty and not a remark.

    Raises:
        InputError: it has semicolons, as spreadsheets write where the decimal sign is a comma, or tabs, bars, spaces.
    """
    lines = (line.strip() for line in text.splitlines())
    names = next((line for line in lines if line and not line.startswith("#")), "")
    if "," in names:
        return
    for separator, word in SEPARATORS.items():
        if separator in names:
            raise InputError(f"has {word} between its columns, must be commas, and points in numbers", file=file)
