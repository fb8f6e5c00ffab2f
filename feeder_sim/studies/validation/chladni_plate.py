"""A plate that steers balls: how far a ball moves in one note, from every place of a square plate of silicon.

The plate is that of Zhou, Sariola, Latifi and Liimatainen (Nat. Commun. 7 (2016) 12764): 50 x 50 mm, 0.525 mm thick,
free, driven in its middle; solder balls of 0.6 mm; notes of 500 ms, whose amplitude rises and falls in straight lines.
Its amplitudes are not known. That of each note was set so that three quarters of all steps were below 0.175 mm, and
so it is here. Damping, restitution and friction are assumed.

Plate and drive have all symmetries of the square. So an eighth of the plate is enough.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from feeder_sim.errors import InputError
from feeder_sim.plate.materials import MATERIALS
from feeder_sim.plate.modes import PlateModes, plate_modes
from feeder_sim.plate.rectangle import RectangularPlate
from feeder_sim.plate.response import DEFAULT_DAMPING_RATIO
from feeder_sim.records.trajectory import Status
from feeder_sim.run.batch import measure_drift
from feeder_sim.scenario import Ball, Contact, CustomMaterial, Drive, PistonPlate, Run, Scenario, Start
from feeder_sim.scenario.engine_choice import choose_engine
from feeder_sim.scene.prepared import Prepared
from feeder_sim.scene.scene import GRAVITY, Scene, build_scene
from feeder_sim.studies.validation.forced_field import ForcedField, force_in_the_middle, forced_field, triangle_terms

NOTES_HZ = (7459.0, 10548.0, 11175.0, 11840.0, 12544.0, 14080.0, 14917.0, 15804.0)
PLATE = RectangularPlate(0.05, 0.05, 0.525e-3, MATERIALS["silicon"])
HIGHEST_HZ = 60e3  # of the modes that make a field; four times the highest note
NOTE_S = 0.5
QUANTILE, STEP = 0.75, 0.175e-3  # [1], [m]: so many steps are shorter than that
PER_AXIS = 21  # start points
SPACING = 2.4e-3  # [m] between them; the outermost are 1 mm from the edge
BALL_MM = 0.6
SOLDER = CustomMaterial(density_kg_m3=8400.0, youngs_modulus_gpa=30.0, poisson_ratio=0.4)  # Sn-Pb 60/40
DROP_MM = (0.001, 0.003)  # a ball lies on the plate; the range makes one run different from the next
LOOKS_PER_S = 100.0
CLOSE = 0.02  # of the quantile, at which the search for the amplitude ends
FIRST_THROW = 1000.0  # throw number with which it begins
MOST_TRIES = 8
STEEPEST = 2.0  # the largest power of the amplitude with which steps are taken to grow, and
FLATTEST = 0.4  # the smallest


@dataclass(frozen=True)
class Assumed:
    """What the experiment does not say.

    Attributes:
        restitution, friction: of ball and plate [1].
        damping_ratio: of all modes [1]; 0.002 is a Q of 250.
        frequency_scale: drive of the computed plate over the note [1].
    """

    restitution: float = 0.5
    friction: float = 0.3
    damping_ratio: float = DEFAULT_DAMPING_RATIO
    frequency_scale: float = 1.03


@dataclass(frozen=True)
class Steps:
    """What one note does to a ball at every start point.

    Attributes:
        note: [Hz].
        field: motion of the plate.
        amplitude: where it moves most, at the peak of the note [m].
        start: places (n, 2) [m]; step: mean motion from there (n, 2) [m].
        spread: standard deviation of single runs at one place, root mean square over all places [m]; NaN of one run.
        runs: at every place, without its images by symmetry.
        lost: runs in which the ball fell off the plate, their images not counted.
    """

    note: float
    field: ForcedField
    amplitude: float
    start: NDArray[np.float64]
    step: NDArray[np.float64]
    spread: float
    runs: int
    lost: int

    @property
    def length(self) -> NDArray[np.float64]:
        """Of the steps (n,) [m]."""
        return np.asarray(np.hypot(*self.step.T))

    @property
    def quantile(self) -> float:
        """Of the length of the steps [m]."""
        return float(np.quantile(self.length, QUANTILE))

    @property
    def throw_number(self) -> float:
        """A w^2 / g where the plate moves most."""
        return self.amplitude * (2.0 * math.pi * self.field.frequency) ** 2 / GRAVITY

    @property
    def cosine(self) -> float:
        """Mean cosine between steps and the bare gradient, weighted by the length of the steps."""
        return mean_cosine(self.step, self.field.downhill(self.start))


def mean_cosine(one: NDArray[np.float64], other: NDArray[np.float64]) -> float:
    """Mean cosine between two fields of vectors (n, 2), weighted by the length of the first."""
    weight, size = np.hypot(*one.T), np.hypot(*other.T)
    along = (one * other).sum(axis=1) / np.where(size > 0.0, size, 1.0)
    return float(along.sum() / weight.sum())


def chladni_modes() -> PlateModes:
    """The modes of the plate that its middle can drive, and others."""
    return plate_modes(PLATE, highest_frequency=HIGHEST_HZ)


def note_field(modes: PlateModes, note: float, assumed: Assumed) -> ForcedField:
    """How the plate moves under a force in its middle, at a note [Hz]."""
    return forced_field(modes, force_in_the_middle(modes), assumed.frequency_scale * note, assumed.damping_ratio)


def start_points() -> NDArray[np.float64]:
    """All start points (PER_AXIS^2, 2) [m], y running fastest."""
    line = SPACING * (np.arange(PER_AXIS) - PER_AXIS // 2)
    return np.stack(np.meshgrid(line, line, indexing="ij"), axis=-1).reshape(-1, 2)


def of_an_eighth(points: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which points (n, 2) lie in the eighth 0 <= y <= x of the square, (n,)."""
    x, y = points.T
    return np.asarray((y > -1e-9) & (y < x + 1e-9))


