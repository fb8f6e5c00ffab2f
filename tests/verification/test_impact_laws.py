"""Laws of impact by choice: tangential restitution of balls, restitution by the speed, Zener's theory."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import REPOSITORY, changing, from_python, moving_part, symmetric
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from zener import predict, yield_speed

from feeder_sim.constants import GRAVITY
from feeder_sim.engines.impulse import impact_law
from feeder_sim.engines.impulse.engine import ImpulseEngine
from feeder_sim.engines.impulse.reaction.engine import ReactingEngine
from feeder_sim.engines.impulse.state import TANGENTIAL_FIELDS, kind_type
from feeder_sim.plate.materials import MATERIALS
from feeder_sim.plate.rectangle import RectangularPlate
from feeder_sim.plate.zener import (
    TABLE_POINTS,
    TABLE_STEP,
    contact_stiffness,
    inelasticity,
    log_restitution_table,
    point_impedance,
    restitution,
)
from feeder_sim.pool.work import Work
from feeder_sim.run.run_folder import record_run
from feeder_sim.scenario import Ball, Contact, Drive, ModePlate, RigidPlate, Run, Scenario, Start, Strip
from feeder_sim.scene.part import zener_inelasticities
from feeder_sim.scene.scene import Scene, build_scene

push_off_plate = from_python(impact_law.push_off_plate)
RADIUS, MASS = 1.5e-3, 1.1e-4
INERTIA = 0.4 * MASS * RADIUS**2
STEEL, ALUMINIUM = MATERIALS["steel"], MATERIALS["aluminium"]
PLATE = RectangularPlate(1.0, 1.0, 3e-3, ALUMINIUM)


@given(seed=st.integers(0, 10**6), e=st.floats(0.0, 1.0), mu=st.floats(0.0, 0.5), beta=st.floats(0.0, 1.0))
@settings(max_examples=100, deadline=None)
def test_ball_leaves_by_three_constants(seed: int, e: float, mu: float, beta: float) -> None:
    """At the contact: u_n' = -e u_n; u_t' = -beta u_t, or mu times the normal impulse against the slip."""
    rng = np.random.default_rng(seed)
    normal, moves = rng.normal(size=3), rng.normal(size=3)
    normal /= np.linalg.norm(normal)
    arm, velocity, spin = -RADIUS * normal, rng.normal(size=3), rng.normal(size=3) * 300.0
    velocity -= (1.1 + abs(normal @ velocity) + abs(normal @ moves)) * normal
    momentum = INERTIA * spin
    before, inverse = velocity + np.cross(spin, arm) - moves, symmetric(np.eye(3) / INERTIA)
    energy = MASS * ((velocity - moves) ** 2).sum() + INERTIA * (spin**2).sum()
    kind = np.zeros(1, kind_type(TANGENTIAL_FIELDS))[0]
    with moving_part(velocity, momentum) as part:
        kind["tangential_restitution"] = beta
        push_off_plate(part, kind, 1.0 / MASS, inverse, tuple(arm), tuple(normal), tuple(moves), (e, mu))
    after = velocity + np.cross(momentum / INERTIA, arm) - moves
    assert after @ normal == pytest.approx(-e * (before @ normal), abs=1e-12)
    slip, left = (u - (u @ normal) * normal for u in (before, after))
    # 2/7 of the mass is what a point of the surface of a ball moves against along it.
    grip = mu * (1.0 + e) * abs(before @ normal)
    if 2.0 / 7.0 * (1.0 + beta) * np.linalg.norm(slip) <= grip:
        assert left == pytest.approx(-beta * slip, abs=1e-12)
    else:
        assert left == pytest.approx(slip - 3.5 * grip * slip / np.linalg.norm(slip), abs=1e-12)
    assert MASS * ((velocity - moves) ** 2).sum() + (momentum**2).sum() / INERTIA <= energy * (1.0 + 1e-12)


def test_restitution_falls_by_a_power_of_the_speed() -> None:
    falling = from_python(impact_law.falling_restitution)
    assert falling(0.4, 0.25, 2.0, 2.0) == pytest.approx(0.4, rel=1e-15)
    assert falling(0.4, 0.25, 2.0, 32.0) == pytest.approx(0.2, rel=1e-12)
    assert falling(0.4, 0.25, 2.0, 2.0 * 0.4**4) == pytest.approx(1.0, rel=1e-12)
    assert falling(0.4, 0.25, 2.0, 1e-6) == 1.0 and falling(0.4, 0.25, 2.0, 0.0) == 1.0
    assert falling(0.0, 0.25, 2.0, 1e-6) == 0.0


def test_zener_restitution_has_its_limits() -> None:
    """No loss without waves; small losses by the work along the undamped motion; lambda^-5 in the end."""
    assert restitution(0.0) == pytest.approx(1.0, abs=1e-8)
    beta = math.gamma(0.6) * math.gamma(1.5) / math.gamma(2.1)
    slope = 1.2 * 1.25**0.6 * beta
    assert (1.0 - restitution(1e-4)) / 1e-4 == pytest.approx(slope, rel=1e-3)
    assert slope == pytest.approx(1.7302, abs=1e-4)
    assert restitution(4.999) / restitution(5.001) == pytest.approx((5.001 / 4.999) ** 5, rel=1e-6)
    # exp(-1.719 lambda), a fit in use for moderate losses.
    for value in (0.05, 0.1, 0.3):
        assert restitution(value) == pytest.approx(math.exp(-1.719 * value), rel=0.015)


def test_zener_lambda_is_that_of_the_dimensional_equation() -> None:
    """A ball of 3 mm on 3 mm of aluminium, integrated in SI, and Zener's own formula."""
    k, z, mass = contact_stiffness(STEEL, RADIUS, ALUMINIUM), point_impedance(PLATE), 4 / 3 * np.pi * RADIUS**3 * 7850.0

    def motion(_: float, state: np.ndarray) -> list[float]:
        force = k * max(state[0] - state[2], 0.0) ** 1.5
        return [state[1], -force / mass, force / z]

    def parted(t: float, state: np.ndarray) -> float:
        return float(state[0] - state[2])

    parted.terminal, parted.direction = True, -1.0  # type: ignore[attr-defined]
    e1, e2 = 210e9 / 0.91, 71e9 / (1.0 - 0.33**2)
    for speed in (0.1, 1.0):
        found = solve_ivp(motion, (0.0, 1e-3), [0.0, speed, 0.0], events=parted, rtol=1e-10, atol=1e-16, max_step=1e-7)
        own = inelasticity(STEEL, RADIUS, PLATE, speed)
        assert -found.y[1, -1] / speed == pytest.approx(restitution(own), rel=1e-5)
        written = np.pi**0.6 / 3**0.5 * 0.25 * (speed * (2770.0 / e2) ** 0.5) ** 0.2
        written *= (7850.0 / 2770.0) ** 0.6 * (e1 / (e1 + e2)) ** 0.4
        assert own == pytest.approx(written, rel=1e-12)


