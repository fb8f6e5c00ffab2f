"""Measured tosses of a cube (benchmarks/validation/cube_tosses.csv) in Bullet and in plain MuJoCo.

    python benchmarks/peers/tosses.py [--only bullet|mujoco] [--steps-per-ms 10]

Prints the share of the tosses that end with the measured face up, the median distance of the final centre from the
measured one, the number of tosses, and the processor time per simulated second. The cube has an edge of 104.8 mm; mass,
inertia, friction and restitution are the authors' own, nothing is fitted (Pfrommer, Halm and Posa, CoRL 2020).
"""

from __future__ import annotations

import argparse
import importlib
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

DATA = Path(__file__).parents[1] / "validation" / "cube_tosses.csv"
EDGE, MASS, INERTIA = 0.1048, 0.370, 8.1e-4  # [m], [kg], [kg m2] about every axis
FRICTION, RESTITUTION = 0.18, 0.125
STEPS_PER_MS = 10
PLACE, TURN = ("x_m", "y_m", "z_m"), ("qw", "qx", "qy", "qz")
VELOCITY, SPIN = ("vx_m_s", "vy_m_s", "vz_m_s"), ("wx_rad_s", "wy_rad_s", "wz_rad_s")  # spin in the cube's own axes
END_PLACE, END_TURN = tuple(f"end_{name}" for name in PLACE), tuple(f"end_{name}" for name in TURN)
ENGINES = {"bullet": "toss_bullet", "mujoco": "toss_mujoco"}
Tosses = NDArray[np.void]


def corners() -> NDArray[np.float64]:
    """Of the cube, shape (8, 3) [m]."""
    return 0.5 * EDGE * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float64)


def read_tosses(path: Path = DATA) -> Tosses:
    """Rows of the data, with the columns of the file."""
    return np.genfromtxt(path, delimiter=",", names=True)


def columns(tosses: Tosses, names: tuple[str, ...]) -> NDArray[np.float64]:
    """Some columns side by side, shape (n, len(names))."""
    return np.stack([tosses[name] for name in names], axis=1)


def starts(tosses: Tosses) -> tuple[NDArray[np.float64], ...]:
    """Places (n, 3) with no corner below z = 0, quaternions (n, 4), velocities and spins in body axes (n, 3)."""
    place, turn = columns(tosses, PLACE), columns(tosses, TURN)
    turn = turn / np.linalg.norm(turn, axis=1, keepdims=True)
    matrices = Rotation.from_quat(turn, scalar_first=True).as_matrix()
    lowest = place[:, 2] + (matrices[:, 2] @ corners().T).min(axis=1)
    place[:, 2] -= np.minimum(lowest, 0.0)
    return place, turn, columns(tosses, VELOCITY), columns(tosses, SPIN)


def face_up(turn: NDArray[np.float64]) -> NDArray[np.int64]:
    """Which of the six faces points up most, shape (n,): 0 to 2 along the axes of the cube, 3 to 5 against them."""
    up = Rotation.from_quat(turn, scalar_first=True).as_matrix()[:, 2]
    return np.asarray(np.argmax(np.hstack([up, -up]), axis=1), np.int64)


def scores(tosses: Tosses, poses: NDArray[np.float64]) -> dict[str, float]:
    """How well final poses (n, 7) agree with the measured ones."""
    same = face_up(poses[:, 3:]) == face_up(columns(tosses, END_TURN))
    apart = np.linalg.norm(poses[:, :3] - columns(tosses, END_PLACE), axis=1)
    return {"same_face": float(same.mean()), "median_error_mm": 1e3 * float(np.median(apart)), "n": len(poses)}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", choices=tuple(ENGINES), help="one of the engines")
    parser.add_argument("--steps-per-ms", type=int, default=STEPS_PER_MS, help=f"[{STEPS_PER_MS}]")
    options = parser.parse_args()
    tosses = read_tosses()
    for name, module in ENGINES.items():
        if options.only in (None, name):
            try:
                engine: Any = importlib.import_module(module)
            except ImportError as error:
                print(f"{name}: skipped, not installed ({error})", file=sys.stderr)
                continue
            began = time.process_time()
            found = scores(tosses, engine.final_poses(tosses, steps_per_ms=options.steps_per_ms))
            cost = (time.process_time() - began) / float(tosses["duration_s"].sum())
            print(
                f"{name}: same_face {found['same_face']:.3f}, median_error_mm {found['median_error_mm']:.1f}, "
                f"n {found['n']:.0f}, {cost:.2g} s of processor time per simulated second; {engine.SETTINGS}"
            )
    return 0


if __name__ == "__main__":
    sys.exit(main())
