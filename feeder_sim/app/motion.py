"""What the page shows of a plate's motion: modes, their fields on a grid, and where parts will drift.

The drift is that of the first law of drift maps: v = c omega h/2 times the slope of the amplitude, towards where the
plate moves less, wherever its acceleration is above gravity. It takes no run, so that it follows the mouse.
"""

from __future__ import annotations

import base64
import dataclasses
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from contourpy import contour_generator
from numpy.typing import NDArray

from feeder_sim.constants import GRAVITY
from feeder_sim.errors import InputError
from feeder_sim.plate.actuators import Actuator, modal_force_table
from feeder_sim.plate.mode_file import ModeFile, read_mode_file
from feeder_sim.plate.response import deflection_at, modal_forces, oscillators
from feeder_sim.scenario import BendingPlate, ModePlate, Scenario
from feeder_sim.scene.mode_cache import modes_of_plate

POINTS = 61  # of the grid, per axis
DRIFT = 0.7  # c of the law; +- 0.1
STILL = 0.3  # of the largest amplitude; nodal lines are drawn where what moves out of phase is smaller
HIGHEST_HZ = 8000.0  # modes that are shown where a plate does not say how far


def displayed_modes(scenario: Scenario) -> ModeFile:
    """The modes of the plate of a scenario.

    Raises:
        InputError: it has none, or they cannot be computed.
    """
    plate = scenario.plate
    if isinstance(plate, BendingPlate):
        highest = max((drive.frequency_hz for _, drive in scenario.excitations), default=0.0)
        return modes_of_plate(plate.as_file(plate.highest_frequency_hz or max(HIGHEST_HZ, 1.2 * highest)))
    if isinstance(plate, ModePlate):
        return read_mode_file(plate.mode_file)
    problem = f'is "{plate.kind}", whose modes the page does not show; must be "plate" or "modes"'
    raise InputError(problem, key="plate.kind")


class Motion:
    """The modes of a plate on a grid, and what they make of voltages."""

    def __init__(self, mode_file: ModeFile) -> None:
        self.mode_file, self.oscillators = mode_file, oscillators(mode_file)
        modes, plate = mode_file.modes, mode_file.modes.plate
        self.x, self.y = (np.linspace(-0.5, 0.5, POINTS) * side for side in (plate.length, plate.width))
        self.shapes = np.stack([modes.evaluate_grid(j, self.x, self.y)[0] for j in range(len(modes))])
        places = np.stack(np.meshgrid(self.x, self.y, indexing="ij"), axis=-1)
        outline = modes.outline
        self.on_plate = np.full((POINTS, POINTS), True) if outline is None else outline.holds(places)
        self.forces = modal_forces(mode_file) if mode_file.actuators else np.zeros((len(modes), 0))
        self.stiffened = 1.0

    def learn(self, scenario: Scenario) -> None:
        """Take in how much less patches of this plate do for stiffening it where they are, all of them together.

        `moved` needs it: the modes know of stiffness where patches were, not of where one is dragged.
        """
        plate = scenario.plate
        if isinstance(plate, BendingPlate) and plate.actuator:
            loose = tuple(actuator.model_copy(update={"loads": False}) for actuator in plate.actuator)
            bare = displayed_modes(scenario.model_copy(update={"plate": plate.model_copy(update={"actuator": loose})}))
            bare_forces = modal_force_table(bare.modes, self.mode_file.actuators)
            self.stiffened = float(np.sqrt((self.forces**2).sum() / (bare_forces**2).sum()))

    def moved(self, index: int, at: tuple[float, float]) -> NDArray[np.float64]:
        """Modal forces [N/V] with one patch at another place [m], about: see `learn`; frequencies stay as they are."""
        actuators: list[Actuator] = list(self.mode_file.actuators)
        layer = dataclasses.replace(actuators[index].layer, centre=at)
        actuators[index] = dataclasses.replace(actuators[index], layer=layer)
        forces = self.forces.copy()
        forces[:, index] = self.stiffened * modal_force_table(self.mode_file.modes, [actuators[index]])[:, 0]
        return forces

    def driven(
        self, frequency: float, volts_vpp: float, names: Sequence[str], forces: NDArray[np.float64] | None = None
    ) -> NDArray[np.complex128]:
        """Modal coordinates (n_modes,) [m] under a voltage of some actuators, in phase, at a frequency [Hz]."""
        force = (self.forces if forces is None else forces) @ self.voltages(volts_vpp, names)
        return self.oscillators.modal_coordinates(np.array([frequency]), force)[0]

    def voltages(self, volts_vpp: float, names: Sequence[str]) -> NDArray[np.complex128]:
        """Complex amplitude of every actuator [V]."""
        return np.array([0.5 * volts_vpp * (a.name in names) for a in self.mode_file.actuators], complex)

    def of_mode(self, mode: int, amplitude: float) -> NDArray[np.complex128]:
        """Modal coordinates of one mode alone, by its amplitude [m]."""
        return np.where(np.arange(len(self.mode_file.modes)) == mode, amplitude, 0.0).astype(complex)

    def measured(self, mode: int, volts_vpp: float) -> float | None:
        """Amplitude of the antinode of a mode [m] by its measured gain; None where there is none."""
        for resonance in self.mode_file.resonances:
            if resonance.mode == mode and math.isfinite(resonance.gain):
                at = deflection_at(self.mode_file.modes, mode, resonance.driven_point, "resonance.driven_point_mm")
                return resonance.gain * volts_vpp / at
        return None

    def field(self, q: NDArray[np.complex128], frequency: float) -> dict[str, Any]:
        """The motion as the page draws it, and its largest amplitude and hop in words."""
        w = np.tensordot(q, self.shapes, axes=1)
        amplitude = np.abs(w)
        peak = float(amplitude[self.on_plate].max()) or 1e-300
        # As nearly real as a common phase makes it, so that red and blue are opposite.
        w = w * np.exp(-0.5j * np.angle((w[self.on_plate] ** 2).sum())) / peak
        omega = 2.0 * math.pi * frequency
        slope = np.gradient(amplitude, self.x, self.y)
        hops = self.on_plate & (amplitude * omega**2 > GRAVITY)
        speed = -1e3 * DRIFT * omega * 0.5 * self.mode_file.modes.plate.thickness * np.where(hops, slope, 0.0)
        arrays = {"re": w.real, "im": w.imag, "vx": speed[0], "vy": speed[1]}
        largest = np.hypot(*speed)[self.on_plate].max()
        words = f"{frequency:.5g} Hz: up to {1e6 * peak:.3g} µm, {peak * omega**2 / GRAVITY:.4g} g; "
        words += f"parts drift at up to {largest:.2g} mm/s" if hops.any() else "parts stay where they are"
        standing = np.abs(w.imag[self.on_plate]).max() < STILL
        lines = contour_generator(self.x, self.y, w.real.T).lines(0.0) if standing else []
        drawn = [(1e3 * np.asarray(line)).round(2).tolist() for line in lines]
        field = {name: _packed(array) for name, array in arrays.items()}
        return field | {"nx": POINTS, "ny": POINTS, "words": words, "lines": drawn}


def _packed(array: NDArray[np.float64]) -> str:
    return base64.b64encode(np.clip(array, -1e6, 1e6).astype("<f4").tobytes()).decode()
