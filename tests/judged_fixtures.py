"""Random scenes of up to twelve parts beside up to six fixtures: they end, nothing goes through, energy does not grow.

    finding = judged("standing", 12)

standing  fixtures of all shapes on a plate at rest
moved     the same on a piston or a tray; of those on a tray some stand
gates     on a plate at rest, of which one moves by itself: to and fro, or turning
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from judged_scenes import MODELS, PISTON, Finding, Rng, ball, corner_part, looked_at
from numpy.typing import NDArray
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation
from trimesh.triangles import closest_point

from feeder_sim.records.trajectory import Frames
from feeder_sim.scene.fixture import RigidFixture
from feeder_sim.scene.fixture_path import path_of
from feeder_sim.scene.scene import Scene

Raw = dict[str, Any]
IN_FIXTURE = 2e-6  # [m]
LOOKS = 25  # frames of a scene in which depths are measured
PLACES = [(x, y) for x in (-30.0, 0.0, 30.0) for y in (-30.0, 0.0, 30.0)]  # of fixtures [mm], out of each other
AROUND = [(45.0, 0.0), (-45.0, 0.0), (0.0, 45.0), (0.0, -45.0), (45.0, 45.0)]


def judged(kind: str, seed: int, law: str = "newton") -> Finding | None:
    """Run a scene by a law of impact and look at what came out; None where the scene is refused."""
    raw = scene(kind, seed)
    finding = looked_at(raw | {"contact": raw["contact"] | {"law": law}}, f"{kind}_{seed}", in_fixtures)
    if finding is None or kind != "gates":
        return finding
    faults = tuple(fault for fault in finding.faults if "energy grows" not in fault)  # as what moves may give it
    return Finding(finding.scene, faults, finding.wall_s, finding.counts)


def scene(kind: str, seed: int) -> Raw:
    """The scene of a kind, one of `KINDS`, with a number."""
    rng = np.random.default_rng(seed)
    e, mu = float(rng.choice([0.0, 0.2, 0.5, 0.9])), float(rng.choice([0.0, 0.1, 0.3, 1.0]))
    contact = {"restitution": e, "friction": mu, "part_restitution": e, "part_friction": mu}
    parts = []
    for i in range(int(rng.integers(1, 13))):
        x, y = rng.uniform(-40.0, 40.0, 2)
        turn = rng.normal(size=4)
        start = {
            "kind": "state",
            "position_mm": [float(x), float(y), 35.0 + 16.0 * i],
            "quaternion": (turn / np.linalg.norm(turn)).tolist(),
            "velocity_mm_s": [*rng.uniform(-200.0, 200.0, 2).tolist(), -100.0],
        }
        parts.append((ball(rng) if rng.random() < 0.2 else corner_part(rng)) | {"start": start})
    places = rng.permutation(len(PLACES))[: int(rng.integers(1, 7))]
    fixtures = [_fixture(rng) | {"position_mm": _place(PLACES[k], rng)} for k in places]
    plate, drive = PLATES[kind](rng)
    if kind == "moved":
        for fixture in fixtures:
            fixture["moves"] = str(rng.choice(["plate", "plate", "stands"]))
            if plate["kind"] != "tray" or fixture["moves"] == "stands":  # else the plate may lift parts against it
                fixture["position_mm"] = fixture["position_mm"][:2]
    if kind == "gates":
        contact["friction"] = contact["part_friction"] = min(mu, 0.3)
        fixtures[0] |= _motion(rng) | {"position_mm": _place((0.0, 0.0), rng)}
        for fixture, place in zip(fixtures[1:], AROUND, strict=False):  # farther than a part is long: none is squeezed
            fixture["position_mm"] = _place(place, rng)
    raw = {"title": f"Random scene {seed}, {kind}", "plate": plate, "contact": contact, "part": parts}
    run = {"duration_s": 0.7, "seeds": 1, "frames_per_second": 500.0}
    return raw | {"fixture": fixtures, "run": run} | ({"drive": [drive]} if drive else {})


def _place(middle: tuple[float, float], rng: Rng) -> list[float]:
    """Of a wiper, too: some stand over the plate [mm]."""
    gap = float(rng.choice([0.0, 0.0, rng.uniform(0.5, 5.0)]))
    return [*middle, gap] if gap else list(middle)


def _fixture(rng: Rng) -> Raw:
    """One that fits into a circle of 28 mm, whatever its turn."""
    shape = str(rng.choice(["box", "cylinder", "ramp", "extrusion", "mesh"]))
    long, wide, high = float(rng.uniform(5.0, 22.0)), float(rng.uniform(0.5, 8.0)), float(rng.uniform(1.0, 25.0))
    turn, e = float(rng.uniform(-180.0, 180.0)), float(rng.choice([0.0, 0.5]))
    table: Raw = {"shape": shape, "turn_deg": turn, "restitution": e, "friction": float(rng.choice([0.0, 0.3]))}
    if shape == "box":
        return table | {"size_mm": [long, wide, high]}
    if shape == "cylinder":
        return table | {"diameter_mm": wide, "height_mm": high}
    if shape == "ramp":
        return table | {"size_mm": [min(long, 12.0), wide, high]}
    if shape == "mesh":
        return table | {"file": str(MODELS / "bracket/bracket.stl")}
    arm = 0.5 * long  # an angle of two arms
    points = [[0.0, 0.0], [arm, 0.0], [arm, wide], [wide, wide], [wide, arm + wide], [0.0, arm + wide]]
    return table | {"points_mm": points, "height_mm": high}


def _motion(rng: Rng) -> Raw:
    """Within the place that a fixture has to itself, so that what it pushes can give way."""
    if rng.random() < 0.4:
        return {"turns_per_minute": float(rng.uniform(-120.0, 120.0))}
    if rng.random() < 0.5:
        return {"path": [{"at_s": float(rng.uniform(0.1, 0.5)), "by_mm": [0.0, 0.0, float(rng.uniform(1.0, 20.0))]}]}
    by = [*rng.uniform(-2.0, 2.0, 2).tolist(), 0.0]
    return {"path": [{"at_s": 0.2, "by_mm": by}, {"at_s": 0.35, "turn_deg": float(rng.uniform(-90.0, 90.0))}]}


def _still(rng: Rng) -> tuple[Raw, Raw | None]:
    return {"kind": "still", "length_mm": 400.0, "width_mm": 400.0}, None


def _moved(rng: Rng) -> tuple[Raw, Raw | None]:
    hz, g = float(10.0 ** rng.uniform(1.3, 2.5)), float(rng.choice([0.5, 1.5, 4.0]))
    size = min(1e6 * 9.81 * g / (2.0 * np.pi * hz) ** 2, 900.0)  # less than fixtures go on below the plate
    if rng.random() < 0.5:
        return PISTON, {"frequency_hz": hz, "amplitude_um": size}
    tray = {"kind": "tray", "length_mm": 400.0, "width_mm": 400.0, "tilt_deg": float(rng.choice([0.0, 5.0]))}
    return tray, {"frequency_hz": hz, "stroke_um": size, "angle_deg": float(rng.uniform(0.0, 90.0))}


PLATES: dict[str, Callable[[Rng], tuple[Raw, Raw | None]]] = {"standing": _still, "moved": _moved, "gates": _still}
KINDS = tuple(PLATES)


def in_fixtures(scene: Scene, frames: Frames) -> list[str]:
    """The deepest that a part is found in a fixture."""
    deepest, name = 0.0, ""
    for row in np.unique(np.linspace(0, len(frames) - 1, LOOKS).astype(int)):
        for fixture in scene.fixtures:
            bodies = _in_space(scene, fixture, float(frames.time[row]))
            for i, part in enumerate(scene.parts):
                turn = Rotation.from_quat(frames.quaternion[row, i], scalar_first=True)
                pieces = [turn.apply(piece) + frames.position[row, i] for piece in part.pieces or (part.corners,)]
                for piece in pieces:
                    for body in bodies:
                        if _far(piece, body, part.corner_radius):
                            continue
                        depth = _depth(piece, body, part.corner_radius)
                        deepest, name = max((deepest, name), (depth, fixture.name))
    return [f"a part is {1e6 * deepest:.3g} um in {name}"] if deepest > IN_FIXTURE else []


def _depth(a: NDArray[np.float64], b: NDArray[np.float64], radius: float) -> float:
    """How far a convex piece with spheres of a radius [m] around its corners is in a body [m], negative outside."""
    hull = ConvexHull(b)
    if len(a) == 1:
        inside = float((hull.equations[:, :3] @ a[0] + hull.equations[:, 3]).max())
        nearest = closest_point(b[hull.simplices], np.repeat(a, len(hull.simplices), axis=0))
        return radius - (inside if inside < 0.0 else float(np.linalg.norm(nearest - a, axis=1).min()))
    own = ConvexHull(a)
    crossed = np.cross(_edges(a, own)[:, None], _edges(b, hull)[None]).reshape(-1, 3)
    size = np.linalg.norm(crossed, axis=1)
    crossed = crossed[size > 1e-6] / size[size > 1e-6, None]
    axes = np.concatenate([own.equations[:, :3], -hull.equations[:, :3], crossed, -crossed])
    return float(((a @ axes.T).max(axis=0) - (b @ axes.T).min(axis=0)).min()) + radius


def _edges(points: NDArray[np.float64], hull: ConvexHull) -> NDArray[np.float64]:
    """Directions of the edges of a hull, and of the diagonals of its faces (n, 3)."""
    ends = np.unique(np.sort(hull.simplices[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1), axis=0)
    along = points[ends[:, 1]] - points[ends[:, 0]]
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    along *= np.sign(along[:, :1] + 1e-3 * along[:, 1:2] + 1e-6 * along[:, 2:])
    return np.unique(along.round(9), axis=0)


def _far(a: NDArray[np.float64], b: NDArray[np.float64], radius: float) -> bool:
    return bool((a.min(0) - radius > b.max(0)).any() or (b.min(0) - radius > a.max(0)).any())


def _in_space(scene: Scene, fixture: RigidFixture, t: float) -> list[NDArray[np.float64]]:
    """Corners of the bodies of a fixture at a time [s]."""
    path = path_of(fixture.table, scene.times.stages)
    centre, attitude = fixture.pose(*path.at(t)) if path else (fixture.centre, fixture.attitude)
    bodies = [centre + body @ attitude.T for body in fixture.bodies]
    if fixture.moves:
        middle = np.zeros((1, 2))
        moved = scene.surface.displacement(middle, t)[0] - [0.0, 0.0, scene.surface.resting_height(middle)[0]]
        bodies = [body + moved for body in bodies]
    return bodies
