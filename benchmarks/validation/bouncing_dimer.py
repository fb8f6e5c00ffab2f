"""A dimer on a plate that moves up and down: its drift over its aspect ratio, with one ball on the plate.

    python benchmarks/validation/bouncing_dimer.py [--seeds 12] [--json] [--picture FILE]

Steel balls of 5 mm, 25 Hz, 0.9 g, restitution 0.7, three coefficients of friction. The mode depends on the start, so
that only some starts end in it. Speeds are positive toward the ball that bounces. Beside them are those of a program of
its own (dimer_by_steps.py), with the same law of restitution, Newton's, and with Poisson's.

S. Dorbolo, D. Volfson, L. Tsimring and A. Kudrolli, Phys. Rev. Lett. 95 (2005) 044101, found that a dimer drifts in
this mode, with a speed and a direction that depend on its aspect ratio, here the length over all over the diameter of a
ball.

The parameters here are not theirs, which were not at hand. What friction does can be said beforehand. Let the dimer be
nearly level, with its axis R above the points of contact and l between the balls, and let one ball stay on the plate
while the other lands, so that its turn changes by dw. The normal impulses add up to m (l/2) dw. Both points of contact
move along the plate at the same velocity. They stick if friction gives m R dw, so if mu >= 2 R / l; and the same holds
while the other ball flies. With the aspect ratio a = 1 + l / 2 R:

    sticks where a >= 1 + 1 / mu

A dimer that sticks drifts slowly, in the moments in which the other ball is off the plate; one that slips far drifts
faster, toward the ball on the plate. The direction changes at somewhat longer dimers than sticking begins. (That
sticking or slipping at the double impact decides, and that the direction changes only where the slip is large enough:
R. Zhang, Z. Zhao, X. Zheng and Q. Wang, J. Comput. Nonlinear Dynam. 14 (2019) 061007.)
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from arguments import new_file, whole
from dimer_by_steps import Shaker, Shape, drift_by_steps
from numpy.typing import NDArray
from paths import follow
from scipy.spatial.transform import Rotation
from vertex_impacts import Law

from feeder_sim.constants import GRAVITY
from feeder_sim.document.figure import MM, MS, empty_figure
from feeder_sim.measures.statistic import Statistic
from feeder_sim.scenario import Contact, Dimer, Drive, RigidPlate, Run, Scenario, Start
from feeder_sim.scene.scene import Scene, build_scene
from feeder_sim.single_thread import single_threaded

DIAMETER, FREQUENCY, THROW_NUMBER, RESTITUTION = 5e-3, 25.0, 0.9, 0.7  # [m], [Hz]
AMPLITUDE = THROW_NUMBER * GRAVITY / (2.0 * math.pi * FREQUENCY) ** 2  # [m]
BOUNCES_TO = GRAVITY / (8.0 * FREQUENCY**2)  # [m], in a flight that takes a period
PERIODS, COUNTED = 75, 35  # of the plate, in a run and at its end
PER_PERIOD = 40  # frames
STEP = 1e-6  # [s], of the program of its own
LOWEST, HIGHEST = 0.4, 2.8  # heights at which a ball is let go, over BOUNCES_TO
STEEPEST = 0.7  # of the axis then, its sine
SAME = 0.03  # of the largest height: two periods that differ by less are alike
ON_PLATE, MOSTLY = 0.05, 0.8  # of the largest height; share of the time that the other ball is below it
Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Bounce:
    """How one dimer moves in the end.

    Attributes:
        drifts: whether one ball stays on the plate while the other bounces once in every period.
        speed: of the dimer along its axis [m/s], positive toward the ball that bounces higher.
        height: that this ball comes to over the plate [m].
        on_plate: share of the time that the other one is on it.
        time, high, low: the last periods (n,) [s], and how high over the plate the balls are then (n,) [m].
    """

    drifts: bool
    speed: float
    height: float
    on_plate: float
    time: Floats
    high: Floats
    low: Floats


@dataclass(frozen=True)
class DimerDrift:
    """Many starts of a dimer.

    Attributes:
        aspect_ratio: length over all over the diameter of a ball.
        bounces: of each start.
    """

    aspect_ratio: float
    friction: float
    bounces: tuple[Bounce, ...]

    @property
    def speed_mm_s(self) -> Statistic:
        """Toward the ball that bounces, over the starts that end in the drift mode."""
        return Statistic.of(1e3 * bounce.speed for bounce in self.bounces if bounce.drifts)


def turning_point(friction: float) -> float:
    """Aspect ratio from which on a dimer sticks as it lands."""
    return 1.0 + 1.0 / friction


def speed_by_steps(aspect_ratio: float, friction: float, *, poisson: bool) -> float:
    """Speed [mm/s] as `DimerDrift.speed_mm_s`, from the highest start, by dimer_by_steps.py."""
    apart, radius = (aspect_ratio - 1.0) * DIAMETER, 0.5 * DIAMETER
    shape = Shape(radius, apart, 0.4 * radius**2 + 0.25 * apart**2)
    shaker, law = Shaker(AMPLITUDE, 2.0 * math.pi * FREQUENCY), Law(friction, RESTITUTION, poisson, joined=False)
    rise = min(HIGHEST * BOUNCES_TO, STEEPEST * apart)
    return 1e3 * float(drift_by_steps(shape, shaker, law, rise, STEP, PERIODS))


def dimer_scenario(aspect_ratio: float, friction: float, *, planar: bool = True) -> Scenario:
    """A steel dimer on a plate that moves up and down, for one seed."""
    start = Start(drop_height_mm=(0.0, 10.0), yaw_deg=(0.0, 0.0))
    return Scenario(
        plate=RigidPlate(kind="piston", length_mm=1000.0, width_mm=1000.0),
        drive=(Drive(frequency_hz=FREQUENCY, amplitude_um=1e6 * AMPLITUDE, ring_up=False),),
        part=(
            Dimer(
                shape="dimer",
                ball_diameter_mm=1e3 * DIAMETER,
                length_mm=1e3 * DIAMETER * aspect_ratio,
                start=start,
            ),
        ),
        contact=Contact(restitution=RESTITUTION, friction=friction),
        run=Run(engine="impulse", duration_s=PERIODS / FREQUENCY, seeds=1, planar=planar),
    )


@single_threaded
def dimer_drift(aspect_ratio: float, friction: float, starts: int = 12, *, planar: bool = True) -> DimerDrift:
    """Let a dimer go many times with one ball on the plate and the other at rest over it, at as many heights."""
    scene = build_scene(dimer_scenario(aspect_ratio, friction, planar=planar))
    apart = (aspect_ratio - 1.0) * DIAMETER
    rise = np.minimum(np.linspace(LOWEST, HIGHEST, starts) * BOUNCES_TO / apart, STEEPEST)
    attitudes = Rotation.from_rotvec(np.stack([np.zeros(starts), np.arcsin(rise), np.zeros(starts)], axis=1))
    lowest = [scene.kinds[0].lowest(quaternion) for quaternion in attitudes.as_quat(scalar_first=True)]
    places = np.stack([np.zeros(starts), np.zeros(starts), -np.array(lowest)], axis=1)
    time = np.arange(PERIODS * PER_PERIOD + 1) / (PER_PERIOD * FREQUENCY)
    ways = zip(*follow(scene, places, attitudes, time), strict=True)
    return DimerDrift(aspect_ratio, friction, tuple(_bounce(scene, time, place, turn) for place, turn in ways))


def _bounce(scene: Scene, time: Floats, place: Floats, attitude: Floats) -> Bounce:
    """How a dimer moves at the end of its way: times (n,) [s], places (n, 3) [m], attitudes (n, 4)."""
    counted = slice(-COUNTED * PER_PERIOD, None)
    part, drive = scene.kinds[0], scene.drives[0]
    axis = Rotation.from_quat(attitude[counted], scalar_first=True).apply([1.0, 0.0, 0.0])
    plate = drive.amplitude * np.sin(2.0 * math.pi * drive.drive_frequency * time[counted])
    centre, reach = place[counted, 2] - part.corner_radius - plate, part.corners[1, 0] * axis[:, 2]
    gaps = [centre + reach, centre - reach]
    bouncing = int(gaps[1].mean() > gaps[0].mean())
    high, low = gaps[bouncing], gaps[1 - bouncing]
    height = float(high.max())
    on_plate = float((low < ON_PLATE * height).mean())
    alike = np.abs(high[PER_PERIOD:] - high[:-PER_PERIOD]).max() < SAME * height
    moved = ((place[counted][1:, :2] - place[counted][:-1, :2]) * axis[1:, :2]).sum()
    speed = float(moved / (time[-1] - time[counted][0])) * (-1.0 if bouncing else 1.0)
    drifts = bool(alike and on_plate > MOSTLY and height > drive.amplitude)
    return Bounce(drifts, speed, height, on_plate, time[counted], high, low)


SHOWN = 4  # periods
TYPICAL = 5.0  # aspect ratio of the dimer whose balls are shown, at least
COLOURS = ("#be3434", "#3a60be", "#e08a1e", "#3a8a5a")


def draw_bouncing_dimer(found: Sequence[DimerDrift], path: Path) -> None:
    """Draw the balls of the first dimer that drifts, and the speeds of all, a line for each friction."""
    figure = empty_figure(9.6, 3.9)
    left, right = figure.subplots(1, 2, width_ratios=[1.0, 1.4])
    drift, bounce = next((d, b) for d in found if d.aspect_ratio >= TYPICAL for b in d.bounces if b.drifts)
    n = int(SHOWN / FREQUENCY / (bounce.time[1] - bounce.time[0])) + 1
    time = MS * (bounce.time[:n] - bounce.time[0])
    left.plot(time, bounce.high[:n] * MM, color=COLOURS[0], label="ball that bounces")
    left.plot(time, bounce.low[:n] * MM, color=COLOURS[1], label="ball on the plate")
    left.set(xlabel="time (ms)", ylabel="over the plate (mm)", xlim=(0.0, time[-1]))
    left.set_ylim(-0.15, 1.35 * MM * bounce.height)
    left.set_title(f"aspect ratio {drift.aspect_ratio:g}, friction {drift.friction:g}", fontsize=9)
    left.legend(fontsize=8, loc="upper right")
    for colour, friction in zip(COLOURS, sorted({d.friction for d in found}), strict=False):
        own = [d for d in found if d.friction == friction]
        ratio = np.array([d.aspect_ratio for d in own])
        right.plot(ratio, [d.speed_mm_s.mean for d in own], "o-", color=colour, label=f"friction {friction:g}")
        right.axvline(turning_point(friction), color=colour, linestyle="--", linewidth=0.9)
    right.axhline(0.0, color="0.5", linewidth=0.8)
    right.set_yscale("symlog", linthresh=0.1)
    right.set_yticks([-10, -1, -0.1, 0, 0.1, 1], ["-10", "-1", "-0.1", "0", "0.1", "1"])
    right.set(xlabel="length over ball diameter", ylabel="speed (mm/s)", xlim=(ratio[0] - 0.5, ratio[-1] + 0.5))
    right.set_title("positive: toward the ball that bounces; dashed: 1 + 1 / friction", fontsize=9)
    right.legend(fontsize=8, loc="lower right", framealpha=1.0)
    right.grid(True, alpha=0.3)
    figure.savefig(path, dpi=150)


FRICTIONS = (0.1, 0.2, 0.3)
ASPECT_RATIOS = (3.5, 4.0, 4.5, 5.0, 5.5, 6.0, 7.0, 8.0, 9.0, 10.0, 12.0, 14.0)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=whole(1, 10_000), default=12, help="starts of each dimer")
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--picture", type=new_file)
    options = parser.parse_args()
    found, rows = [], []
    for friction in FRICTIONS:
        if not options.json:
            print(f"friction {friction:g}: 1 + 1/mu = {turning_point(friction):.2f}")
            print("  ratio  in the mode  speed (mm/s)  by steps  Poisson")
        for ratio in ASPECT_RATIOS:
            drift = dimer_drift(ratio, friction, options.seeds)
            speed = drift.speed_mm_s
            found.append(drift)
            newton, poisson = (speed_by_steps(ratio, friction, poisson=law) for law in (False, True))
            row = {"friction": friction, "aspect_ratio": ratio, "speed_mm_s": speed.as_dict()}
            rows.append(row | {"by_steps_mm_s": newton, "poisson_mm_s": poisson})
            if not options.json:
                text = f"{speed.mean:+.2f}" if speed.n else "-"
                print(
                    f"  {ratio:5g}  {speed.n:4d} of {options.seeds:<4d}  {text:>9}  {newton:+10.2f}  {poisson:+9.2f}",
                    flush=True,
                )
    if options.json:
        print(json.dumps(rows, indent=1))
    if options.picture:
        draw_bouncing_dimer(found, options.picture)


if __name__ == "__main__":
    main()
