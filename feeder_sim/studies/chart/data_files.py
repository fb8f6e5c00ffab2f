"""Rows of a chart as CSV and as JSON."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

Row = dict[str, Any]


def finite_rows(rows: Iterable[Row]) -> list[Row]:
    """Rows as JSON takes them: a number that is not finite becomes None."""
    return [{k: None if isinstance(v, float) and not math.isfinite(v) else v for k, v in row.items()} for row in rows]


def write_rows(finite: Sequence[Row], folder: Path, name: str) -> None:
    """Write rows with the same keys to NAME.csv and NAME.json of a folder; None is an empty field in CSV."""
    with (folder / f"{name}.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(finite[0]))
        writer.writeheader()
        writer.writerows(finite)
    (folder / f"{name}.json").write_text(json.dumps(finite, indent=1), encoding="utf-8")
