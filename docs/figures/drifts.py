"""Draws measured and computed drift speeds, one dot per seed: `python docs/figures/drifts.py` (minutes)."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import feeder_sim
from feeder_sim.document.figure import empty_figure
from feeder_sim.measures.drift import transport_speed
from feeder_sim.scenario import with_run

HERE = Path(__file__).parent
SCENARIOS = HERE.parents[1] / "scenarios"
# mean and standard deviation of six runs [mm/s]: D. Shi, EPFL thesis TH7124, 2016
MEASURED = {"drift_4750hz": (1.44, 0.27), "drift_8775hz": (4.17, 0.64)}
SEEDS = {"impulse": 48, "mujoco": 12}
COLOURS = {"impulse": "#c23030", "mujoco": "#1f5fa8"}
SPREAD = 0.09  # of the dots beside each other


def main() -> None:
    figure = empty_figure(8.0, 3.6)
    for axes, (name, (mean, deviation)) in zip(figure.subplots(1, 2), MEASURED.items(), strict=True):
        axes.errorbar([0], [mean], [deviation], fmt="o", color="black", capsize=5)
        for place, (engine, seeds) in enumerate(SEEDS.items(), 1):
            scenario = with_run(feeder_sim.load_scenario(SCENARIOS / f"{name}.toml"), engine=engine, seeds=seeds)
            result = feeder_sim.simulate(scenario)
            cell = result.prepared.cell
            assert cell is not None
            speed = np.array([1e3 * transport_speed(seed.frames, cell) for seed in result.seeds])
            beside = place + SPREAD * np.linspace(-1.0, 1.0, len(speed))
            axes.plot(beside, speed, ".", color=COLOURS[engine], alpha=0.5)
            axes.plot([place - 0.2, place + 0.2], [speed.mean()] * 2, color=COLOURS[engine])
        labels = ["measured", *(f"{engine}\n{seeds} seeds" for engine, seeds in SEEDS.items())]
        axes.set_xticks(range(3), labels)
        hertz = name.removeprefix("drift_").removesuffix("hz")
        axes.set(xlim=(-0.5, 2.5), ylim=(0.0, None), ylabel="transport speed (mm/s)", title=f"{hertz} Hz, 1.00 µm")
        axes.grid(True, axis="y", alpha=0.3)
    figure.savefig(HERE / "drifts.png", dpi=130)


if __name__ == "__main__":
    main()
