"""Free cylinders: they touch a plate with two circles, in closed form."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from conftest import changing, from_python, opened
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from feeder_sim.constants import GRAVITY
from feeder_sim.engines.impulse.circles import _time_apart
from feeder_sim.engines.impulse.engine import ImpulseEngine
from feeder_sim.engines.impulse.rest import CARRIES
from feeder_sim.engines.impulse.state import ASLEEP, AWAKE
from feeder_sim.part.rigid_part import CORNER_RADIUS, RigidPart
from feeder_sim.records.trajectory import Frames
from feeder_sim.scenario import Contact, Cylinder, Drive, RigidPlate, Run, Scenario, Start, Strip
from feeder_sim.scene.scene import build_scene

RADIUS, HALF = 2e-3, 3e-3  # [m]
ON_ITS_SIDE = Rotation.from_euler("x", 90.0, degrees=True)  # axis along y
STILL = RigidPlate(kind="piston", length_mm=60.0, width_mm=60.0)


class Thrown:
    """A cylinder that begins somewhere over a plate, at a velocity [m/s] and angular velocity [rad/s]."""

    def __init__(
        self,
        attitude: Rotation,
        position: Any,
        velocity: Any = (0.0, 0.0, 0.0),
        spin: Any = (0.0, 0.0, 0.0),
        *,
        radius: float = RADIUS,
        half: float = HALF,
        plate: Any = STILL,
        drive: tuple[float, float] = (1000.0, 0.0),
        contact: tuple[float, float] = (0.2, 0.3),
        **run: Any,
    ) -> None:
        scenario = Scenario(
            plate=plate,
            drive=(Drive(frequency_hz=drive[0], amplitude_um=drive[1]),),
            part=(Cylinder(shape="cylinder", diameter_mm=2e3 * radius, height_mm=2e3 * half, start=Start()),),
            contact=Contact(restitution=contact[0], friction=contact[1]),
            run=Run(**({"duration_s": 1.0, "seeds": 1, "frames_per_second": 1000.0} | run)),
        )
        self.scene = build_scene(scenario)
        self.part: RigidPart = self.scene.kinds[0]
        self.engine = ImpulseEngine(self.scene, np.random.default_rng(0))
        axes = attitude.as_matrix()
        with changing(self.engine) as state:
            state["position"][0], state["velocity"][0], state["attitude"][0] = position, velocity, axes
            state["momentum"][0] = axes @ (self.part.inertia * (axes.T @ np.asarray(spin, float)))

    def energy(self, frames: Frames) -> np.ndarray:
        body_spin = (
            Rotation.from_quat(frames.quaternion[:, 0], scalar_first=True).inv().apply(frames.angular_velocity[:, 0])
        )
        energy = 0.5 * self.part.mass * (frames.velocity[:, 0] ** 2).sum(axis=1)
        energy += self.part.mass * GRAVITY * frames.position[:, 0, 2]
        return np.asarray(energy + 0.5 * (self.part.inertia * body_spin**2).sum(axis=1))


def below_centre(attitude: Rotation, radius: float = RADIUS, half: float = HALF) -> Any:
    """How far the lowest point of a cylinder is below its centre [m]."""
    up = attitude.as_matrix()[..., 2, :]
    return radius * np.hypot(up[..., 0], up[..., 1]) + half * np.abs(up[..., 2]) + CORNER_RADIUS


def attitudes(frames: Frames) -> Rotation:
    return Rotation.from_quat(frames.quaternion[:, 0], scalar_first=True)


@pytest.mark.parametrize("speed", [0.02, 0.3])
def test_a_cylinder_on_its_side_rolls_on(speed: float) -> None:
    """With 32 corners on each rim it rattled, and lost 21 % and 50 % of its speed in 0.4 s."""
    rolling = RADIUS + CORNER_RADIUS
    part = Thrown(ON_ITS_SIDE, (-20e-3, 0.0, rolling), (speed, 0.0, 0.0), (0.0, speed / rolling, 0.0))
    frames = part.engine.advance(150)
    assert frames.velocity[:, 0, 0] == pytest.approx(speed, rel=1e-5)
    assert np.abs(frames.position[:, 0, 2] - rolling).max() < 5e-9
    energy = part.energy(frames)
    assert np.abs(energy / energy[0] - 1.0).max() < 1e-4


@pytest.mark.parametrize("degrees", [10.0, 30.0])
def test_a_coin_rolls_round_on_its_edge_with_its_centre_at_rest(degrees: float) -> None:
    """Euler's disc; the rate of its precession follows from dL/dt = torque with the centre at rest.

    With 32 corners on each rim it lost half of its energy in 0.1 s.
    """
    radius, half, tilt = 10e-3, 0.5e-3, math.radians(degrees)
    attitude = Rotation.from_euler("y", tilt)
    arm = attitude.apply([radius, 0.0, -half])  # to the contact, about which it turns
    turned, axis = arm / np.linalg.norm(arm), attitude.apply([0.0, 0.0, 1.0])
    share = np.cross(turned, axis)[1] / np.cross([0.0, 0.0, 1.0], axis)[1]  # precession over spin
    place = (0.0, 0.0, float(below_centre(attitude, radius, half)))
    shape: dict[str, Any] = {"radius": radius, "half": half, "contact": (0.2, 0.5), "steps_per_period": 200}
    part = Thrown(attitude, place, **shape)
    inertia = attitude.as_matrix() @ np.diag(part.part.inertia) @ attitude.as_matrix().T
    change = share * np.cross([0.0, 0.0, 1.0], inertia @ turned)[1]
    spin = math.sqrt(arm[0] * -part.part.mass * GRAVITY / change)
    part = Thrown(attitude, place, spin=spin * turned, **shape)
    frames = part.engine.advance(200)
    energy, axes = part.energy(frames), attitudes(frames).as_matrix()[:, :, 2]
    assert np.diff(energy).max() < 1e-6 * energy[0] and energy[-1] > 0.99 * energy[0]
    assert np.abs(np.degrees(np.arccos(axes[:, 2])) - degrees).max() < 0.05
    assert np.abs(frames.position[:, 0, 2] - below_centre(attitudes(frames), radius, half)).max() < 1e-8
    angle = np.unwrap(np.arctan2(axes[:, 1], axes[:, 0]))
    rate = np.polyfit(frames.time, angle, 1)[0]
    assert rate == pytest.approx(spin * share, rel=2e-3)


@pytest.mark.parametrize(
    ("radius", "half", "degrees"), [(0.5e-3, 0.25e-3, 10.0), (1.5e-3, 1e-3, 5.0), (4e-3, 5e-4, 2.0)]
)
def test_a_coin_that_wobbles_gains_no_energy(radius: float, half: float, degrees: float) -> None:
    """Lifted as a whole at its contact it gained up to 8 % in a second, and stood up."""
    attitude = Rotation.from_euler("y", degrees, degrees=True)
    arm, shape = attitude.apply([radius, 0.0, -half]), {"radius": radius, "half": half, "contact": (0.2, 0.5)}
    spin = 40.0 * math.sqrt(2e-3 / radius) * arm / np.linalg.norm(arm)
    part = Thrown(attitude, (0.0, 0.0, float(below_centre(attitude, radius, half))), spin=spin, **shape)  # type: ignore[arg-type]
    energy = part.energy(part.engine.advance(1000))
    assert np.maximum.accumulate(energy[::100])[-1] == energy[0]
    assert (np.diff(energy[::100]) < 1e-4 * energy[0]).all()


def test_a_coin_let_go_on_its_edge_rocks_and_falls_asleep() -> None:
    radius, half, attitude = 4e-3, 0.5e-3, Rotation.from_euler("y", 20.0, degrees=True)
    part = Thrown(attitude, (0.0, 0.0, below_centre(attitude, radius, half)), radius=radius, half=half)
    frames = part.engine.advance(300)
    energy = part.energy(frames)
    assert np.diff(energy).max() < 3e-4 * energy[0]
    assert (below_centre(attitudes(frames), radius, half) - frames.position[:, 0, 2]).max() < 1e-7
    assert frames.position[-1, 0, 2] == pytest.approx(half + CORNER_RADIUS, abs=1e-6)
    assert opened(part.engine)["there"][0] == ASLEEP


@pytest.mark.parametrize(("euler", "height"), [((0.0, 0.0), HALF), ((90.0, 37.0), RADIUS)], ids=["flat", "on its side"])
def test_a_cylinder_lands_and_falls_asleep(euler: tuple[float, float], height: float) -> None:
    attitude = Rotation.from_euler("XZ", euler, degrees=True)
    part = Thrown(attitude, (0.0, 0.0, height + 0.5e-3))
    frames = part.engine.advance(300)
    assert opened(part.engine)["there"][0] == ASLEEP
    assert -1e-9 < frames.position[-1, 0, 2] - (height + CORNER_RADIUS) < CARRIES  # asleep from that height on
    assert np.abs(frames.angular_velocity).max() < 1e-3  # two contacts settle to 3 um/s


def time_of_impact(frames: Frames) -> float:
    """When the parabola of the centre that it flies first meets that of the last frame."""
    (z, late), (v, after), t = (
        frames.position[[0, -1], 0, 2],
        frames.velocity[[0, -1], 0, 2],
        frames.time[-1] - frames.time[0],
    )
    # z + v s - g s^2 / 2 = late - after (t - s) - g (t - s)^2 / 2
    return float((late - after * t - 0.5 * GRAVITY * t * t - z) / (v - after - GRAVITY * t))


@pytest.mark.parametrize("degrees", [0.5, 20.0, 80.0, 150.0])
def test_a_tilted_cylinder_meets_the_plate_when_the_closed_form_says(degrees: float) -> None:
    attitude = Rotation.from_euler("yz", [degrees, 77.0], degrees=True) * Rotation.from_euler("z", 13.0, degrees=True)
    drop = 1e-3
    part = Thrown(attitude, (0.0, 0.0, drop + below_centre(attitude)), contact=(0.9, 0.0), frames_per_second=4e4)
    expected = math.sqrt(2.0 * drop / GRAVITY)
    start = part.engine.current()
    assert start.position[0, 0, 2] - drop == pytest.approx(float(below_centre(attitude)), abs=1e-15)
    frames = part.engine.advance(math.ceil(expected / part.scene.frame_interval))
    frames = Frames(
        **{name: np.concatenate([getattr(start, name), values[-1:]]) for name, values in vars(frames).items()}
    )
    assert time_of_impact(frames) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("seed", range(12))
def test_a_spinning_cylinder_is_not_missed(seed: int) -> None:
    """Where its circles first meet the plate, from its free flight, against when the engine has it hit."""
    rng = np.random.default_rng(seed)
    attitude, spin = Rotation.random(random_state=rng), 300.0 * rng.normal(size=3)
    high = float(below_centre(attitude)) + 1e-3
    run: dict[str, Any] = {"frames_per_second": 1e5, "steps_per_period": 100}
    aloft = Thrown(attitude, (0.0, 0.0, 0.5), spin=spin, **run).engine.advance(3000)
    part = Thrown(attitude, (0.0, 0.0, high), spin=spin, contact=(0.5, 0.3), **run)
    frames = part.engine.advance(3000)
    gap = high - 0.5 * GRAVITY * aloft.time**2 - below_centre(attitudes(aloft))
    first = int(np.argmax(gap < 0.0))
    assert first > 0
    crossing = brentq(lambda t: np.interp(t, aloft.time, gap), aloft.time[first - 1], aloft.time[first])
    turned = np.abs(frames.angular_velocity - aloft.angular_velocity).max(axis=(1, 2)) > 1e-6
    hit = frames.time[int(np.argmax(turned))]
    assert turned.any() and crossing - 1e-5 < hit < crossing + 2e-5  # a step and a frame of 10 us each


def test_which_way_a_drop_ends_does_not_hang_on_where_the_corners_would_be() -> None:
    """The same drop, turned about the cylinder's own axis before: with 32 corners they were millimetres apart."""
    tilted, spin, found = Rotation.from_euler("y", 50.0, degrees=True), (50.0, 20.0, 30.0), []
    for degrees in (0.0, 17.0, 111.0):
        attitude = tilted * Rotation.from_euler("z", degrees, degrees=True)
        found.append(Thrown(attitude, (0.0, 0.0, 6e-3), spin=spin, half=1e-3).engine.advance(300).position[:, 0])
    assert np.abs(found[0][-1] - found[0][0]).max() > 3e-3
    assert np.abs(np.array(found) - found[0]).max() < 1e-10


