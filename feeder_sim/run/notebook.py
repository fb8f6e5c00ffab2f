"""A small Jupyter notebook about the scenario beside it: load, check, simulate, measure, draw the modes."""

from __future__ import annotations

from typing import Any

from feeder_sim.scenario import Scenario
from feeder_sim.scenario.paths import input_files

_LOAD = """\
import feeder_sim

scenario = feeder_sim.load_scenario("scenario.toml")
prepared = feeder_sim.prepare(scenario)
print(scenario.title)
print("engine:", prepared.engine.name, "-", prepared.engine.reason)
print("cautions:", *(prepared.cautions or ["none"]), sep="\\n  ")"""
_SIMULATE = """\
result = feeder_sim.simulate(scenario.changed({{"run.seeds": {seeds}}}))
print(*result.lines(), sep="\\n")"""
_MEASURES = """\
from IPython.display import display

display(*(found for _, found in result.findings))"""
_DRAW = """\
import matplotlib.pyplot as plt
import numpy as np

surface = prepared.scene.surface
x, y = (np.linspace(-0.5 * side, 0.5 * side, 121) for side in (surface.length, surface.width))
points = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
labels = {mode.drive.shape: mode.label for mode in prepared.scene.driven}
figure, grid = plt.subplots(1, max(1, len(labels)), squeeze=False, figsize=(4 * max(1, len(labels)), 3.5))
for axes, (shape, label) in zip(grid[0], labels.items()):
    deflection = surface.deflection(shape, points).reshape(len(x), len(y))
    largest = abs(deflection).max()
    axes.pcolormesh(1e3 * x, 1e3 * y, deflection.T, cmap="RdBu", vmin=-largest, vmax=largest)
    if deflection.min() < 0.0 < deflection.max():
        axes.contour(1e3 * x, 1e3 * y, deflection.T, levels=[0.0], colors="black")  # nodal lines
    axes.set(title=label, xlabel="x (mm)", ylabel="y (mm)", aspect="equal")"""
FEW_SEEDS = 4


def notebook(scenario: Scenario) -> dict[str, Any]:
    """The notebook as JSON takes it (nbformat 4.5)."""
    seeds = min(FEW_SEEDS, scenario.run.seeds)
    own_modes = "plate.mode_file" in input_files(scenario)
    again = (
        " After a change of `plate.toml`: `feeder-sim modes plate.toml --out modes.h5 --force`." if own_modes else ""
    )
    cells = [
        _words("intro", f"# {scenario.title or 'A scenario'}\n\nIn `scenario.toml` is what is simulated.{again}"),
        _code("load", _LOAD),
        _words("simulate-words", "A few seeds: starts differ, and hops are chaotic. Ask for more when it matters."),
        _code("simulate", _SIMULATE.format(seeds=seeds)),
        _words("measures-words", "All measures, with mean, standard deviation, standard error and number of values:"),
        _code("measures", _MEASURES),
        _words(
            "modes-words", "The modes that are driven. Parts hop where the colour is strong, and drift to the lines."
        ),
        _code("modes", _DRAW),
    ]
    kernel = {"kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"}}
    return {"cells": cells, "metadata": kernel, "nbformat": 4, "nbformat_minor": 5}


def _words(name: str, text: str) -> dict[str, Any]:
    return {"cell_type": "markdown", "id": name, "metadata": {}, "source": _lines(text)}


def _code(name: str, text: str) -> dict[str, Any]:
    more: dict[str, Any] = {"execution_count": None, "outputs": []}
    return {"cell_type": "code", "id": name, "metadata": {}, "source": _lines(text)} | more


def _lines(text: str) -> list[str]:
    return text.splitlines(keepends=True)
