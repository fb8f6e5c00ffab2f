"""Contact of two parts in free space: laws of impact, distance of hulls, and the engine as a whole."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from conftest import changing, from_python, hull_distances, moving_part, rows, symmetric
from scipy.optimize import nnls
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from feeder_sim.constants import GRAVITY
from feeder_sim.engines.impulse import single_impact
from feeder_sim.engines.impulse.engine import ImpulseEngine
from feeder_sim.engines.impulse.kinds import read_kinds
from feeder_sim.engines.impulse.pairs import hulls
from feeder_sim.engines.impulse.pairs.hulls import HullLibrary
from feeder_sim.engines.impulse.parts_engine import COLUMNS
from feeder_sim.engines.impulse.scratch import new_scratch
from feeder_sim.engines.impulse.state import new_parts
from feeder_sim.engines.surface_arrays import surface_arrays
from feeder_sim.machine_code import borrow
from feeder_sim.machine_code.jit import callable_from_python
from feeder_sim.part.rigid_part import RigidPart
from feeder_sim.records.trajectory import Frames
from feeder_sim.scenario import (
    Ball,
    Contact,
    Cylinder,
    Drive,
    Heap,
    HexNut,
    RigidPlate,
    Run,
    Scattered,
    Scenario,
    Start,
)
from feeder_sim.scene.part import build_part
from feeder_sim.scene.scene import Scene, build_scene

hull_distance, resolve_single = from_python(hulls.hull_distance), from_python(single_impact.resolve_single)
NUT, LARGE_NUT = build_part(HexNut(size="M2.5")), build_part(HexNut(size="M5"))
BALL, SMALL_BALL = (build_part(Ball(shape="ball", diameter_mm=d)) for d in (6.0, 3.0))
ROD = build_part(Cylinder(shape="cylinder", diameter_mm=4.0, height_mm=9.0))
DEEPEST = 50e-6  # [m] that hulls may be found inside each other at a frame


class Body:
    """One part of a collision."""

    def __init__(self, part: RigidPart, attitude: np.ndarray, velocity: np.ndarray, spin: np.ndarray) -> None:
        self.part, self.velocity = part, velocity.copy()
        self.inertia = attitude @ np.diag(part.inertia) @ attitude.T
        self.inverse_inertia = np.linalg.inv(self.inertia)
        self.momentum = self.inertia @ spin

    def at(self, arm: np.ndarray) -> np.ndarray:
        return np.asarray(self.velocity + np.cross(self.inverse_inertia @ self.momentum, arm))

    def energy(self) -> float:
        turning = self.momentum @ self.inverse_inertia @ self.momentum
        return float(0.5 * self.part.mass * self.velocity @ self.velocity + 0.5 * turning)


def collide(a: Body, b: Body, arms: np.ndarray, normal: np.ndarray, e: float, mu: float) -> bool:
    inverse_mass = 1 / a.part.mass, 1 / b.part.mass
    inverse_inertia = symmetric(a.inverse_inertia), symmetric(b.inverse_inertia)
    with moving_part(a.velocity, a.momentum) as one, moving_part(b.velocity, b.momentum) as other:
        return bool(resolve_single(one, other, inverse_mass, inverse_inertia, rows(arms), tuple(normal), e, mu))


def random_pair(
    rng: np.random.Generator, parts: tuple[RigidPart, RigidPart]
) -> tuple[Body, Body, np.ndarray, np.ndarray]:
    """Two parts in any state that touch with a corner or surface point of either, and the normal from a to b."""
    bodies, arms = [], np.empty((2, 3))
    normal = rng.normal(size=3)
    normal /= np.linalg.norm(normal)
    for i, part in enumerate(parts):
        attitude = Rotation.random(rng=rng).as_matrix()
        bodies.append(Body(part, attitude, rng.normal(size=3) * 0.3, rng.normal(size=3) * 60.0))
        corners = part.corners @ attitude.T
        outward = normal if i == 0 else -normal
        arms[i] = corners[np.argmax(corners @ outward)] + part.corner_radius * outward
    return bodies[0], bodies[1], arms, normal


PAIRS = [(BALL, BALL), (BALL, SMALL_BALL), (NUT, NUT), (NUT, LARGE_NUT), (LARGE_NUT, SMALL_BALL), (ROD, NUT)]


@pytest.mark.parametrize("parts", PAIRS, ids=lambda pair: f"{len(pair[0].corners)}-{len(pair[1].corners)} corners")
def test_laws_of_impact_for_random_states(parts: tuple[RigidPart, RigidPart]) -> None:
    rng = np.random.default_rng(1)
    hits = restored = slipped = 0
    for _ in range(300):
        a, b, arms, normal = random_pair(rng, parts)
        e, mu = float(rng.random()), float(rng.random() * 1.5)
        before, energy = b.at(arms[1]) - a.at(arms[0]), a.energy() + b.energy()
        velocities, momenta = (a.velocity.copy(), b.velocity.copy()), (a.momentum.copy(), b.momentum.copy())
        hit = collide(a, b, arms, normal, e, mu)
        assert hit == (before @ normal < 0.0)
        if not hit:  # separating bodies are left alone, to the last bit
            assert np.array_equal(np.stack(velocities), np.stack([a.velocity, b.velocity]))
            assert np.array_equal(np.stack(momenta), np.stack([a.momentum, b.momentum]))
            continue
        hits += 1
        impulse = b.part.mass * (b.velocity - velocities[1])
        scale = float(np.linalg.norm(impulse))
        # Momentum, and angular momentum about the point of contact, of which the arms are the bodies' distances.
        assert a.part.mass * (a.velocity - velocities[0]) == pytest.approx(-impulse, abs=1e-9 * scale)
        assert a.momentum - momenta[0] == pytest.approx(np.cross(arms[0], -impulse), abs=1e-12 * scale)
        assert b.momentum - momenta[1] == pytest.approx(np.cross(arms[1], impulse), abs=1e-12 * scale)
        # Coulomb: pressed, within the cone; where it slips on, on the cone's edge and against the slip.
        pressed = float(impulse @ normal)
        friction = impulse - pressed * normal
        assert pressed > 0.0
        assert np.linalg.norm(friction) <= mu * pressed * (1 + 1e-6)
        after = b.at(arms[1]) - a.at(arms[0])
        slip = after - (after @ normal) * normal
        if np.linalg.norm(slip) > 1e-6:
            slipped += 1
            assert friction @ slip == pytest.approx(-mu * pressed * float(np.linalg.norm(slip)), rel=1e-6)
        # Newton's law, unless it would create energy; never more than it, never less than no restitution.
        approach, departure = float(before @ normal), float(after @ normal)
        assert -1e-9 <= departure <= -e * approach + 1e-9
        restored += departure == pytest.approx(-e * approach, abs=1e-9)
        assert a.energy() + b.energy() <= energy * (1 + 1e-12)
    assert 100 < hits < 200 and slipped > 5
    assert restored > 0.8 * hits


def test_smooth_impact_without_loss_keeps_its_energy() -> None:
    rng = np.random.default_rng(2)
    for parts in PAIRS:
        for _ in range(50):
            a, b, arms, normal = random_pair(rng, parts)
            energy = a.energy() + b.energy()
            collide(a, b, arms, normal, 1.0, 0.0)
            assert a.energy() + b.energy() == pytest.approx(energy, rel=1e-12)


def minkowski_distance(a: np.ndarray, b: np.ndarray) -> float:
    """Signed distance of the hulls of points a and b: that of the origin from the hull of all their differences.

    From outside by least squares with weights of the points that must not be negative (Lawson and Hanson 1974, ch. 23).
    """
    points = (a[:, None] - b[None]).reshape(-1, 3)
    outside = float(ConvexHull(points).equations[:, 3].max())  # the origin is inside of a facet with a negative offset
    if outside <= 0.0:
        return outside
    scale = np.linalg.norm(points, axis=1).min()
    weight, _ = nnls(
        np.vstack([points.T / scale, np.ones(len(points))]), np.array([0.0, 0.0, 0.0, 1.0]), maxiter=10_000
    )
    return float(np.linalg.norm(points.T @ weight) / weight.sum())


class TwoParts:
    """The engine's distance of two parts."""

    def __init__(self, a: RigidPart, b: RigidPart) -> None:
        self.parts = (a, b)
        self.library = HullLibrary([a.corners, b.corners], [part.corner_radius for part in self.parts])
        self.hulls = self.library.hulls()

    def distance(self, positions: np.ndarray, attitudes: np.ndarray, reach: float = 1.0) -> float:
        state = new_parts(positions, attitudes, [0, 1])
        return float(hull_distance(self.hulls, state[0], 0, state[1], 1, reach))

    def expected(self, positions: np.ndarray, attitudes: np.ndarray) -> float:
        a, b = (part.corners @ r.T + x for part, x, r in zip(self.parts, positions, attitudes, strict=True))
        radii = sum(part.corner_radius for part in self.parts)
        apart = np.linalg.norm(a[0] - b[0]) if len(a) == len(b) == 1 else minkowski_distance(a, b)
        return float(apart - radii)


