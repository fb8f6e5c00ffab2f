"""How well pulses are predicted: random pulses of one nut at random places, and the share that fits them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from feeder_sim.feeder.feeder import Feeder
from feeder_sim.scenario import Scattered
from feeder_sim.studies.closed_loop.letter import MIDDLE, letter_scenario
from feeder_sim.studies.closed_loop.prediction import GradientDrift, MapDrift
from feeder_sim.studies.drift_map.drift_map import DriftMap

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
