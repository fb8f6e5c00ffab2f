"""Recipes to begin a search with: those of a large sample that a drift map brings to the goal soonest.

A walk of a drift map costs a small part of a full run, and is a few percent off where the map holds. So it finds where
to look, and full runs decide.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from feeder_sim.errors import InputError
from feeder_sim.run.prepare import prepare
from feeder_sim.scenario import Scenario
from feeder_sim.scene.prepared import Prepared
from feeder_sim.scene.start import start_poses
from feeder_sim.studies.drift_map.drift_map import DriftMap
from feeder_sim.studies.drift_map.files import load_map
from feeder_sim.studies.drift_map.walk import walk
from feeder_sim.studies.search.search import GENERATION
from feeder_sim.studies.search.space import Space
from feeder_sim.studies.search.trials import Aim
from feeder_sim.studies.sweep.design import Point

MEASURE = "arrival_time_s"  # the one that a walk can tell
WALKERS = 24  # of a recipe; all of them have to arrive


def first_recipes(
    space: Space, aim: Aim, map_file: Path, recipes: int, progress: Callable[[float], None] | None = None
) -> list[Point]:
    """The recipes of `screened` that a search begins with besides the present one.

    Raises:
        InputError: as `screened`, or the file holds no drift map.
    """
    return screened(space, aim, load_map(map_file), recipes, GENERATION, progress)


def screened(
    space: Space,
    aim: Aim,
    drift_map: DriftMap,
    recipes: int,
    count: int,
    progress: Callable[[float], None] | None = None,
) -> list[Point]:
    """The best of a scrambled Sobol sample of recipes, best first.

    Args:
        space: what may be changed.
        aim: has to be the least time of arrival.
        drift_map: of the part and contact of the scenario, and the thickness of its plate.
        recipes: in the sample, rounded up to a power of two.
        count: how many to return; fewer where fewer recipes bring all walkers to the goal.
        progress: called with the share that is done.

    Raises:
        InputError: another aim, no goal, several parts, or a map that covers none of the recipes.
    """
    if aim.measure != MEASURE or aim.largest:
        raise InputError(f"screens for the least {MEASURE} only, which a drift map can tell", argument="screen")
    if space.scenario.goal is None or space.scenario.n_parts > 1:
        raise InputError("needs a [goal] and a single part, which a drift map moves", argument="screen")
    from scipy.stats import qmc  # takes a second to import

    exponent = max(1, int(np.ceil(np.log2(recipes))))
    shares = qmc.Sobol(len(space.parameters), rng=space.scenario.run.seed).random_base2(exponent)
    arrivals: list[tuple[float, Point]] = []
    refused: InputError | None = None
    for number, row in enumerate(shares):
        point = {p.key: p.at(float(share)) for p, share in zip(space.parameters, row, strict=True)}
        try:
            arrival = _arrival(drift_map, space.changed(point), number)
        except InputError as error:  # beyond the map, or no recipe
            refused = error
        else:
            if np.isfinite(arrival):
                arrivals.append((arrival, point))
        if progress:
            progress((number + 1) / len(shares))
    if not arrivals and refused is not None:
        raise refused
    return [point for _, point in sorted(arrivals, key=lambda pair: pair[0])[:count]]


def _arrival(drift_map: DriftMap, scenario: Scenario, number: int) -> float:
    """Mean time of arrival [s]; infinite if a walker does not arrive."""
    prepared = prepare(scenario)
    rng = np.random.default_rng([scenario.run.seed, number])
    starts = _starts(prepared, rng)
    walked = walk(drift_map, prepared, starts, rng)
    goal = scenario.goal
    assert goal is not None
    away = walked.points - 1e-3 * np.array([goal.x_mm, goal.y_mm or 0.0])
    distance = np.abs(away[:, 0]) if goal.y_mm is None else np.hypot(*away.T)
    arrived = ~walked.lost & (np.nan_to_num(distance, nan=np.inf) <= 1e-3 * goal.within_mm)
    return float(walked.total.mean()) if arrived.all() else np.inf


def _starts(prepared: Prepared, rng: np.random.Generator) -> np.ndarray:
    """Places (walkers, 2) [m] as seeds would draw them."""
    return np.array([start_poses(prepared.scene, rng)[0].position[:2] for _ in range(WALKERS)])
