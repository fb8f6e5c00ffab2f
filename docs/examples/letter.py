"""A nut along a letter, by choosing the mode of each short pulse.

    python docs/examples/letter.py N --seeds 8 --picture docs/figures/letter.png
    python docs/examples/letter.py N --fit 0.03 --seeds 40 --map nut.npz

After Zhou, Sariola, Latifi and Liimatainen, Nature Communications 7 (2016) 12764: of all modes the one is taken whose
predicted end comes nearest to a point of the path that lies a little ahead.
"""

from __future__ import annotations

import argparse
import math
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from prediction import GradientDrift, MapDrift, Prediction, add_map_options, drift_map_of, prediction_of

from feeder_sim.document.figure import empty_figure
from feeder_sim.example_files import example_file
from feeder_sim.feeder.feeder import Feeder
from feeder_sim.plate.mode_file import read_mode_file
from feeder_sim.plate.mode_shapes import RitzShape
from feeder_sim.scenario import Excitation, HexNut, ModePlate, Run, Scattered, Scenario, Schedule, Stage, Start
from feeder_sim.scene.scene import Scene
from feeder_sim.studies.drift_map.drift_map import DriftMap

LETTERS = {  # corners [mm]; of the S, two arcs
    "N": [(-12.0, -16.0), (-12.0, 16.0), (12.0, -16.0), (12.0, 16.0)],
    "Z": [(-12.0, 16.0), (12.0, 16.0), (-12.0, -16.0), (12.0, -16.0)],
    "L": [(-10.0, 16.0), (-10.0, -16.0), (10.0, -16.0)],
    "S": [
        *((8.0 * math.cos(a), 8.0 + 8.0 * math.sin(a)) for a in np.radians(np.arange(20.0, 271.0, 10.0))),
        *((8.0 * math.cos(a), -8.0 + 8.0 * math.sin(a)) for a in np.radians(np.arange(80.0, -161.0, -10.0))),
    ],
}
MODES_HZ = (1300.0, 8200.0)  # whose waves are longer than a nut, and short enough to have nodes near every place
DEGENERATE = 1e-4  # relative difference of two frequencies that are one
MIDDLE = 0.05  # [m]; half the side of the square over which a mode has its speed
SPEED = 0.03  # [m/s], root mean square over that square of the velocity amplitude
PULSE_S, REST_S = 0.1, 0.05
AHEAD = 0.7e-3  # [m] along the path from the nearest place to the one that is aimed at
MOST_PULSES = 3000
MOVED = 5e-5  # [m]; a part that a pulse moves by less is not sent the same way again


@dataclass(frozen=True)
class Way:
    """How a nut followed a path.

    Attributes:
        wanted: corners of the path [m], shape (k, 2).
        places: of the nut at the start and after every pulse [m], shape (n + 1, 2).
        deviation: of these from the path [m], shape (n + 1,).
        stages: names of the pulses, n.
        time: simulated [s].
        arrived: whether the end of the path was reached.
    """

    wanted: NDArray[np.float64]
    places: NDArray[np.float64]
    deviation: NDArray[np.float64]
    stages: tuple[str, ...]
    time: float
    arrived: bool

    @property
    def mean_deviation_mm(self) -> float:
        return 1e3 * float(self.deviation.mean())

    @property
    def largest_deviation_mm(self) -> float:
        return 1e3 * float(self.deviation.max())

    @property
    def missed_mm(self) -> float:
        """Largest distance from a point of the path to the way, as at a corner that was cut."""
        import shapely

        points = shapely.points([_Line(self.wanted).at(way) for way in np.arange(0.0, 1e-3 * self.length_mm, 1e-4)])
        return 1e3 * float(shapely.distance(shapely.LineString(self.places), points).max())

    @property
    def length_mm(self) -> float:
        """Of the path."""
        return 1e3 * float(np.linalg.norm(np.diff(self.wanted, axis=0), axis=1).sum())


def letter_path(letter: str) -> NDArray[np.float64]:
    """Corners (k, 2) [m] of the path of a letter."""
    return 1e-3 * np.array(LETTERS[letter])