TURNS = np.stack([np.eye(3), np.eye(3)])


@pytest.mark.parametrize("gap", [1e-3, 1e-5, 1e-6])
def test_distance_of_faces_is_known(gap: float) -> None:
    nuts = TwoParts(NUT, NUT)
    flats, height, tip = 5e-3, 2e-3, 5e-3 / np.sqrt(3)
    turned = Rotation.from_rotvec([0.0, 0.0, np.pi / 6]).as_matrix()
    on_top = np.array([[0.0, 0.0, 0.0], [0.3e-3, -0.2e-3, height + gap]])
    assert nuts.distance(on_top, TURNS) == pytest.approx(gap, abs=1e-8)
    side_by_side = np.array([[0.0, 0.0, 0.0], [flats + gap, 0.1e-3, 0.2e-3]])
    assert nuts.distance(side_by_side, np.stack([turned, turned])) == pytest.approx(gap, abs=1e-8)
    tip_to_tip = np.array([[0.0, 0.0, 0.0], [2 * tip + gap, 0.0, 0.0]])
    assert nuts.distance(tip_to_tip, TURNS) == pytest.approx(gap, abs=1e-8)
    balls = TwoParts(BALL, SMALL_BALL)
    assert balls.distance(np.array([[0.0, 0, 0], [0, 4.5e-3 + gap, 0]]), TURNS) == pytest.approx(gap, abs=1e-12)


