"""Quantities of the conformance set from recorded motions: the same for every engine, whatever it records.

Cases of one part have one motion; those of several parts, and those with a run for each angle, have one for each.
"""

from __future__ import annotations

import itertools
import math
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import numpy as np
from case_files import GRAVITY, ConformanceError, case, not_a_name, number, part, records
from numpy.typing import NDArray
from right_values import cube_corner
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]
TIME, PLACE, VELOCITY, SPIN = ("time",), ("x", "y", "z"), ("vx", "vy", "vz"), ("wx", "wy", "wz")
ATTITUDE, BODY = ("qw", "qx", "qy", "qz"), "body"  # columns that only some cases need
NUT_HALF_HEIGHT = float(part("nut").corners[:, 2].max())
NUT_CORNER = float(np.hypot(*part("nut").corners[0, :2]))  # from its axis [m]
BALL = part("ball").radius
SHORTER = 0.01  # of the duration, that a motion may lack: that much may be left between two rows


@dataclass(frozen=True)
class Motion:
    """States of one part at n times. With `every_step` gravity has not acted since an impact.

    Attributes:
        time: shape (n,) [s].
        position, velocity: of the centre of mass, shape (n, 3) [m], [m/s].
        spin: in axes of the world, shape (n, 3) [rad/s].
        attitude: quaternions, w first, shape (n, 4); only `heap_at_rest` asks for them.
    """

    time: Array
    position: Array
    velocity: Array
    spin: Array
    every_step: bool = False
    attitude: Array | None = None


Quantities = dict[str, float]


def after_impact(motion: Motion, height: float) -> tuple[float, int]:
    """Speed upwards [m/s] with which a part left an impact at this height [m] of its centre, and its row.

    The row is that of the largest upward velocity; what gravity took since the impact is added.
    """
    row = int(np.argmax(motion.velocity[:, 2]))
    upward = float(motion.velocity[row, 2])
    if upward <= 0.0 or motion.every_step:
        return max(upward, 0.0), row
    rise = max(float(motion.position[row, 2]) - height, 0.0)
    return math.sqrt(upward**2 + 2.0 * GRAVITY * rise), row


def rebound(motion: Motion) -> Quantities:
    upward, row = after_impact(motion, NUT_HALF_HEIGHT)
    return {
        "upward_velocity": upward,
        "sideways_velocity": math.hypot(*motion.velocity[row, :2]),
        "corner_velocity_by_spin": NUT_CORNER * float(np.linalg.norm(motion.spin[row])),
    }


def ball_impact(motion: Motion, height: float = BALL) -> Quantities:
    """Both impacts of a ball that flies along x, and that of a cube, whose centre is higher then."""
    upward, row = after_impact(motion, height)
    return {
        "upward_velocity": upward,
        "velocity_along": float(motion.velocity[row, 0]),
        "spin": float(motion.spin[row, 1]),
    }


def slide_to_rest(motion: Motion) -> Quantities:
    """The way that a nut slid along x from x = 0, and the speed [mm/s] at which it creeps once it has stopped."""
    stopped = int(np.searchsorted(motion.time, case("slide_to_rest")["looks"]["stopped_s"] - 1e-9))
    crept = math.hypot(*(motion.position[-1, :2] - motion.position[stopped, :2]))
    return {
        "distance": 1e3 * float(motion.position[stopped, 0]),
        "creep": 1e3 * crept / float(motion.time[-1] - motion.time[stopped]),
    }


def rising_plate(motion: Motion) -> Quantities:
    tables = case("rising_plate")
    speed, drop = tables["plate"]["speed_m_s"], 1e-3 * tables["start"][0]["height_mm"]
    fall = (math.sqrt(speed**2 + 2.0 * GRAVITY * drop) - speed) / GRAVITY
    return {"upward_velocity": after_impact(motion, BALL + speed * fall)[0]}