def letter_scenario(
    mode_file: Path,
    letter: str,
    *,
    speed: float = SPEED,
    pulse_s: float = PULSE_S,
    rest_s: float = REST_S,
    modes_hz: tuple[float, float] = MODES_HZ,
) -> Scenario:
    """A nut at the begin of a letter, and pulses of all modes in a range of frequencies.

    All pulses have the same speed in the middle of the plate. Two modes of one frequency are driven one by one, and
    together with the one sign and the other, which takes two actuators. Without these no pulse moves a part across
    a mirror line of the plate: all other modes are as strong on one side as on the other.
    """
    modes = read_mode_file(mode_file).modes
    x = np.linspace(-0.5 * modes.plate.length, 0.5 * modes.plate.length, 181)
    y = np.linspace(-0.5 * modes.plate.width, 0.5 * modes.plate.width, 181)
    middle = np.ix_(np.abs(x) <= MIDDLE, np.abs(y) <= MIDDLE)
    stages = []
    for numbers, weights in _patterns(modes.natural_frequency, modes_hz):
        frequency = float(modes.natural_frequency[numbers[0]])
        shapes = [
            weight * RitzShape(modes, i).evaluate_grid(x, y)[0] for i, weight in zip(numbers, weights, strict=True)
        ]
        level = speed / (2.0 * math.pi * frequency * math.sqrt(float((sum(shapes)[middle] ** 2).mean())))
        drives = tuple(
            Excitation(
                frequency_hz=frequency,
                mode=i + 1,
                amplitude_um=round(1e6 * level * float(np.abs(shape).max()), 4),
                phase_deg=0.0 if weight > 0.0 else 180.0,
            )
            for i, weight, shape in zip(numbers, weights, shapes, strict=True)
        )
        signs = ["+" if weight > 0.0 else "-" for weight in weights]
        name = "".join(f"{sign}{i + 1}" for sign, i in zip(signs, numbers, strict=True)).removeprefix("+")
        stages.append(Stage(name=f"mode {name}", drive=drives, duration_s=pulse_s, pause_s=rest_s))
    begin = LETTERS[letter][0]
    return Scenario(
        title=f"A nut along the letter {letter}",
        plate=ModePlate(kind="modes", mode_file=mode_file.resolve()),
        schedule=Schedule(stage=tuple(stages)),
        part=(HexNut(size="M2.5", start=Start(position_mm=begin, drop_height_mm=(0.0, 0.0))),),
        run=Run(seeds=1, frames_per_second=100.0),
    )


def _patterns(
    frequency: NDArray[np.float64], modes_hz: tuple[float, float]
) -> Iterator[tuple[tuple[int, ...], tuple[float, ...]]]:
    """Numbers of modes that are driven together, and their weights."""
    number = 0
    while number < len(frequency):
        paired = number + 1 < len(frequency) and frequency[number + 1] < (1.0 + DEGENERATE) * frequency[number]
        if modes_hz[0] <= frequency[number] <= modes_hz[1]:
            yield (number,), (1.0,)
            if paired:
                yield (number + 1,), (1.0,)
                yield (number, number + 1), (1.0, 1.0)
                yield (number, number + 1), (1.0, -1.0)
        number += 2 if paired else 1


def steer(
    feeder: Feeder,
    path: NDArray[np.float64],
    *,
    prediction: Prediction | None = None,
    ahead: float = AHEAD,
    most_pulses: int = MOST_PULSES,
    seen: Callable[[float], None] | None = None,
) -> Way:
    """Steer the only part of a feeder along a path, pulse by pulse.

    Args:
        feeder: has one part, at the begin of the path.
        path: corners (k, 2) [m].
        prediction: of all its stages; the gradient of the plate's speed by default.
        ahead: distance along the path to the point that is aimed at [m].
        most_pulses: after which it is given up.
        seen: takes the share of the path that is done.
    """
    predicted = prediction or GradientDrift(feeder.scene)
    line = _Line(path)
    place = feeder.poses().position[0, :2]
    places, done = [place], 0.0
    stages: list[str] = []
    held_at, tried = place, np.zeros(len(feeder.stage_names), bool)  # what has been tried in vain at a place
    while len(stages) < most_pulses and len(feeder.poses()):
        done = line.nearest(place, done, done + 3.0 * ahead)
        if seen:
            seen(done / line.length)
        if done >= line.length - 0.5 * ahead:
            break
        aim = line.at(done + ahead)
        ends = np.array([predicted.predict(i, place[None])[0] for i in range(len(feeder.stage_names))])
        best = int(np.argmin(np.where(tried, np.inf, np.linalg.norm(ends - aim, axis=1))))
        feeder.vibrate(best)
        stages.append(feeder.stage_names[best])
        poses = feeder.poses()
        if len(poses):
            place = poses.position[0, :2]
            places.append(place)
        tried[best] = True
        if np.linalg.norm(place - held_at) > MOVED or tried.all():
            held_at, tried[:] = place, False
    held = np.array(places)
    arrived = done >= line.length - 0.5 * ahead
    return Way(path, held, line.distance(held), tuple(stages), feeder.time, arrived)


