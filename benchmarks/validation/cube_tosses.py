"""Measured tosses of a cube against this package, and against Bullet where its results are given.

    python benchmarks/validation/cube_tosses.py [--data FILE] [--json] [--engine mujoco] [--friction 0.15]
    python benchmarks/validation/cube_tosses.py --engine both --steps 20 40 80 160 --csv FILE --picture FILE

The picture also shows what is in cube_tosses_points.csv and, of other engines (benchmarks/peers/tosses.py --csv), in
cube_tosses_peers.csv beside this script.

`same_face`: share of the tosses that end with the measured face up; `median_error_mm`: of the distance between the
computed and the measured last place of the centre. Friction 0.18 and restitution 0.125 are those of the authors of the
data; nothing is fitted.

Tosses are computed from the first frame of each to the last. Data: ContactNets (Pfrommer, Halm and Posa, Conf. on Robot
Learning 2020). The cube's size, mass and moment of inertia are the authors', too.
"""

from __future__ import annotations

import argparse
import csv
import json
import math
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
from arguments import between, new_file, whole
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from feeder_sim.document.figure import MM, empty_figure
from feeder_sim.engines.protocol import engine_class
from feeder_sim.errors import FeederSimError, InputError
from feeder_sim.run.prepare import prepare
from feeder_sim.scenario import Box, Contact, GivenState, RigidPlate, Run, Scenario
from feeder_sim.scenario.scenario import STILL_HZ
from feeder_sim.scene.prepared import Prepared
from feeder_sim.single_thread import single_threaded

EDGE_MM, MASS_G, INERTIA_G_MM2 = 104.8, 370.0, 8.1e5
FRICTION, RESTITUTION = 0.18, 0.125
BOARD_MM = 4e3
LARGEST, SHORTEST_S, UNIT_ERROR = 1e4, 1e-2, 1e-2  # of any number, of a duration, of the length of a quaternion
STEPS = 40  # in 4 ms
CLEAR_MM = 1e-3  # over the board; a start that the tracking has put into it is lifted to that height
STATE = ("x_m", "y_m", "z_m", "qw", "qx", "qy", "qz", "vx_m_s", "vy_m_s", "vz_m_s", "wx_rad_s", "wy_rad_s", "wz_rad_s")
END = ("end_x_m", "end_y_m", "end_z_m", "end_qw", "end_qx", "end_qy", "end_qz")
COLUMNS = ("toss", "duration_s", *STATE, *END)
Engine = Literal["impulse", "mujoco"]


@dataclass(frozen=True)
class Toss:
    """One toss: the tracked cube in the first frame, and its pose in the last; z = 0 is the board.

    Attributes:
        number: in the data.
        duration: between the two frames [s].
        position, velocity: of the centre, shape (3,) [m], [m/s].
        attitude: at the start.
        angular_velocity: shape (3,), in the axes of the cube [rad/s].
        end_position: shape (3,) [m].
        end_attitude: in the last frame.
    """

    number: int
    duration: float
    position: NDArray[np.float64]
    attitude: Rotation
    velocity: NDArray[np.float64]
    angular_velocity: NDArray[np.float64]
    end_position: NDArray[np.float64]
    end_attitude: Rotation


@dataclass(frozen=True)
class TossStudy:
    """Computed against measured ends of tosses.

    Attributes:
        start, measured, computed: first place of the centre, and the measured and computed last ones, (tosses, 3) [m].
        same_face: whether the face that points up is the measured one, shape (tosses,).
        angle: by which the computed attitude differs from the measured one, shape (tosses,) [rad].
        lifted: by how much a start was lifted out of the board at most [m].
        processor_s_per_s: processor time of the engine per simulated second.
    """

    start: NDArray[np.float64]
    measured: NDArray[np.float64]
    computed: NDArray[np.float64]
    same_face: NDArray[np.bool_]
    angle: NDArray[np.float64]
    lifted: float
    processor_s_per_s: float

    @property
    def error(self) -> NDArray[np.float64]:
        """Distance of the computed from the measured last place, shape (tosses,) [m]."""
        return np.asarray(np.linalg.norm(self.computed - self.measured, axis=1))

    @property
    def way(self) -> NDArray[np.float64]:
        """Measured, from the first place to the last, shape (tosses,) [m]."""
        return np.asarray(np.linalg.norm(self.measured - self.start, axis=1))

    def summary(self) -> dict[str, float]:
        """The figures by name, as JSON takes them."""
        return {
            "same_face": float(self.same_face.mean()),
            "median_error_mm": 1e3 * float(np.median(self.error)),
            "median_way_mm": 1e3 * float(np.median(self.way)),
            "median_angle_deg": float(np.degrees(np.median(self.angle))),
            "n": len(self.error),
            "lifted_mm": 1e3 * self.lifted,
            "processor_s_per_s": self.processor_s_per_s,
        }


