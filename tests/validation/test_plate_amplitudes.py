"""Amplitudes and frequencies of the source's plate from its dimensions and the data sheet of its patches."""

from __future__ import annotations

import json

import numpy as np
import pytest
from command_line import feeder_sim
from conftest import REPOSITORY
from plate_amplitudes import electrical, loaded_variants, predict, read_amplitudes

from feeder_sim.plate.mode_file import ModeFile
from feeder_sim.scenario import load_plate_file

PLATE = REPOSITORY / "models/plate_180_piezos"
MEASURED = read_amplitudes(PLATE / "measured.csv")


@pytest.fixture(scope="module")
def variants() -> dict[str, ModeFile]:
    return loaded_variants(load_plate_file(PLATE / "plate.toml"))


@pytest.mark.slow
def test_six_amplitudes_follow_from_the_data_sheet(variants: dict[str, ModeFile]) -> None:
    """Glue unknown: the interval holds all, its middle is within 15 % in the mean."""
    loaded = variants["mass and stiffness"]
    ratio, spread = np.array([each.ratio for each in predict(loaded, MEASURED)]), loaded.actuators[0].moment_spread
    assert (ratio / spread < 1.0).all() and (ratio * spread > 1.0).all() and spread < 1.7
    assert np.abs(ratio - 1.0).mean() < 0.06


@pytest.mark.slow
def test_a_patch_moves_the_bare_plate_as_it_moves_the_one_that_it_stiffens(variants: dict[str, ModeFile]) -> None:
    bare, loaded = (
        np.array([each.ratio for each in predict(variants[name], MEASURED)])
        for name in ("nothing", "mass and stiffness")
    )
    assert np.abs(bare / loaded - 1.0).max() < 0.1


@pytest.mark.slow
def test_currents_and_maxima_of_the_resistance() -> None:
    """Measured currents have one or two digits: 0.06 A is 0.055 to 0.065 A."""
    rows = electrical(load_plate_file(PLATE / "plate.toml"), MEASURED)
    currents = np.array([row["current_over_measured"] for row in rows])
    digit = np.array([0.005 / (50.0 * one.current) for one in MEASURED])
    assert (np.abs(currents - 1.0) < np.maximum(0.05, digit)).all() and np.abs(currents - 1.0).mean() < 0.03
    for row in rows:
        above = row["resistance_maximum_hz"] - row["displacement_maximum_hz"]
        assert 0.0 < above < row["half_bandwidth_hz"]


@pytest.mark.slow
def test_mass_and_stiffness_of_the_patches_even_out_the_frequencies(variants: dict[str, ModeFile]) -> None:
    """What is left is common to all modes, as an error of Young's modulus is."""
    deviations = {
        name: np.array([each.deviation for each in predict(held, MEASURED)]) for name, held in variants.items()
    }
    assert np.abs(deviations["nothing"]).max() < 0.008
    assert np.abs(deviations["mass and stiffness"]).max() < 0.0095
    assert deviations["mass and stiffness"].std() < 0.5 * deviations["nothing"].std()


@pytest.mark.slow
def test_patches_split_the_degenerate_pair(variants: dict[str, ModeFile]) -> None:
    pairs = {name: held.modes.natural_frequency[5:7] for name, held in variants.items()}
    assert np.ptp(pairs["nothing"]) < 1e-6 * pairs["nothing"][0]
    assert 0.3 < np.ptp(pairs["mass and stiffness"]) < 1.0 and 10.0 < np.ptp(pairs["mass"]) < 13.0


def test_response_in_the_centre_has_the_measured_peaks() -> None:
    done = feeder_sim("response", PLATE / "modes.h5", "--at", "0,0", "--volts", 100, "--json")
    assert done.returncode == 0, done.stderr
    peaks = json.loads(done.stdout)["peaks"]
    for one in MEASURED:
        if one.actuator != "centre":
            continue
        peak = min(peaks, key=lambda peak: abs(peak["frequency_hz"] - one.frequency))
        assert peak["frequency_hz"] == pytest.approx(one.frequency, rel=2e-3)
        assert peak["amplitude_um"] == pytest.approx(50e6 * one.amplitude, rel=0.2)
        assert peak["damping_ratio"] == pytest.approx(one.damping_ratio, rel=0.05)
