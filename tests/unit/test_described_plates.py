"""A plate that a scenario describes itself, or by the name of a plate file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import check_refused, feeder_sim
from conftest import toml_of

from feeder_sim.errors import InputError
from feeder_sim.scenario import PlateFile, Scenario, load_plate_file, load_scenario
from feeder_sim.scene import mode_cache
from feeder_sim.scene.plate_modes import NoModes, compute_modes
from feeder_sim.scene.scene import build_scene
from feeder_sim.studies.sweep.design import with_frequencies

Raw = dict[str, Any]
PATCH: Raw = {"name": "a", "at_mm": [10.0, 5.0], "size_mm": [10.0, 10.0], "thickness_mm": 0.5, "d31_pm_per_v": 180.0}
PATCH |= {"loads": False}  # the modes of the bare plate, which take no time
SHAPE: Raw = {"length_mm": 80.0, "width_mm": 60.0, "thickness_mm": 2.0, "damping_ratio": 0.003}
SCENARIO: Raw = {
    "plate": {"kind": "plate", **SHAPE, "actuator": [PATCH, PATCH | {"name": "b", "at_mm": [-20.0, -15.0]}]},
    "drive": [{"frequency_hz": 2200.0, "voltage_vpp": 40.0, "actuator": ["a"]}],
    "part": [{"shape": "hex_nut", "size": "M2"}],
    "run": {"duration_s": 0.1, "seeds": 1},
}


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cache of its own."""
    monkeypatch.setattr(mode_cache, "base_folder", lambda: tmp_path / "cache")
    mode_cache._cached_modes.cache_clear()
    return tmp_path / "cache/modes"


def test_its_modes_are_those_of_the_plate_file(tmp_path: Path) -> None:
    (tmp_path / "plate.toml").write_text(
        toml_of({"plate": SHAPE | {"highest_frequency_hz": 4000.0}, "actuator": SCENARIO["plate"]["actuator"]})
    )
    held = compute_modes(load_plate_file(tmp_path / "plate.toml"))
    scene = build_scene(Scenario.model_validate(SCENARIO))
    driven = scene.driven[0]
    j = int(np.abs(held.modes.natural_frequency - driven.drive.natural_frequency).argmin())
    assert driven.drive.natural_frequency == pytest.approx(held.modes.natural_frequency[j], rel=1e-6)
    assert driven.drive.damping_ratio == 0.003
    force = abs(held.force_per_volt[j, 0]) * 20.0
    omega = 2.0 * np.pi * held.modes.natural_frequency[j]
    assert driven.drive.amplitude == pytest.approx(force / (0.006 * held.modes.modal_mass[j] * omega**2), rel=1e-5)


def test_every_number_of_it_can_be_set(tmp_path: Path) -> None:
    scenario = Scenario.model_validate(SCENARIO)
    thin, moved = (
        build_scene(scenario.changed(change))
        for change in ({"plate.thickness_mm": 1.0}, {"plate.actuator[1].at_mm[0]": -25.0, "drive[0].actuator": ["b"]})
    )
    assert thin.surface.thickness == 0.001
    as_drawn = build_scene(scenario.changed({"drive[0].actuator": ["b"]}))
    assert moved.drives[0].amplitude != pytest.approx(as_drawn.drives[0].amplitude, rel=1e-3)


def test_a_plate_file_is_put_into_the_scenario_and_its_keys_may_be_given_anew(tmp_path: Path) -> None:
    (tmp_path / "plates").mkdir()
    plate = {"plate": SHAPE | {"highest_frequency_hz": 4000.0}, "actuator": [PATCH]}
    (tmp_path / "plates/plate.toml").write_text(toml_of(plate))
    raw = SCENARIO | {"plate": {"kind": "plate", "file": "plates/plate.toml", "thickness_mm": 1.5}}
    (tmp_path / "scenario.toml").write_text(toml_of(raw))
    scenario = load_scenario(tmp_path / "scenario.toml")
    own = scenario.plate
    assert (own.thickness_mm, own.length_mm, own.file) == (1.5, 80.0, None)  # type: ignore[union-attr]
    assert own.actuator[0].name == "a"  # type: ignore[union-attr]
    again = scenario.changed({"plate.actuator[0].size_mm": [12.0, 8.0]})
    assert again.plate.actuator[0].size_mm == (12.0, 8.0)  # type: ignore[union-attr]
    (tmp_path / "plates/plate.toml").write_text(toml_of(plate, {"plate.width_mm": -3.0}))
    check_refused(feeder_sim("check", tmp_path / "scenario.toml"), "plate.toml", "plate.width_mm ... -3")


