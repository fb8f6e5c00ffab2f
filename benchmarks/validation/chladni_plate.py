"""Steps of a ball on the steering plate of Zhou et al. (2016), predicted for eight notes from dimensions alone.

    python benchmarks/validation/chladni_plate.py [--out steps.csv] [--picture chladni_plate.png] [--json]

Square of silicon, 50 x 50 x 0.525 mm, free, driven by a force in its middle; solder ball of 0.6 mm; notes of 500 ms
that rise and fall in straight lines, each with the amplitude at which three quarters of the steps are below 0.175 mm.
The file has the mean step of a ball from each of 21 x 21 places, for every note. The measured field is not here:
whoever has it compares it with the file.

--scale: the computed plate is driven at the note times this. Frequencies of the real plate are 3 % off those of a
computed one, and the gradients agree with the motion when scaled by 3 %; so 1.03, since a plate that carries a piezo is
heavier than a bare one and resounds lower. 1 drives at the note itself.

Takes 3 minutes on two cores, 1 with --quick.

The plate is that of Zhou, Sariola, Latifi and Liimatainen (Nat. Commun. 7 (2016) 12764). Damping, restitution and
friction are assumed.

Plate and drive have all symmetries of the square. So an eighth of the plate is enough.
"""

from __future__ import annotations

import argparse
import csv
import json
import math
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TextIO

import numpy as np
from arguments import between, new_file
from forced_field import Force, ForcedField, force_in_the_middle, forced_field, triangle_terms
from numpy.typing import NDArray

