from __future__ import annotations

import math

import numpy as np
import pytest
from conftest import from_python
from scipy.integrate import solve_ivp

from feeder_sim.plate import compiled
from feeder_sim.plate.drive import ModalDrive, ModalTerms, modal_terms

modal_motion = from_python(compiled.modal_motion)


def oscillator(drive: ModalDrive, times: np.ndarray) -> np.ndarray:
    """The oscillator of the module's docstring, integrated numerically."""
    assert drive.damping_ratio is not None
    zeta, omega_n, omega = drive.damping_ratio, 2 * np.pi * drive.natural_frequency, 2 * np.pi * drive.drive_frequency

    def rate(t: float, state: np.ndarray) -> list[float]:
        on = drive.start <= t < drive.stop
        angle = omega * (t - drive.start) + drive.phase
        force = 2 * zeta * omega_n**2 * drive.amplitude * math.cos(angle) if on else 0.0
        return [state[1], force - 2 * zeta * omega_n * state[1] - omega_n**2 * state[0]]

    solution = solve_ivp(rate, (0.0, times[-1]), [0.0, 0.0], t_eval=times, rtol=1e-9, atol=1e-12, max_step=1e-4)
    return np.asarray(solution.y[0])


@pytest.mark.parametrize("detuning", [0.0, -0.02, 0.03])
def test_response_solves_the_driven_oscillator(detuning: float) -> None:
    drive = ModalDrive(0, 400.0 * (1 + detuning), 400.0, 1.0, phase=0.7, damping_ratio=0.02, start=0.004, stop=0.05)
    times = np.linspace(0.0, 0.09, 400)
    q = modal_terms([drive]).phasor(times, 1)[:, 0].real
    assert np.abs(q - oscillator(drive, times)).max() < 2e-5


def test_envelope_rings_up_and_decays_as_at_resonance() -> None:
    zeta, f = 0.002, 2797.0
    terms = modal_terms([ModalDrive(0, f, f, 3e-6, damping_ratio=zeta, stop=0.1)])
    decay = zeta * 2 * np.pi * f
    t = np.array([0.01, 0.03, 0.08])
    assert np.abs(terms.phasor(t, 1)[:, 0]) == pytest.approx(3e-6 * (1 - np.exp(-decay * t)), rel=2 * zeta)
    after = np.abs(terms.phasor(np.array([0.1, 0.12]), 1)[:, 0])
    assert after[1] / after[0] == pytest.approx(np.exp(-decay * 0.02), rel=1e-6)


def test_motion_is_continuous_when_the_drive_stops() -> None:
    terms = modal_terms([ModalDrive(0, 500.0, 505.0, 1.0, damping_ratio=0.01, stop=0.0321)])
    before, after = terms.phasor(np.array([0.0321 - 1e-9, 0.0321 + 1e-9]), 1)[:, 0].real
    assert after == pytest.approx(before, abs=1e-5)


def test_without_ring_up_the_motion_is_a_sine_at_once() -> None:
    terms = modal_terms([ModalDrive(0, 100.0, 100.0, 2.0, start=0.5, stop=0.6)])
    t = np.array([0.4999, 0.5025, 0.5975, 0.6001])
    assert terms.phasor(t, 1)[:, 0].real == pytest.approx([0.0, 2.0, -2.0, 0.0], abs=1e-9)


def test_compiled_motion_equals_the_numpy_one() -> None:
    drives = [
        ModalDrive(0, 400.0, 400.0, 1.0, damping_ratio=0.01, stop=0.02),
        ModalDrive(1, 410.0, 400.0, 0.5, phase=1.0, damping_ratio=0.02, start=0.01),
        ModalDrive(0, 400.0, 400.0, 0.3, start=0.015),
    ]
    terms = modal_terms(drives)
    rates = ModalTerms(terms.shape, terms.start, terms.stop, terms.coefficient * terms.rate, terms.rate)
    q, velocity = np.zeros(2), np.zeros(2)
    for t in np.linspace(0.0, 0.05, 37):
        modal_motion(t, terms.shape, terms.start, terms.stop, terms.coefficient, terms.rate, q, velocity)
        assert q == pytest.approx(terms.phasor(t, 2)[0].real, abs=1e-12)
        assert velocity == pytest.approx(rates.phasor(t, 2)[0].real, abs=1e-9)


@pytest.mark.parametrize("ratio", [0.002, 0.02, 0.1, 0.5, 0.9])
def test_motion_stays_within_its_bounds(ratio: float) -> None:
    """Place and speed of a mode from its start to after its stop, against `largest` and `largest_speed`."""
    for detuning in (0.1, 0.5, 0.95, 1.0, 1.05, 2.0, 10.0):
        for phase in np.linspace(0.0, 2.0 * math.pi, 7):
            for periods in (0.3, 3.1, 200.0):
                drive = ModalDrive(0, 1000.0 * detuning, 1000.0, 1e-6, float(phase), ratio, stop=periods * 1e-3)
                terms = modal_terms([drive])
                t = np.concatenate([np.linspace(0.0, 3.0 * drive.stop, 2000), np.linspace(0.0, 0.02, 2000)])
                place = np.abs(terms.phasor(t, 1)[:, 0].real)
                rates = ModalTerms(terms.shape, terms.start, terms.stop, terms.coefficient * terms.rate, terms.rate)
                assert place.max() <= 1.0001 * drive.largest
                assert np.abs(rates.phasor(t, 1)[:, 0].real).max() <= 1.0001 * drive.largest_speed
