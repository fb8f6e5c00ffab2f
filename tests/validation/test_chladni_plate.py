"""The plate that steers balls: its modes, its motion at a note, and where balls go on it."""

from __future__ import annotations

import io
import math
from typing import Any

import numpy as np
import pytest
from chladni_plate import (
    NOTE_S,
    NOTES_HZ,
    PLATE,
    STEP,
    Assumed,
    Steps,
    chladni_modes,
    find_amplitude,
    mean_cosine,
    note_field,
    of_an_eighth,
    play,
    share,
    start_points,
    unfold,
    write_steps,
)
from conftest import REPOSITORY
from forced_field import Force, force_in_the_middle, forced_field, triangle_terms
from scipy.sparse.linalg import eigsh
from skfem import Basis, BilinearForm, ElementTriArgyris, MeshTri
from skfem.helpers import dd

from feeder_sim.plate.mode_file import read_mode_file
from feeder_sim.plate.modes import PlateModes, plate_modes
from feeder_sim.scenario import Excitation, load_scenario
from feeder_sim.scene.scene import build_scene

# A wafer along <110>, written out to verify the material, too.
E, NU, G, RHO, SIDE, H = 169e9, 0.064, 50.9e9, 2329.0, 0.05, 0.525e-3
D, DK = E * H**3 / (12.0 * (1.0 - NU**2)), G * H**3 / 12.0


@pytest.fixture(scope="module")
def modes() -> PlateModes:
    return chladni_modes()


@BilinearForm
def stiffness(w: Any, v: Any, _: Any) -> Any:
    a, b = dd(w), dd(v)
    along = a[0, 0] * b[0, 0] + a[1, 1] * b[1, 1] + NU * (a[0, 0] * b[1, 1] + a[1, 1] * b[0, 0])
    return D * along + 4.0 * DK * a[0, 1] * b[0, 1]


@BilinearForm
def mass(w: Any, v: Any, _: Any) -> Any:
    return RHO * H * w * v + RHO * H**3 / 12.0 * (w.grad[0] * v.grad[0] + w.grad[1] * v.grad[1])


def test_frequencies_of_the_free_silicon_square_are_those_of_finite_elements() -> None:
    """Thin plate, orthotropic, element of Argyris."""
    cells = np.linspace(-0.5 * SIDE, 0.5 * SIDE, 10)
    basis = Basis(MeshTri.init_tensor(cells, cells), ElementTriArgyris())
    shift = (2.0 * math.pi * 100.0) ** 2  # the motions of the plate as a whole have the frequency 0
    squared = eigsh(stiffness.assemble(basis), 23, M=mass.assemble(basis), sigma=-shift)[0]
    expected = np.sqrt(np.sort(squared)[3:]) / (2.0 * math.pi)
    found = plate_modes(PLATE, highest_frequency=18e3, theory="kirchhoff").natural_frequency
    np.testing.assert_allclose(found[:20], expected, rtol=3e-5)


def test_far_below_all_modes_the_plate_moves_as_a_whole(modes: PlateModes) -> None:
    field = forced_field(modes, force_in_the_middle(modes), 2.0, 0.002)
    np.testing.assert_allclose(np.abs(field.at(start_points())), 1.0, atol=1e-4)
    mass_kg = RHO * H * SIDE**2
    assert field.scale == pytest.approx(1.0 / (mass_kg * (2.0 * math.pi * 2.0) ** 2), rel=1e-4)


def test_two_shapes_move_as_all_modes_of_a_scenario_do() -> None:
    """The package's own way: every mode an oscillator, here long after the drive began."""
    held = read_mode_file(REPOSITORY / "models/plate_silicon/modes.h5")
    scenario = load_scenario(REPOSITORY / "scenarios/chladni_plate.toml")
    assert scenario.schedule is not None
    (drive,) = scenario.schedule.stage[4].drive
    stage = scenario.schedule.stage[4].model_copy(
        update={"drive": (drive.model_copy(update={"modes": "all"}),), "duration_s": 2.0}
    )
    schedule = scenario.schedule.model_copy(update={"stage": (stage,), "cycles": 1})
    surface = build_scene(scenario.model_copy(update={"schedule": schedule})).surface
    assert isinstance(drive, Excitation)
    force = Force(held.force_per_volt[:, 0] * 0.5 * (drive.voltage_vpp or 0.0))
    field = forced_field(held.modes, force, drive.frequency_hz, 0.002)
    points = start_points()
    together = np.array([surface.displacement(points, 1.0 + k / 7.0 / drive.frequency_hz)[:, 2] for k in range(7)])
    largest = np.sqrt((together**2).mean(axis=0) * 2.0)  # seven points of a period
    np.testing.assert_allclose(largest, field.scale * np.abs(field.at(points)), atol=2e-3 * field.scale)