def read_tosses(path: Path) -> list[Toss]:
    """Read a table of tosses with the columns `COLUMNS`.

    Raises:
        InputError: it cannot be read, a column is missing, or a value is no number.
    """
    try:
        with path.open(newline="", encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"cannot be read: {error}", file=path) from error
    if not rows:
        raise InputError("holds no tosses", file=path)
    for name in COLUMNS:
        if name not in rows[0]:
            raise InputError(f"is missing, must be the columns {', '.join(COLUMNS)}", file=path, key=name)
    return [_toss(row, line, path) for line, row in enumerate(rows, 2)]


def _toss(row: dict[str, str], line: int, path: Path) -> Toss:
    values = {}
    for name in COLUMNS:
        try:
            values[name] = float(row[name])
        except (TypeError, ValueError) as error:
            raise InputError(f"is {row[name]!r}, must be a number", file=path, key=f"line {line}, {name}") from error
        if not abs(values[name]) <= LARGEST:
            raise InputError(f"is {row[name]}, must be up to {LARGEST:g}", file=path, key=f"line {line}, {name}")
    if values["duration_s"] < SHORTEST_S:
        raise InputError(
            f"is {values['duration_s']:g}, must be at least {SHORTEST_S:g}",
            file=path,
            key=f"line {line}, duration_s",
        )
    state, end = (np.array([values[name] for name in names]) for names in (STATE, END))
    for turn, name in ((state[3:7], "qw"), (end[3:], "end_qw")):
        if abs(np.linalg.norm(turn) - 1.0) > UNIT_ERROR:
            raise InputError(
                f"to {name.replace('qw', 'qz')} have length {np.linalg.norm(turn):g}, must be 1",
                file=path,
                key=f"line {line}, {name}",
            )
    return Toss(
        int(values["toss"]),
        values["duration_s"],
        state[:3],
        Rotation.from_quat(state[3:7], scalar_first=True),
        state[7:10],
        state[10:],
        end[:3],
        Rotation.from_quat(end[3:], scalar_first=True),
    )


def toss_scenario(
    toss: Toss,
    engine: Engine = "impulse",
    *,
    steps: int | None = STEPS,
    friction: float = FRICTION,
    restitution: float = RESTITUTION,
) -> tuple[Scenario, float]:
    """The scenario of a toss, and by how much its start was lifted out of the board [m].

    Args:
        toss: measured.
        engine: that is to compute it.
        steps: in 4 ms, see `run.steps_per_period`; None for the engine without a step.
        friction, restitution: of cube and board.
    """
    half = 0.5 * EDGE_MM
    lowest = 1e3 * toss.position[2] - half * float(np.abs(toss.attitude.as_matrix()[2]).sum())
    lifted = max(0.0, CLEAR_MM - lowest)
    x, y, z = (1e3 * toss.position).tolist()
    spin = toss.attitude.apply(toss.angular_velocity)
    rate = math.ceil(toss.duration) / toss.duration  # the last frame is at the end, to half a step
    scenario = Scenario(
        title=f"toss {toss.number} of a cube",
        plate=RigidPlate(kind="still", length_mm=BOARD_MM, width_mm=BOARD_MM, thickness_mm=100.0),
        part=(
            Box(
                shape="box",
                size_mm=(EDGE_MM,) * 3,
                mass_g=MASS_G,
                inertia_g_mm2=(INERTIA_G_MM2,) * 3,
                start=GivenState(
                    kind="state",
                    position_mm=(x, y, z + lifted),
                    quaternion=tuple(toss.attitude.as_quat(scalar_first=True).tolist()),
                    velocity_mm_s=tuple((1e3 * toss.velocity).tolist()),
                    angular_velocity_rad_s=tuple(spin.tolist()),
                ),
            ),
        ),
        contact=Contact(restitution=restitution, friction=friction),
        run=Run(
            engine=engine,
            duration_s=toss.duration + 1.0 / (STILL_HZ * (steps or STEPS)),
            seeds=1,
            steps_per_period=steps,
            frames_per_second=rate,
        ),
    )
    return scenario, 1e-3 * lifted


