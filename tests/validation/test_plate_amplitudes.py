"""Amplitudes and frequencies of the source's plate from its dimensions, its patches and one calibrated moment."""

from __future__ import annotations

import json

import numpy as np
import pytest
from command_line import feeder_sim
from conftest import REPOSITORY
from plate_amplitudes import loaded_variants, predict, read_amplitudes

from feeder_sim.plate.mode_file import ModeFile
from feeder_sim.scenario import load_plate_file

PLATE = REPOSITORY / "models/plate_180_piezos"
MEASURED = read_amplitudes(PLATE / "measured.csv")


@pytest.fixture(scope="module")
def variants() -> dict[str, ModeFile]:
    return loaded_variants(load_plate_file(PLATE / "plate.toml"))


def test_five_amplitudes_follow_from_one(variants: dict[str, ModeFile]) -> None:
    ratio = np.array([each.ratio for each in predict(variants["nothing"], MEASURED)])
    assert ratio[0] == pytest.approx(1.0, abs=1e-3)  # the moment in the plate file is calibrated on it
    assert np.abs(ratio[1:] - 1.0).max() < 0.12
    assert np.abs(ratio[1:] - 1.0).mean() < 0.06


def test_mass_and_stiffness_of_the_patches_even_out_the_frequencies(variants: dict[str, ModeFile]) -> None:
    """What is left is common to all modes, as an error of Young's modulus is."""
    deviations = {
        name: np.array([each.deviation for each in predict(held, MEASURED)]) for name, held in variants.items()
    }
    assert np.abs(deviations["nothing"]).max() < 0.008
    assert np.abs(deviations["mass and stiffness"]).max() < 0.0095
    assert deviations["mass and stiffness"].std() < 0.5 * deviations["nothing"].std()


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
        assert peak["amplitude_um"] == pytest.approx(50e6 * one.amplitude, rel=0.12)
        assert peak["damping_ratio"] == pytest.approx(one.damping_ratio, rel=0.05)