DRIVES = [(4750.0, 1.0), (558.0, 90.0)]  # [Hz], [um]


@pytest.mark.parametrize("drive", DRIVES, ids=["4750 Hz", "558 Hz"])
@pytest.mark.parametrize(("radius", "half"), [(1.5e-3, 1e-3), (4e-3, 0.5e-3), (2e-3, 4.5e-3)])
def test_no_point_of_the_circles_enters_a_vibrating_plate(
    drive: tuple[float, float], radius: float, half: float
) -> None:
    """720 points of each circle, at every frame; with 32 corners on each they entered by up to 17 um."""
    angle = np.linspace(0.0, 2.0 * np.pi, 720, endpoint=False)
    circle = radius * np.column_stack([np.cos(angle), np.sin(angle)])
    points = np.concatenate([np.column_stack([circle, np.full(720, z)]) for z in (-half, half)])
    deepest, looked_at = -np.inf, 0
    for seed in range(3):
        rng = np.random.default_rng(seed)
        attitude, velocity = Rotation.random(random_state=rng), 0.1 * rng.normal(size=3)
        height = float(below_centre(attitude, radius, half)) + 2e-4
        part = Thrown(
            attitude,
            (3e-3, 0.0, height),
            velocity,
            150.0 * rng.normal(size=3),
            radius=radius,
            half=half,
            plate=Strip(thickness_mm=3.0),
            drive=drive,
            frames_per_second=1e5,
        )
        frames = part.engine.advance(2000)
        near = np.flatnonzero(frames.position[:, 0, 2] - below_centre(attitudes(frames), radius, half) < 1e-4)
        for row in near:
            at = attitudes(frames[row : row + 1]).apply(points) + frames.position[row, 0]
            at = at[at[:, 2] < 2e-4]
            under = part.scene.surface.displacement(at[:, :2], float(frames.time[row]))[:, 2]
            deepest = max(deepest, float((under + CORNER_RADIUS - at[:, 2]).max()))
        looked_at += len(near)
    assert looked_at > 20
    assert deepest < 5e-6


