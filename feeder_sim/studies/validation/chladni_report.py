"""What the steps of balls on the plate of chladni_plate.py say: how they follow the bare gradient of its motion.

The bare gradient is -grad A^2 of the squared amplitude, which points to the nodes. Its length is 0 on them, and that of
the steps is not: a ball that hops is carried by the motion of the surface in its plane, of the amplitude
(h / 2) w |grad A|, of which it gets a share.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, TextIO

import numpy as np
from numpy.typing import NDArray

from feeder_sim.measures.statistic import finite_or_none
from feeder_sim.plate.actuators import Actuator
from feeder_sim.plate.materials import Material
from feeder_sim.plate.mode_shapes import standing_wave
from feeder_sim.plate.modes import PlateModes
from feeder_sim.plate.nodal_lines import nodal_lines
from feeder_sim.plate.ritz.attachments import Layer
from feeder_sim.studies.validation.chladni_plate import NOTE_S, Assumed, Steps, mean_cosine, note_field, start_points
from feeder_sim.studies.validation.forced_field import Force, forced_field, triangle_terms

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