IMAGES = tuple(
    np.array(matrix, float) for sx in (1, -1) for sy in (1, -1) for matrix in (((sx, 0), (0, sy)), ((0, sx), (sy, 0)))
)  # of a square under its symmetries


def unfold(
    points: NDArray[np.float64], eighth: NDArray[np.float64], vectors: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Vectors (n, 2) at all points (n, 2) of a square from those (m, 2) of an eighth of it.

    Where several images meet, on the lines of symmetry, their mean stands: noise across the line goes.
    """
    total, count = np.zeros((len(points), 2)), np.zeros(len(points))
    for image in IMAGES:
        distance = np.abs(points[:, None] - (eighth @ image.T)[None]).max(axis=2)
        at, of = np.nonzero(distance < 1e-3 * SPACING)
        total[at] += (vectors @ image.T)[of]
        count[at] += 1.0
    return total / count[:, None]


def ball_scene(field: ForcedField, amplitude: float, place: NDArray[np.float64], runs: int, assumed: Assumed) -> Scene:
    """One ball at a place (2,) [m] on the plate that plays a note; amplitude [m] where the plate moves most.

    The scene of a piston of that amplitude, whose surface then is that of the field.
    """
    plate = field.parts.plate
    scenario = Scenario(
        plate=PistonPlate(
            kind="piston",
            length_mm=1e3 * plate.length,
            width_mm=1e3 * plate.width,
            thickness_mm=1e3 * plate.thickness,
        ),
        drive=(Drive(frequency_hz=field.frequency, amplitude_um=1e6 * amplitude, ring_up=False),),
        part=(
            Ball(
                shape="ball",
                diameter_mm=BALL_MM,
                material=SOLDER,
                start=Start(position_mm=(1e3 * place[0], 1e3 * place[1]), drop_height_mm=DROP_MM),
            ),
        ),
        contact=Contact(restitution=assumed.restitution, friction=assumed.friction),
        run=Run(engine="impulse", duration_s=NOTE_S, seeds=runs, frames_per_second=LOOKS_PER_S),
    )
    return build_scene(scenario)


def play(
    field: ForcedField,
    note: float,
    amplitude: float,
    runs: int,
    assumed: Assumed,
    start: NDArray[np.float64] | None = None,
) -> Steps:
    """Play a note with an amplitude [m] and see where balls go, from an eighth of the plate or from given places.

    Raises:
        InputError: a run diverged, or no ball of a place stayed on the plate.
    """
    everywhere = start_points() if start is None else start
    places = everywhere[of_an_eighth(everywhere)] if start is None else start
    surface = field.surface(triangle_terms(amplitude, field.frequency, NOTE_S))

    def prepared(place: NDArray[np.float64]) -> Prepared:
        scene = replace(ball_scene(field, amplitude, place, runs, assumed), surface=surface)
        return Prepared(scene, choose_engine(scene.scenario), None, ())

    found = measure_drift(map(prepared, places))
    if any(Status.DIVERGED in each.status for each in found):
        raise InputError(f"a run diverged at {note:g} Hz and {1e6 * amplitude:.3g} um")
    velocity = [(each.findings.drift_velocity_x_mm_s, each.findings.drift_velocity_y_mm_s) for each in found]
    lost = sum(runs - x.n for x, _ in velocity)
    step = 1e-3 * NOTE_S * np.array([(x.mean, y.mean) for x, y in velocity])
    if not np.isfinite(step).all():
        raise InputError(f"no ball of a place stayed on the plate at {note:g} Hz and {1e6 * amplitude:.3g} um")
    variance = [x.sd**2 + y.sd**2 for x, y in velocity if x.n > 1]
    spread = 1e-3 * NOTE_S * math.sqrt(np.mean(variance)) if variance else math.nan
    steps = unfold(everywhere, places, step) if start is None else step
    return Steps(note, field, amplitude, everywhere, steps, spread, runs, lost)


def find_amplitude(
    field: ForcedField, note: float, runs: int, assumed: Assumed, notify: Callable[[str], None] | None = None
) -> Steps:
    """Play a note with the amplitude at which `QUANTILE` of the steps are shorter than `STEP`.

    Raises:
        InputError: the search does not end, or as for `play`.
    """
    omega = 2.0 * math.pi * field.frequency
    amplitude = FIRST_THROW * GRAVITY / omega**2
    before: Steps | None = None
    for _ in range(MOST_TRIES):
        steps = play(field, note, amplitude, runs, assumed)
        if notify:
            notify(f"{note:g} Hz, {1e6 * amplitude:.3f} um: {1e3 * steps.quantile:.4f} mm, cosine {steps.cosine:.3f}")
        miss = STEP / steps.quantile
        if abs(miss - 1.0) < CLOSE:
            return steps
        power = 1.0
        if before is not None:
            power = math.log(steps.quantile / before.quantile) / math.log(steps.amplitude / before.amplitude)
            power = min(max(power, FLATTEST), STEEPEST)
        before, amplitude = steps, amplitude * miss ** (1.0 / power)
    raise InputError(f"no amplitude found at {note:g} Hz after {MOST_TRIES} tries")