class _Line:
    """A path by the way along it."""

    def __init__(self, corners: NDArray[np.float64]) -> None:
        self._corners = corners
        self._along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(corners, axis=0), axis=1))])
        self.length = float(self._along[-1])

    def at(self, way: float) -> NDArray[np.float64]:
        """The point (2,) after a way [m] from the begin, at most at the end."""
        return np.array([np.interp(way, self._along, self._corners[:, k]) for k in (0, 1)])

    def nearest(self, place: NDArray[np.float64], start: float, end: float) -> float:
        """The way to the point nearest to a place, among those from one way to another one [m]."""
        ways = np.linspace(start, min(end, self.length), 61)
        points = np.array([self.at(way) for way in ways])
        return float(ways[np.linalg.norm(points - place, axis=1).argmin()])

    def distance(self, places: NDArray[np.float64]) -> NDArray[np.float64]:
        """Distance (n,) [m] of places (n, 2) from the path."""
        import shapely

        return np.asarray(shapely.distance(shapely.LineString(self._corners), shapely.points(places)))


PULSES = 25  # of one start
SLIGHT = 0.01  # a share with which no part comes to a node


@dataclass(frozen=True)
class Fit:
    """Ways of pulses against what is predicted.

    Attributes:
        way: computed, shape (n, 2) [m].
        share: of the in-plane speed, or of what a drift map predicts, by least squares [1].
        correlation: of computed and predicted ways [1].
        left: root mean square of what the prediction leaves, over that of the ways [1].
    """

    way: NDArray[np.float64]
    share: float
    correlation: float
    left: float

    @property
    def way_mm(self) -> float:
        """Root mean square of the ways."""
        return 1e3 * float(np.sqrt((self.way**2).sum(axis=1).mean()))


def fit_pulses(
    mode_file: Path,
    speed: float,
    seeds: int,
    *,
    drift_map: DriftMap | None = None,
    seen: Callable[[float], None] | None = None,
) -> Fit:
    """Let a nut take random pulses in the middle of the plate, `PULSES` from every one of some random starts.

    Args:
        mode_file: of the plate.
        speed: root mean square of the velocity amplitude in the middle [m/s].
        seeds: number of starts.
        drift_map: predicts in place of the gradient.
        seen: takes the share of the work that is done.
    """
    scenario = letter_scenario(mode_file, "N", speed=speed)
    start = Scattered(kind="scattered", size_mm=(2e3 * MIDDLE, 2e3 * MIDDLE))
    first = Feeder(scenario.model_copy(update={"part": (scenario.part[0].model_copy(update={"start": start}),)}))
    slight = 1.0 if drift_map else SLIGHT
    prediction = MapDrift(first.scene, drift_map) if drift_map else GradientDrift(first.scene, share=slight)
    ways, predicted = [], []
    for seed in range(seeds):
        feeder, rng = first.again(seed), np.random.default_rng(seed)
        for number in rng.integers(len(feeder.stage_names), size=PULSES):
            before = feeder.poses().position[:, :2]
            feeder.vibrate(int(number))
            after = feeder.poses().position[:, :2]
            if not len(after):
                break
            ways.append(after[0] - before[0])
            predicted.append((prediction.predict(int(number), before) - before)[0] / slight)
        if seen:
            seen((seed + 1) / seeds)
    way, unit = np.array(ways), np.array(predicted)
    share = float((way * unit).sum() / (unit**2).sum())
    left = float(np.sqrt(((way - share * unit) ** 2).sum() / (way**2).sum()))
    return Fit(way, share, float(np.corrcoef(way.ravel(), unit.ravel())[0, 1]), left)


SHOWN_MODES = 4  # whose nodal lines are drawn, those that were used most
MARGIN = 0.012  # [m] around the letter


