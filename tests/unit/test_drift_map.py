"""A drift map: from paths to the table, from the table to walks in closed form, and what it refuses."""

from __future__ import annotations

import math
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import REPOSITORY, refusal, strip_scenario
from prediction import GradientDrift, MapDrift

from feeder_sim.constants import GRAVITY
from feeder_sim.plate.materials import MATERIALS
from feeder_sim.plate.mode_shapes import standing_wave
from feeder_sim.plate.rectangle import RectangularPlate
from feeder_sim.run.prepare import prepare
from feeder_sim.scenario import Strip, load_scenario, resolve_material, with_run
from feeder_sim.scene.prepared import Prepared
from feeder_sim.studies.drift_map.drift_map import DriftMap
from feeder_sim.studies.drift_map.files import load_map, save_map
from feeder_sim.studies.drift_map.making import binned, made_of, strip_of
from feeder_sim.studies.drift_map.walk import Mode, velocity, walk
from feeder_sim.studies.search.screening import screened
from feeder_sim.studies.search.space import Space
from feeder_sim.studies.search.trials import Aim

THICKNESS, FREQUENCY, AMPLITUDE = 3e-3, 4750.0, 1e-6
PLATE = RectangularPlate(1.0, 1.0, THICKNESS, MATERIALS["aluminium"])
OMEGA = 2.0 * math.pi * FREQUENCY
DRIVE: dict[str, Any] = {"frequency_hz": FREQUENCY, "amplitude_um": 1e6 * AMPLITUDE, "ring_up": False}
BINS = 24
ANGLES = (np.arange(BINS) + 0.5) * 0.5 * math.pi / BINS


def on_strip(duration_s: float = 4.0) -> Prepared:
    return prepare(strip_scenario(duration_s=duration_s).changed({"drive": [DRIVE]}))


def drift_map(drift: float = 0.0, along: float = 0.0, across: float = 0.0) -> DriftMap:
    """A map in which the drift goes with the slope and the diffusion is the same all over a wave."""
    frequency, speed = np.array([400.0, 10000.0]), np.array([0.004, 0.6])
    table = np.ones((2, 2, BINS))
    made = made_of(on_strip().scenario, THICKNESS)
    tables = (drift * np.sin(ANGLES) * table, 0.0 * table, along * table, across * table)
    return DriftMap(made, PLATE, frequency, speed, *tables, 1.0, 1.0)


def test_drift_in_proportion_to_the_slope_is_a_path_in_closed_form() -> None:
    """d theta / dt = K sin theta has tan(theta / 2) = tan(theta0 / 2) exp(K t)."""
    share, wave = 0.7, standing_wave(PLATE, FREQUENCY)
    prepared = on_strip()
    start = np.array([0.2, 0.5, 0.8])
    points = np.stack([start / wave.wavenumber, np.zeros(3)], axis=1)
    walked = walk(drift_map(share), prepared, points, np.random.default_rng(0))
    rate = share * 0.5 * THICKNESS * wave.wavenumber**2 * OMEGA * AMPLITUDE
    angle = 2.0 * np.arctan(np.tan(0.5 * start) * math.exp(rate * prepared.scene.times.duration))
    assert angle.max() < 0.5 * math.pi  # none has come to the node, where it would stay
    # Linear between the bins: at most an eighth of the square of a bin off; Euler's steps are as small.
    assert walked.points[:, 0] * wave.wavenumber == pytest.approx(angle, rel=2e-3)
    assert (walked.points[:, 1] == 0.0).all()


def test_diffusion_alone_spreads_parts_evenly_and_as_fast_as_it_says() -> None:
    n = 4000
    walked = walk(drift_map(0.0, 0.02, 0.005), on_strip(duration_s=1.0), np.zeros((n, 2)), np.random.default_rng(0))
    expected = 2.0 * np.array([0.02, 0.005]) * (OMEGA * AMPLITUDE) ** 3 / GRAVITY
    assert walked.points.var(axis=0) == pytest.approx(expected, rel=5.0 * math.sqrt(2.0 / n))
    assert np.abs(walked.points.mean(axis=0)).max() < 5.0 * math.sqrt(expected.max() / n)


def test_nothing_moves_where_the_antinode_is_below_one_g() -> None:
    at = drift_map(1.0, 1.0, 1.0)
    limit = GRAVITY / OMEGA**2
    still = at.at(FREQUENCY, np.array([0.99 * limit]), np.zeros(1))
    moves = at.at(FREQUENCY, np.array([0.99 * limit]), np.array([standing_wave(PLATE, FREQUENCY).wavenumber * limit]))
    assert all(value == 0.0 for value in still)
    assert all(value > 0.0 for value in moves)


