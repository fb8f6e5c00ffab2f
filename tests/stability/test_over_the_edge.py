"""Many nuts over the edge of the plate at rest: what tips over falls down beside the plate, and not into it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from invariants import energy

from feeder_sim.constants import GRAVITY
from feeder_sim.run.simulation import simulate
from feeder_sim.scenario import Scenario
from feeder_sim.scenario.tables import validated

HALF, THICK = 90e-3, 3e-3  # of the plate [m]


@pytest.mark.parametrize("number", [0, 1, pytest.param(5, marks=pytest.mark.slow)])
def test_what_tips_over_the_edge_does_not_get_under_the_plate(number: int) -> None:
    rng = np.random.default_rng(number)
    parts = []
    for y in np.arange(-84.0, 85.0, 8.0):
        for side in (-1.0, 1.0):
            start = {
                "kind": "state",
                "position_mm": [89.5 * side, float(y), 4.0],
                "quaternion": _unit(rng.normal(size=4)),
                "velocity_mm_s": [20.0 * side * rng.random(), 5.0 * rng.normal(), 0.0],
                "angular_velocity_rad_s": (20.0 * rng.normal(size=3)).tolist(),
            }
            parts.append({"shape": "hex_nut", "size": "M2.5", "start": start})
    raw = {
        "plate": {"kind": "still", "length_mm": 2e3 * HALF, "width_mm": 2e3 * HALF},
        "contact": {"friction": 0.5},
        "part": parts,
        "run": {"duration_s": 0.4, "seeds": 1, "frames_per_second": 500.0},
    }
    result = simulate(validated(raw, Scenario, Path("edge.toml")))
    position = result.seeds[0].frames.position
    assert not result.failures
    assert 20 < (position[-1, :, 2] < 0.0).sum() < 40  # most tip over
    below = (position[..., 2] < 0.0) & (position[..., 2] > -THICK)
    assert not (below & (np.abs(position[..., 0]) < HALF - 1e-3)).any()


def test_what_slides_over_the_edge_is_not_lifted_onto_the_plate_again() -> None:
    """Thin boxes spin as they fall beside the plate, at any time within its windows: none gains energy."""
    parts, velocity, spin = [], np.array([-273.5, -334.3, 0.0]), -65.9
    for i, x in enumerate(np.linspace(-70.0, 70.0, 8)):
        late, turn = -1e-3 * i, 2.377 - 1e-3 * i * spin
        start = {
            "kind": "state",
            "position_mm": (np.array([x, 1.55 - 1e3 * HALF, 0.184]) + velocity * late).tolist(),
            "quaternion": [0.0, float(np.sin(0.5 * turn)), float(np.cos(0.5 * turn)), 0.0],
            "velocity_mm_s": velocity.tolist(),
            "angular_velocity_rad_s": [0.0, 0.0, spin],
        }
        parts.append({"shape": "box", "size_mm": [18.45, 1.726, 0.3646], "start": start})
    raw = {
        "plate": {"kind": "still", "length_mm": 2e3 * HALF, "width_mm": 2e3 * HALF},
        "contact": {"friction": 0.0, "restitution": 0.5},
        "part": parts,
        "run": {"duration_s": 0.1, "seeds": 1, "frames_per_second": 1000.0},
    }
    result = simulate(validated(raw, Scenario, Path("edge.toml")))
    frames = result.seeds[0].frames
    assert (frames.position[-1, :, 2] < -5e-3).all()
    total = energy(result.scene, frames)
    weight = np.array([part.mass for part in result.scene.parts]) * GRAVITY
    assert (np.diff(total, axis=0) / weight).max() < 1e-7


def _unit(quaternion: np.ndarray) -> list[float]:
    return [float(value) for value in quaternion / np.linalg.norm(quaternion)]
