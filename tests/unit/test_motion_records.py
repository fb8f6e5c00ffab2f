"""Motions of a tray that have no period: records of displacements or accelerations, and spectra."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import check_refused, feeder_sim
from conftest import toml_of
from numpy.typing import NDArray
from scipy.signal import welch

from feeder_sim import simulate
from feeder_sim.constants import GRAVITY
from feeder_sim.plate.record import Record, random_motion, read_record
from feeder_sim.scenario import Scenario
from feeder_sim.scene.scene import build_scene

Raw = dict[str, Any]
Array = NDArray[np.float64]
TRAY: Raw = {
    "plate": {"kind": "tray", "length_mm": 600.0, "width_mm": 100.0},
    "part": [{"shape": "box", "size_mm": [8, 8, 2], "start": {"kind": "point", "tilt_deg": 0.0, "yaw_deg": 0.0}}],
    "contact": {"friction": 0.4, "restitution": 0.0},
    "run": {"duration_s": 2.0, "seeds": 1},
}
RISE = math.radians(20.0)
SPECTRUM = "frequency_hz, z_g2_hz\n10, 0.001\n100, 0.01\n300, 0.001\n"


def table(columns: dict[str, Array], spacing: float = 1e-3) -> str:
    """The text of a record with lines a spacing [s] apart."""
    rows = zip(*columns.values(), strict=True)
    lines = [", ".join(f"{value:.15g}" for value in (1e3 * spacing * i, *row)) for i, row in enumerate(rows)]
    return f"t_ms, {', '.join(columns)}\n" + "\n".join(lines) + "\n"


def beat(t: Array, order: int = 0) -> Array:
    """Two frequencies at no multiple of anything [m], or a derivative of their motion."""
    parts = ((150e-6, 47.3, 0.4), (20e-6, 91.7, 2.0))
    waves = [
        a * (2.0 * math.pi * f) ** order * np.sin(2.0 * math.pi * f * t + p + order * math.pi / 2.0)
        for a, f, p in parts
    ]
    return np.asarray(np.sum(waves, axis=0))


def moved(record: Record, t: Array, order: int = 0) -> Array:
    """A derivative of the motion of a record, (n, 6)."""
    terms = record.terms
    terms = replace(terms, coefficient=terms.coefficient * terms.rate**order)
    return terms.phasor(t, 6).real


def test_a_block_slides_by_a_record_of_a_sinusoid_as_by_the_sinusoid(tmp_path: Path) -> None:
    way = 150.0 * np.sin(2.0 * math.pi * 50.0 * 1e-3 * np.arange(2001.0))
    (tmp_path / "sine.csv").write_text(table({"x_um": way * math.cos(RISE), "z_um": way * math.sin(RISE)}))
    drives: list[Raw] = [
        {"frequency_hz": 50.0, "stroke_um": 150.0, "angle_deg": 20.0, "ring_up": False},
        {"frequency_hz": 50.0, "motion_file": tmp_path / "sine.csv", "periodic": False},
    ]
    paths = [
        simulate(Scenario.model_validate(TRAY | {"drive": [drive]})).seeds[0].frames.position[:, 0] for drive in drives
    ]
    assert np.abs(paths[0] - paths[1]).max() < 1e-6 * np.abs(paths[0][:, 0]).max()


def test_segments_join_in_place_speed_and_acceleration() -> None:
    record = read_record(table({"x_um": 1e6 * beat(1e-3 * np.arange(3001.0))}), Path("r.csv"), 100.0)
    for order, size in enumerate((170e-6, 0.056, 20.0)):
        terms = record.terms
        _, jump = replace(terms, coefficient=terms.coefficient * terms.rate**order).jumps(6)
        assert len(jump) > 10 and np.abs(jump[1:-1]).max() < 1e-9 * size


def test_a_record_is_followed_between_its_lines_from_where_the_tray_stands() -> None:
    record, t = (
        read_record(table({"x_um": 1e6 * beat(1e-3 * np.arange(3001.0))}), Path("r.csv"), 100.0),
        np.arange(0, 3, 7e-4),
    )
    for order, size in enumerate((170e-6, 0.056, 20.0)):
        expected = beat(t, order) - (beat(np.zeros(1)) if order == 0 else 0.0)
        np.testing.assert_allclose(moved(record, t, order)[:, 0], expected, atol=1e-6 * size)


def test_accelerations_move_as_the_displacements_from_rest_do() -> None:
    t = 1e-3 * np.arange(2001.0)
    record = read_record(table({"z_g": beat(t, 2) / GRAVITY, "ry_rad_s2": beat(t, 2)}), Path("r.csv"), 100.0)
    expected = beat(t) - beat(np.zeros(1)) - t * beat(np.zeros(1), 1)
    motion = moved(record, t[:-1])
    np.testing.assert_allclose(motion[:, 2], expected[:-1], atol=1e-6 * np.abs(expected).max())
    np.testing.assert_allclose(motion[:, 4], expected[:-1], atol=1e-6 * np.abs(expected).max())


def shove(t: Array) -> Array:
    """From rest to rest, 300 um farther, within half a second [um]."""
    return 150.0 * (1.0 - np.cos(math.pi * np.clip(0.5 + np.tanh((t - 0.5) / 0.05) / 2.0, 0.0, 1.0)))


def test_a_tray_stays_where_a_record_ends_and_stops_with_its_drive(tmp_path: Path) -> None:
    (tmp_path / "shove.csv").write_text(table({"x_um": shove(1e-3 * np.arange(1001.0))}))
    drive = {"frequency_hz": 60.0, "motion_file": tmp_path / "shove.csv", "periodic": False, "start_s": 0.25}
    scene = build_scene(Scenario.model_validate(TRAY | {"drive": [drive | {"duration_s": 1.5}]}))
    place = [scene.surface.displacement(np.zeros((1, 2)), t)[0, 0] for t in (0.2, 0.75, 1.25, 1.6, 1.8)]
    np.testing.assert_allclose(place, [0.0, 150e-6, 300e-6, 300e-6, 0.0], atol=1e-9)


T = 1e-3 * np.arange(2001.0)
REFUSED: list[tuple[Callable[[], str], Raw, str]] = [
    (lambda: table({"x_um": np.where(T < 0.7, 0.0, 100.0)}), {}, "motion.csv: jumps near 699 ms, in x"),
    (lambda: table({"x_um": 500.0 * np.abs(T - 0.7)}), {"frequency_hz": 100.0}, "motion.csv: jumps near ... ms, in x"),
    (lambda: table({"x_um": 100.0 * np.sin(60.0 * T)}), {"frequency_hz": 400.0}, "1 ms apart ... 400 ... 0.833"),
    (
        lambda: table({"x_um": 100.0 * np.sin(60.0 * T[:900])}),
        {},
        "ends after 0.899 s ... must last 2 s or end at rest",
    ),
    (lambda: table({"x_g": np.full(2001, 0.01)}), {}, "moves the tray by 196 mm after 2 s, must be up to 20 mm"),
    (lambda: "t_ms, x_um, z_g\n0, 0, 0\n", {}, "must be t_ms and x_um ... or x_g"),
    (lambda: "t_ms, x_um\n0, 1\n1, 2\n3, 3\n4, 1\n", {}, "uneven times"),
    (lambda: table({"x_um": 0.0 * T}), {}, "moves nothing"),
    (lambda: SPECTRUM, {"periodic": True, "phase_deg": 3.0}, "phase_deg is 3, must be none with psd_file"),
    (lambda: SPECTRUM, {"frequency_hz": 5.0}, "has no multiple of 0.5 Hz ... frequency_hz = 5"),
    (lambda: SPECTRUM.replace("10,", "0,"), {}, "frequencies that rise from above 0"),
]


@pytest.mark.parametrize(("text", "change", "expected"), REFUSED)
def test_records_that_cannot_be_used_are_refused(
    text: Callable[[], str], change: Raw, expected: str, tmp_path: Path
) -> None:
    (tmp_path / "motion.csv").write_text(text())
    source: Raw = {"motion_file": "motion.csv", "periodic": False}
    if text() == SPECTRUM or "hz" in text():
        source = {"psd_file": "motion.csv"}
    drive = {"frequency_hz": 60.0} | source | change
    (tmp_path / "tray.toml").write_text(toml_of(TRAY | {"drive": [drive]}))
    check_refused(feeder_sim("check", tmp_path / "tray.toml"), expected)


def density(frequency: Array) -> Array:
    """Of `SPECTRUM` [g^2/Hz]."""
    lines = np.array([[10.0, 1e-3], [100.0, 1e-2], [300.0, 1e-3]])
    return np.exp(np.interp(np.log(frequency), np.log(lines[:, 0]), np.log(lines[:, 1])))


def test_a_random_motion_has_the_mean_square_and_the_density_of_its_spectrum() -> None:
    record, t = random_motion(SPECTRUM, Path("p.csv"), 300.0, 20.0, 0), np.arange(0.0, 20.0, 5e-4)
    acceleration = moved(record, t, 2)[:, 2] / GRAVITY
    grid = np.linspace(10.0, 300.0, 100_001)
    area = np.trapezoid(density(grid), grid)
    assert np.sqrt(np.square(acceleration).mean()) == pytest.approx(math.sqrt(area), rel=0.01)
    frequency, estimate = welch(acceleration, 2000.0, nperseg=1000)
    inside = (frequency > 20.0) & (frequency < 280.0)
    ratio = estimate[inside] / density(frequency[inside])
    assert ratio.mean() == pytest.approx(1.0, abs=0.03) and ratio.std() < 0.3  # of some 75 spectra, half overlapped


def test_the_same_seed_of_a_spectrum_moves_alike_and_another_one_does_not() -> None:
    motions = [random_motion(SPECTRUM, Path("p.csv"), 300.0, 1.0, seed).terms for seed in (3, 3, 4)]
    assert (motions[0].coefficient == motions[1].coefficient).all()
    t = np.linspace(0.1, 0.9, 50)
    assert np.abs(motions[0].phasor(t, 6) - motions[2].phasor(t, 6)).max() > 1e-5


def test_a_motion_of_many_terms_at_many_times_is_what_it_is_at_each() -> None:
    terms, t = random_motion(SPECTRUM, Path("p.csv"), 300.0, 20.0, 0).terms, np.linspace(0.0, 19.9, 3001)
    together = terms.phasor(t, 6).real
    np.testing.assert_allclose(together[::100], [terms.phasor(one, 6)[0].real for one in t[::100]], atol=1e-15)
