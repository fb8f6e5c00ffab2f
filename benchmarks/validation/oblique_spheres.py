"""Oblique impact of a sphere: rigid-body theory, the impact law of the impulse engine, and both engines.

    python benchmarks/validation/oblique_spheres.py [--json] [--picture FILE]

Prints a table as CSV: angle of incidence to the normal, tangential restitution of the centre, angular velocity.

A sphere of radius R without spin arrives with v at an angle theta to the normal. While it sticks in the end, the
tangential velocity of its centre falls to 5/7; it slides throughout where tan(theta) > 7/2 mu (1 + e), and then

    f = v_t' / v_t = 1 - mu (1 + e) / tan(theta)      (tangential restitution of the centre)
    omega = 5/2 mu (1 + e) v_n / R                     (5/7 v_t / R where it sticks)

Benchmark test 4 of Chung and Ooi, Granular Matter 13 (2011) 643, with the constants of an aluminium oxide sphere that
Kharaz, Gorham and Salman measured (Powder Technology 120 (2001) 281).
"""

from __future__ import annotations

import argparse
import csv
import json
import math
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from arguments import new_file
from numpy.typing import NDArray
from single_impacts import after_impacts

from feeder_sim.document.figure import empty_figure
from feeder_sim.engines.protocol import engine_class
from feeder_sim.scenario import Ball, Contact, Drive, RigidPlate, Run, Scenario, Start
from feeder_sim.scenario.engine_choice import choose_engine
from feeder_sim.scene.scene import build_scene

DIAMETER, SPEED, RESTITUTION, FRICTION = 5e-3, 3.9, 0.98, 0.092  # [m], [m/s]
ANGLES = (2.0, *map(float, range(5, 90, 5)), 88.0)  # [deg]
FREQUENCY_HZ = 1e4  # of a plate that does not move; it sets the step, 2.5 us


@dataclass(frozen=True)
class Rebound:
    """How a sphere leaves the plate; arrays over the angles.

    Attributes:
        tangential: velocity of its centre along the plate over that before [1].
        spin: angular velocity [rad/s].
        angle: of its velocity to the normal [deg].
    """

    tangential: NDArray[np.float64]
    spin: NDArray[np.float64]
    angle: NDArray[np.float64]


def _rebound(theta: NDArray[np.float64], along: NDArray[np.float64], up: NDArray[np.float64], spin: object) -> Rebound:
    before = SPEED * np.sin(theta)
    return Rebound(along / before, np.asarray(spin, float), np.degrees(np.arctan2(along, up)))


def theory(degrees: NDArray[np.float64]) -> Rebound:
    """The closed form above, for angles above 0 [deg]."""
    theta = np.radians(degrees)
    normal, grip = SPEED * np.cos(theta), FRICTION * (1.0 + RESTITUTION)
    slides = degrees > sliding_angle()
    kept = np.where(slides, 1.0 - grip / np.tan(theta), 5.0 / 7.0)
    along = kept * SPEED * np.sin(theta)
    spin = np.where(slides, 2.5 * grip * normal, along) / (0.5 * DIAMETER)
    return _rebound(theta, along, RESTITUTION * normal, spin)


def sliding_angle() -> float:
    """The angle above which a sphere slides throughout [deg]."""
    return math.degrees(math.atan(3.5 * FRICTION * (1.0 + RESTITUTION)))


def by_law(degrees: NDArray[np.float64]) -> Rebound:
    """The impact law of the impulse engine, by its compiled function."""
    theta, n, radius = np.radians(degrees), len(degrees), 0.5 * DIAMETER
    velocity = SPEED * np.stack([np.sin(theta), np.zeros(n), -np.cos(theta)], axis=1)
    arm, e = np.tile([0.0, 0.0, -radius], (n, 1)), np.full(n, RESTITUTION)
    up = np.array([0.0, 0.0, 1.0])
    v, w = after_impacts(velocity, np.zeros((n, 3)), arm, up, 2.5 / radius**2, e, FRICTION)
    return _rebound(theta, v[:, 0], v[:, 2], w[:, 1])


def by_engine(degrees: NDArray[np.float64], engine: Literal["impulse", "mujoco"]) -> Rebound:
    """One step of a whole scene: a ball released at the plate, with a velocity; seen one frame later.

    Gravity, over at most two steps of 2.5 us, is in it.
    """
    theta = np.radians(degrees)
    moved = [_thrown(float(angle), engine) for angle in theta]
    along, up, spin = np.array(moved).T
    return _rebound(theta, along, up, spin)


