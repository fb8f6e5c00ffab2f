"""Modes of the plate as values of a key: a key that ends in `.mode` takes the frequency of the drive along.

The frequency is that of the measured resonance where the mode file has one, else the natural frequency.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from feeder_sim.errors import InputError
from feeder_sim.plate.mode_file import read_mode_file
from feeder_sim.scenario import Scenario
from feeder_sim.scenario.changes import changed_values

MODE = ".mode"


def with_frequencies(scenario: Scenario, point: Mapping[str, Any], *, file: Path = Path("scenario")) -> dict[str, Any]:
    """What a point changes in a scenario: its values, and the frequencies that go with its modes.

    A drive whose frequency the point has itself keeps that one.

    Raises:
        InputError: the plate has no mode file, or no such mode; `file` names the scenario.
    """
    along: dict[str, Any] = {}
    for key, value in point.items():
        drive = key.removesuffix(MODE)
        if drive != key and f"{drive}.frequency_hz" not in point:
            plate = changed_values(scenario.model_dump(), point, file)["plate"]
            frequency = _frequency(mode_frequencies(plate), key, value)
            along |= {f"{drive}.frequency_hz": frequency, f"{drive}.natural_frequency_hz": None}
    return along | dict(point)


def mode_frequencies(plate: Any) -> tuple[float, ...]:
    """Where each mode of a plate is driven [Hz]; `plate` is the table of a scenario, checked or not.

    Raises:
        InputError: it has no mode file.
    """
    file = plate.get("mode_file") if isinstance(plate, Mapping) else None
    if not isinstance(file, str | Path):
        raise InputError("is missing, allowed is a mode file where modes are varied", key="plate.mode_file")
    try:
        state = Path(file).stat()
    except OSError:
        return _read(Path(file), 0, 0)  # which says what is wrong
    return _read(Path(file), state.st_mtime_ns, state.st_size)


@functools.lru_cache(8)
def _read(file: Path, changed: int, size: int) -> tuple[float, ...]:
    held = read_mode_file(file)
    found = [float(frequency) for frequency in held.modes.natural_frequency]
    for resonance in held.resonances:
        found[resonance.mode] = resonance.frequency
    return tuple(found)


def _frequency(frequencies: tuple[float, ...], key: str, mode: Any) -> float:
    if not isinstance(mode, int) or not 1 <= mode <= len(frequencies):
        raise InputError(f"is {mode}, allowed is 1 to {len(frequencies)}, the modes of the plate", key=key)
    return frequencies[mode - 1]
