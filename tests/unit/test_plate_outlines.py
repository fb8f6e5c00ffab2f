"""Plate files with an outline, holes and supports, from the command line to a run."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from command_line import check_refused, feeder_sim
from conftest import toml_of

from feeder_sim.errors import InputError
from feeder_sim.plate.elements.mesh_modes import MeshModes
from feeder_sim.plate.mode_file import ModeFile, read_mode_file, write_mode_file
from feeder_sim.plate.response import oscillators
from feeder_sim.scenario import load_plate_file
from feeder_sim.scene.plate_modes import compute_modes

Raw = dict[str, Any]
SPRING: Raw = {"at_mm": [10.0, 10.0], "diameter_mm": 6.0, "stiffness_n_per_mm": 5.0, "loss_factor": 0.2}
ELL: Raw = {
    "plate": {
        "outline": {"points_mm": [[0, 0], [120, 0], [120, 40], [50, 40], [50, 90], [0, 90]]},
        "thickness_mm": 2.0,
        "highest_frequency_hz": 4000.0,
        "damping_ratio": 0.003,
    },
    "hole": [{"centre_mm": [100.0, 20.0], "diameter_mm": 8.0}],
    "actuator": [
        {"name": "p", "at_mm": [25.0, 60.0], "size_mm": [15.0, 15.0], "thickness_mm": 0.5, "d31_pm_per_v": 180.0}
    ],
    "support": [SPRING, SPRING | {"at_mm": [110.0, 10.0]}, SPRING | {"at_mm": [10.0, 80.0]}],
}
SCENARIO = """
[plate]
kind = "modes"
mode_file = "modes.h5"
[[drive]]
frequency_hz = {frequency}
voltage_vpp = 60.0
[[part]]
shape = "hex_nut"
size = "M2.5"
[part.start]
position_mm = [-30.0, -20.0]
[run]
duration_s = 0.2
seeds = 1
"""


@pytest.fixture(scope="module")
def held(tmp_path_factory: pytest.TempPathFactory) -> ModeFile:
    path = tmp_path_factory.mktemp("plate") / "plate.toml"
    path.write_text(toml_of(ELL))
    return compute_modes(load_plate_file(path))


def test_places_move_with_the_outline(held: ModeFile) -> None:
    """The bounding box is centred; the patch is where it was drawn."""
    outline = held.modes.outline
    assert outline is not None and outline.size == pytest.approx((0.12, 0.09))
    np.testing.assert_allclose(outline.exterior.min(axis=0), [-0.06, -0.045])
    assert held.actuators[0].layer.centre == pytest.approx((-0.035, 0.015))


def test_modes_on_feet_are_damped_by_them(held: ModeFile) -> None:
    every = oscillators(held)
    assert not every.assumed.any()
    assert every.damping_ratio[0] > 0.05 and every.damping_ratio[6:].max() < 0.01
    assert every.damping_ratio.min() >= 0.003


def test_a_mode_file_keeps_the_mesh_and_all_that_is_known_on_it(held: ModeFile, tmp_path: Path) -> None:
    write_mode_file(tmp_path / "modes.h5", held)
    kept = read_mode_file(tmp_path / "modes.h5")
    assert isinstance(kept.modes, MeshModes)
    x, y = np.linspace(-0.07, 0.07, 31), np.linspace(-0.05, 0.05, 21)
    for i in (0, 5, len(kept.modes) - 1):
        np.testing.assert_array_equal(kept.modes.evaluate_grid(i, x, y), held.modes.evaluate_grid(i, x, y))
    np.testing.assert_array_equal(kept.force_per_volt, held.force_per_volt)
    np.testing.assert_array_equal(oscillators(kept).damping_ratio, oscillators(held).damping_ratio)


@pytest.mark.parametrize(
    ("name", "change", "expected"),
    [
        ("mesh/triangle", lambda values: values + 10_000, "names a point that is not there"),
        ("mesh/triangle", lambda values: values[:, [1, 0, 2]], "clockwise"),
        ("mesh/triangle", lambda values: values[:-1], "fourth degree"),
        ("mesh/field", lambda values: values[:, :, :-1], "has shape"),
        ("mesh/field", lambda values: 0.0 * values, "without deflection"),
    ],
)
def test_a_damaged_mesh_is_refused(name: str, change: Any, expected: str, held: ModeFile, tmp_path: Path) -> None:
    write_mode_file(tmp_path / "modes.h5", held)
    with h5py.File(tmp_path / "modes.h5", "r+") as file:
        values = change(file[name][()])
        del file[name]
        file[name] = values
    with pytest.raises(InputError, match=expected):
        read_mode_file(tmp_path / "modes.h5")


def test_a_part_runs_on_it_and_the_surface_is_that_of_the_elements(held: ModeFile, tmp_path: Path) -> None:
    write_mode_file(tmp_path / "modes.h5", held)
    force = np.abs(held.force_per_volt[:, 0]) / (held.modes.modal_mass * held.modes.natural_frequency**2)
    frequency = float(held.modes.natural_frequency[6:][force[6:].argmax()])
    (tmp_path / "scenario.toml").write_text(SCENARIO.format(frequency=round(frequency, 3)))
    done = feeder_sim("run", tmp_path / "scenario.toml", "--out", tmp_path / "run", "--json")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["highest_rise_mm"]["mean"] >= 0.0


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"plate.length_mm": 100.0}, "plate ... length_mm is 100 ... outline"),
        ({"plate.outline": None}, "plate ... length_mm is missing ... outline"),
        ({"hole[0].centre_mm": [80.0, 70.0]}, "plate.outline ... hole 1 is not within"),
        ({"actuator[0].at_mm": [80.0, 70.0]}, "actuator[0].at_mm"),
        ({"actuator[0].at_mm": [98.0, 22.0]}, "actuator[0].at_mm ... hole"),
        ({"support[0].at_mm": [90.0, 80.0]}, "support[0].at_mm ... beside it"),
        ({"support[0].stiffness_n_per_mm": None}, "support[0] ... stiffness_n_per_mm"),
        ({"support[0].hold": "clamped"}, "support[0] ... stiffness_n_per_mm ... none"),
        ({"support[0].to_mm": [20.0, 10.0]}, "support[0] ... one of to_mm"),
        ({"plate.damping_ratio": None}, "plate.damping_ratio is missing ... loss_factor"),
        ({"plate.uniform_width": True}, "plate.uniform_width"),
        ({"plate.outline.points_mm": [[0, 0], [90, 60], [90, 0], [0, 60]]}, "crosses itself"),
    ],
)
def test_plates_that_cannot_be_meant_are_refused(change: Raw, expected: str, tmp_path: Path) -> None:
    (tmp_path / "plate.toml").write_text(toml_of(ELL, change))
    check_refused(feeder_sim("modes", tmp_path / "plate.toml"), "plate.toml", expected)


@pytest.mark.slow  # 80 s: finite elements of fourth degree on a plate of 400 x 8 mm
def test_a_rectangle_that_the_series_does_not_resolve_is_computed_by_elements(tmp_path: Path) -> None:
    """As bending modes of a beam of 400 mm; the twentieth would need more polynomials than there are."""
    strip = {"length_mm": 400.0, "width_mm": 8.0, "thickness_mm": 1.0, "highest_frequency_hz": 9000.0}
    (tmp_path / "strip.toml").write_text(toml_of({"plate": strip}))
    modes = compute_modes(load_plate_file(tmp_path / "strip.toml")).modes
    assert isinstance(modes, MeshModes)
    straight = [i for i in range(len(modes)) if np.ptp(modes.evaluate(i, 0.2, [-0.003, 0.003])[0]) < 0.05]
    order = np.sqrt(modes.natural_frequency[straight])
    assert len(order) > 15 and np.diff(order) == pytest.approx([order[1] - order[0]] * (len(order) - 1), rel=0.03)
    (tmp_path / "strip.toml").write_text(toml_of({"plate": strip | {"uniform_width": True}}))
    check_refused(feeder_sim("modes", tmp_path / "strip.toml"), "plate.highest_frequency_hz", "not resolved")


def test_a_clamped_edge_and_a_round_plate_from_the_command_line(tmp_path: Path) -> None:
    clamp = {"hold": "clamped", "at_mm": [-50.0, -20.0], "to_mm": [-50.0, 20.0]}
    strip = {"length_mm": 100.0, "width_mm": 40.0, "thickness_mm": 1.0, "highest_frequency_hz": 800.0}
    disc = {"outline": {"diameter_mm": 100.0}, "thickness_mm": 1.0, "highest_frequency_hz": 2500.0}
    frequencies = []
    for name, raw in (("strip", {"plate": strip, "support": [clamp]}), ("disc", {"plate": disc})):
        (tmp_path / f"{name}.toml").write_text(toml_of(raw))
        done = feeder_sim("modes", tmp_path / f"{name}.toml", "--json")
        assert done.returncode == 0, done.stderr
        frequencies.append([row["natural_frequency_hz"] for row in json.loads(done.stdout)])
    assert frequencies[0][0] == pytest.approx(83.5, rel=0.02)  # a cantilever, a little stiffer than a beam
    assert frequencies[1][0] == pytest.approx(frequencies[1][1], rel=1e-3)  # two nodal diameters, twice
