"""Modes that a user brings in: the package's own give the same drift, parts fall through the hole of another plate."""

from __future__ import annotations

import importlib.util
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import feeder_sim
from own_modes import nodes_2411, places, plate_180, shape_55, units_164, values_at, write_table, write_universal
from scipy.spatial.transform import Rotation

import feeder_sim as package
from feeder_sim.plate.mode_file import read_mode_file
from feeder_sim.records.seed import Cause
from feeder_sim.scenario import Drive, ModePlate, Scenario, load_scenario, with_run

HOLE, RADIUS = np.array([0.035, 0.0]), 0.012  # of models/plate_hole


def transport_speed(scenario: Scenario) -> tuple[float, float]:
    """Mean and standard error [mm/s]."""
    measured = package.simulate(scenario).measures()["transport_speed_mm_s"]
    assert measured["n"] == scenario.run.seeds
    return measured["mean"], measured["se"]


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["csv", "unv"])
def test_drift_on_modes_that_went_through_a_file(tmp_path: Path, repository: Path, kind: str) -> None:
    held, points = plate_180(), places()
    which = [12, 13]
    frequency = held.modes.natural_frequency[which].tolist()
    w = values_at(held.modes, which, points)[:, 0]
    if kind == "csv":
        file = write_table(tmp_path / "own.csv", frequency, points, w)
    else:
        shapes = [shape_55(f, np.stack([0 * v, 0 * v, v])) for f, v in zip(frequency, w, strict=True)]
        file = write_universal(tmp_path / "own.unv", units_164(), nodes_2411(points), *shapes)
    done = feeder_sim("modes", "import", file, "--thickness", 3, "--out", tmp_path / "own.h5")
    assert done.returncode == 0, done.stderr
    own = load_scenario(repository / "scenarios/drift_2797hz_plate.toml")
    (resonance,) = (r for r in held.resonances if r.mode == 13)
    # The file has no gain: the same amplitude at the same point.
    (volts,) = (drive.voltage_vpp for drive in own.drive if isinstance(drive, Drive))
    amplitude = 1e6 * resonance.gain * (volts or math.nan)
    drive = Drive(frequency_hz=2797.0, amplitude_um=amplitude, at_mm=(0.0, 0.0), damping_ratio=resonance.damping_ratio)
    plate = ModePlate(kind="modes", mode_file=tmp_path / "own.h5")
    brought = own.model_copy(update={"plate": plate, "drive": (drive,)})
    (mean, error), (expected, own_error) = transport_speed(brought), transport_speed(own)
    assert abs(mean - expected) < 2.5 * math.hypot(error, own_error), f"{mean:.3f} +- {error:.3f}, {expected:.3f}"
    assert error < 0.1 * mean


def finite_elements(repository: Path) -> Any:
    """The script that makes models/plate_hole."""
    path = repository / "models/plate_hole/finite_elements.py"
    spec = importlib.util.spec_from_file_location("plate_hole_finite_elements", path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.slow
def test_the_table_of_the_plate_with_a_hole_is_that_of_its_script(repository: Path) -> None:
    made = finite_elements(repository)
    plate = made.mesh()
    frequency, shapes = made.modes(plate)
    np.testing.assert_allclose(
        read_mode_file(repository / "models/plate_hole/modes.h5").modes.natural_frequency, frequency, rtol=1e-5
    )
    assert (
        made.table(plate, frequency, shapes).splitlines()[1]
        == ((repository / "models/plate_hole/modes.csv").read_text().splitlines()[1])
    )
    # Twice as fine a mesh gives the same: the modes are resolved, and so is the hole.
    finer = made.modes(plate.refined())[0]
    np.testing.assert_allclose(frequency, finer, rtol=1e-4)


def test_the_mode_file_of_the_plate_with_a_hole_is_its_table_brought_in(tmp_path: Path, repository: Path) -> None:
    folder = repository / "models/plate_hole"
    options = ("--thickness", 3, "--outline", folder / "outline.toml", "--out", tmp_path / "modes.h5")
    assert feeder_sim("modes", "import", folder / "modes.csv", *options).returncode == 0
    found, stored = (read_mode_file(path).modes for path in (tmp_path / "modes.h5", folder / "modes.h5"))
    x, y = np.linspace(-0.08, 0.08, 33), np.linspace(-0.06, 0.06, 25)
    for i in range(len(stored)):
        np.testing.assert_allclose(found.evaluate_grid(i, x, y)[0], stored.evaluate_grid(i, x, y)[0], atol=1e-4)
    assert stored.outline is not None and len(stored.outline.holes) == 1


@pytest.mark.slow
def test_nuts_fall_through_the_hole_and_none_hangs_over_it(repository: Path) -> None:
    scenario = with_run(load_scenario(repository / "scenarios/plate_with_hole.toml"), seeds=3)
    result = package.simulate(scenario)
    assert not result.failures
    outline = result.scene.surface.outline
    assert outline is not None
    through = 0
    for seed in result.seeds:
        frames, removals = seed.frames, seed.removals
        assert (removals.cause == Cause.LOST).all()
        for part in removals.part:
            place = frames.position[frames.present[:, part], part, :2]
            below = frames.position[frames.present[:, part], part, 2] < -1e-3
            through += bool(np.linalg.norm(place[below][0] - HOLE) < RADIUS)  # where it went below the plate
        there = frames.present[-1]
        place, height = frames.position[-1, there, :2], frames.position[-1, there, 2]
        lying = height < 0.0012  # a nut is 2 mm high; what is higher flies
        # A nut may lie over the edge of the hole, but its centre of mass has to be between points of it on the plate.
        for part in np.flatnonzero(there)[lying & (height > 0.0)]:
            turned = Rotation.from_quat(frames.quaternion[-1, part], scalar_first=True)
            corners = turned.apply(result.scene.parts[part].corners)[:, :2]
            share = np.linspace(0.0, 1.0, 41)[:, None, None, None]
            points = (share * corners + (1.0 - share) * corners[:, None]).reshape(-1, 2)
            carried = points[outline.distance(points + frames.position[-1, part, :2]) > 0.0]
            angles = np.sort(np.arctan2(carried[:, 1], carried[:, 0]))
            gaps = np.diff(np.append(angles, angles[0] + 2.0 * np.pi))
            assert gaps.max() < np.pi + 0.05
    assert through >= 3
