"""How the plate rings up at 558 Hz, and its resonance curve about 2797 Hz, beside what the source saw.

    python benchmarks/resonance.py [--uncertainty 0.1] [--picture FILE] [--json]

Ring-up: `models/plate_180` driven at 558 Hz and 100 V peak to peak. The surface that a run moves is sampled at its
middle, and the time is taken from which on its extremes stay above 90, 95 and 98 % of the settled ones. Beside it stand
the time of A (1 - exp(-zeta omega t)), and its interval for a damping ratio that is known within 10 %. The source
(D. Shi, EPFL thesis TH7124, 2016) saw a ring-up of about 0.4 s.

Resonance curve: `models/plate_180_piezos` driven by its patch in the middle at 100 V peak to peak. The file has no gain
there, only frequency and damping ratio, so that the height follows from the moment per volt, which was calibrated at
558 Hz. The source drew 2790 to 2806 Hz, had 20.62 um by finite elements and measured 19.70 um. Takes 15 s.
"""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from numpy.typing import NDArray

from feeder_sim.document.figure import UM, Figure
from feeder_sim.plate.mode_file import read_mode_file
from feeder_sim.plate.response import Response, frequency_response, oscillators, voltages
from feeder_sim.scenario import Ball, Drive, Rectangle, Run, Scenario
from feeder_sim.scene.scene import Scene, build_scene

MODELS = Path(__file__).parents[1] / "models"
VPP = 100.0

RING_UP_HZ = 558.0
SAMPLED_S = 1.5
PER_PERIOD = 80  # samples; between two of them the extreme is off by less than 1e-3
LEVELS = (0.90, 0.95, 0.98)
SOURCE_RING_UP_S = 0.4

LOW_HZ, HIGH_HZ = 2790.0, 2806.0
PRINTED_HZ = (2790.0, 2794.0, 2797.0, 2800.0, 2806.0)
SOURCE_ELEMENTS, SOURCE_MEASURED = 20.62e-6, 19.70e-6  # [m]


@dataclass(frozen=True)
class RingUp:
    """The plate from the moment on at which its drive is switched on.

    Attributes:
        time: of the extremes of the surface (n,) [s].
        extreme: |w| there [m].
        settled: the last of them [m].
        damping_ratio: [1].
    """

    time: NDArray[np.float64]
    extreme: NDArray[np.float64]
    settled: float
    damping_ratio: float

    def reaches(self, level: float) -> float:
        """Time [s] at which the extremes rise above a share of the settled one for good."""
        after = int(np.flatnonzero(self.extreme < level * self.settled)[-1])
        two = slice(after, after + 2)
        return float(np.interp(level * self.settled, self.extreme[two], self.time[two]))


def closed_form(level: float, damping_ratio: float) -> float:
    """Time [s] at which 1 - exp(-zeta omega t) reaches a level."""
    return -math.log(1.0 - level) / (damping_ratio * 2.0 * math.pi * RING_UP_HZ)


@dataclass(frozen=True)
class Reached:
    """When a level is reached, each time in [s].

    Attributes:
        level: of the settled amplitude [1].
        time: on the sampled surface.
        closed_form: by the exponential.
        low, high: by the exponential, over the interval of the damping ratio.
    """

    level: float
    time: float
    closed_form: float
    low: float
    high: float


def reached(rise: RingUp, level: float, uncertainty: float) -> Reached:
    """Times of a level, with a relative uncertainty of the damping ratio."""
    factors = (1.0, 1.0 + uncertainty, 1.0 - uncertainty)
    return Reached(level, rise.reaches(level), *(closed_form(level, factor * rise.damping_ratio) for factor in factors))


def ring_up_scene() -> Scene:
    """The plate alone; a scene needs a part, which moves nothing."""
    return build_scene(
        Scenario(
            plate=Rectangle(kind="rectangle", mode_file=MODELS / "plate_180/modes.h5"),
            drive=(Drive(frequency_hz=RING_UP_HZ, voltage_vpp=VPP),),
            part=(Ball(shape="ball", diameter_mm=3.0, material="steel"),),
            run=Run(duration_s=SAMPLED_S),
        )
    )


