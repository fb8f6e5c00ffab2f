"""Scenes shared by the tests, built in code."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from feeder_sim.records.trajectory import Frames
from feeder_sim.scenario import Contact, Drive, HexNut, PistonPlate, Run, Scenario, Start, Strip
from feeder_sim.scene.scene import Scene

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


def hull_distances(scene: Scene, frames: Frames) -> NDArray[np.float64]:
    """Distance of all hulls that are near each other, over all frames [m]."""
    import mujoco
    from scipy.spatial import cKDTree

    from feeder_sim.engines.impulse.hulls import HullLibrary

    library = HullLibrary([kind.corners for kind in scene.kinds], [kind.corner_radius for kind in scene.kinds])
    model, data = library._model, library._data
    largest, found = 2.0 * max(kind.size for kind in scene.kinds), []
    for row in range(len(frames)):
        there = np.flatnonzero(frames.present[row])
        for a, b in cKDTree(frames.position[row, there]).query_pairs(largest):
            for copy, part in ((0, there[a]), (1, there[b])):
                body = 2 * scene.kind_of[part] + copy
                data.mocap_pos[body] = frames.position[row, part]
                data.mocap_quat[body] = frames.quaternion[row, part]
            mujoco.mj_kinematics(model, data)
            first, second = 2 * scene.kind_of[there[a]], 2 * scene.kind_of[there[b]] + 1
            found.append(mujoco.mj_geomDistance(model, data, int(first), int(second), 1e-3, None))
    return np.array(found)