from feeder_sim.constants import GRAVITY
from feeder_sim.document.figure import MM, UM, empty_figure
from feeder_sim.errors import InputError
from feeder_sim.measures.statistic import finite_or_none
from feeder_sim.plate.actuators import Actuator
from feeder_sim.plate.materials import MATERIALS, Material
from feeder_sim.plate.mode_shapes import standing_wave
from feeder_sim.plate.modes import PlateModes, plate_modes
from feeder_sim.plate.nodal_lines import nodal_lines
from feeder_sim.plate.rectangle import RectangularPlate
from feeder_sim.plate.response import DEFAULT_DAMPING_RATIO
from feeder_sim.plate.ritz.attachments import Layer
from feeder_sim.records.seed import Status
from feeder_sim.run.batch import measure_drift
from feeder_sim.scenario import Ball, Contact, CustomMaterial, Drive, RigidPlate, Run, Scenario, Start
from feeder_sim.scenario.engine_choice import choose_engine
from feeder_sim.scene.prepared import Prepared
from feeder_sim.scene.scene import Scene, build_scene

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
        plate=RigidPlate(
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


HEADER = ("note_hz", "x_mm", "y_mm", "dx_mm", "dy_mm")
BIN_EDGES = np.linspace(0.0, 1.0, 6)  # distance to the node over a quarter of the wavelength
NAMES = ("distance", "step", "gradient", "slope")
DETUNING = 1e-4  # relative, over which the change of the field with the frequency is taken
OTHER_SCALES = (1.0, 0.97)  # of the frequency
OTHER_DAMPING = (0.0005, 0.01)  # a Q of 1000 and of 50
PATCH_MM = 5.0


@dataclass(frozen=True)
class Profile:
    """Length of steps, of the gradient and of the slope over the distance to the nearest nodal line.

    Attributes:
        distance: of every start point, over a quarter of the wavelength [1], (n,).
        step, gradient, slope: lengths of the step, of grad A^2 and of grad A, over their means over all points [1].
    """

    distance: NDArray[np.float64]
    step: NDArray[np.float64]
    gradient: NDArray[np.float64]
    slope: NDArray[np.float64]

    def binned(self) -> dict[str, NDArray[np.float64]]:
        """Means between `BIN_EDGES` of step, gradient and slope, by name, NaN without a point there."""
        at = np.digitize(self.distance, BIN_EDGES) - 1
        bins = [at == k for k in range(len(BIN_EDGES) - 1)]
        return {
            name: np.array([getattr(self, name)[one].mean() if one.any() else math.nan for one in bins])
            for name in ("step", "gradient", "slope")
        }

    def correlation(self, name: str) -> float:
        """Of the length of the steps with that of the gradient or of the slope [1]."""
        return float(np.corrcoef(self.step, getattr(self, name))[0, 1])


def profile(steps: Steps) -> Profile:
    """The profile of one note."""
    field = steps.field
    surface = field.surface(triangle_terms(1.0, field.frequency, NOTE_S))
    quarter = 0.25 * standing_wave(field.parts.plate, field.frequency).wavelength
    gradient, slope = np.hypot(*field.downhill(steps.start).T), slope_of(steps)
    distance = nodal_lines(surface, 0).distance(steps.start) / quarter
    lengths = (each / each.mean() for each in (steps.length, gradient, slope))
    return Profile(distance, *lengths)


def slope_of(steps: Steps) -> NDArray[np.float64]:
    """|grad A| [1] at the start points at the peak of the note, (n,)."""
    return np.asarray(steps.amplitude * np.linalg.norm(steps.field.gradient(steps.start), axis=1))


def share(steps: Steps) -> float:
    """Speed of a ball over the amplitude of the surface's velocity in its plane [1], by least squares over a note.

    On average over a note the amplitude is half that of its peak.
    """
    speed = 0.5 * steps.field.parts.plate.thickness * 2.0 * math.pi * steps.field.frequency * slope_of(steps)
    carried = 0.5 * NOTE_S * speed
    return float(steps.length @ carried / (carried @ carried))


def together(profiles: Sequence[Profile]) -> Profile:
    """The points of several notes."""
    return Profile(*(np.concatenate([getattr(p, name) for p in profiles]) for name in NAMES))


def sensitivity(modes: PlateModes, note: float, assumed: Assumed) -> dict[str, float]:
    """Mean cosine between the bare gradient as assumed and that under other assumptions, by what is changed."""
    points = start_points()
    own = note_field(modes, note, assumed).downhill(points)
    other = {f"scale {scale:g}": replace(assumed, frequency_scale=scale) for scale in OTHER_SCALES}
    other |= {f"damping ratio {zeta:g}": replace(assumed, damping_ratio=zeta) for zeta in OTHER_DAMPING}
    fields = {name: note_field(modes, note, each) for name, each in other.items()}
    fields[f"patch {PATCH_MM:g} mm"] = forced_field(
        modes, patch_force(modes), assumed.frequency_scale * note, assumed.damping_ratio
    )
    return {name: mean_cosine(own, field.downhill(points)) for name, field in fields.items()}


def patch_force(modes: PlateModes) -> Force:
    """What a square patch bonded under the middle does to the modes, for a unit moment."""
    side = 1e-3 * PATCH_MM
    ceramic = Material(7700.0, 77e9, 0.31)  # a patch acts by its edges; what it is made of does not count here
    layer = Layer((0.0, 0.0), (side, side), 0.0, 1e-3, -1, ceramic)
    return Force(Actuator("patch", layer, 1.0).force_per_volt(modes))


def lag(modes: PlateModes, note: float, assumed: Assumed) -> float:
    """How far the plate is from the stationary state while a note rises, over its motion at the peak [1].

    Under a force that grows as t, W(w) t - i dW/dw follows; the second part is what stationary steps leave out.
    """
    scale = assumed.frequency_scale
    one, other = (
        note_field(modes, note, replace(assumed, frequency_scale=scale * (1.0 + sign * DETUNING))) for sign in (-1, 1)
    )
    points = start_points()
    low, high = (field.scale * field.at(points) for field in (one, other))
    # Their phases are turned to the larger part each; back to that of the first.
    high = high * np.exp(1j * np.angle(np.vdot(high, low)))
    change = (high - low) / (2.0 * math.pi * (other.frequency - one.frequency))
    return float(np.abs(change).max() / (0.5 * NOTE_S) / np.abs(low).max())


def write_steps(every: Sequence[Steps], file: TextIO) -> None:
    """Write the steps of notes as CSV, one row per start point."""
    rows = csv.writer(file, lineterminator="\n")
    rows.writerow(HEADER)
    for steps in every:
        for (x, y), (dx, dy) in zip(1e3 * steps.start, 1e3 * steps.step, strict=True):
            rows.writerow((f"{steps.note:g}", f"{x + 0.0:.3f}", f"{y + 0.0:.3f}", f"{dx:.6f}", f"{dy:.6f}"))


def as_row(steps: Steps, own: Profile) -> dict[str, Any]:
    """What is reported of one note; units in the names."""
    return {
        "note_hz": steps.note,
        "drive_hz": steps.field.frequency,
        "amplitude_um": 1e6 * steps.amplitude,
        "throw_number": steps.throw_number,
        "mean_cosine": steps.cosine,
        "median_step_mm": 1e3 * float(np.median(steps.length)),
        "quantile_step_mm": 1e3 * steps.quantile,
        "largest_step_mm": 1e3 * float(steps.length.max()),
        "spread_mm": finite_or_none(1e3 * steps.spread),
        "lost": steps.lost,
        "share": share(steps),
        "correlation_gradient": own.correlation("gradient"),
        "correlation_slope": own.correlation("slope"),
        "profile": as_table(own),
    }


def as_table(own: Profile) -> dict[str, list[float | None]]:
    """The binned profile as JSON takes it, which has no NaN."""
    return {name: [finite_or_none(float(v)) for v in values] for name, values in own.binned().items()}


MAP_POINTS = 161  # per axis
MAGNIFIED = 10.0  # arrows over steps


def save_chladni_plate(shown: Sequence[Steps], every: Sequence[Steps], path: Path) -> None:
    """Draw the steps of some notes over the amplitude, and the profile of all; the suffix of `path` says how."""
    figure = empty_figure(4.3 * len(shown) + 4.4, 4.2)
    panels = figure.subplots(1, len(shown) + 1)
    for axes, steps in zip(panels[:-1], shown, strict=True):
        filled = _draw_steps(axes, steps)
        figure.colorbar(filled, ax=axes, label="amplitude (µm)", shrink=0.8)
    _draw_profile(panels[-1], every)
    figure.savefig(path, dpi=110)


def _draw_steps(axes: Any, steps: Steps) -> Any:
    """Arrows from the start points over the amplitude of the plate, with the nodal lines of its larger part."""
    parts = steps.field.parts
    x, y = (np.linspace(-0.5, 0.5, MAP_POINTS) * side for side in (parts.plate.length, parts.plate.width))
    real, imaginary = (parts.evaluate_grid(i, x, y)[0] for i in range(2))
    amplitude = steps.amplitude * np.hypot(real, imaginary)
    filled = axes.contourf(x * MM, y * MM, amplitude.T * UM, levels=12, cmap="Blues")
    axes.contour(x * MM, y * MM, real.T, levels=[0.0], colors="#be3434", linewidths=1.2)
    axes.quiver(
        *(steps.start.T * MM),
        *(steps.step.T * MM * MAGNIFIED),
        angles="xy",
        scale_units="xy",
        scale=1.0,
        width=0.0045,
        color="black",
    )
    axes.set(
        aspect="equal",
        xlabel="x (mm)",
        ylabel="y (mm)",
        title=f"{steps.note:g} Hz: steps x {MAGNIFIED:g}, nodal lines red",
    )
    return filled


def _draw_profile(axes: Any, every: Sequence[Steps]) -> None:
    """Length of the steps, of grad A^2 and of grad A over the distance to the node, of all notes."""
    points = together([profile(steps) for steps in every])
    means = points.binned()
    middle = 0.5 * (BIN_EDGES[:-1] + BIN_EDGES[1:])
    inside = points.distance <= BIN_EDGES[-1]
    axes.plot(points.distance[inside], points.step[inside], ".", color="0.8", markersize=2, label="steps, all notes")
    axes.plot(middle, means["step"], "o-", color="black", label="their mean")
    axes.plot(middle, means["slope"], "^--", color="#3a60be", label="mean of |grad A|")
    axes.plot(middle, means["gradient"], "s--", color="#be3434", label="mean of |grad A$^2$|")
    axes.set(
        xlim=(0.0, BIN_EDGES[-1]),
        ylim=(0.0, 3.0),
        xlabel="distance to the node over a quarter wavelength",
        ylabel="length over its mean on the plate",
        title="Length of the steps",
    )
    axes.legend(fontsize=8, loc="upper left", framealpha=1.0)


RUNS = 8
OTHER_RESTITUTIONS = (0.3, 0.7)
OTHER_FRICTIONS = (0.1, 0.5)
PICTURED_HZ = (7459.0, 14917.0)


def none_as_nan(value: float | None) -> float:
    return math.nan if value is None else value


def say(line: str) -> None:
    print(line, file=sys.stderr, flush=True)


def study(assumed: Assumed, runs: int, *, others: bool) -> tuple[list[Steps], dict[str, Any]]:
    modes = chladni_modes()
    every, rows = [], []
    for note in NOTES_HZ:
        field = note_field(modes, note, assumed)
        steps = find_amplitude(field, note, runs, assumed, say)
        row = as_row(steps, profile(steps)) | {"lag": lag(modes, note, assumed)}
        row["gradient_cosine"] = sensitivity(modes, note, assumed)
        if others:
            changed = {f"restitution {e:g}": replace(assumed, restitution=e) for e in OTHER_RESTITUTIONS}
            changed |= {f"friction {mu:g}": replace(assumed, friction=mu) for mu in OTHER_FRICTIONS}
            row["other"] = {
                name: beside(steps, find_amplitude(field, note, runs, each, say)) for name, each in changed.items()
            }
        every.append(steps)
        rows.append(row)
    return every, {
        "assumed": assumed.__dict__,
        "runs": runs,
        "notes": rows,
        "profile": as_table(together([profile(steps) for steps in every])),
    }


def beside(steps: Steps, other: Steps) -> dict[str, float]:
    """The same note under another assumption: its amplitude, and how far its steps differ, over their rms."""
    apart = np.hypot(*(steps.step - other.step).T)
    return {
        "amplitude_um": 1e6 * other.amplitude,
        "mean_cosine": other.cosine,
        "share": share(other),
        "steps_apart": float(np.sqrt((apart**2).mean() / (steps.length**2).mean())),
    }


def print_report(table: dict[str, Any]) -> None:
    print("note   drive   amplitude  A w2/g  cosine  median  spread  lost  share  correlation with  lag")
    print("[Hz]   [Hz]    [um]                       [mm]    [mm]                 grad A  grad A2")
    for row in table["notes"]:
        spread = none_as_nan(row["spread_mm"])
        print(
            f"{row['note_hz']:<6g} {row['drive_hz']:<7.0f} {row['amplitude_um']:<10.2f} {row['throw_number']:<7.0f} "
            f"{row['mean_cosine']:<7.4f} {row['median_step_mm']:<7.3f} {spread:<7.3f} {row['lost']:<5} "
            f"{row['share']:<6.3f} {row['correlation_slope']:<7.3f} {row['correlation_gradient']:<9.3f} "
            f"{100 * row['lag']:.1f} %"
        )
    print(
        "\ndistance to the node over a quarter of the wavelength; means of step, |grad A|, |grad A^2|, over their means"
    )
    lengths = [table["profile"][name] for name in ("step", "slope", "gradient")]
    for low, high, *means in zip(BIN_EDGES[:-1], BIN_EDGES[1:], *lengths, strict=True):
        print(f"{low:.1f} - {high:.1f}" + "".join(f"{mean:>7.2f}" for mean in means))
    print("\nmean cosine with the bare gradient under other assumptions")
    for name in table["notes"][0]["gradient_cosine"]:
        print(f"{name:<22}" + "".join(f"{row['gradient_cosine'][name]:>7.2f}" for row in table["notes"]))
    for name in table["notes"][0].get("other", ()):
        for what, text in (
            ("amplitude_um", "um"),
            ("mean_cosine", "cosine"),
            ("share", "share"),
            ("steps_apart", "steps apart"),
        ):
            values = "".join(f"{row['other'][name][what]:>8.3f}" for row in table["notes"])
            print(f"{name + ', ' + text:<30}{values}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    default = Assumed()
    parser.add_argument("--out", type=new_file, help="CSV file of the steps")
    parser.add_argument("--picture", type=new_file)
    parser.add_argument("--json", action="store_true")
    runs = f"at each place [{RUNS}]"
    parser.add_argument("--runs", type=int, choices=range(1, 101), metavar="N", default=RUNS, help=runs)
    ranges = {
        "restitution": (default.restitution, 0.0, 0.9),
        "friction": (default.friction, 0.0, 2.0),
        "damping": (default.damping_ratio, 1e-5, 0.1),
        "scale": (default.frequency_scale, 0.9, 1.1),
    }
    for name, (usual, low, high) in ranges.items():
        parser.add_argument(f"--{name}", type=between(low, high), default=usual, help=f"[{usual:g}]")
    parser.add_argument("--quick", action="store_true", help="leave out other restitutions and frictions")
    options = parser.parse_args()
    assumed = Assumed(options.restitution, options.friction, options.damping, options.scale)
    try:
        every, table = study(assumed, options.runs, others=not options.quick)
    except InputError as error:
        parser.error(str(error))
    if options.out:
        with options.out.open("w", encoding="utf-8", newline="") as file:
            write_steps(every, file)
    if options.picture:
        save_chladni_plate([steps for steps in every if steps.note in PICTURED_HZ], every, options.picture)
    if options.json:
        print(json.dumps(table))
    else:
        print_report(table)


if __name__ == "__main__":
    main()