def test_a_distance_beyond_reach_is_the_reach() -> None:
    far = np.array([[0.0, 0.0, 0.0], [0.05, 0.0, 0.0]])
    assert TwoParts(NUT, NUT).distance(far, TURNS, reach=1e-3) == 1e-3


@pytest.mark.parametrize(
    ("a", "b"),
    [(NUT, NUT), (NUT, LARGE_NUT), (ROD, NUT), (LARGE_NUT, SMALL_BALL), (SMALL_BALL, NUT), (BALL, SMALL_BALL)],
    ids=["nuts", "two sizes", "rod and nut", "nut and ball", "ball and nut", "balls"],
)
def test_distance_in_random_poses_is_that_of_the_minkowski_difference(a: RigidPart, b: RigidPart) -> None:
    """The library's answer to a tenth of a micrometre, from 3 mm apart to 0.3 mm inside each other."""
    two, rng = TwoParts(a, b), np.random.default_rng(3)
    inside = close = 0
    for _ in range(400):
        attitudes = Rotation.random(2, rng=rng).as_matrix()
        direction = rng.normal(size=3)
        direction /= np.linalg.norm(direction)
        apart = rng.uniform(0.4, 1.3) * (a.size + b.size)
        positions = np.stack([0.02 * rng.normal(size=3), np.zeros(3)])
        positions[1] = positions[0] + apart * direction
        expected = two.expected(positions, attitudes)
        if expected < -0.3e-3:
            continue
        inside, close = inside + (expected < 0.0), close + (abs(expected) < 1e-4)
        assert two.distance(positions, attitudes) == pytest.approx(expected, abs=1e-7)
    assert inside > 5 and close > 2


