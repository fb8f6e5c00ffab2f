"""Keys with units in their names, and numbers, as a reader wants to see them."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from pathlib import PurePath
from typing import Any

# Suffix of a key: its unit. The longest suffix that fits counts.
UNITS = {
    "um_per_vpp": "µm per V peak to peak",
    "um2_per_n": "µm²/N",
    "pm_per_v": "pm/V",
    "n_per_mm": "N/mm",
    "kg_m3": "kg/m3",
    "mm_s": "mm/s",
    "m_s": "m/s",
    "rad_s": "rad/s",
    "deg_s": "degrees/s",
    "g_mm2": "g mm2",
    "mm": "mm",
    "um": "µm",
    "nm": "nm",
    "mm_deg": "mm, mm and degrees",
    "mrad": "mrad",
    "per_min": "1/min",
    "ms": "ms",
    "us": "µs",
    "hz": "Hz",
    "deg": "degrees",
    "vpp": "V peak to peak",
    "gpa": "GPa",
    "ohm": "ohm",
    "ma": "mA",
    "w": "W",
    "n": "N",
    "percent": "%",
    "kg": "kg",
    "g": "g",
    "s": "s",
}
FILES = ("file", "shape", "mode_file", "pieces")  # of which the name is shown, not the path
RANGES = ("drop_height_mm", "yaw_deg", "tilt_deg")  # from which each seed draws its own
LONGEST_CELL = 200  # characters of a value in a table
ENOUGH_DIGITS, FREQUENCY_DIGITS = 4, 6


def split_unit(key: str) -> tuple[str, str]:
    """A key as words, and its unit: `transport_speed_mm_s` is "transport speed" in "mm/s"."""
    if not key.endswith("_per_s"):
        for suffix in sorted(UNITS, key=len, reverse=True):
            if key.endswith(f"_{suffix}"):
                return key.removesuffix(f"_{suffix}").replace("_", " "), UNITS[suffix]
    return key.replace("_", " "), ""


def headed(key: str) -> str:
    """A key as the head of a column: words, and the unit in brackets."""
    words, unit = split_unit(key)
    return f"{words} ({unit})" if unit else words


def sentence(line: str) -> str:
    """A line as a sentence, with a capital and a full stop."""
    return f"{line[:1].upper()}{line[1:].removesuffix('.')}."


def measure_label(measure: str) -> str:
    """A measure by its dotted name as text, with the unit in brackets."""
    path, _, last = measure.rpartition(".")
    return f"{path.replace('_', ' ')}: {headed(last)}" if path else headed(last)


def key_label(key: str) -> str:
    """A key of a scenario as the head of a column: its path as a file has it, and its unit in brackets."""
    path, _, last = key.rpartition(".")
    return f"{path}.{headed(last)}" if path else headed(last)


def key_words(key: str) -> str:
    """A key of a scenario as the label of an axis: `drive[0].amplitude_um` is "amplitude of drive 0 (µm)"."""
    *tables, last = key.removeprefix("schedule.").split(".")
    name, bracket, number = last.partition("[")
    words, unit = split_unit(name)
    text = " of ".join([f"{words}{bracket}{number}", *reversed(tables)]).replace("_", " ")
    text = re.sub(r"\[(\d+)\]", r" \1", text)
    return f"{text} ({unit})" if unit else text


def value_text(value: Any, digits: int = 6) -> str:
    """A value of a key in a table."""
    return number(value, digits) if isinstance(value, float) else str(value)


def point_text(point: Mapping[str, Any]) -> str:
    """Values of keys in words."""
    texts = []
    for key, value in point.items():
        name, unit = split_unit(key.rpartition(".")[2])
        texts.append(f"{name} {value_text(value, 4)}{f' {unit}' if unit else ''}")
    return ", ".join(texts)


def number(value: float, digits: int = ENOUGH_DIGITS) -> str:
    """A number with a few digits; large ones are not rounded to powers of ten."""
    if math.isnan(value):
        return ""
    if float(value).is_integer() and abs(value) < 1e6:
        return f"{value:.0f}"
    if 10**digits <= abs(value) < 1e6:
        return f"{value:.0f}"
    return f"{value:.{digits}g}"


def cell_text(key: str, value: Any) -> str:
    """A value in a table: a number as exact as its unit needs, both ends of bounds, lists with commas."""
    if value is None:
        return ""
    if isinstance(value, Sequence) and not isinstance(value, str):
        if "bounds" in key and len(value) == 2:
            return between(*value)
        return ", ".join(cell_text(key, entry) for entry in value)
    if isinstance(value, float):
        return number(value, FREQUENCY_DIGITS if key.endswith("_hz") else ENOUGH_DIGITS)
    return worded(value) if isinstance(value, bool) else str(value)


def with_error(value: float, error: float) -> tuple[str, str]:
    """A value and its error [the same unit] with as many places as two digits of the error need."""
    if math.isnan(value):
        return "", ""
    if not (math.isfinite(error) and error > 0.0):
        return number(value), "" if math.isnan(error) else number(error)
    places = max(0, 1 - math.floor(math.log10(error)))
    if places > 6:
        return f"{value:.6g}", f"{error:.2g}"
    return f"{value:.{places}f}", f"{error:.{places}f}"


def between(low: float, high: float) -> str:
    """Both ends of an interval with as many places as two digits of its width need; empty without one."""
    if not (math.isfinite(low) and math.isfinite(high)):
        return ""
    first, last = (with_error(end, high - low)[0] for end in (low, high))
    return first if low == high else f"{first} to {last}"


def worded(value: Any) -> str:
    """A value of a scenario as text; tables in it as "key value" with units."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, int | float):
        return number(float(value), 6)
    if isinstance(value, Mapping):
        return ", ".join(f"{split_unit(key)[0]} {worded_in(key, inner)}" for key, inner in value.items())
    if isinstance(value, Sequence) and not isinstance(value, str):
        separator = "; " if any(isinstance(inner, Mapping) for inner in value) else ", "
        return separator.join(worded(inner) for inner in value)
    text = str(value)
    return text if len(text) <= LONGEST_CELL else f"{text[: LONGEST_CELL - 3]}..."


def worded_in(key: str, value: Any) -> str:
    """The value of a key with its unit; of a file only the name, of a range both ends unless they are the same."""
    unit = split_unit(key)[1]
    text = worded_of(key, value)
    return f"{text} {unit}" if unit else text


def worded_of(key: str, value: Any) -> str:
    """The same without the unit."""
    if key in FILES and isinstance(value, str):
        return PurePath(value).name
    if key in RANGES and isinstance(value, Sequence) and len(value) == 2:
        low, high = (worded(end) for end in value)
        return low if low == high else f"{low} to {high}"
    return worded(value)
