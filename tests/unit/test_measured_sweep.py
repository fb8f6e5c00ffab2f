"""Impedance of patches, bounds of amplitudes, and resonances fitted to a sweep of an LCR meter."""

from __future__ import annotations

import json
import math
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from command_line import check_refused, feeder_sim
from conftest import REPOSITORY
from numpy.typing import NDArray

from feeder_sim.errors import InputError
from feeder_sim.plate.actuators import clamped_capacitance
from feeder_sim.plate.impedance_fit import Sweep, fit_sweep
from feeder_sim.plate.materials import CERAMICS
from feeder_sim.plate.mode_file import Resonance, read_mode_file
from feeder_sim.plate.response import (
    DAMPING_RANGE,
    DEFAULT_DAMPING_RATIO,
    amplitude_bounds,
    frequency_response,
    modal_forces,
    oscillators,
    voltages,
)

PLATE = REPOSITORY / "models/plate_180_piezos"
HELD = read_mode_file(PLATE / "modes.h5")
CENTRE = [actuator.name for actuator in HELD.actuators].index("centre")
DRIVEN = (558.0, 1420.0, 2797.0, 6199.0)  # measured resonances that the patch in the centre drives


def impedance(frequency: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Of the patch in the centre [ohm], the others at rest."""
    modes, theta = oscillators(HELD), modal_forces(HELD)[:, CENTRE]
    patch, omega = HELD.actuators[CENTRE], 2.0 * math.pi * frequency
    q = modes.modal_coordinates(frequency, theta.astype(complex))
    charge = patch.capacitance * (1.0 - 1j * patch.loss_tangent) + q @ theta
    return np.asarray(1.0 / (1j * omega * charge))


FREQUENCY = np.arange(500.0, 6400.0, 0.25)
CLEAN = impedance(FREQUENCY)


def noisy(share: float, seed: int = 0) -> NDArray[np.float64]:
    return np.asarray(CLEAN.real * np.exp(share * np.random.default_rng(seed).standard_normal(len(CLEAN))))


def sweep_file(path: Path, frequency: NDArray[np.float64], resistance: NDArray[np.float64]) -> Path:
    lines = ["# LCR meter", "frequency_hz,resistance_ohm"]
    path.write_text("\n".join([*lines, *(f"{f:.4f},{r:.6g}" for f, r in zip(frequency, resistance, strict=True))]))
    return path


def test_impedance_in_the_response_is_that_of_its_formula() -> None:
    response = frequency_response(HELD, voltages(HELD, ["centre"], 50.0, [0.0]), low=500.0, high=6400.0)
    np.testing.assert_allclose(response.impedance, impedance(response.frequency), rtol=1e-12)
    patch = HELD.actuators[CENTRE]
    expected = 0.25 * math.pi * response.frequency * patch.capacitance * patch.loss_tangent * 100.0**2
    np.testing.assert_allclose(response.heat, expected, rtol=1e-12)
    two = frequency_response(HELD, voltages(HELD, ["centre", "back"], 50.0, [0.0, 1.0]), low=500.0, high=700.0)
    assert np.isnan(two.impedance).all()  # at two voltages there is no impedance


@pytest.mark.parametrize("seed", range(3))
def test_resonances_of_a_sweep_with_noise(seed: int) -> None:
    fit = fit_sweep(Sweep(FREQUENCY, noisy(0.01, seed), None), HELD.actuators[CENTRE].capacitance)
    modes = oscillators(HELD)
    for measured in DRIVEN:
        mode = int(np.abs(modes.natural_frequency - measured).argmin())
        resonance = min(fit.resonances, key=lambda each: abs(each.frequency - measured))
        assert resonance.frequency == pytest.approx(modes.natural_frequency[mode], rel=2e-4)
        assert resonance.damping_ratio == pytest.approx(modes.damping_ratio[mode], rel=0.05)
        assert abs(resonance.frequency - measured) < 5.0 * resonance.frequency_error
    assert fit.loss_tangent == pytest.approx(0.003, rel=0.02) and fit.scatter == pytest.approx(0.01, rel=0.2)


@pytest.mark.slow
def test_a_sweep_becomes_a_plate_file_in_one_command(tmp_path: Path) -> None:
    plate = tmp_path / "plate.toml"
    plate.write_bytes((PLATE / "plate.toml").read_bytes())
    path = tmp_path / "sweep.csv"
    rows = zip(FREQUENCY, np.abs(CLEAN), np.angle(CLEAN, deg=True), strict=True)
    path.write_text(
        "frequency_hz, impedance_ohm, phase_deg\n" + "\n".join(f"{f:.4f}, {z:.7g}, {p:.6f}" for f, z, p in rows)
    )
    out, picture = tmp_path / "measured.toml", tmp_path / "fit.png"
    done = feeder_sim("response", plate, "--measured", path, "--write", out, "--picture", picture, "--json")
    assert done.returncode == 0, done.stderr
    fitted = json.loads(done.stdout)["resonances"]
    assert picture.stat().st_size > 10_000
    written = {row["mode"]: row for row in tomllib.loads(out.read_text())["resonance"] if "mode" in row}
    assert {row["mode"] for row in fitted} == set(written)
    before = tomllib.loads(plate.read_text())["resonance"]
    for row in before:  # the clean sweep gives back what made it; others stay
        same = [each for each in written.values() if abs(each["frequency_hz"] - row["frequency_hz"]) < 0.02]
        assert bool(same) == (row["frequency_hz"] in DRIVEN)
        assert not same or same[0]["damping_ratio"] == pytest.approx(row["damping_ratio"], rel=0.02)
    assert len(tomllib.loads(out.read_text())["resonance"]) >= len(before)
    assert feeder_sim("modes", out).returncode == 0
    check_refused(feeder_sim("response", plate, "--measured", path, "--write", out), "measured.toml", "exists")


def test_two_resonances_in_one_maximum_are_refused() -> None:
    frequency, capacitance = np.arange(2600.0, 3000.0, 0.5), 3.6e-7
    omega, natural = 2.0 * np.pi * frequency[:, None], 2.0 * np.pi * np.array([2797.0, 2803.0])
    branches = 2e-4 * natural**2 / (natural**2 - omega**2 + 4e-3j * natural * omega)
    admittance = 1j * omega[:, 0] * capacitance * (1.0 - 3e-3j + branches.sum(axis=1))
    noise = np.exp(0.01 * np.random.default_rng(0).standard_normal(len(frequency)))
    with pytest.raises(InputError, match=r"about the maximum at 28\d\d.*one resonance each"):
        fit_sweep(Sweep(frequency, (1.0 / admittance).real * noise, None), capacitance)


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ("khz", "frequency_hz ... 0.5 to 6.39 ... in Hz"),
        ("gap", "points across the maximum at 2797 ... steps of"),
        ("empty", "resistance_ohm ... '' ... row 31 ... a number"),
        ("falling", "frequency_hz ... row 41 ... rising"),
        ("negative", "row 51 ... above 0"),
        ("short", "12 rows ... 20"),
        ("flat", "no maximum"),
        ("semicolons", "semicolons"),
        ("names", "no column impedance_ohm"),
    ],
)
def test_an_invalid_sweep_is_refused(change: str, expected: str, tmp_path: Path) -> None:
    frequency, resistance = FREQUENCY[::2].copy(), noisy(0.01)[::2]
    keep = np.abs(FREQUENCY - 558.0) > 20.0  # too narrow for these steps
    if change == "khz":
        frequency = FREQUENCY / 1000.0
        resistance = noisy(0.01)
    elif change == "gap":
        gap = np.abs(FREQUENCY - 2798.0) > 6.0
        gap |= np.abs(FREQUENCY - 2797.0) < 0.1
        frequency, resistance = FREQUENCY[gap & keep], noisy(0.01)[gap & keep]
    elif change == "falling":
        frequency[40] = 1.0
    elif change == "negative":
        resistance[50] = -1.0
    elif change == "short":
        frequency, resistance = frequency[:12], resistance[:12]
    elif change == "flat":
        resistance = 1.0 / frequency
    path = sweep_file(tmp_path / "sweep.csv", frequency, resistance)
    text = path.read_text()
    if change == "empty":
        lines = text.splitlines()
        lines[32] = lines[32].split(",")[0] + ","
        text = "\n".join(lines)
    text = text.replace(",", ";") if change == "semicolons" else text
    path.write_text(text.replace("resistance_ohm", "ohms") if change == "names" else text)
    check_refused(feeder_sim("response", PLATE / "modes.h5", "--measured", path), "sweep.csv", expected)


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        ("--write out.toml", "--write ... --measured"),
        ("--measured none.csv", "none.csv ... cannot be read"),
        ("--measured none.csv --actuator nobody", "--actuator ... nobody"),
        ("--measured none.csv --write out.toml", "--write ... plate file"),
    ],
)
def test_invalid_options_of_a_sweep_are_refused(options: str, expected: str, tmp_path: Path) -> None:
    done = feeder_sim("response", PLATE / "modes.h5", *options.split(), cwd=tmp_path)
    check_refused(done, expected)


def test_bounds_are_those_of_bond_ceramic_and_damping() -> None:
    modes, spread = oscillators(HELD), HELD.actuators[CENTRE].moment_spread
    known = next(r.mode for r in HELD.resonances if r.frequency == 2797.0)
    assert amplitude_bounds(HELD, modes, known, [CENTRE]) == pytest.approx((1.0 / spread, spread))
    assumed = int(np.flatnonzero(modes.assumed)[0])
    low, high = (DEFAULT_DAMPING_RATIO / ratio for ratio in reversed(DAMPING_RANGE))
    assert amplitude_bounds(HELD, modes, assumed, [CENTRE]) == pytest.approx((low / spread, high * spread))
    gain = Resonance(known, 2797.0, 0.002, 1e-7, (0.0, 0.0), ("centre",))
    measured = replace(HELD, resonances=(gain,))
    assert amplitude_bounds(measured, oscillators(measured), known, [CENTRE]) == (1.0, 1.0)


def test_capacitance_is_that_of_the_measured_currents() -> None:
    """I = pi f C Upp of the source's six currents: 357 nF."""
    patch = HELD.actuators[CENTRE]
    capacitance = clamped_capacitance(patch.layer, CERAMICS["NCE46"].relative_permittivity, 25)
    assert capacitance == pytest.approx(357e-9, rel=0.02) and patch.capacitance == pytest.approx(capacitance)
