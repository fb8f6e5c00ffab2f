"""Parts with play in a round guide: sliding and rolling along the wall, staying inside, and the limit without play."""

from __future__ import annotations

import math

import numpy as np
import pytest
from pydantic import ValidationError

from feeder_sim.constants import GRAVITY
from feeder_sim.engines.mujoco.engine import MujocoEngine
from feeder_sim.run.simulation import Result, simulate
from feeder_sim.scenario import Ball, Contact, Cylinder, Drive, RigidPlate, Run, Scenario, Slide, Start, Tube
from feeder_sim.scene.scene import build_scene

TILT = 30.0
BALL = {"shape": "ball", "diameter_mm": 3.0}
CYLINDER = {"shape": "cylinder", "diameter_mm": 4.5, "height_mm": 6.0}


def scene(part: Ball | Cylinder, *, amplitude_um: float = 0.0, **run: object) -> Scenario:
    return Scenario(
        plate=RigidPlate(kind="piston", length_mm=300.0, width_mm=300.0),
        drive=(Drive(frequency_hz=558.0, amplitude_um=amplitude_um, ring_up=False),),
        part=(part,),
        contact=Contact(),
        run=Run(**({"duration_s": 0.15, "seeds": 1, "frames_per_second": 5000.0} | run)),  # type: ignore[arg-type]
    )


def falling_ball(friction: float, engine: str) -> Result:
    """A ball in a leaning tube, high above the plate."""
    tube = Tube(kind="tube", inner_diameter_mm=4.6, tilt_deg=TILT, restitution=0.4, friction=friction)
    part = Ball(**BALL, guide=tube, start=Start(drop_height_mm=(110.0, 110.0)))  # type: ignore[arg-type]
    return simulate(scene(part, engine=engine))


def acceleration_along(result: Result) -> float:
    """Of the ball along the axis [m/s^2], once it lies on the wall."""
    frames, axis = result.seeds[0].frames, result.scene.guides[0].axis  # type: ignore[union-attr]
    late = frames.time > 0.08
    return -float(np.polyfit(frames.time[late], frames.velocity[late, 0] @ axis, 1)[0])


@pytest.mark.parametrize(
    ("friction", "expected"),
    [
        (0.0, math.cos(math.radians(TILT))),
        (0.2, math.cos(math.radians(TILT)) - 0.2 * math.sin(math.radians(TILT))),  # slips
        (1.0, 5.0 / 7.0 * math.cos(math.radians(TILT))),  # rolls: friction above 2/7 of cot(tilt)
    ],
)
def test_ball_slides_or_rolls_down_the_wall(friction: float, expected: float) -> None:
    assert acceleration_along(falling_ball(friction, "impulse")) == pytest.approx(expected * GRAVITY, rel=1e-3)


def test_ball_slides_down_the_wall_in_mujoco() -> None:
    expected = math.cos(math.radians(TILT)) * GRAVITY
    assert acceleration_along(falling_ball(0.0, "mujoco")) == pytest.approx(expected, rel=1e-3)


def test_mujoco_is_refused_where_its_friction_cone_lifts_parts_off_the_wall() -> None:
    with pytest.raises(ValidationError, match=r"guide\.friction is 0\.2, must be 0 in MuJoCo"):
        falling_ball(0.2, "mujoco")
    # The reason: the ball should come to lie on the wall, and bounces ever more across it.
    scene = build_scene(falling_ball(0.2, "impulse").scene.scenario)
    frames = MujocoEngine(scene, np.random.default_rng(0)).advance(750)
    across = np.array([math.cos(math.radians(TILT)), 0.0, -math.sin(math.radians(TILT))])
    speed = np.abs(frames.velocity[:, 0] @ across)
    assert speed[500:].max() > 1.5 * speed[100:350].max()


def test_wall_impacts_obey_the_restitution_of_the_wall() -> None:
    result = falling_ball(0.0, "impulse")
    frames = result.seeds[0].frames
    # Across the axis the ball bounces on the lower wall in a field g sin(tilt): flight times shrink by 0.4.
    tilt = math.radians(TILT)
    across = np.array([math.cos(tilt), 0.0, -math.sin(tilt)])
    speed = frames.velocity[:, 0] @ across
    hits = np.flatnonzero(np.diff(speed) < -1e-3)
    before, after = speed[hits[0]], speed[hits[0] + 1]
    assert after == pytest.approx(-0.4 * before, abs=2.0 * GRAVITY * math.sin(tilt) / 5000.0)
    flights = np.diff(frames.time[hits[:3]])
    assert flights[1] / flights[0] == pytest.approx(0.4, abs=0.03)