def tops(name: str) -> Callable[[Motion], Quantities]:
    """Mean height [mm] over the resting plate of the tops of the last flights of a ball.

    Each follows from the highest sample of a period of the plate and its velocity. NaN for a ball that was thrown off.
    """
    plate, counted = case(name)["plate"], case(name)["looks"]["counted_periods"]

    def top(motion: Motion) -> Quantities:
        height = motion.position[:, 2] - BALL
        period = np.floor(motion.time * plate["frequency_hz"] + 1e-6).astype(int)
        last = int(period[-1]) + (1 if period[-1] == period[-2] else 0)
        highest = [
            rows[np.argmax(height[rows])]
            for k in range(last - counted, last)
            if len(rows := np.flatnonzero(period == k))
        ]
        reached = height[highest] + motion.velocity[highest, 2] ** 2 / (2.0 * GRAVITY)
        thrown = float(np.max(reached)) > 100e-6 * plate["z_um"]
        return {"top": math.nan if thrown else 1e3 * float(np.mean(reached))}

    return top


def way_at(motion: Motion, time: float) -> float:
    """Place along x [mm]."""
    return 1e3 * float(motion.position[min(int(np.searchsorted(motion.time, time - 1e-9)), len(motion.time) - 1), 0])


def two_axes(motion: Motion) -> Quantities:
    """Mean speed [mm/s] once the nut follows the tray."""
    first, last = case("two_axes")["looks"]["first_s"], case("two_axes")["duration_s"]
    return {"speed": (way_at(motion, last) - way_at(motion, first)) / (last - first)}


def fast_slip(motion: Motion) -> Quantities:
    tables = case("fast_slip")
    return {"early_way": way_at(motion, tables["looks"]["early_s"]), "way": way_at(motion, tables["duration_s"])}


# --- several parts or runs --------------------------------------------------------------------------------------------


def relative_velocity(first: Motion, second: Motion) -> float:
    """Along x at the end [m/s]."""
    return float(second.velocity[-1, 0] - first.velocity[-1, 0])


def head_on(first: Motion, second: Motion) -> Quantities:
    mean = 0.5 * float(first.velocity[-1, 0] + second.velocity[-1, 0])
    return {"relative_velocity": relative_velocity(first, second), "mean_velocity": mean}


def off_centre(first: Motion, second: Motion) -> Quantities:
    return {
        "relative_velocity": relative_velocity(first, second),
        "velocity_along": float(second.velocity[-1, 1]),
        "spin": float(second.spin[-1, 2]),
    }


def kinetic_energy(motion: Motion) -> Array:
    """Of a cube, whose moments are the same about all axes, shape (n,) [J]."""
    cube = part("cube")
    moving = cube.mass * (motion.velocity**2).sum(axis=1)
    return np.asarray(0.5 * (moving + cube.inertia[0] * (motion.spin**2).sum(axis=1)))


def energy(motion: Motion) -> Array:
    """Kinetic energy of a cube and potential energy over z = 0, shape (n,) [J]."""
    return np.asarray(kinetic_energy(motion) + part("cube").mass * GRAVITY * motion.position[:, 2])


def energy_gain(name: str) -> Callable[..., Quantities]:
    """The largest gain of energy over the runs of a cube, over its kinetic energy at the start."""
    first = case(name)["looks"]["first_s"]

    def gain(*runs: Motion) -> Quantities:
        gains = []
        for motion in runs:
            total = energy(motion)
            gains.append((total[motion.time > first - 1e-9].max() - total[0]) / kinetic_energy(motion)[0])
        return {"energy_gain": float(np.max(gains))}

    return gain


def heap(*cubes: Motion) -> Quantities:
    """Energies over that at the start, and how far [mm] a cube was in the plate or in another one."""
    corners = part("cube").corners
    total, moving = np.sum([energy(each) for each in cubes], axis=0), np.sum([kinetic_energy(m) for m in cubes], axis=0)
    axes = [_axes(motion) for motion in cubes]
    lowest_corner = min(
        float((motion.position[:, 2, None] + np.einsum("nj,kj->nk", turned[:, 2], corners)).min())
        for motion, turned in zip(cubes, axes, strict=True)
    )
    pairs = itertools.combinations(zip(cubes, axes, strict=True), 2)
    inside = max(
        float(overlap(two.position - one.position, first, second, corners.max()).max())
        for (one, first), (two, second) in pairs
    )
    return {
        "energy_gain": max(float(np.diff(total).max()), 0.0) / float(total[0]),
        "kinetic_energy": float(moving[-1] / total[0]),
        "depth": 1e3 * max(-lowest_corner, 0.0),
        "overlap": 1e3 * max(inside, 0.0),
    }