@single_threaded
def compute_tosses(
    tosses: Sequence[Toss],
    engine: Engine = "impulse",
    *,
    steps: int | None = STEPS,
    friction: float = FRICTION,
    restitution: float = RESTITUTION,
    progress: Callable[[float], None] | None = None,
) -> TossStudy:
    """Compute every toss and compare its end with the measured one; progress is told the share that is done."""
    prepared = [toss_scenario(toss, engine, steps=steps, friction=friction, restitution=restitution) for toss in tosses]
    _end(prepare(prepared[0][0]))  # compiles
    ends, spent = [], 0.0
    for i, (scenario, _) in enumerate(prepared):
        end, seconds = _end(prepare(scenario))
        ends.append(end)
        spent += seconds
        if progress:
            progress((i + 1) / len(tosses))
    lifted = max(lift for _, lift in prepared)
    return compare(tosses, np.array(ends), lifted, spent / sum(toss.duration for toss in tosses))


def _end(prepared: Prepared) -> tuple[NDArray[np.float64], float]:
    """Position and quaternion (7,) at the end of a scenario, and the processor time that its engine took [s]."""
    scene = prepared.scene
    engine: Any = engine_class(prepared.engine)(scene, np.random.default_rng(0))
    started = time.process_time()
    frames = engine.advance(scene.n_frames - 1)
    spent = time.process_time() - started
    return np.concatenate([frames.position[-1, 0], frames.quaternion[-1, 0]]), spent


def compare(
    tosses: Sequence[Toss], ends: NDArray[np.float64], lifted: float = 0.0, processor_s_per_s: float = np.nan
) -> TossStudy:
    """Compare computed last poses (tosses, 7), position [m] and quaternion (w first), with the measured ones."""
    measured = np.array([toss.end_position for toss in tosses])
    attitudes = Rotation.concatenate([toss.end_attitude for toss in tosses])
    computed = Rotation.from_quat(ends[:, 3:], scalar_first=True)
    return TossStudy(
        start=np.array([toss.position for toss in tosses]),
        measured=measured,
        computed=ends[:, :3],
        same_face=upper_face(computed) == upper_face(attitudes),
        angle=(computed * attitudes.inv()).magnitude(),
        lifted=lifted,
        processor_s_per_s=processor_s_per_s,
    )


def upper_face(attitude: Rotation) -> NDArray[np.int64]:
    """Number of the face of a cube that points up most, at attitudes (n,): +-1, +-2, +-3 for +-x, +-y, +-z."""
    up = attitude.as_matrix()[:, 2, :]  # of every axis of the cube its part along z
    axis = np.abs(up).argmax(axis=1)
    return np.asarray((axis + 1) * np.sign(np.take_along_axis(up, axis[:, None], axis=1)[:, 0]), np.int64)


DRAWN = 24  # tosses in the plan view
COLOURS = {"impulse": "#c23030", "mujoco": "#1f5fa8", "Bullet": "#6b8e23", "plain MuJoCo": "#5fa4d8"}
OTHERS = "#8b5a2b"
LARGEST_MM = 200.0
COSTS = (1e-3, 1.0)  # [s/s]