def test_zener_table_is_as_good_as_the_equation() -> None:
    place, table = TABLE_STEP * np.arange(TABLE_POINTS), log_restitution_table()
    for value in (0.003, 0.0545, 0.5, 1.3, 3.3, 5.2, 30.0):
        from_table = math.exp(np.interp(math.log1p(value), place, table))
        assert from_table == pytest.approx(restitution(value), rel=1e-4)


def still(contact: Contact, speed: float, **start: Any) -> Scene:
    """A ball that is thrown at a strip that does not move."""
    scenario = Scenario(
        plate=Strip(thickness_mm=3.0),
        drive=(Drive(frequency_hz=5e3, amplitude_um=0.0, ring_up=False),),
        part=(
            Ball(
                shape="ball",
                diameter_mm=2e3 * RADIUS,
                start=Start(drop_height_mm=(0.0, 0.0), velocity_mm_s=(*start.get("along", (0.0, 0.0)), -1e3 * speed)),
            ),
        ),
        contact=contact,
        run=Run(duration_s=1e-3, seeds=1, frames_per_second=1e5),
    )
    return build_scene(scenario)


def rebound(scene: Scene) -> np.ndarray:
    """Velocity (3,) after the first impact, at t = 0 [m/s]."""
    frames = ImpulseEngine(scene, np.random.default_rng(0)).advance(2)
    return np.asarray(frames.velocity[-1, 0] + [0.0, 0.0, GRAVITY * frames.time[-1]])