def letter_picture(scene: Scene, way: Way, file: Path) -> None:
    """Draw a way.

    Args:
        scene: of the feeder, with all stages in its schedule.
        way: of the nut.
        file: picture to write.
    """
    schedule = scene.scenario.schedule
    assert schedule is not None
    low, high = way.wanted.min(axis=0) - MARGIN, way.wanted.max(axis=0) + MARGIN
    picture = empty_figure(5.0, 5.0 * float((high - low)[1] / (high - low)[0]))
    axes = picture.add_subplot()
    x, y = (np.linspace(low[k], high[k], 161) for k in (0, 1))
    points = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    shapes = scene.surface.deflections(points)
    firsts = np.concatenate([[0], np.cumsum([len(stage.drive) for stage in schedule.stage])])
    for name, _ in Counter(way.stages).most_common(SHOWN_MODES):
        number = schedule.stage_names.index(name)
        drives = scene.drives[firsts[number] : firsts[number + 1]]
        w = sum(drive.amplitude * np.cos(drive.phase) * shapes[drive.shape] for drive in drives)
        axes.contour(1e3 * x, 1e3 * y, np.reshape(w, (len(x), len(y))).T, levels=[0.0], colors="0.85", linewidths=1.0)
    axes.plot(*(1e3 * way.wanted.T), color="tab:orange", linewidth=5.0, alpha=0.4, solid_joinstyle="round")
    axes.plot(*(1e3 * way.places.T), color="tab:blue", linewidth=1.0, marker=".", markersize=2.5)
    axes.set(xlabel="x [mm]", ylabel="y [mm]", aspect="equal")
    axes.set_title(
        f"{way.length_mm:.0f} mm in {way.time:.0f} s and {len(way.stages)} pulses: "
        f"{way.mean_deviation_mm:.2f} mm off, at most {way.largest_deviation_mm:.2f} mm",
        fontsize=9,
    )
    picture.savefig(file, dpi=150)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("letter", choices=sorted(LETTERS))
    parser.add_argument("--seeds", type=int, default=8)
    parser.add_argument("--pulses", type=int, default=MOST_PULSES, help="at most")
    parser.add_argument("--fit", type=float, metavar="M_S", help="fit the prediction to random pulses of this speed")
    parser.add_argument("--plate", type=Path, default=example_file("models/plate_180/modes.h5"))
    parser.add_argument("--picture", type=Path, help="of the first seed's way along the letter")
    add_map_options(parser)
    options = parser.parse_args()
    if options.fit:
        drift_map = drift_map_of(options) if options.map else None
        fit = fit_pulses(options.plate, options.fit, options.seeds, drift_map=drift_map)
        print(
            f"{len(fit.way)} pulses of {options.fit:g} m/s, {fit.way_mm:.2f} mm each: share {fit.share:.3f}, ", end=""
        )
        print(f"correlation {fit.correlation:.3f}, {100.0 * fit.left:.0f} % of the way left")
        return
    first = Feeder(letter_scenario(options.plate, options.letter))
    path, prediction = letter_path(options.letter), prediction_of(first.scene, options)
    ways = []
    for seed in range(options.seeds):
        way = steer(first.again(seed), path, prediction=prediction, most_pulses=options.pulses)
        ways.append(way)
        print(
            f"seed {seed}: {'arrived' if way.arrived else 'gave up'} after {way.time:.1f} s, {len(way.stages)} pulses; "
            f"deviation {way.mean_deviation_mm:.2f} mm, at most {way.largest_deviation_mm:.2f} mm; "
            f"path missed by {way.missed_mm:.2f} mm at most",
            flush=True,
        )
    for name, values in (
        ("mean deviation [mm]", [way.mean_deviation_mm for way in ways]),
        ("largest deviation [mm]", [way.largest_deviation_mm for way in ways]),
        ("path missed [mm]", [way.missed_mm for way in ways]),
        ("time [s]", [way.time for way in ways]),
    ):
        print(f"{name:<24} {np.mean(values):.2f}, {min(values):.2f} to {max(values):.2f}")
    print(f"{ways[0].length_mm:.0f} mm; arrived: {sum(way.arrived for way in ways)} of {len(ways)}")
    if options.picture:
        letter_picture(first.scene, ways[0], options.picture)


if __name__ == "__main__":
    main()