def test_the_time_apart_is_a_lower_bound() -> None:
    """Of circles that turn steadily and are pulled down, over a plane whose slope changes within its bound."""
    rng = np.random.default_rng(0)
    apart, tight, n = from_python(_time_apart), [], 400
    for case in range(n):
        radius, gap, rate, a = 2e-3, 10.0 ** rng.uniform(-7, -3), 0.3 * rng.normal(), 10.0 ** rng.uniform(1, 3.5)
        s, u = 10.0 ** rng.uniform(-4, 0) * rng.normal(size=2), 10.0 ** rng.uniform(0, 3) * rng.normal(size=2)
        e = -s / np.linalg.norm(s)
        turns = 0.0 if case % 2 else 10.0 ** rng.uniform(-4, -2)
        found = apart(gap, rate, a, tuple(s), tuple(u), tuple(e), radius, turns, 1.0)
        t = np.linspace(0.0, found, 200)[:, None]
        way = np.linspace(0.0, 2.0 * np.pi, 60)
        for change in turns * np.column_stack([np.cos(way), np.sin(way)]):
            v = s + t * u - change
            lower = gap + t[:, 0] * (rate - 0.5 * a * t[:, 0]) - radius * (np.linalg.norm(v, axis=1) + v @ e)
            assert found == 0.0 or lower.min() > -1e-11
        if turns == 0.0:
            v = s + 1.05 * found * u
            tight.append(gap + 1.05 * found * (rate - 0.525 * a * found) - radius * (np.linalg.norm(v) + v @ e))
    assert (np.array(tight) < 0.0).all()  # nor is it far too short