def _thrown(theta: float, engine: Literal["impulse", "mujoco"]) -> tuple[float, float, float]:
    """Velocity along and normal to the plate [m/s], and spin [rad/s], after the impact."""
    speed = 1e3 * SPEED
    start = Start(drop_height_mm=(0.0, 0.0), velocity_mm_s=(speed * math.sin(theta), 0.0, -speed * math.cos(theta)))
    scenario = Scenario(
        plate=RigidPlate(kind="piston"),
        drive=(Drive(frequency_hz=FREQUENCY_HZ, amplitude_um=0.0, ring_up=False),),
        part=(Ball(shape="ball", diameter_mm=1e3 * DIAMETER, start=start),),
        contact=Contact(restitution=RESTITUTION, friction=FRICTION),
        run=Run(engine=engine, duration_s=1e-3, seeds=1, frames_per_second=1e5),
    )
    scene = build_scene(scenario)
    frames = engine_class(choose_engine(scenario))(scene, np.random.default_rng(0)).advance(2)
    velocity, spin = frames.velocity[-1, 0], frames.angular_velocity[-1, 0]
    return float(velocity[0]), float(velocity[2]), float(spin[1])


MARKS = {"impulse": ("o", "#be3434"), "mujoco": ("x", "#3a60be")}


def draw_oblique_spheres(angle: NDArray[np.float64], methods: Mapping[str, Rebound], path: Path) -> None:
    """Draw tangential restitution and angular velocity over the angle of incidence [deg]."""
    figure = empty_figure(9.0, 3.6)
    left, right = figure.subplots(1, 2)
    fine = np.linspace(1.0, 89.5, 400)
    exact = theory(fine)
    left.plot(fine, exact.tangential, color="black", linewidth=1.0, label="theory")
    right.plot(fine, exact.spin, color="black", linewidth=1.0, label="theory")
    for name, (mark, colour) in MARKS.items():
        left.plot(angle, methods[name].tangential, mark, color=colour, markersize=5, fillstyle="none", label=name)
        right.plot(angle, methods[name].spin, mark, color=colour, markersize=5, fillstyle="none", label=name)
    left.set(ylabel="tangential restitution of the centre (1)")
    right.set(ylabel="angular velocity after (rad/s)")
    for axes in (left, right):
        axes.axvline(sliding_angle(), color="gray", linewidth=0.8, linestyle="--")
        axes.set(xlabel="angle of incidence to the normal (degrees)", xlim=(0.0, 90.0))
        axes.grid(True, alpha=0.3)
        axes.legend(fontsize=8)
    figure.savefig(path, dpi=110)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--picture", type=new_file, help="draw the table")
    options = parser.parse_args()
    angle = np.array(ANGLES)
    methods = {
        "theory": theory(angle),
        "law": by_law(angle),
        "impulse": by_engine(angle, "impulse"),
        "mujoco": by_engine(angle, "mujoco"),
    }
    if options.picture:
        draw_oblique_spheres(angle, methods, options.picture)
    rows = [_row(methods, i) for i in range(len(angle))]
    if options.json:
        largest = {name: _largest(methods["theory"], found) for name, found in methods.items() if name != "theory"}
        print(json.dumps({"sliding_angle_deg": sliding_angle(), "largest_deviation": largest, "rows": rows}))
        return
    writer = csv.DictWriter(sys.stdout, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows({key: f"{value:.6g}" for key, value in row.items()} for row in rows)


def _row(methods: dict[str, Rebound], i: int) -> dict[str, float]:
    row = {"angle_deg": ANGLES[i]}
    for name, found in methods.items():
        row[f"tangential_restitution_{name}"] = float(found.tangential[i])
        row[f"angular_velocity_rad_s_{name}"] = float(found.spin[i])
        row[f"rebound_angle_deg_{name}"] = float(found.angle[i])
    return row


def _largest(theory: Rebound, found: Rebound) -> dict[str, float]:
    """Largest deviations from theory."""
    return {
        "tangential_restitution": float(np.abs(found.tangential - theory.tangential).max()),
        "angular_velocity_share": float(np.abs(found.spin / theory.spin - 1.0).max()),
    }


if __name__ == "__main__":
    main()