def test_on_a_plate_parts_drift_to_where_its_mode_moves_less() -> None:
    drive = {"frequency_hz": 2646.0, "amplitude_um": 5.0}
    scenario = load_scenario(REPOSITORY / "scenarios/drift_2797hz_plate.toml").changed(
        {"drive": [drive], "run.stop": "time"}
    )
    scene = prepare(scenario).scene
    table = drift_map(0.7)
    mode = Mode.of(table, scene.surface, 0, 2646.0)
    points = np.random.default_rng(3).uniform(-0.08, 0.08, (200, 2))
    v = velocity(table, mode, 5e-6, points)
    ahead = points + 1e-5 * v / np.linalg.norm(v, axis=1)[:, None]
    before, after = (np.abs(scene.surface.deflection(0, p)) for p in (points, ahead))
    assert (after < before)[before > 0.02].all()
    w, quadrature, _ = mode.local(points)
    waves = standing_wave(PLATE, 2646.0).wavenumber
    expected = 0.7 * 0.5 * THICKNESS * 2.0 * math.pi * 2646.0 * 5e-6 * quadrature * waves
    off_node = np.arctan2(quadrature, w) < ANGLES[-1]  # by symmetry nothing drifts right on a node
    assert off_node.mean() > 0.9
    assert np.linalg.norm(v, axis=1)[off_node] == pytest.approx(expected[off_node], rel=5e-3)


def test_a_loop_predicts_by_the_map_as_by_the_gradient_where_both_say_the_same() -> None:
    """A drift in proportion to the slope is a share of the in-plane speed, h/2 times the gradient of the speed."""
    stage = {"drive": [DRIVE | {"ring_up": True}], "duration_s": 0.3}
    scenario = on_strip().scenario.changed({"drive": [], "schedule": {"stage": [stage]}, "run": {"seeds": 1}})
    scene = prepare(scenario).scene
    quarter = 0.5 * math.pi / standing_wave(PLATE, FREQUENCY).wavenumber
    places = np.stack([quarter * np.array([0.1, 0.4, 0.7]), np.zeros(3)], axis=1)
    by_map = MapDrift(scene, drift_map(0.7)).predict(0, places)
    assert np.linalg.norm(by_map - places, axis=1).min() > 2e-5
    assert by_map == pytest.approx(GradientDrift(scene, share=0.7).predict(0, places), rel=2e-3)
    other = replace(drift_map(0.7), made=replace(drift_map(0.7).made, part="other"))
    assert "of another part" in refusal(MapDrift, scene, other)


def test_increments_give_drift_toward_the_node_and_diffusion() -> None:
    """A random walk with a drift along +x: toward the node in the first quarter of the wave, away from it after."""
    rng, n, lag, drift, spread = np.random.default_rng(0), 3000, 0.1, 1e-3, 2e-6
    paths = [
        np.stack([start + drift * lag * np.arange(4), np.zeros(4)], axis=1)
        + np.vstack([np.zeros((1, 2)), np.cumsum(math.sqrt(2.0 * spread * lag) * rng.standard_normal((3, 2)), axis=0)])
        for start in rng.choice([0.5, 2.5], n)
    ]
    found = binned(paths, 1, lag, 1.0, 4)
    (near,) = np.flatnonzero(found.count)  # pi - 2.5 = 0.64 lies in the same bin as 0.5
    assert near == 1
    assert found.count[near] == 3 * n
    assert found.drift[near] == pytest.approx(0.0, abs=5.0 * found.drift_se[near])
    right = binned(paths[:1] + [p for p in paths if p[0, 0] == 0.5], 1, lag, 1.0, 4)
    assert right.drift[near] == pytest.approx(drift, abs=5.0 * right.drift_se[near])
    assert 0.0 < right.drift_se[near] < 0.1 * drift
    for value in (right.along[near], right.across[near]):
        assert value == pytest.approx(spread, rel=0.1)


def test_a_saved_map_is_the_same(tmp_path: Path) -> None:
    held = drift_map(0.7, 0.01, 0.02)
    save_map(held, tmp_path / "map.npz")
    read = load_map(tmp_path / "map.npz", on_strip().scenario, THICKNESS)
    assert read.made == held.made and read.plate == held.plate and read.simulated_s == held.simulated_s
    for name in ("frequency", "speed", "drift", "drift_se", "along", "across"):
        assert (getattr(read, name) == getattr(held, name)).all()
    one = on_strip().scenario  # many parts are computed in steps, the one of the map without
    many = one.changed({"part[0].count": 4, "part[0].start": {"kind": "scattered", "size_mm": [9.0, 50.0]}})
    assert made_of(one, THICKNESS) == made_of(many, THICKNESS) != made_of(with_run(one, steps_per_period=80), THICKNESS)


ORTHOTROPIC = {"density_kg_m3": 2770.0, "youngs_modulus_gpa": 71.0, "poisson_ratio": 0.33}
ORTHOTROPIC |= {"youngs_modulus_y_gpa": 71.0, "shear_modulus_gpa": 26.7}