def draw_tosses(studies: Mapping[str, TossStudy], points: Sequence[Mapping[str, str]], path: Path) -> None:
    """Draw the tosses of studies by the name of their engine.

    `points`: rows with `engine`, `steps_per_ms`, `median_error_mm` and `processor_s_per_s`.
    """
    figure = empty_figure(13.0, 4.6)
    plan, share, cost = figure.subplots(1, 3, width_ratios=[1.25, 1, 1])
    first = next(iter(studies.values()))
    every = max(1, len(first.start) // DRAWN)
    for start, end in zip(MM * first.start[::every], MM * first.measured[::every], strict=True):
        plan.plot([start[0], end[0]], [start[1], end[1]], color="#bbbbbb", linewidth=0.8, zorder=1)
    measured = MM * first.measured[::every]
    plan.plot(measured[:, 0], measured[:, 1], "o", color="black", markersize=6, fillstyle="none", label="measured")
    for name, study in studies.items():
        colour = COLOURS.get(name, OTHERS)
        computed = MM * study.computed[::every]
        plan.plot(computed[:, 0], computed[:, 1], ".", color=colour, markersize=5, label=name)
        error = np.sort(MM * study.error)
        share.plot(error, np.arange(1, len(error) + 1) / len(error), color=colour, label=name)
    plan.set(xlabel="x (mm)", ylabel="y (mm)", title=f"Ends of every {every}th toss, from above", aspect="equal")
    plan.legend(fontsize=8, loc="upper left")
    share.axvline(EDGE_MM, color="#999999", linewidth=0.8, linestyle=":")
    share.annotate("edge of the cube", (1.02 * EDGE_MM, 0.5), fontsize=8, color="#777777")
    share.set(xlim=(0.0, LARGEST_MM), ylim=(0.0, 1.0), xlabel="error of the last place (mm)", ylabel="share of tosses")
    share.set_title("How far off")
    share.legend(fontsize=8, loc="lower right")
    for name in dict.fromkeys(row["engine"] for row in points):
        rows = [row for row in points if row["engine"] == name]
        x, y = ([float(row[key]) for row in rows] for key in ("processor_s_per_s", "median_error_mm"))
        span = " to ".join(dict.fromkeys(f"{float(row['steps_per_ms']):g}" for row in (rows[0], rows[-1])))
        cost.plot(x, y, "o-", color=COLOURS.get(name, OTHERS), markersize=4, label=f"{name}, {span} steps per ms")
    cost.set(xscale="log", xlabel="processor time per simulated second (s)", ylabel="median error (mm)")
    cost.set_title("Speed against accuracy")
    cost.set(xlim=COSTS)
    cost.set_ylim(0.0, 1.25 * max(float(row["median_error_mm"]) for row in points))
    cost.legend(fontsize=8)
    for axes in (share, cost):
        axes.grid(True, alpha=0.3)
    figure.savefig(path, dpi=130)


DATA = Path(__file__).parent / "cube_tosses.csv"
POINTS = (Path(__file__).parent / "cube_tosses_points.csv", Path(__file__).parent / "cube_tosses_peers.csv")
WRITTEN = ("engine", "steps_per_ms", "same_face", "median_error_mm", "median_angle_deg", "n", "processor_s_per_s")
PERIOD_MS = 4.0  # that the steps of a plate at rest are counted in


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, default=DATA, help="table of tosses [the one beside this script]")
    parser.add_argument("--engine", choices=("impulse", "mujoco", "both"), default="impulse")
    parser.add_argument(
        "--steps", type=whole(20, 10_000), nargs="+", default=[STEPS], help=f"steps in {PERIOD_MS:g} ms [{STEPS}]"
    )
    parser.add_argument("--friction", type=between(0.0, 10.0), default=FRICTION, help=f"of cube and board [{FRICTION}]")
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.add_argument("--csv", type=new_file, help="write a row for each engine and number of steps")
    parser.add_argument("--picture", type=new_file, help="draw the ends, and error over cost")
    options = parser.parse_args()
    try:
        return compared(options)
    except FeederSimError as error:
        print(error, file=sys.stderr)
        return 2


def compared(options: argparse.Namespace) -> int:
    tosses, rows, studies = read_tosses(options.data), [], {}
    for engine in get_args(Engine) if options.engine == "both" else (options.engine,):
        for steps in options.steps:
            study = compute_tosses(tosses, engine, steps=steps, friction=options.friction)
            studies[engine] = study
            rows.append({"engine": engine, "steps_per_ms": steps / PERIOD_MS} | study.summary())
            if not options.json:
                print(
                    f"{engine:<8} {steps / PERIOD_MS:>5g} steps per ms: same face {study.same_face.mean():.3f}, median "
                    f"error {rows[-1]['median_error_mm']:.1f} mm after {rows[-1]['median_way_mm']:.0f} mm, "
                    f"{len(tosses)} tosses, {study.processor_s_per_s:.3f} s of processor time per simulated second",
                    flush=True,
                )
    if len(studies) > 1 and not options.json:
        apart = np.linalg.norm(studies["impulse"].computed - studies["mujoco"].computed, axis=1)
        print(f"ends of the two engines are {1e3 * np.median(apart):.1f} mm apart (median)")
    if options.json:
        print(json.dumps(rows[0] if len(rows) == 1 else rows))
    if options.csv:
        with options.csv.open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, WRITTEN, extrasaction="ignore")
            writer.writeheader()
            writer.writerows(rows)
    if options.picture:
        points = []
        for path in POINTS:
            with path.open(newline="", encoding="utf-8") as file:
                points += list(csv.DictReader(file))
        draw_tosses(studies, points, options.picture)
    return 0


if __name__ == "__main__":
    sys.exit(main())