def resting_plate(part: Any, *others: Any, side_mm: float = 60.0, **contact: Any) -> Scene:
    return build_scene(
        Scenario(
            plate=RigidPlate(kind="piston", length_mm=side_mm, width_mm=side_mm),
            drive=(Drive(frequency_hz=500.0, amplitude_um=0.0),),
            part=(part, *others),
            contact=Contact(**contact),
            run=Run(duration_s=1.0, seeds=1, frames_per_second=500.0),
        )
    )


def in_the_air(scene: Scene, positions: list[list[float]], velocities: list[list[float]]) -> ImpulseEngine:
    """An engine whose parts fly instead of starting over the plate."""
    engine = ImpulseEngine(scene, np.random.default_rng(0))
    n = len(positions)
    with changing(engine) as state:
        state["position"][:n], state["velocity"][:n] = positions, velocities
    return engine


def masses(scene: Scene) -> np.ndarray:
    return np.array([part.mass for part in scene.parts])


@callable_from_python
def borrowed_law(kinds: Any) -> Any:
    """The laws as the inner loops see them."""
    kind = borrow(kinds).record[0]
    return kind.restitution[0], kind.friction[0], kind.restitution[1], kind.friction[1]


def test_the_inner_loops_read_the_contacts_of_the_scenario() -> None:
    """They see arrays by their bare addresses, so each of them has to lie in memory row by row."""
    contact = {"restitution": 0.1, "friction": 0.2, "part_restitution": 0.3, "part_friction": 0.4}
    nut, rod = HexNut(size="M2.5"), Cylinder(shape="cylinder", diameter_mm=3.0, height_mm=4.0)
    far = Ball(shape="ball", diameter_mm=4.0, start=Start(position_mm=(20.0, 0.0)))
    for parts in ((nut,), (rod,), (nut, far)):
        scene = resting_plate(*parts, **contact)
        kinds = read_kinds(scene)
        assert borrowed_law(kinds) == (0.1, 0.2, 0.3, 0.4)
        library = HullLibrary([kind.corners for kind in scene.kinds], [kind.corner_radius for kind in scene.kinds])
        scratch, surface = new_scratch(kinds, scene.surface.n_shapes), surface_arrays(scene)
        for held in (kinds, surface, scratch, library.hulls()):
            for name, array in held._asdict().items():
                assert not isinstance(array, np.ndarray) or array.flags.c_contiguous, name
        assert new_parts(np.zeros((1, 3)), np.eye(3)[None], [0]).flags.c_contiguous


@pytest.mark.parametrize("e", [0.0, 0.2, 0.9, 1.0])
@pytest.mark.parametrize("diameters", [(4.0, 4.0), (6.0, 3.0)])
def test_head_on_collision_of_balls_in_flight(e: float, diameters: tuple[float, float]) -> None:
    start = Scattered(kind="scattered")
    balls = [Ball(shape="ball", diameter_mm=d, start=start) for d in diameters]
    scene = resting_plate(*balls, part_restitution=e)
    engine = in_the_air(scene, [[-6e-3, 0.0, 0.05], [6e-3, 0.0, 0.05]], [[0.3, 0.0, 0.0], [-0.1, 0.0, 0.0]])
    frames = engine.advance(25)
    (m, n), (u, v) = masses(scene), (0.3, -0.1)
    centre = (m * u + n * v) / (m + n)
    expected = [centre - e * n / (m + n) * (u - v), centre + e * m / (m + n) * (u - v)]
    assert frames.velocity[0, :, 0] == pytest.approx([u, v])
    assert frames.velocity[-1, :, 0] == pytest.approx(expected, abs=1e-6)
    assert np.abs(frames.velocity[..., 1]).max() < 1e-9
    assert frames.velocity[..., 2] == pytest.approx(-GRAVITY * np.tile(frames.time[:, None], 2), abs=1e-9)
    met = (12e-3 - 0.5e-3 * sum(diameters)) / (u - v)
    end = frames.time[-1]
    places = [-6e-3 + u * met + expected[0] * (end - met), 6e-3 + v * met + expected[1] * (end - met)]
    assert frames.position[-1, :, 0] == pytest.approx(places, abs=2e-6)