def test_a_measured_resonance_above_the_drives_finds_its_mode() -> None:
    scenario = Scenario.model_validate(SCENARIO)
    highest = with_frequencies(scenario.changed({"plate.highest_frequency_hz": 9000.0}), {"drive[0].mode": 8})
    resonance = {"frequency_hz": 1.01 * highest["drive[0].frequency_hz"], "damping_ratio": 0.001}
    scene = build_scene(scenario.changed({"plate.resonance": [resonance]}))
    assert scene.driven[0].drive.drive_frequency == 2200.0


def test_modes_are_kept_and_a_damaged_file_is_made_again(cache: Path) -> None:
    file = PlateFile.model_validate({"plate": SHAPE | {"highest_frequency_hz": 3000.0}})
    first = mode_cache.modes_of_plate(file)
    (kept,) = cache.glob("*.h5")
    mode_cache._cached_modes.cache_clear()
    again = mode_cache.modes_of_plate(file)
    np.testing.assert_array_equal(again.modes.coefficients, first.modes.coefficients)
    kept.write_bytes(kept.read_bytes()[:1000])
    mode_cache._cached_modes.cache_clear()
    np.testing.assert_array_equal(mode_cache.modes_of_plate(file).modes.coefficients, first.modes.coefficients)
    assert [path.name for path in cache.iterdir()] == [kept.name]


def test_a_drive_of_nearly_the_same_frequency_needs_no_other_modes(cache: Path) -> None:
    scenario = Scenario.model_validate(SCENARIO)
    kept = []
    for frequency in (2200.0, 2210.0, 2220.0):
        build_scene(scenario.changed({"drive[0].frequency_hz": frequency}))
        kept.append({path.name for path in cache.iterdir()})
    assert kept[0] == kept[1] == kept[2]


def test_a_mode_that_is_varied_takes_the_frequency_of_the_plate_at_that_point_along() -> None:
    scenario = Scenario.model_validate(SCENARIO).changed({"plate.highest_frequency_hz": 4000.0})
    frequencies = [
        with_frequencies(scenario, {"drive[0].mode": 2, "plate.thickness_mm": thickness})["drive[0].frequency_hz"]
        for thickness in (1.0, 2.0)
    ]
    assert frequencies[1] / frequencies[0] == pytest.approx(2.0, rel=0.02)
    with pytest.raises(InputError, match=r"plate\.highest_frequency_hz"):
        with_frequencies(Scenario.model_validate(SCENARIO), {"drive[0].mode": 2})


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"plate.actuator[1].at_mm": [50.0, 0.0]}, "plate.actuator[1].at_mm ... on the plate"),
        ({"plate.actuator[1].name": "a"}, "plate ... actuator[1].name ... 'a'"),
        ({"plate.thickness_mm": None}, "plate.thickness_mm ... missing"),
        ({"plate.outline": {"diameter_mm": 50.0}}, "plate ... length_mm"),
        ({"plate.support": [{"at_mm": [0, 0]}]}, "plate.support[0] ... stiffness_n_per_mm"),
        ({"plate.file": "nowhere.toml"}, "nowhere.toml"),
        ({"drive[0].actuator": ["c"]}, "drive[0].actuator ... 'c'"),
    ],
)
def test_what_no_plate_can_be_is_refused_with_its_key(change: Raw, expected: str, tmp_path: Path) -> None:
    (tmp_path / "scenario.toml").write_text(toml_of(SCENARIO, change))
    check_refused(feeder_sim("check", tmp_path / "scenario.toml"), expected)


def test_a_missing_plate_file_is_refused_in_python() -> None:
    with pytest.raises(InputError, match=r"nowhere\.toml"):
        Scenario.model_validate(SCENARIO | {"plate": {"kind": "plate", "file": "nowhere.toml"}})


@pytest.mark.parametrize(
    "shape",
    [pytest.param({"outline": {"diameter_mm": 60.0}}, marks=pytest.mark.slow), {"length_mm": 60.0, "width_mm": 50.0}],
)
def test_a_plate_without_a_mode_that_low_says_where_its_first_one_is(shape: dict[str, Any]) -> None:
    body = {"thickness_mm": 2.5, "damping_ratio": 0.002} | shape
    with pytest.raises(
        NoModes, match=r"is 1000, below the first mode of the plate, which is at (\d+\.\d) Hz"
    ) as refusal:
        compute_modes(PlateFile.model_validate({"plate": body | {"highest_frequency_hz": 1000.0}}))
    first = compute_modes(PlateFile.model_validate({"plate": body | {"highest_frequency_hz": 5000.0}}))
    assert refusal.value.first == pytest.approx(first.modes.natural_frequency[0], rel=1e-4)