@pytest.mark.parametrize("turned", [0.0, 5.0])
@pytest.mark.parametrize("beyond", [-2e-4, 1e-3])
def test_a_cylinder_over_the_edge_tips_when_its_centre_is_beyond_it(beyond: float, turned: float) -> None:
    """It begins to turn about the edge at m g b / (I + m (R^2 + b^2))."""
    attitude = Rotation.from_euler("y", 90.0, degrees=True) * Rotation.from_euler("z", turned, degrees=True)
    place = (30e-3 + beyond, 0.0, RADIUS + CORNER_RADIUS)
    part = Thrown(attitude, place, contact=(0.0, 0.5))
    frames = part.engine.advance(100)
    leans = np.arcsin(-attitudes(frames).as_matrix()[:, 2, 2])
    if beyond < 0.0:
        assert np.abs(leans).max() < 1e-4 and frames.position[-1, 0, 2] == pytest.approx(place[2], abs=1e-7)
        return
    inertia = part.part.inertia[0] / part.part.mass + RADIUS**2 + beyond**2
    assert leans[4] == pytest.approx(0.5 * GRAVITY * beyond / inertia * frames.time[4] ** 2, rel=0.02)
    assert frames.position[-1, 0, 2] < -5e-3


def test_a_cylinder_rolls_along_the_edge_and_over_it() -> None:
    rolling, speed = RADIUS + CORNER_RADIUS, 0.05
    along = Rotation.from_euler("y", 90.0, degrees=True)
    spin = (-speed / rolling, 0.0, 0.0)
    part = Thrown(along, (28.5e-3, -15e-3, rolling), (0.0, speed, 0.0), spin)
    frames = part.engine.advance(500)
    assert frames.velocity[-1, 0, 1] == pytest.approx(speed, rel=1e-4)
    assert np.abs(frames.position[:, 0, 2] - rolling).max() < 1e-7
    part = Thrown(ON_ITS_SIDE, (29e-3, 0.0, rolling), (speed, 0.0, 0.0), (0.0, speed / rolling, 0.0))
    frames = part.engine.advance(120)
    assert frames.velocity[18, 0, 0] == pytest.approx(speed, rel=1e-3)  # just before the edge
    assert frames.position[-1, 0, 2] < -5e-3
    assert opened(part.engine)["there"][0] == AWAKE