def test_prediction_says_how_far_it_holds() -> None:
    """A steel ball of 3 mm on 3 mm of aluminium: contact times and yield speeds by their own formulas."""
    slow, fast = predict(STEEL, 3e-3, PLATE, [0.1, 1.0])
    assert (slow.restitution, fast.restitution) == pytest.approx((0.912, 0.864), abs=1e-3)
    assert fast.inelasticity / slow.inelasticity == pytest.approx(10.0**0.2, rel=1e-12)
    # Hertz: 2.87 (m^2 / (R E*^2 v))^(1/5), for v = 1 m/s (Johnson, Contact Mechanics, 1985, eq. 11.24).
    mass, reduced = 4 / 3 * np.pi * RADIUS**3 * 7850.0, 59.25e9
    assert fast.contact_time == pytest.approx(2.87 * (mass**2 / (RADIUS * reduced**2)) ** 0.2, rel=2e-3)
    assert 0.0 < fast.reach < slow.reach < 0.02
    assert yield_speed(STEEL, ALUMINIUM, 500e6) / yield_speed(STEEL, ALUMINIUM, 250e6) == pytest.approx(2.0**2.5)
    assert 7850.0 * yield_speed(STEEL, ALUMINIUM, 250e6) ** 2 / 250e6 == pytest.approx(
        26.0 * (250e6 / reduced) ** 4, rel=2e-3
    )