@pytest.mark.parametrize(
    ("changes", "thickness", "said"),
    [
        ({"part[0].size": "M3"}, THICKNESS, "another part"),
        ({"contact.restitution": 0.3}, THICKNESS, "another contact"),
        ({}, 2e-3, "a plate of 3 mm"),
        ({"plate.material": "steel"}, THICKNESS, "another material"),
        ({"plate.material": ORTHOTROPIC}, THICKNESS, "another mat"),
        ({"run.in_plane_velocity": False}, THICKNESS, "run.in_plane_velocity: is false"),
    ],
)
def test_a_map_of_something_else_is_refused(
    tmp_path: Path, changes: dict[str, object], thickness: float, said: str
) -> None:
    save_map(drift_map(0.7), tmp_path / "map.npz")
    assert said in refusal(load_map, tmp_path / "map.npz", on_strip().scenario.changed(changes), thickness)


def test_files_that_are_no_map_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "map.npz"
    assert "cannot be read" in refusal(load_map, path)
    for content in (b"", b"text", b"PK\x03\x04 cut off"):
        path.write_bytes(content)
        assert "is no drift map" in refusal(load_map, path)
    held = drift_map(0.7)
    save_map(replace(held, drift=held.drift[:, :, :3]), path)
    assert "is no drift map" in refusal(load_map, path)
    monkeypatch.setattr("feeder_sim.studies.drift_map.files.VERSION", 0)
    save_map(held, path)
    monkeypatch.undo()
    assert "version 0, must be 2" in refusal(load_map, path)


def test_drives_beyond_the_map_are_refused() -> None:
    for changes, said in (
        ({"drive[0].frequency_hz": 11000.0}, "is 11000, must be 400 to 10000"),
        ({"drive[0].amplitude_um": 25.0}, "moves an antinode at 0.746 m/s"),
        ({"drive": 2 * [DRIVE]}, "drives 2 modes at once"),
    ):
        prepared = prepare(on_strip().scenario.changed(changes))
        assert said in refusal(walk, drift_map(0.7), prepared, np.zeros((1, 2)), np.random.default_rng(0))


def test_a_sequence_of_modes_carries_a_point_to_its_goal() -> None:
    """Without diffusion, in a little longer than full runs take; each stage ends when the part has settled."""
    prepared = prepare(load_scenario(REPOSITORY / "scenarios/transport_strip.toml"))
    start = prepared.scenario.part[0].start
    walked = walk(drift_map(0.7), prepared, np.array([[-0.075, 0.0]]), np.random.default_rng(0))
    assert start.kind == "point" and start.position_mm == (-75.0, 0.0)
    assert abs(walked.points[0, 0]) < 1e-3
    assert (walked.duration[:, 0] < 20.0).all() and (walked.duration[:, 0] > 0.5).all()
    assert walked.total[0] == pytest.approx(walked.duration.sum() + 5 * 0.2)
    assert 25.0 < walked.total[0] < 45.0


def test_screening_finds_the_recipes_that_arrive_soonest() -> None:
    """Stronger drives bring a part to the goal sooner, as far as the walk keeps its way."""
    scenario = load_scenario(REPOSITORY / "scenarios/transport_strip.toml")
    key = "schedule.stage[0].drive[0].amplitude_um"
    space = Space.of(scenario, [f"{key}=10:40"])
    aim = Aim("arrival_time_s", False, 4)
    found = screened(space, aim, drift_map(0.7, 1e-3, 1e-3), 4, 2)
    amplitudes = [point[key] for point in found]
    assert len(found) == 2 and amplitudes == sorted(amplitudes, reverse=True)
    for wrong in (Aim("picked", False, 4), Aim("arrival_time_s", True, 4)):
        assert "the least arrival_time_s only" in refusal(screened, space, wrong, drift_map(0.7), 8, 3)
    other = Space.of(scenario.changed({"part[0].size": "M3"}), [f"{key}=10:40"])
    assert "of another part" in refusal(screened, other, aim, drift_map(0.7), 2, 1)


def test_a_strip_for_the_plate_of_a_scenario() -> None:
    strip = strip_of(load_scenario(REPOSITORY / "scenarios/transport_strip.toml"))
    assert strip.thickness_mm == pytest.approx(3.0)
    assert resolve_material(strip.material).youngs_modulus == pytest.approx(MATERIALS["aluminium"].youngs_modulus)
    assert strip_of(on_strip().scenario) == Strip(thickness_mm=3.0)
    assert "plate.kind" in refusal(strip_of, load_scenario(REPOSITORY / "scenarios/ball_50hz.toml"))
    steered = load_scenario(REPOSITORY / "scenarios/chladni_plate.toml")
    assert asdict(resolve_material(strip_of(steered).material)) == pytest.approx(asdict(MATERIALS["silicon"]))