@pytest.mark.parametrize("beside", [0.5e-3, 1.5e-3, 2.5e-3])
def test_balls_that_meet_off_centre_push_each_other_along_their_centres(beside: float) -> None:
    """Without friction; the direction is that of the closed form, however the pair stood when it was found."""
    scene = resting_plate(
        *(Ball(shape="ball", diameter_mm=3.0, start=Scattered(kind="scattered")),) * 2, part_friction=0.0
    )
    way, u = np.array([-5.5e-3, beside, 0.0]), np.array([0.7, 0.0, 0.0])
    engine = in_the_air(scene, [[0.0, 0.0, 0.05], [way[0], way[1], 0.05]], [[0.0, 0.0, 0.0], [0.7, 0.0, 0.0]])
    frames = engine.advance(25)
    met = (-way[0] - np.sqrt(9e-6 - beside**2)) / u[0]
    normal = (way + u * met) / 3e-3
    change = np.diff(frames.velocity[-1], axis=0)[0] - u
    assert change / np.linalg.norm(change) == pytest.approx(normal, abs=3e-3)  # they are found within 3 um


@pytest.mark.parametrize("friction", [0.0, 0.3])
@pytest.mark.parametrize("seed", range(4))
def test_nuts_that_meet_in_the_air_keep_their_momenta(seed: int, friction: float) -> None:
    """Tumbling nuts, off centre: momentum and angular momentum stay, energy does not grow, and no hull is entered."""
    nuts = HexNut(size="M2.5", count=2, start=Scattered(kind="scattered"))
    scene = resting_plate(nuts, part_friction=friction, part_restitution=0.5)
    rng = np.random.default_rng(seed)
    engine = in_the_air(scene, [[-6e-3, 0.0, 0.1], [6e-3, 1e-3, 0.1]], [[0.4, 0.02, 0.0], [-0.2, 0.0, 0.05]])
    with changing(engine) as state:
        state["momentum"][:2] = rng.normal(size=(2, 3)) * 100.0 * NUT.inertia.mean()
        state["attitude"][:2] = Rotation.random(2, rng=rng).as_matrix()
    frames = [engine.current()]
    turning = [engine._row[:, COLUMNS["momentum"]]]
    for _ in range(40):
        frames.append(engine.advance(1))
        turning.append(engine._row[:, COLUMNS["momentum"]])
    joined = Frames.joined(frames)
    fall = np.stack([0 * joined.time, 0 * joined.time, -GRAVITY * joined.time], axis=1)[:, None]
    velocity = joined.velocity - fall
    assert np.abs(velocity[-1, :, 0] - velocity[0, :, 0]).max() > 0.1  # they did meet
    assert velocity.sum(axis=1) == pytest.approx(np.tile(velocity[0].sum(axis=0), (41, 1)), abs=1e-9)
    # About the common centre of mass, which falls freely; seen from it there is no gravity.
    arms = joined.position - joined.position.mean(axis=1, keepdims=True)
    total = NUT.mass * np.cross(arms, velocity).sum(axis=1) + np.array(turning).sum(axis=1)
    # An impact of parts that overlap by some um pushes them apart, which turns the arm of their momenta.
    assert total == pytest.approx(np.tile(total[0], (41, 1)), abs=0.5 * NUT.mass * 0.6 * DEEPEST)
    assert energy(scene, joined, velocity).max() <= energy(scene, joined, velocity)[0] * (1 + 1e-9)
    assert hull_distances(scene, joined).min() > -DEEPEST