def test_a_note_rises_and_falls_in_straight_lines() -> None:
    terms = triangle_terms(3e-6, 1e4, NOTE_S)
    times = NOTE_S * np.array([0.0, 0.2, 0.5, 0.6, 0.999999])
    modulus = np.abs(terms.phasor(times, 2))
    np.testing.assert_allclose(modulus, 3e-6 * np.array([[0.0, 0.4, 1.0, 0.8, 2e-6]] * 2).T, atol=3e-10)


@pytest.mark.parametrize("note", NOTES_HZ[::3])
def test_the_bare_gradient_points_to_the_nodes(modes: PlateModes, note: float) -> None:
    field, points = note_field(modes, note, Assumed()), start_points()
    downhill = field.downhill(points)
    moved = points + 1e-5 * downhill / np.linalg.norm(downhill, axis=1, keepdims=True).clip(1e-9)
    moves = np.hypot(*downhill.T) > 1e-6 * np.hypot(*downhill.T).max()
    assert (np.abs(field.at(moved)) < np.abs(field.at(points)))[moves].mean() > 0.99
    assert moves.mean() > 0.99  # the middle rests


def test_an_eighth_stands_for_the_plate(modes: PlateModes) -> None:
    points = start_points()
    downhill = note_field(modes, 7459.0, Assumed()).downhill(points)
    eighth = of_an_eighth(points)
    assert eighth.sum() == 66
    np.testing.assert_allclose(unfold(points, points[eighth], downhill[eighth]), downhill, atol=1e-6 * downhill.max())


def test_file_of_steps_has_one_row_for_each_place(modes: PlateModes) -> None:
    field, points = note_field(modes, 7459.0, Assumed()), start_points()
    steps = Steps(7459.0, field, 1e-6, points, 0.01 * points, 0.0, 1, 0)
    file = io.StringIO()
    write_steps([steps, steps], file)
    header, *rows = file.getvalue().splitlines()
    assert header == "note_hz,x_mm,y_mm,dx_mm,dy_mm"
    assert len(rows) == 2 * 441 and rows[0] == "7459,-24.000,-24.000,-0.240000,-0.240000"


@pytest.mark.slow
def test_balls_go_to_the_nodes_at_the_share_of_the_surface_that_a_sphere_can_take(modes: PlateModes) -> None:
    """Friction takes the lowest point of a solid sphere along, and with it 2/7 of the motion, at some phases of it."""
    assumed = Assumed()
    field = note_field(modes, 14917.0, assumed)
    places = 1e-3 * np.array([[4.8, 2.4], [14.4, 7.2], [19.2, 9.6], [12.0, 0.0], [2.4, 16.8]])
    steps = play(field, 14917.0, 1.2e-6, 4, assumed, start=places)
    assert mean_cosine(steps.step, field.downhill(places)) > 0.98
    assert steps.lost == 0 and 0.17 < share(steps) < 2.0 / 7.0


@pytest.mark.slow
def test_the_amplitude_of_a_note_is_found(modes: PlateModes) -> None:
    """In the experiment three quarters of the steps were below 0.175 mm."""
    assumed = Assumed(restitution=0.3)
    steps = find_amplitude(note_field(modes, 15804.0, assumed), 15804.0, 1, assumed)
    assert steps.quantile == pytest.approx(STEP, rel=0.02) and len(steps.step) == 441
    assert 0.8e-6 < steps.amplitude < 1.3e-6 and steps.cosine > 0.98
