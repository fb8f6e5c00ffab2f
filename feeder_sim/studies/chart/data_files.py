"""Rows of a chart as CSV and as JSON."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any


def write_rows(rows: Sequence[dict[str, Any]], folder: Path, name: str) -> None:
    """Write rows with the same keys to NAME.csv and NAME.json of a folder.

    A number that is not finite becomes an empty field in CSV and null in JSON.
    """
    finite = [{k: None if isinstance(v, float) and not math.isfinite(v) else v for k, v in row.items()} for row in rows]
    with (folder / f"{name}.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(finite[0]))
        writer.writeheader()
        writer.writerows(finite)
    (folder / f"{name}.json").write_text(json.dumps(finite, indent=1), encoding="utf-8")