def energy(scene: Scene, frames: Frames, velocity: np.ndarray) -> np.ndarray:
    """Energy of motion of all parts, one value per frame [J]."""
    inertia = np.array([part.inertia for part in scene.parts])
    turned = Rotation.from_quat(frames.quaternion.reshape(-1, 4), scalar_first=True).inv()
    spin = turned.apply(frames.angular_velocity.reshape(-1, 3)).reshape(frames.position.shape)
    moving = 0.5 * masses(scene) @ (velocity**2).sum(axis=2).T
    return np.asarray(moving + 0.5 * (inertia * spin**2).sum(axis=(1, 2)))


@pytest.mark.slow
def test_a_crowd_pushed_together_on_a_plate_does_not_enter_itself() -> None:
    """Nuts, rods and balls thrown at the middle of a plate at rest, in a heap of each other."""
    start = Scattered(kind="scattered", size_mm=(50.0, 50.0))
    nuts = HexNut(size="M2.5", count=14, start=start)
    rods = Cylinder(shape="cylinder", diameter_mm=3.0, height_mm=4.0, count=4, start=start)
    balls = Ball(shape="ball", diameter_mm=4.0, count=6, start=start)
    scene = resting_plate(nuts, rods, balls)
    engine = ImpulseEngine(scene, np.random.default_rng(4))
    with changing(engine) as state:
        state["velocity"][:, :2] = -40.0 * state["position"][:, :2]  # up to 1.4 m/s
    before = state["velocity"]
    frames = engine.advance(150)
    spread = np.linalg.norm(frames.position[..., :2], axis=2).mean(axis=1)
    assert spread.min() < 0.7 * spread[0]  # they did come together
    assert np.abs(frames.velocity[..., :2] - before[:, :2]).max() > 0.3
    assert hull_distances(scene, frames).min() > -DEEPEST
    # Nothing drives them: the plate takes energy out, and parts give it to each other.
    total = energy(scene, frames, frames.velocity) + GRAVITY * frames.position[..., 2] @ masses(scene)
    drop = GRAVITY * masses(scene).sum() * 2 * DEEPEST
    assert (np.diff(total) < drop).all()
    assert total[-1] < 0.5 * total[0]


@pytest.mark.parametrize("seed", [10, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (5, 12))])
def test_a_heap_that_falls_in_on_itself_does_not_enter_itself(seed: int) -> None:
    scene = resting_plate(HexNut(size="M2.5", count=30, start=Heap(kind="heap", diameter_mm=16.0)))
    engine = ImpulseEngine(scene, np.random.default_rng(seed))
    frames = engine.advance(300)
    assert hull_distances(scene, frames).min() > -DEEPEST
    on_plate = np.abs(frames.position[-1, :, :2]).max(axis=1) < 0.03
    assert on_plate.sum() > 10  # the others have slid off the small plate
    assert (frames.position[-1, on_plate, 2] > 0.0).all()
    speed = np.linalg.norm(frames.velocity[-1, on_plate], axis=1)
    assert np.median(speed) < 0.05  # it has come to rest


def test_without_friction_parts_on_a_plate_keep_their_momentum_along_it() -> None:
    """What the parts do to each other does not change the total; a smooth plate at rest pushes upwards alone."""
    balls = Ball(shape="ball", diameter_mm=4.0, count=8, start=Scattered(kind="scattered", size_mm=(40.0, 40.0)))
    scene = resting_plate(balls, side_mm=400.0, friction=0.0, part_friction=0.2, part_restitution=0.5)
    engine = ImpulseEngine(scene, np.random.default_rng(6))
    with changing(engine) as state:
        state["velocity"][:, :2] = -10.0 * state["position"][:, :2]
    begin = state["velocity"][:, :2]
    frames = engine.advance(100)
    assert np.abs(frames.velocity[-1, :, :2] - begin).max() > 0.05
    total = frames.velocity[..., :2].sum(axis=1)
    assert total == pytest.approx(np.tile(begin.sum(axis=0), (100, 1)), abs=1e-6)
