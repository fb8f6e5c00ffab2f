from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from conftest import from_python, strip_scenario

from feeder_sim.plate import compiled
from feeder_sim.plate.mode_file import read_mode_file
from feeder_sim.plate.mode_shapes import StandingWave
from feeder_sim.plate.nodal_lines import antinode_near, nodal_lines
from feeder_sim.scenario import load_scenario
from feeder_sim.scene.scene import build_scene

surface_modes = from_python(compiled.surface_modes)


def test_strip_surface_moves_as_the_analytic_wave() -> None:
    scene = build_scene(strip_scenario())
    wave = scene.driven[0].shape
    assert isinstance(wave, StandingWave)
    points = np.random.default_rng(0).uniform(-0.029, 0.029, (50, 2))
    t = 0.21
    q = scene.surface.terms.phasor(t, 1)[0, 0].real
    u = scene.surface.displacement(points, t)
    half = 0.5 * scene.surface.thickness
    assert u[:, 2] == pytest.approx(q * np.cos(wave.wavenumber * points[:, 0]), abs=1e-6 * abs(q))
    horizontal = half * wave.rotation * np.sin(wave.wavenumber * points[:, 0]) * q
    assert u[:, 0] == pytest.approx(horizontal, abs=1e-6 * abs(q))
    assert np.abs(u[:, 1]).max() == 0.0


def test_a_table_twice_as_fine_is_sixteen_times_as_good() -> None:
    """Cubic interpolation; the middles of its cells are worst."""
    errors = []
    for number in (40, 80):
        surface = build_scene(strip_scenario().changed({"run.points_per_wavelength": number})).surface
        x = 0.5 * (surface.x[2:-3] + surface.x[3:-2])
        wave = build_scene(strip_scenario()).driven[0].shape
        assert isinstance(wave, StandingWave)
        exact = np.cos(wave.wavenumber * x)
        errors.append(np.abs(surface.deflection(0, np.column_stack([x, 0.0 * x])) - exact).max())
    assert errors[0] / errors[1] == pytest.approx(16.0, rel=0.1)


def test_horizontal_motion_leans_towards_the_node_while_the_surface_rises() -> None:
    """Between antinode (x = 0) and node the top surface moves along a line inclined towards the node."""
    scene = build_scene(strip_scenario())
    u = scene.surface.displacement(np.array([[0.01, 0.0]]), 0.21)[0]
    assert u[0] * u[2] > 0.0


def test_velocity_is_the_time_derivative_of_the_displacement() -> None:
    surface = build_scene(strip_scenario()).surface
    points, t, dt = np.array([[0.004, 0.01], [-0.012, 0.0]]), 0.1234, 1e-8
    difference = (surface.displacement(points, t + dt) - surface.displacement(points, t - dt)) / (2 * dt)
    assert surface.velocity(points, t) == pytest.approx(difference, abs=1e-6 * np.abs(difference).max())


def test_table_of_a_plate_mode_matches_the_polynomials_and_the_compiled_twin(repository: Path) -> None:
    scene = build_scene(load_scenario(repository / "scenarios/drift_2797hz_plate.toml"))
    surface, modes = scene.surface, read_mode_file(repository / "models/plate_180/modes.h5").modes
    points = np.random.default_rng(1).uniform(-0.09, 0.09, (200, 2))
    exact = modes.evaluate(13, points[:, 0], points[:, 1])
    assert surface.deflection(0, points) == pytest.approx(exact[0], abs=1e-6)
    found = np.zeros((1, 3))
    for i, (x, y) in enumerate(points):
        surface_modes(x, y, surface.x, surface.y, surface.table, found)
        # The rotations turn within a layer of one thickness at the free edge, hence their wider tolerance.
        assert (np.abs(found[0] - exact[:, i]) < [1e-6, 1e-4, 1e-4] * np.abs(exact).max(axis=1)).all()


def test_points_off_the_plate_are_clamped_to_its_edge() -> None:
    surface = build_scene(strip_scenario()).surface
    edge = np.array([[0.5 * surface.length, 0.0]])
    assert surface.deflection(0, edge + np.array([0.01, 5.0])) == pytest.approx(surface.deflection(0, edge))


def test_nodal_lines_and_antinode_of_a_strip() -> None:
    scene = build_scene(strip_scenario())
    wave = scene.driven[0].shape
    assert isinstance(wave, StandingWave)
    lines = nodal_lines(scene.surface)
    assert lines.distance(np.zeros((1, 2)))[0] == pytest.approx(wave.wavelength / 4, rel=1e-6)
    assert antinode_near(scene.surface, 0, (0.005, 0.0))[0] == pytest.approx(0.0, abs=1e-5)
