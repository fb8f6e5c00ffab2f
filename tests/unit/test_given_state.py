"""Parts that start with their whole state, weighed parts, and plates that nothing moves."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from feeder_sim.constants import GRAVITY
from feeder_sim.engines.lookup import engine_class
from feeder_sim.errors import InputError
from feeder_sim.run.prepare import prepare
from feeder_sim.run.simulation import simulate
from feeder_sim.scenario import Scenario
from feeder_sim.scenario.tables import validated

TURN = Rotation.from_euler("xyz", [0.3, -0.8, 1.9])
SPIN = np.array([3.0, -20.0, 11.0])  # [rad/s]
STATE = {
    "kind": "state",
    "position_mm": [10.0, -20.0, 60.0],
    "quaternion": TURN.as_quat(scalar_first=True).tolist(),
    "velocity_mm_s": [300.0, 100.0, 200.0],
    "angular_velocity_rad_s": SPIN.tolist(),
}
BOX = {"shape": "box", "size_mm": [6.0, 6.0, 15.0], "material": "steel"}


def scenario(part: dict[str, Any] | None = None, start: dict[str, Any] | None = None, **tables: Any) -> Scenario:
    raw = {
        "plate": {"kind": "still"},
        "part": [BOX | (part or {}) | {"start": STATE | (start or {})}],
        "run": {"seeds": 1, "duration_s": 0.1, "frames_per_second": 1000.0},
    }
    return validated(raw | tables, Scenario, Path("scenario.toml"))


def frames_of(one: Scenario, n: int) -> Any:
    prepared = prepare(one)
    engine = engine_class(prepared.engine)(prepared.scene, np.random.default_rng(0))
    return prepared.scene, engine.current(), engine.advance(n)


@pytest.mark.parametrize("engine", ["impulse", "mujoco"])
def test_it_flies_from_its_state_as_a_free_body_does(engine: str) -> None:
    run = {"seeds": 1, "duration_s": 0.1, "frames_per_second": 1000.0, "engine": engine}
    scene, first, frames = frames_of(scenario(run=run), 50)
    assert first.position[0, 0] == pytest.approx([0.01, -0.02, 0.06])
    assert first.velocity[0, 0] == pytest.approx([0.3, 0.1, 0.2])
    assert first.angular_velocity[0, 0] == pytest.approx(SPIN)
    assert (Rotation.from_quat(first.quaternion[0, 0], scalar_first=True) * TURN.inv()).magnitude() < 1e-9
    t = frames.time[-1]
    flown = np.array([0.01 + 0.3 * t, -0.02 + 0.1 * t, 0.06 + 0.2 * t - 0.5 * GRAVITY * t**2])
    assert frames.position[-1, 0] == pytest.approx(flown, abs=GRAVITY * t * scene.timestep)
    momentum = []
    for seen in (first, frames):  # stays, while body and angular velocity turn about it
        turn = Rotation.from_quat(seen.quaternion[-1, 0], scalar_first=True).as_matrix()
        momentum.append(turn @ np.diag(scene.kinds[0].inertia) @ turn.T @ seen.angular_velocity[-1, 0])
    assert np.linalg.norm(momentum[1] - momentum[0]) < 1e-3 * np.linalg.norm(momentum[0])  # MuJoCo is first order
    assert np.linalg.norm(frames.angular_velocity[-1, 0] - SPIN) > 1.0


def test_a_block_slides_to_rest_where_coulomb_stops_it() -> None:
    still = {"quaternion": [1.0, 0.0, 0.0, 0.0], "angular_velocity_rad_s": [0.0, 0.0, 0.0]}
    start = still | {"position_mm": [0.0, 0.0, 7.5015], "velocity_mm_s": [400.0, 0.0, 0.0]}
    run = {"seeds": 1, "duration_s": 0.3, "frames_per_second": 1000.0}
    _, _, frames = frames_of(scenario(start=start, contact={"restitution": 0.0, "friction": 0.2}, run=run), 300)
    assert frames.position[-1, 0, 0] == pytest.approx(0.4**2 / (2.0 * 0.2 * GRAVITY), rel=2e-3)
    assert (frames.velocity[-1] == 0.0).all()  # asleep


def test_the_guard_knows_the_energy_of_a_spin() -> None:
    fast = {"position_mm": [0.0, 0.0, 8.0], "angular_velocity_rad_s": [1500.0, 0.0, 0.0]}
    run = {"seeds": 1, "duration_s": 0.05, "frames_per_second": 1000.0}
    assert not simulate(scenario(start=fast | {"quaternion": [1.0, 0.0, 0.0, 0.0]}, run=run)).failures


def test_a_weighed_part_has_the_mass_and_the_moments_it_is_given() -> None:
    solid = prepare(scenario()).scene.kinds[0]
    weighed = prepare(scenario({"mass_g": 2.0})).scene.kinds[0]
    assert weighed.mass == pytest.approx(2e-3)
    assert weighed.inertia == pytest.approx(solid.inertia * 2e-3 / solid.mass)
    measured = prepare(scenario({"mass_g": 2.0, "inertia_g_mm2": [30.0, 30.0, 20.0]})).scene.kinds[0]
    assert measured.inertia == pytest.approx([3e-8, 3e-8, 2e-8])


@pytest.mark.parametrize(
    ("part", "start", "tables", "line"),
    [
        ({}, {"quaternion": [0.9, 0.0, 0.0, 0.0]}, {}, r"start: .*quaternion has length 0\.9, allowed is 1"),
        ({}, {"position_mm": [0.0, 0.0, 1.0]}, {}, r"position_mm: puts its lowest point .* mm into the plate, allowed"),
        ({}, {"position_mm": [0.0, 200.0, 60.0]}, {}, r"position_mm: is \[0, 200\], allowed is \+-90"),
        ({"count": 2}, {}, {}, r'start.kind is "state", allowed is "scattered", "heap" or "placed" with count = 2'),
        ({"inertia_g_mm2": [1.0, 1.0, 3.0]}, {}, {}, "above the sum of the other two"),
        ({}, {}, {"drive": [{"frequency_hz": 50.0, "amplitude_um": 1.0}]}, r'plate.kind is "still", allowed is no'),
        ({}, {}, {"plate": {"kind": "piston"}}, r"exactly one of \[\[drive\]\] and \[schedule\] is needed"),
    ],
)
def test_what_cannot_be_is_one_line(part: Any, start: Any, tables: Any, line: str) -> None:
    with pytest.raises(InputError, match=line):
        frames_of(scenario(part, start, **tables), 1)
