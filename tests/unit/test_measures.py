from __future__ import annotations

import gc
import inspect
import math
import re
import weakref

import numpy as np
import pytest
from conftest import REPOSITORY, piston_scenario, resting, strip_scenario

from feeder_sim.errors import InputError
from feeder_sim.measures.catalogue import MEASURES
from feeder_sim.measures.drift import drift_velocity, first_passage, transport_speed
from feeder_sim.measures.stage_lines import once_for_scene
from feeder_sim.measures.statistic import Statistic
from feeder_sim.records.trajectory import Frames
from feeder_sim.run.simulation import simulate
from feeder_sim.scene.cell import transport_cell
from feeder_sim.scene.scene import Scene, build_scene


def moving(x: np.ndarray, time: np.ndarray) -> Frames:
    position = np.zeros((len(time), 1, 3))
    position[:, 0, 0] = x
    return resting(time, position)


def test_uniform_motion_gives_its_own_speed() -> None:
    cell = transport_cell(build_scene(strip_scenario()))
    assert cell is not None
    time = np.linspace(0.0, 20.0, 5000)
    assert transport_speed(moving(1e-3 * time, time), cell) == pytest.approx(1e-3, rel=1e-6)
    assert drift_velocity(moving(1e-3 * time, time)) == pytest.approx([1e-3, 0.0])


def test_first_passage_counts_when_the_part_turns_back() -> None:
    time, way = np.array([0.0, 1.0, 2.0, 3.0, 4.0]), np.array([1.0, 0.7, 0.9, 0.5, 0.1])
    assert first_passage(time, way, 0.8) == pytest.approx(2 / 3)
    assert first_passage(time, way, 0.2) == pytest.approx(3.75)


def test_what_is_made_of_a_scene_is_made_once_for_it() -> None:
    one, other = (build_scene(strip_scenario()) for _ in range(2))
    asked: list[int] = []

    def number(scene: Scene) -> int:
        asked.append(id(scene))
        return len(asked)

    remembered = once_for_scene(number)
    assert [remembered(scene) for scene in (one, one, other, other, one)] == [1, 1, 2, 2, 3]
    assert asked == [id(one), id(other), id(one)]
    gone = weakref.ref(one)
    del one
    gc.collect()
    assert gone() is None  # it does not keep the scene


def test_a_part_that_never_arrives_has_no_speed() -> None:
    cell = transport_cell(build_scene(strip_scenario()))
    assert cell is not None
    time = np.linspace(0.0, 5.0, 100)
    assert math.isnan(transport_speed(moving(1e-3 * time, time), cell))


def test_statistic_of_finite_values_only() -> None:
    found = Statistic.of([1.0, 2.0, math.nan, 3.0])
    assert (found.mean, found.sd, found.n) == (2.0, 1.0, 3)
    assert found.se == pytest.approx(1 / math.sqrt(3))
    assert Statistic.of([]).as_dict() == {"mean": None, "sd": None, "se": None, "n": 0}


def test_passage_rule_needs_a_node_and_a_start_before_the_line() -> None:
    with pytest.raises(InputError, match=r"run\.stop"):
        simulate(piston_scenario(stop="passage"))
    with pytest.raises(InputError, match=r"start\.position_mm"):
        simulate(strip_scenario(x_mm=8.0, stop="passage"))


def test_all_findings_are_in_the_docs() -> None:
    """Of every measure of the package, by what its `findings` says that it returns."""
    text = (REPOSITORY / "docs/api.md").read_text()
    returned = {str(inspect.signature(type(measure).findings).return_annotation) for measure in MEASURES}
    names = {name for annotation in returned for name in re.findall(r"\w+Findings", annotation)}
    assert len(names) > 8 and [name for name in sorted(names) if f".{name}\n" not in text] == []
