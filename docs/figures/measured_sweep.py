"""A synthetic sweep of an LCR meter, 1 % of noise, and the resonances that are fitted to it.

    python docs/figures/measured_sweep.py [--csv FILE]

Makes docs/figures/measured_sweep.png. The sweep is that of the patch in the centre of models/plate_180_piezos.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from feeder_sim.plate.impedance_fit import Sweep, fit_sweep
from feeder_sim.plate.mode_file import read_mode_file
from feeder_sim.plate.response import frequency_response, voltages
from feeder_sim.plots.pictures import draw_fit

HERE = Path(__file__).parent
LOW, HIGH, STEP = 500.0, 4000.0, 0.25  # [Hz]


def main(csv: Annotated[Path | None, typer.Option(help="Write the sweep to this file, too.")] = None) -> None:
    held = read_mode_file(HERE.parents[1] / "models/plate_180_piezos/modes.h5")
    response = frequency_response(held, voltages(held, ["centre"], 50.0, [0.0]), low=LOW, high=HIGH)
    frequency = np.arange(LOW, HIGH, STEP)
    clean = np.interp(frequency, response.frequency, np.log(response.impedance.real))
    resistance = np.exp(clean + 0.01 * np.random.default_rng(0).standard_normal(len(frequency)))
    sweep = Sweep(frequency, resistance, None)
    fit = fit_sweep(sweep, held.actuators[0].capacitance)
    draw_fit(sweep, fit, HERE / "measured_sweep.png", title="Series resistance of the patch in the centre")
    if csv is not None:
        table = np.column_stack([frequency, resistance])
        np.savetxt(csv, table, "%.6g", delimiter=",", header="frequency_hz,resistance_ohm", comments="")


if __name__ == "__main__":
    typer.run(main)