def overlap(apart: Array, first: Array, second: Array, half: float) -> Array:
    """How deep two cubes are in each other, or less than 0 [m]: the least over the axes that may separate them.

    Args:
        apart: from the centre of the first to that of the second, shape (n, 3) [m].
        first, second: their axes as columns, shape (n, 3, 3).
        half: half of a side [m].
    """
    faces = np.concatenate([first, second], axis=2).transpose(0, 2, 1)
    edges = np.cross(first.transpose(0, 2, 1)[:, :, None], second.transpose(0, 2, 1)[:, None]).reshape(-1, 9, 3)
    lengths = np.linalg.norm(edges, axis=2, keepdims=True)
    # Edges that are parallel have no axis of their own; that of a face is taken.
    directions = np.concatenate(
        [faces, np.where(lengths > 1e-6, edges / np.maximum(lengths, 1e-6), faces[:, :1])], axis=1
    )
    reach = sum(np.abs(np.einsum("nai,nij->naj", directions, axes)).sum(axis=2) for axes in (first, second))
    return np.asarray((half * reach - np.abs(np.einsum("nai,ni->na", directions, apart))).min(axis=1))


def _axes(motion: Motion) -> Array:
    if motion.attitude is None:
        raise ConformanceError(f"are missing, needed are the columns {', '.join(ATTITUDE)}", place="attitudes")
    return np.asarray(Rotation.from_quat(motion.attitude, scalar_first=True).as_matrix())


OBSERVERS: dict[str, Callable[..., Quantities]] = {
    "rebound": rebound,
    "slide": ball_impact,
    "oblique_sticking": ball_impact,
    "slide_to_rest": slide_to_rest,
    "rising_plate": rising_plate,
    "throw": tops("throw"),
    "bouncing_ball": tops("bouncing_ball"),
    "mesh_cube": lambda motion: ball_impact(motion, cube_corner()[1]),
    "two_parts_meet": head_on,
    "two_parts_slide": off_centre,
    "two_parts_stick": off_centre,
    "energy_at_edge": energy_gain("energy_at_edge"),
    "energy_at_corner": energy_gain("energy_at_corner"),
    "energy_of_bounces": energy_gain("energy_of_bounces"),
    "heap_at_rest": heap,
    "two_axes": two_axes,
    "fast_slip": fast_slip,
}


def motions_of(name: str) -> int:
    """How many motions a case has: of its parts, or runs."""
    tables = case(name)
    return len(tables["start"]) * int(tables.get("sweep", {}).get("runs", 1))


# --- starts -----------------------------------------------------------------------------------------------------------


def attitudes(name: str) -> list[Array]:
    """Quaternions, w first, of every part or run of a case at its start; yaw and tilt by chance are left out."""
    tables = case(name)
    sweep = tables.get("sweep")
    if sweep is None:
        return [_attitude(start) for start in tables["start"]]
    then = _turned(**sweep["then"]) if "then" in sweep else Rotation.identity()
    angles = sweep["first_deg"] + sweep["step_deg"] * np.arange(sweep["runs"])
    return [(then * _turned(sweep["about"], angle)).as_quat(scalar_first=True) for angle in angles]


def _turned(about: str, deg: float) -> Rotation:
    return Rotation.from_euler(about, deg, degrees=True)


def _attitude(start: dict[str, object]) -> Array:
    if "quaternion" in start:
        quaternion = np.array(start["quaternion"], float)
        return quaternion / np.linalg.norm(quaternion)
    turn = start.get("turn")
    assert turn is None or isinstance(turn, dict)
    return np.asarray((_turned(**turn) if turn else Rotation.identity()).as_quat(scalar_first=True))


