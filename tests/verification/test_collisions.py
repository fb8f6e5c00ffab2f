"""Parts that meet, at zero time and at all their points, along axes of faces and edges; components at rest."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from conftest import changing, from_python, hull_distances, opened
from invariants import growth, quiet, recorded
from judged_crowds import judged
from scipy.optimize import linprog
from scipy.spatial import ConvexHull, HalfspaceIntersection
from scipy.spatial.transform import Rotation

from feeder_sim.engines.impulse.engine import ImpulseEngine
from feeder_sim.engines.impulse.joint import pair_after
from feeder_sim.engines.impulse.kinds import hull_of, read_kinds
from feeder_sim.engines.impulse.pairs import hulls, separating_axis, touching_points
from feeder_sim.engines.impulse.pairs.hulls import HullLibrary
from feeder_sim.engines.impulse.pairs.separating_axis import new_meeting
from feeder_sim.engines.impulse.state import ASLEEP, AWAKE, new_parts
from feeder_sim.scenario import Box, GivenState, HexNut, RigidPlate, Run, Scenario, Start
from feeder_sim.scene.scene import Scene, build_scene

SIDE = 4.0  # [mm] of a cube
BLOCK = (6.0, 6.0, 3.0)  # [mm]
PLATE = RigidPlate(kind="still", length_mm=200.0, width_mm=200.0)
TOUCH = 1e-6  # [m]


def cube(x: float, speed: float, y: float = 0.0) -> Box:
    state = GivenState(kind="state", position_mm=(x, y, 50.0), velocity_mm_s=(speed, 0.0, 0.0))
    return Box(shape="box", size_mm=(SIDE,) * 3, start=state)


def met(one: Box, other: Box, **contact: Any) -> Any:
    made = Scenario(plate=PLATE, part=(one, other), contact=quiet(**contact), run=Run(duration_s=0.05, seeds=1))
    _, (frames,) = recorded(made)
    return frames


@pytest.mark.parametrize("e", [0.0, 0.3, 0.8, 1.0])
def test_cubes_that_meet_face_to_face_rebound_without_spin(e: float) -> None:
    frames = met(cube(-5.0, 200.0), cube(5.0, -200.0), part_restitution=e)
    np.testing.assert_allclose(frames.velocity[-1, :, 0], [-0.2 * e, 0.2 * e], atol=1e-6)
    assert np.abs(frames.angular_velocity).max() < 1e-6
    assert np.abs(frames.velocity[-1, :, 1]).max() < 1e-9


def test_cubes_that_meet_beside_each_other_turn_as_by_hand() -> None:
    """Offset by 1 mm, without friction: the face that both share is 3 mm wide, and the impulse acts in its middle.

    Two points of the face keep the rebound -e v only if the impulse is at its edge: with an arm r of the contact, which
    is 1.5 mm for both, what is left of the approach at the far edge is less.
    """
    e, mass, v = 0.3, 1.0, 0.2
    frames = met(cube(-5.0, 1e3 * v), cube(5.0, 0.0, y=1.0), part_restitution=e, part_friction=0.0)
    spin, speed = frames.angular_velocity[-1, :, 2], frames.velocity[-1, :, 0]
    assert spin[0] == pytest.approx(spin[1], rel=1e-9)
    # All impulses lie between the edges of the common face, y = -1 and 2 mm from the first centre.
    inertia = mass * (SIDE * 1e-3) ** 2 / 6.0
    push = mass * speed[1]
    arm = -inertia * spin[1] / push + 1e-3  # from the first centre
    assert -1e-3 - 1e-9 <= arm <= 2e-3 + 1e-9
    # Where points are in contact after it, none of the edges approaches, and one of them at least has -e v.
    edges = np.array([-1e-3, 2e-3])
    after = (speed[1] - spin[1] * (edges - 1e-3)) - (speed[0] - spin[0] * edges)
    assert after.min() == pytest.approx(e * v, rel=1e-5)


def test_hulls_have_edges_between_faces_that_differ() -> None:
    corners = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
    edges, planes = hull_of(corners)
    assert (len(edges), len(planes)) == (12, 6)
    along = corners[edges[:, 1]] - corners[edges[:, 0]]
    turned = np.cross(planes[edges[:, 3], :3], planes[edges[:, 2], :3])
    assert (np.einsum("ij,ij->i", along, turned) > 0.0).all()
    for corner in (0, 1):
        for face in (2, 3):
            on = np.einsum("ij,ij->i", planes[edges[:, face], :3], corners[edges[:, corner]])
            np.testing.assert_allclose(on + planes[edges[:, face], 3], 0.0, atol=1e-12)


# Axes and points, against independent arithmetic


class Placed:
    """Two parts of a scene in poses, their hulls as half spaces."""

    def __init__(self, scene: Scene, rng: np.random.Generator) -> None:
        self.kinds = read_kinds(scene)
        self.room = new_meeting(self.kinds)
        self.parts = new_parts(np.zeros((2, 3)), Rotation.random(2, rng).as_matrix(), scene.kind_of)
        self.pieces = [self.kinds.piece[part["kind"]] for part in self.parts]

    def corners(self, end: int) -> np.ndarray:
        piece, part = self.pieces[end], self.parts[end]
        own = self.kinds.corners[piece["corner_from"] : piece["corner_to"]]
        return np.asarray(own @ part["attitude"].T + part["position"])

    def look(self) -> tuple[float, np.ndarray]:
        (a, b), (first, second) = self.parts, self.pieces
        from_python(separating_axis.place_pieces)(a, first, b, second, self.kinds, self.room)
        gap, axis, self.origin = from_python(separating_axis.separating_axis)(first, second, self.kinds, self.room)
        return gap, np.array(axis)

    def touching(self, axis: np.ndarray) -> np.ndarray:
        first, second = self.pieces
        found = from_python(touching_points.touching_points)(first, second, self.kinds, TOUCH, tuple(axis), self.room)
        return np.asarray(self.room.point[:found] + self.parts["position"][0])

    def move_to_gap(self, gap: float) -> None:
        """Move the second part along a line of centres until both are apart by that, as a library has it."""
        corners = np.split(self.kinds.corners, self.kinds.piece["corner_from"][1:])
        library = HullLibrary(corners, [0.0] * len(corners))
        way = Rotation.random(rng=np.random.default_rng(3)).apply([1.0, 0.0, 0.0])
        low, high = 0.0, 0.05
        for _ in range(60):
            self.parts["position"][1] = 0.5 * (low + high) * way
            a, b = self.parts
            apart = from_python(hulls.hull_distance)(library.hulls(), a, a["kind"], b, b["kind"], 1.0)
            low, high = (low, 0.5 * (low + high)) if apart > gap else (0.5 * (low + high), high)

    def move(self, velocity: np.ndarray, spins: np.ndarray, t: float) -> None:
        """Move the second part [m/s], and turn both [rad/s], for a time [s]."""
        self.parts["position"][1] += t * velocity
        for part, spin in zip(self.parts, spins, strict=True):
            part["attitude"] = Rotation.from_rotvec(t * spin).as_matrix() @ part["attitude"]


def two(seed: int) -> Placed:
    rng = np.random.default_rng(seed)
    nut = HexNut(size="M2.5", start=Start())
    box = Box(shape="box", size_mm=tuple(rng.uniform(2.0, 6.0, 3)), start=Start(position_mm=(20.0, 0.0)))
    return Placed(build_scene(Scenario(plate=PLATE, part=(nut, box), run=Run(duration_s=0.1, seeds=1))), rng)


def depth_along(one: np.ndarray, other: np.ndarray, axis: np.ndarray) -> float:
    return float((one @ axis).max() - (other @ axis).min())


@pytest.mark.parametrize("seed", range(20))
def test_no_direction_has_less_depth_than_the_axis(seed: int) -> None:
    pair = two(seed)
    pair.move_to_gap(-1e-5)
    gap, axis = pair.look()
    one, other = pair.corners(0), pair.corners(1)
    assert -depth_along(one, other, axis) == pytest.approx(gap, abs=1e-12)
    directions = Rotation.random(4000, np.random.default_rng(seed)).apply(axis)
    near = axis + 0.02 * directions
    for way in (*directions, *(near / np.linalg.norm(near, axis=1)[:, None])):
        assert depth_along(one, other, way) >= -gap - 1e-12


def test_axes_turn_with_faces_and_edges() -> None:
    """Where parts have turned by 0.01 rad the axis is as foretold to the third order, and so is a point on both."""
    origins, t = set(), 1e-4
    for seed in range(30):
        pair, rng = two(seed), np.random.default_rng(seed)
        pair.move_to_gap(-1e-6)
        _, axis = pair.look()
        origin, along = pair.origin, tuple(map(tuple, pair.room.along))
        first = pair.touching(axis)[0] - pair.parts["position"][0]
        apart = pair.parts["position"][1] - pair.parts["position"][0]
        velocity, spins = rng.normal(size=3), 40.0 * rng.normal(size=(2, 3))
        motion = tuple(apart), tuple(velocity), tuple(map(tuple, spins)), (False, False)
        now = tuple(first), tuple(first - apart), tuple(axis)
        arm, other, normal = map(np.array, from_python(pair_after._after)(t, origin, now, along, motion))
        np.testing.assert_allclose(arm - other, apart + t * velocity, atol=1e-12)
        pair.move(velocity, spins, t)
        turned = pair.look()[1]
        if pair.origin == origin and np.linalg.norm(turned - axis) < 0.03:  # the same face, or pair of edges
            np.testing.assert_allclose(normal, turned, atol=1e-6)
            origins.add(origin)
    assert origins == {separating_axis.FACE_OF_FIRST, separating_axis.FACE_OF_SECOND, separating_axis.EDGES}


@pytest.mark.parametrize("seed", range(20))
def test_points_that_touch_are_those_of_the_common_body(seed: int) -> None:
    """Hulls that are 0.4 um in each other share a body: its corners are where points touch, but for the band."""
    pair = two(seed)
    pair.move_to_gap(-4e-7)
    gap, axis = pair.look()
    points = pair.touching(axis)
    assert len(points)
    halfspaces = np.concatenate([ConvexHull(pair.corners(end)).equations for end in range(2)])
    inside = linprog(
        [0, 0, 0, -1],
        A_ub=np.hstack([halfspaces[:, :3], np.linalg.norm(halfspaces[:, :3], axis=1)[:, None]]),
        b_ub=-halfspaces[:, 3],
        bounds=[(None, None)] * 3 + [(0, None)],
    ).x
    shared = HalfspaceIntersection(halfspaces * [1, 1, 1, 1e6], inside[:3] * 1e6).intersections * 1e-6
    for point in points:
        assert (halfspaces[:, :3] @ point + halfspaces[:, 3]).max() < 1.1 * TOUCH
    for corner in shared:  # every corner of it has a point nearby, as the touching face is thin
        assert np.linalg.norm(points - corner, axis=1).min() < 1e-4
    assert gap == pytest.approx(-4e-7, abs=1e-9)


# Components at rest


def block(k: int, gap_mm: float = 2e-3, beside_mm: float = 0.0) -> Box:
    height = 0.5 * BLOCK[2] + gap_mm + k * (BLOCK[2] + gap_mm)
    state = GivenState(kind="state", position_mm=(beside_mm * (k % 2), 0.0, height))
    return Box(shape="box", size_mm=BLOCK, start=state)


def stacked(*blocks: Box, e: float, mu: float, duration_s: float = 0.1) -> Scenario:
    contact = quiet(restitution=e, friction=mu, part_restitution=e, part_friction=mu)
    run = Run(duration_s=duration_s, seeds=1, frames_per_second=1000.0)
    return Scenario(plate=PLATE, part=blocks, contact=contact, run=run)


@pytest.mark.parametrize("n", [3, 5, 10])
@pytest.mark.parametrize(("e", "mu"), [(0.0, 0.3), (0.5, 0.3), (0.8, 0.3), (0.2, 0.0)])
def test_a_stack_rests(n: int, e: float, mu: float) -> None:
    scene, (frames,) = recorded(stacked(*(block(k) for k in range(n)), e=e, mu=mu))
    late = frames[slice(50, None)]
    assert not late.velocity.any() and not late.angular_velocity.any()
    assert (late.position == late.position[0]).all()
    assert growth(scene, frames) < 1e-7
    upright = Rotation.from_quat(frames.quaternion[-1], scalar_first=True).magnitude()
    assert upright.max() < 1e-3


def test_blocks_that_fall_on_each_other_rest() -> None:
    scene, (frames,) = recorded(stacked(*(block(k, gap_mm=1.0) for k in range(4)), e=0.5, mu=0.3, duration_s=0.3))
    assert not frames.velocity[-1].any() and growth(scene, frames) < 1e-6
    assert hull_distances(scene, frames[slice(-1, None)]).min() > -5e-6


def asleep(n: int) -> ImpulseEngine:
    engine = ImpulseEngine(build_scene(stacked(*(block(k) for k in range(n)), e=0.2, mu=0.3)), np.random.default_rng(0))
    engine.advance(50)
    assert (opened(engine)["there"] == ASLEEP).all()
    return engine


def test_what_stood_on_a_part_falls_when_it_is_taken_away() -> None:
    engine = asleep(3)
    engine.remove(np.array([0]))
    frames = engine.advance(20)
    fallen = frames.position[-1, 1:, 2] - frames.position[0, 1:, 2]
    np.testing.assert_allclose(fallen, -0.5 * 9.81 * (frames.time[-1] - frames.time[0]) ** 2, rtol=0.2)


def test_a_component_wakes_as_a_whole() -> None:
    engine = asleep(3)
    with changing(engine) as state:
        state["there"][2], state["asleep_with"][2], state["velocity"][2] = AWAKE, -1, [0.2, 0.0, 0.0]
    assert (opened(engine)["there"][:2] == ASLEEP).all()
    engine.advance(1)
    assert (opened(engine)["there"] == AWAKE).all()


def test_a_block_that_slides_does_not_fall_asleep() -> None:
    state = GivenState(kind="state", position_mm=(0.0, 0.0, 4.502 + 2e-3), velocity_mm_s=(30.0, 0.0, 0.0))
    upper = Box(shape="box", size_mm=(3.0, 3.0, 3.0), start=state)
    _, (frames,) = recorded(stacked(block(0), upper, e=0.0, mu=0.0, duration_s=0.05))
    assert frames.velocity[-1, 1, 0] == pytest.approx(0.03, rel=1e-3)


# Random scenes; benchmarks/random_scenes.py runs thousands


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(30))
def test_random_pairs_in_flight_keep_their_momenta(seed: int) -> None:
    finding = judged("pair", seed)
    assert finding is not None
    broken = [fault for fault in finding.faults if "takes" not in fault]  # it may have been compiled meanwhile
    assert not broken, (seed, finding)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(12))
def test_random_heaps_come_to_rest_on_the_plate(seed: int) -> None:
    finding = judged("heap", seed)
    assert finding is not None
    of_rest = [fault for fault in finding.faults if "still moves" in fault or "in the plate" in fault]
    assert not of_rest and finding.gain < 5e-6, (seed, finding)