def ring_up() -> RingUp:
    """Sample the surface under the middle of the plate."""
    scene = ring_up_scene()
    (driven,) = scene.drives
    times = np.arange(round(SAMPLED_S * RING_UP_HZ) * PER_PERIOD) / (PER_PERIOD * RING_UP_HZ)
    height = np.abs(scene.surface.heights(np.zeros((len(times), 2)), times)).reshape(-1, PER_PERIOD // 2)
    at = height.argmax(axis=1)
    rows = np.arange(len(height))
    assert driven.damping_ratio is not None
    extreme = height[rows, at]
    return RingUp(times.reshape(height.shape)[rows, at], extreme, float(extreme[-1]), driven.damping_ratio)


@dataclass(frozen=True)
class Curve:
    """The resonance curve, at the patch that drives it.

    Attributes:
        response: between `LOW_HZ` and `HIGH_HZ`.
        peak_frequency: [Hz].
        peak: [m].
        half_power_width: of the frequencies at which the power has fallen to a half [Hz].
        damping_ratio: that the file gives [1].
    """

    response: Response
    peak_frequency: float
    peak: float
    half_power_width: float
    damping_ratio: float

    def amplitude(self, frequency: float) -> float:
        """Amplitude [m] at a frequency [Hz]."""
        return float(np.interp(frequency, self.response.frequency, self.response.amplitude))


def resonance_curve() -> Curve:
    """Amplitude in the middle of the plate, driven by the patch there."""
    plate = read_mode_file(MODELS / "plate_180_piezos/modes.h5")
    volts = voltages(plate, ["centre"], 0.5 * VPP, [0.0])
    response = frequency_response(plate, volts, low=LOW_HZ, high=HIGH_HZ, point=(0.0, 0.0))
    peak = max(response.peaks, key=lambda each: each.amplitude)
    width = 2.0 * peak.damping_ratio * peak.frequency
    return Curve(response, peak.frequency, peak.amplitude, width, float(oscillators(plate).damping_ratio[peak.mode]))


def draw(rise: RingUp, curve: Curve, uncertainty: float, path: Path) -> None:
    """Draw the ring-up with its interval, and the resonance curve."""

    def draw_ring_up(axes: Any) -> None:
        t = np.linspace(0.0, 1.0, 201)
        rate = rise.damping_ratio * 2.0 * math.pi * RING_UP_HZ
        low, high = (1.0 - np.exp(-rate * factor * t) for factor in (1.0 - uncertainty, 1.0 + uncertainty))
        axes.fill_between(t, 100.0 * low, 100.0 * high, color="#3a60be", alpha=0.25, linewidth=0.0)
        shown = rise.time <= t[-1]
        axes.plot(rise.time[shown], 100.0 * rise.extreme[shown] / rise.settled, color="#3a60be", linewidth=1.2)
        for level in LEVELS:
            axes.plot(rise.reaches(level), 100.0 * level, ".", color="#1d2733")
        axes.axvline(SOURCE_RING_UP_S, color="#be3434", linewidth=0.9, linestyle="--", label="source, about 0.4 s")
        axes.set(xlabel="time (s)", ylabel="amplitude (% of settled)", xlim=(0.0, t[-1]), ylim=(0.0, 102.0))
        axes.set_title(f"{RING_UP_HZ:g} Hz, damping ratio {rise.damping_ratio:g} ± {100.0 * uncertainty:g} %")
        axes.legend(loc="lower right")
        axes.grid(True, alpha=0.3)

    def draw_curve(axes: Any) -> None:
        axes.plot(curve.response.frequency, UM * curve.response.amplitude, color="#3a60be", label="predicted")
        for height, label, marker in (
            (SOURCE_ELEMENTS, "source, finite elements", "^"),
            (SOURCE_MEASURED, "source, measured", "o"),
        ):
            axes.plot(curve.peak_frequency, UM * height, marker, color="#be3434", markersize=4.0, label=label)
        axes.set(xlabel="frequency (Hz)", ylabel="amplitude (µm)", xlim=(LOW_HZ, HIGH_HZ), ylim=(0.0, 22.0))
        axes.set_title(f"{VPP:g} V peak to peak at the middle patch")
        axes.legend(loc="lower center")
        axes.grid(True, alpha=0.3)

    def draw_both(figure: Any) -> None:
        left, right = figure.subplots(1, 2)
        draw_ring_up(left)
        draw_curve(right)

    path.write_bytes(Figure(draw_both, 2.9, alt="", caption="").picture.content)


def main(
    uncertainty: Annotated[float, typer.Option(help="of the damping ratio, relative", min=0.0, max=0.5)] = 0.1,
    picture: Annotated[Path | None, typer.Option(help="draw both")] = None,
    as_json: Annotated[bool, typer.Option("--json")] = False,
) -> None:
    rise, curve = ring_up(), resonance_curve()
    zeta = rise.damping_ratio
    rows = [reached(rise, level, uncertainty) for level in LEVELS]
    amplitudes = {f"{frequency:g}": curve.amplitude(frequency) for frequency in PRINTED_HZ}
    window = HIGH_HZ - LOW_HZ
    bandwidth = 2.0 * curve.damping_ratio * curve.peak_frequency
    if picture is not None:
        draw(rise, curve, uncertainty, picture)
    if as_json:
        peak = {
            "frequency_hz": curve.peak_frequency,
            "amplitude_m": curve.peak,
            "half_power_hz": curve.half_power_width,
        }
        print(
            json.dumps(
                {
                    "ring_up": [asdict(row) for row in rows],
                    "settled_m": rise.settled,
                    "curve_m": amplitudes,
                    "peak": peak,
                }
            )
        )
        return
    print(f"ring-up at {RING_UP_HZ:g} Hz, damping ratio {zeta:g}, settled at {UM * rise.settled:.2f} um")
    print(f"of settled   time (s)   1 - exp(-zeta w t)   damping ratio +-{100.0 * uncertainty:g} %")
    for row in rows:
        print(
            f"{100.0 * row.level:>8.0f} %   {row.time:.3f}      {row.closed_form:.3f}                "
            f"{row.low:.3f} to {row.high:.3f}"
        )
    then = 100.0 * (1.0 - math.exp(-zeta * 2.0 * math.pi * RING_UP_HZ * SOURCE_RING_UP_S))
    print(f"at the source's {SOURCE_RING_UP_S:g} s it has {then:.1f} %")
    print(f"resonance curve, {VPP:g} V peak to peak, damping ratio {curve.damping_ratio:g}")
    for name, amplitude in amplitudes.items():
        print(f"{name:>8} Hz   {UM * amplitude:6.2f} um   {100.0 * amplitude / curve.peak:5.1f} % of the maximum")
    print(f"maximum {UM * curve.peak:.2f} um at {curve.peak_frequency:.2f} Hz")
    for name, value in (("by finite elements", SOURCE_ELEMENTS), ("measured", SOURCE_MEASURED)):
        print(f"source {name} {UM * value:.2f} um, prediction {100.0 * (curve.peak / value - 1.0):+.1f} %")
    print(f"half-power width {curve.half_power_width:.2f} Hz, 2 zeta f {bandwidth:.2f} Hz")
    print(f"the window of {window:g} Hz is {window / bandwidth:.2f} bandwidths")


if __name__ == "__main__":
    typer.run(main)