@pytest.mark.parametrize("tilt", [0.0, 2.0])
def test_cylinder_stays_in_its_tube(tilt: float) -> None:
    tube = Tube(kind="tube", inner_diameter_mm=4.6, tilt_deg=tilt, friction=0.2)
    start = Start(drop_height_mm=(0.1, 3.0), tilt_deg=(0.0, 0.5))
    part = Cylinder(**CYLINDER, guide=tube, start=start)  # type: ignore[arg-type]
    result = simulate(scene(part, amplitude_um=94.5, duration_s=1.0, seeds=4))
    guide = result.scene.guides[0]
    assert guide is not None and guide.radius is not None
    from scipy.spatial.transform import Rotation

    for seed in result.seeds:
        attitude = Rotation.from_quat(seed.frames.quaternion[:, 0], scalar_first=True).as_matrix()
        corners = np.einsum("nij,cj->nci", attitude, result.scene.parts[0].corners) + seed.frames.position[:, :1]
        off = corners - (corners @ guide.axis)[..., None] * guide.axis
        assert np.linalg.norm(off, axis=-1).max() < guide.radius
        assert len(seed.impacts) > 10
        assert seed.failure is None


@pytest.mark.parametrize("e", [0.2, 0.8])
@pytest.mark.parametrize("tilt", [10.0, 30.0, 60.0])
def test_a_ball_stays_in_a_leaning_tube(tilt: float, e: float) -> None:
    """Over a piston that throws it."""
    tube = Tube(kind="tube", inner_diameter_mm=6.2, tilt_deg=tilt)
    part = Ball(shape="ball", diameter_mm=6.0, guide=tube, start=Start(drop_height_mm=(5.0, 5.0)))
    throws = (Drive(frequency_hz=50.0, amplitude_um=300.0),)
    scenario = scene(part, seeds=2, duration_s=0.5).model_copy(
        update={"drive": throws, "contact": Contact(restitution=e)}
    )
    result = simulate(scenario)
    guide = result.scene.guides[0]
    assert guide is not None
    for seed in result.seeds:
        off = seed.frames.position[:, 0] - (seed.frames.position[:, 0] @ guide.axis)[:, None] * guide.axis
        assert np.linalg.norm(off, axis=1).max() < 0.1e-3 + 1e-9
        plate = [result.scene.surface.displacement(np.zeros((1, 2)), t)[0, 2] for t in seed.frames.time]
        assert (seed.frames.position[:, 0, 2] - plate).min() > 3e-3 - 1e-9
        assert seed.counts.late_contacts == 0


@pytest.mark.slow
def test_without_play_a_tube_is_a_slide() -> None:
    start = Start(drop_height_mm=(2.0, 2.0))
    found = []
    for guide in (Slide(kind="slide"), Tube(kind="tube", inner_diameter_mm=4.5001)):
        part = Cylinder(**CYLINDER, guide=guide, start=start)  # type: ignore[arg-type]
        found.append(simulate(scene(part)).seeds[0].impacts)
    slide, tube = found
    assert np.abs(slide.time[:3] - tube.time[:3]).max() < 1e-6
    assert tube.approach_speed[:3] == pytest.approx(slide.approach_speed[:3], abs=1e-5)


def test_energy_falls_to_rest_in_a_leaning_tube() -> None:
    tube = Tube(kind="tube", inner_diameter_mm=4.6, tilt_deg=5.0, friction=0.1)
    start = Start(drop_height_mm=(3.0, 3.0), tilt_deg=(0.3, 0.3))
    part = Cylinder(**CYLINDER, guide=tube, start=start)  # type: ignore[arg-type]
    result = simulate(scene(part, duration_s=0.5, seeds=3))
    inertia, mass = result.scene.parts[0].inertia, result.scene.parts[0].mass
    from scipy.spatial.transform import Rotation

    for seed in result.seeds:
        f = seed.frames
        turned = Rotation.from_quat(f.quaternion[:, 0], scalar_first=True).inv().apply(f.angular_velocity[:, 0])
        motion = 0.5 * (mass * (f.velocity[:, 0] ** 2).sum(axis=1) + (turned**2) @ inertia)
        energy = motion + mass * GRAVITY * f.position[:, 0, 2]
        assert np.diff(energy).max() < mass * GRAVITY * 1e-8
        assert np.linalg.norm(f.velocity[-1, 0]) < 5e-3


def test_both_engines_keep_the_attitude_a_part_has_on_its_slide() -> None:
    start = Start(drop_height_mm=(1.0, 1.0), tilt_deg=(30.0, 30.0))
    found = []
    for engine in ("impulse", "mujoco"):
        guide = Slide(kind="slide", tilt_deg=20.0)
        part = Cylinder(**CYLINDER, guide=guide, start=start)  # type: ignore[arg-type]
        found.append(simulate(scene(part, engine=engine, steps_per_period=400)).seeds[0])
    one, other = found
    assert other.frames.position[0] == pytest.approx(one.frames.position[0])
    assert other.impacts.time[0] == pytest.approx(one.impacts.time[0], abs=2.0 / (558.0 * 400.0))
    assert other.frames.position[-1] == pytest.approx(one.frames.position[-1], abs=2e-6)
