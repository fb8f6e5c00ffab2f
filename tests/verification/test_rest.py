"""Parts that lie still on a plate that has died out fall asleep, and wake when something disturbs them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from conftest import changing, opened

from feeder_sim.constants import GRAVITY
from feeder_sim.engines.impulse.engine import ImpulseEngine
from feeder_sim.engines.impulse.state import ASLEEP, AWAKE
from feeder_sim.scenario import Ball, Contact, HexNut, RigidPlate, Run, Scenario, Start
from feeder_sim.scenario.schedule import Schedule, Stage
from feeder_sim.scene.scene import build_scene

UP, APART = 1.0001e-3, 0.02  # [m]: half a nut is 1 mm high
SHAKE = {"frequency_hz": 500.0, "amplitude_um": 30.0, "ring_up": False}


def nut(x: float, y: float = 0.0) -> HexNut:
    return HexNut(size="M2.5", start=Start(position_mm=(1e3 * x, 1e3 * y), drop_height_mm=(0.01, 0.01)))


def engine(*parts: Any, pause_s: float = 2.0, shake_s: float = 0.05, **contact: Any) -> ImpulseEngine:
    """Parts on a plate that rests for `pause_s`, then shakes; a nut far away makes at least two of them."""
    still = Stage(name="rest", duration_s=pause_s)
    stages = (still, Stage.model_validate({"name": "shake", "drive": [SHAKE], "duration_s": shake_s}))
    scenario = Scenario(
        plate=RigidPlate(kind="piston"),
        schedule=Schedule(stage=stages),
        part=(*parts, nut(-0.05, 0.05)),
        contact=Contact(**contact),
        run=Run(seeds=1, frames_per_second=500.0),
    )
    return ImpulseEngine(build_scene(scenario), np.random.default_rng(0))


def test_a_part_that_has_landed_falls_asleep_where_it_lies() -> None:
    one = engine(nut(0.0))
    one.advance(50)
    assert (opened(one)["there"] == ASLEEP).all()
    before = opened(one)["attitude"].copy()
    frames = one.advance(100)
    assert (frames.position == frames.position[0]).all() and (frames.velocity == 0.0).all()
    assert np.array_equal(before, opened(one)["attitude"])


def test_a_part_on_an_edge_or_a_ball_stays_awake() -> None:
    """A nut stands on a side's edge for a while, and a ball has one corner."""
    edge = HexNut(size="M2.5", start=Start(position_mm=(0.0, 0.0), tilt_deg=(45.0, 45.0), drop_height_mm=(0.01, 0.01)))
    one = engine(edge, Ball(shape="ball", diameter_mm=4.0, start=Start(position_mm=(20.0, 0.0))))
    one.advance(5)
    assert (opened(one)["there"][:2] == AWAKE).all()


def test_a_plate_that_moves_again_wakes_all() -> None:
    one = engine(nut(0.0), pause_s=0.1)
    one.advance(45)
    assert (opened(one)["there"] == ASLEEP).all()
    frames = one.advance(20)
    assert (opened(one)["there"] == AWAKE).all()
    assert frames.position[:, :, 2].max() > 1.1e-3


def pushed(friction: float, speed: float) -> tuple[ImpulseEngine, float]:
    """A nut asleep that another one hits from the side, in flight just over the plate."""
    one = engine(nut(0.0), nut(APART), friction=friction)
    one.advance(50)
    with changing(one) as state:
        assert (state["there"][:2] == ASLEEP).all()
        state["there"][1], state["velocity"][1] = AWAKE, [-speed, 0.0, 0.0]
    at = float(state["position"][0, 0])
    one.advance(200)
    return one, at - float(opened(one)["position"][0, 0])


def test_an_impact_wakes_a_part_and_friction_stops_it() -> None:
    one, way = pushed(friction=0.3, speed=0.5)
    free = np.sqrt(0.5**2 - 2.0 * 0.3 * GRAVITY * (APART - 6e-3))  # what is left of the speed when they meet
    assert 1e-4 < way < free**2 / (2.0 * 0.3 * GRAVITY)
    assert (opened(one)["there"] == ASLEEP).all()
    assert opened(one)["position"][:, 2] == pytest.approx(1e-3, abs=5e-6)


def test_sleep_is_no_friction() -> None:
    """On a plate without friction the nut that was hit slides on."""
    one, way = pushed(friction=0.0, speed=0.05)
    assert opened(one)["there"][0] == AWAKE
    assert way > 1e-3 and np.linalg.norm(opened(one)["velocity"][0, :2]) > 0.01