def lowest(name: str, quaternion: Array) -> float:
    """How far below its centre of mass a part of `common.toml` reaches at an attitude [m]."""
    body = part(name)
    return body.radius or -float(Rotation.from_quat(quaternion, scalar_first=True).apply(body.corners)[:, 2].min())


# --- motions in files -------------------------------------------------------------------------------------------------


def observed_file(name: str, path: Path, *, every_step: bool = False) -> Quantities:
    """Quantities of a case from a CSV file of its motion.

    Raises:
        ConformanceError: a case without chance is needed; the file cannot be read; motions are missing.
    """
    if name not in OBSERVERS:
        raise ConformanceError(not_a_name(name, OBSERVERS), place="--motion")
    motions, tables = read_motions(path, every_step=every_step), case(name)
    if len(motions) != motions_of(name):
        problem = f"has {len(motions)} motions, must have {motions_of(name)} for {name}"
        raise ConformanceError(problem, path, f"column {BODY}")
    for motion in motions:
        if motion.time[-1] < (1.0 - SHORTER) * tables["duration_s"]:
            problem = f"ends at {motion.time[-1]:g} s, must reach {tables['duration_s']:g} s"
            raise ConformanceError(problem, path, "column time")
        if "sweep" not in tables and not np.array_equal(motion.time, motions[0].time):
            raise ConformanceError(f"differs between bodies of {name}, must be the same", path, "column time")
    try:
        return OBSERVERS[name](*motions)
    except ConformanceError as error:
        raise ConformanceError(str(error), path) from error
    except (IndexError, ValueError, ZeroDivisionError) as error:
        raise ConformanceError(f"has too few rows for {name}", path) from error


def read_motions(path: Path, *, every_step: bool = False) -> list[Motion]:
    """Motions in a CSV file, in the order of their bodies.

    Raises:
        ConformanceError: a file that cannot be read, a column that is missing, a value that is no number, times that do
            not grow.
    """
    needed = (*TIME, *PLACE, *VELOCITY, *SPIN)
    lines = records(path, needed, (*needed, *ATTITUDE, BODY))
    columns = [name for name in (*needed, *ATTITUDE) if name in lines[0][1]]
    if len(columns) not in (len(needed), len(needed) + len(ATTITUDE)):
        raise ConformanceError(f"are incomplete, needed are all of {', '.join(ATTITUDE)}, or none", path, "attitudes")
    rows: dict[float, list[list[float]]] = {}
    for line, record in lines:
        body = number(path, line, record, BODY) if BODY in record else 0.0
        state = [number(path, line, record, name) for name in columns]
        of_body = rows.setdefault(body, [])
        if of_body and state[0] <= of_body[-1][0]:
            problem = f"is {state[0]:g}, must be above {of_body[-1][0]:g}, the time before"
            raise ConformanceError(problem, path, f"line {line}, column time")
        of_body.append(state)
    return [_motion(np.array(rows[body]), every_step=every_step) for body in sorted(rows)]


def _motion(states: Array, *, every_step: bool) -> Motion:
    attitude = states[:, 10:14] if states.shape[1] > 10 else None
    return Motion(states[:, 0], states[:, 1:4], states[:, 4:7], states[:, 7:10], every_step, attitude)


def starts_of(name: str) -> Sequence[tuple[str, Array, Array, Array, Array]]:
    """Part, position [m], attitude, velocity [m/s] and spin [rad/s] of every part or run without chance."""
    tables, turned = case(name), attitudes(name)
    starts = tables["start"] * (len(turned) // len(tables["start"]))
    states = []
    for start, quaternion in zip(starts, turned, strict=True):
        height = 1e-3 * start.get("height_mm", 0.0)
        position = 1e-3 * np.array(start["position_mm"]) if "position_mm" in start else np.zeros(3)
        if "position_mm" not in start:
            position[2] = height + lowest(start["part"], quaternion)
        velocity, spin = (np.array(start.get(key, (0.0,) * 3), float) for key in ("velocity_m_s", "spin_rad_s"))
        states.append((start["part"], position, quaternion, velocity, spin))
    return states
