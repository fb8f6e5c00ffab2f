"""Scenes shared by the tests, built in code."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from feeder_sim.scenario import Contact, Drive, HexNut, PistonPlate, Run, Scenario, Start, Strip

REPOSITORY = Path(__file__).parents[1]


@pytest.fixture
def repository() -> Path:
    return REPOSITORY


def strip_scenario(
    *, frequency_hz: float = 4750.0, amplitude_um: float = 1.0, x_mm: float = 1.95, **run: Any
) -> Scenario:
    """An M2.5 nut near the antinode of a standing wave."""
    return Scenario(
        plate=Strip(thickness_mm=3.0),
        drive=(Drive(frequency_hz=frequency_hz, amplitude_um=amplitude_um),),
        part=(HexNut(size="M2.5", start=Start(position_mm=(x_mm, 0.0))),),
        run=Run(**({"duration_s": 0.05, "seeds": 1} | run)),
    )


def piston_scenario(
    *,
    frequency_hz: float = 4750.0,
    amplitude_um: float = 0.0,
    start: Start | None = None,
    part: Any = None,
    contact: Contact | None = None,
    **run: Any,
) -> Scenario:
    """A part over a plate that moves as a whole; at rest by default."""
    start = start or Start()
    return Scenario(
        plate=PistonPlate(kind="piston"),
        drive=(Drive(frequency_hz=frequency_hz, amplitude_um=amplitude_um),),
        part=(part or HexNut(size="M2.5", start=start),),
        contact=contact or Contact(),
        run=Run(**({"duration_s": 0.05, "seeds": 1} | run)),
    )