@pytest.mark.slow
def test_zener_finds_the_plate_of_a_mode_file() -> None:
    """The 180 mm plate is 3 mm of aluminium, as the strip."""
    plate = ModePlate(kind="modes", mode_file=REPOSITORY / "models/plate_180/modes.h5")
    drive = Drive(frequency_hz=2797.0, amplitude_um=1.0)
    ball = Ball(shape="ball", diameter_mm=2e3 * RADIUS)
    contact, run = Contact(restitution="zener"), Run(duration_s=0.1, seeds=1)
    scene = build_scene(Scenario(plate=plate, drive=(drive,), part=(ball,), contact=contact, run=run))
    assert zener_inelasticities(scene) == pytest.approx([inelasticity(STEEL, RADIUS, PLATE)], rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("speed", [0.05, 0.2, 1.0, 3.0])
def test_engine_rebounds_by_the_law_asked_for(speed: float) -> None:
    power = still(Contact(restitution=0.4, restitution_exponent=0.25), speed)
    assert rebound(power)[2] / speed == pytest.approx(min(1.0, 0.4 * speed**-0.25), rel=1e-9)
    zener = still(Contact(restitution="zener"), speed)
    assert rebound(zener)[2] / speed == pytest.approx(restitution(inelasticity(STEEL, RADIUS, PLATE, speed)), rel=1e-4)
    along = Contact(restitution=0.8, friction=0.5, tangential_restitution=0.3)
    assert rebound(still(along, speed, along=(100.0 * speed, 0.0))) == pytest.approx(
        speed * np.array([0.1 * (5.0 - 2.0 * 0.3) / 7.0, 0.0, 0.8]), rel=1e-9
    )


@pytest.mark.slow
def test_a_run_by_a_law_that_mujoco_lacks_has_no_mjcf(tmp_path: Path) -> None:
    ball = Ball(shape="ball", diameter_mm=3.0, start=Start(position_mm=(5.0, 0.0)))
    scenario = Scenario(
        plate=Strip(thickness_mm=3.0),
        drive=(Drive(frequency_hz=4750.0, amplitude_um=1.0),),
        part=(ball,),
        contact=Contact(restitution="zener"),
        run=Run(duration_s=0.05, seeds=1),
    )
    notes: list[str] = []
    record_run(scenario, tmp_path / "run", work=Work(notify=notes.append))
    assert (tmp_path / "run" / "summary.json").exists() and not (tmp_path / "run" / "scene.xml").exists()
    assert any("scene.xml is left out" in note for note in notes)


@pytest.mark.slow
def test_restitution_falls_on_a_plate_that_gives_way_too() -> None:
    """The plate's modes are some hundred times as heavy as the ball; the law holds for the velocity relative to it."""
    start = Start(drop_height_mm=(0.0, 0.0), velocity_mm_s=(0.0, 0.0, -1e3))
    scenario = Scenario(
        plate=ModePlate(kind="modes", mode_file=REPOSITORY / "models/plate_180/modes.h5"),
        drive=(Drive(frequency_hz=2797.0, amplitude_um=1e-3),),
        part=(Ball(shape="ball", diameter_mm=2e3 * RADIUS, start=start),),
        contact=Contact(restitution=0.4, restitution_exponent=0.25, restitution_speed_m_s=0.1),
        run=Run(duration_s=1e-3, seeds=1, frames_per_second=1e5, reaction=True),
    )
    frames = ReactingEngine(build_scene(scenario), np.random.default_rng(0)).advance(2)
    assert frames.velocity[-1, 0, 2] == pytest.approx(0.4 * 10.0**-0.25, rel=0.03)


@pytest.mark.slow
@pytest.mark.parametrize("friction", [0.05, 1.0])
@pytest.mark.parametrize("law", [{"restitution_exponent": 0.2}, {"tangential_restitution": 0.3}])
def test_balls_meet_each_other_by_the_same_law(law: dict[str, Any], friction: float) -> None:
    """Two balls meet in the air, off centre, a micrometre after they start; gravity acts on both alike."""
    n, u = np.array([-0.8, 0.36, 0.48]), np.array([2.0, 0.0, 0.0])
    scenario = Scenario(
        plate=RigidPlate(kind="piston"),
        drive=(Drive(frequency_hz=5e3, amplitude_um=0.0, ring_up=False),),
        part=tuple(
            Ball(shape="ball", diameter_mm=2e3 * RADIUS, start=Start(position_mm=(x, 0.0), drop_height_mm=(20.0, 20.0)))
            for x in (0.0, 10.0)
        ),
        contact=Contact(restitution=0.3, part_restitution=0.5, part_friction=friction, **law),
        run=Run(duration_s=5e-3, seeds=1, frames_per_second=1e4),
    )
    engine = ImpulseEngine(build_scene(scenario), np.random.default_rng(0))
    with changing(engine) as state:
        state["position"][1] = state["position"][0] + (2.0 * RADIUS + 1e-6) * n
        state["velocity"][1] = u
    frames = engine.advance(20)
    before, slip = u @ n, u - (u @ n) * n
    after = frames.velocity[-1, 1] - frames.velocity[-1, 0]
    e = min(1.0, 0.5 * abs(before) ** -law.get("restitution_exponent", 0.0))
    assert after @ n == pytest.approx(-e * before, rel=1e-3)
    left = after - (after @ n) * n - RADIUS * np.cross(frames.angular_velocity[-1].sum(axis=0), n)
    beta = law.get("tangential_restitution", 0.0)
    kept = max(-beta, 1.0 - 3.5 * friction * (1.0 + e) * abs(before) / float(np.linalg.norm(slip)))
    assert left == pytest.approx(kept * slip, abs=1e-3 * float(np.linalg.norm(u)))
