"""Voltages, actuators and measured resonances: plate files, mode files, drives, commands, and what cannot be meant."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import check_refused, feeder_sim, said
from conftest import REPOSITORY, toml_of

from feeder_sim.errors import InputError
from feeder_sim.plate.mode_file import ModeFile, read_mode_file, write_mode_file
from feeder_sim.plate.pairs import mode_pairs
from feeder_sim.plate.response import frequency_response, modal_forces, oscillators, voltages
from feeder_sim.plots.pictures import spaced
from feeder_sim.run.prepare import prepare
from feeder_sim.scenario import Drive, HexNut, ModePlate, Run, Scenario, Start, load_plate_file, load_scenario
from feeder_sim.scene.plate_modes import compute_modes
from feeder_sim.scene.scene import Scene, build_scene

Raw = dict[str, Any]
PATCH: Raw = {"size_mm": [12.0, 10.0], "thickness_mm": 1.0}
LEFT: Raw = PATCH | {"name": "left", "at_mm": [-20.0, 10.0], "d31_pm_per_v": 180.0}
RIGHT: Raw = PATCH | {"name": "right", "at_mm": [25.0, 5.0], "angle_deg": 30.0, "moment_per_volt_n": 0.01}
RIGHT |= {"loads": False}
PLATE: Raw = {
    "plate": {"length_mm": 120.0, "width_mm": 90.0, "thickness_mm": 2.0, "highest_frequency_hz": 4000.0},
    "actuator": [LEFT, RIGHT],
    "bar": [{"at_mm": [0.0, -35.0], "size_mm": [100.0, 8.0], "thickness_mm": 3.0}],
    "mass": [{"at_mm": [50.0, 40.0], "mass_g": 2.0, "offset_mm": 3.0}],
}
SCENARIO = """
[plate]
kind = "modes"
mode_file = "modes.h5"
[[drive]]
frequency_hz = {frequency:.4f}
voltage_vpp = 40.0
{drive}
[[part]]
shape = "hex_nut"
size = "M2.5"
[run]
duration_s = 0.1
"""


@pytest.fixture(scope="module")
def computed(tmp_path_factory: pytest.TempPathFactory) -> ModeFile:
    path = tmp_path_factory.mktemp("computed")
    (path / "plate.toml").write_text(toml_of(PLATE))
    return compute_modes(load_plate_file(path / "plate.toml"))


@pytest.fixture(scope="module")
def folder(computed: ModeFile, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the plate file and its mode file."""
    path = tmp_path_factory.mktemp("plate")
    (path / "plate.toml").write_text(toml_of(PLATE))
    write_mode_file(path / "modes.h5", computed)
    return path


@pytest.fixture(scope="module")
def held(folder: Path) -> ModeFile:
    return read_mode_file(folder / "modes.h5")


def best_mode(held: ModeFile, actuator: int) -> int:
    """Index of the mode that an actuator moves most."""
    every = oscillators(held)
    level = np.abs(modal_forces(held)[:, actuator]) / (every.modal_mass * every.natural_frequency**2)
    return int(level.argmax())


def scenario_in(folder: Path, frequency: float, drive: str) -> Path:
    path = folder / "scenario.toml"
    path.write_text(SCENARIO.format(frequency=frequency, drive=drive))
    return path


def scene_of(folder: Path, frequency: float, drive: str) -> Scene:
    return build_scene(load_scenario(scenario_in(folder, frequency, drive)))


def test_mode_file_keeps_actuators_and_their_forces(computed: ModeFile, held: ModeFile) -> None:
    assert held.actuators == computed.actuators and held.actuators[1].layer.angle == pytest.approx(math.radians(30.0))
    np.testing.assert_array_equal(held.force_per_volt, computed.force_per_volt)
    assert np.abs(held.force_per_volt).max(axis=0).min() > 0.0


def test_bars_and_masses_change_the_modes(folder: Path, held: ModeFile, tmp_path: Path) -> None:
    bare = tmp_path / "bare.toml"
    bare.write_text(toml_of(PLATE, {"bar": None, "mass": None, "actuator[0].loads": False}))
    change = held.modes.natural_frequency[:5] / compute_modes(load_plate_file(bare)).modes.natural_frequency[:5] - 1.0
    assert np.abs(change).max() > 0.02


def test_voltage_drives_the_mode_by_the_force_of_the_actuator(folder: Path, held: ModeFile) -> None:
    j = best_mode(held, 0)
    scene = scene_of(folder, held.modes.natural_frequency[j], 'actuator = ["left"]\ndamping_ratio = 0.003')
    omega, mass = 2.0 * math.pi * held.modes.natural_frequency[j], held.modes.modal_mass[j]
    expected = abs(held.force_per_volt[j, 0]) * 20.0 / (2.0 * 0.003 * mass * omega**2)
    assert scene.drives[0].amplitude == pytest.approx(expected, rel=1e-6)
    assert scene.drives[0].steady_amplitude == pytest.approx(expected, rel=1e-4)


def test_actuators_add_up_with_their_phases(folder: Path, held: ModeFile) -> None:
    j = best_mode(held, 0)
    frequency, force = held.modes.natural_frequency[j], held.force_per_volt[j]

    def amplitude(drive: str) -> float:
        return scene_of(folder, frequency, drive).drives[0].amplitude

    left, right = amplitude('actuator = ["left"]'), amplitude('actuator = ["right"]')
    both = amplitude('actuator = ["left", "right"]')
    opposed = amplitude('actuator = ["left", "right"]\nactuator_phase_deg = [0.0, 180.0]')
    assert right / left == pytest.approx(abs(force[1] / force[0]), rel=1e-9)
    assert both == pytest.approx(left * abs(1.0 + force[1] / force[0]), rel=1e-9)
    assert opposed == pytest.approx(left * abs(1.0 - force[1] / force[0]), rel=1e-9)


def test_all_modes_follow_as_in_the_frequency_response(folder: Path, held: ModeFile) -> None:
    """The stationary motion at a point is that of `frequency_response` at the frequency of the drive."""
    j = best_mode(held, 0)
    frequency, point = 1.003 * float(held.modes.natural_frequency[j]), (0.03, 0.02)
    drive = f'actuator = ["left"]\nmodes = "all"\nnatural_frequency_hz = {held.modes.natural_frequency[j]:.6f}'
    scene = scene_of(folder, frequency, drive)
    assert len(scene.driven[0].followers) == len(held.modes) - 1 and scene.driven[0].left_out == 0.0
    deflection = scene.surface.deflections(np.array([point]))[:, 0]
    motion = abs(sum(drive.steady * deflection[drive.shape] for drive in scene.all_drives[0]))
    volt = voltages(held, ["left"], 20.0, [0.0])
    response = frequency_response(held, volt, low=0.9 * frequency, high=1.1 * frequency, point=point)
    expected = np.interp(frequency, response.frequency, response.amplitude)
    assert motion == pytest.approx(expected, rel=1e-3)
    own = scene_of(folder, frequency, drive.replace('"all"', '"driven"'))
    few = scene_of(folder, frequency, drive.replace('"all"', "0.01"))
    assert own.driven[0].left_out is not None and 0 < len(few.driven[0].followers) < len(held.modes) - 1
    assert 0.0 < (few.driven[0].left_out or 0.0) < own.driven[0].left_out


@pytest.mark.parametrize("ring_up", [True, False])
@pytest.mark.parametrize("off", [0.9985, 1.001, 1.03])
def test_a_voltage_acts_where_it_is_off_resonance(ring_up: bool, off: float, folder: Path, held: ModeFile) -> None:
    """No mode and no resonance is named: everything that counts moves as `frequency_response` says."""
    frequency, point = off * float(held.modes.natural_frequency[best_mode(held, 0)]), (0.03, 0.02)
    scene = scene_of(folder, frequency, f'actuator = ["left"]\nmodes = 0.001\nring_up = {str(ring_up).lower()}')
    deflection = scene.surface.deflections(np.array([point]))[:, 0]
    motion = abs(sum(drive.steady * deflection[drive.shape] for drive in scene.all_drives[0]))
    q = oscillators(held).modal_coordinates(np.array([frequency]), (20.0 * held.force_per_volt[:, 0]).astype(complex))[
        0
    ]
    shapes = np.array([held.modes.evaluate(i, *point)[0] for i in range(len(held.modes))])
    assert motion == pytest.approx(abs(q @ shapes), rel=2e-3)
    assert scene.drives[0].steady_amplitude == pytest.approx(np.abs(q).max(), rel=1e-4)
    usual = scene_of(folder, frequency, 'actuator = ["left"]')
    least = min((drive.steady_amplitude for drive in usual.all_drives[0]), default=0.0)
    assert least >= 0.02 * usual.drives[0].steady_amplitude
    assert len(usual.all_drives[0]) == (np.abs(q) >= 0.02 * np.abs(q).max()).sum()


def test_a_named_mode_has_its_detuning_and_what_is_left_out_is_said(folder: Path, held: ModeFile) -> None:
    every, force = oscillators(held), np.abs(held.force_per_volt[:, 0])
    level = force / (every.modal_mass * every.natural_frequency**2)
    j = int(np.where(force > 1e-3 * force.max(), level, np.inf).argmin())  # others move more
    natural = float(held.modes.natural_frequency[j])
    drive = f'actuator = ["left"]\nmode = {j + 1}\nmodes = "driven"'
    at, off = (scene_of(folder, ratio * natural, drive).driven[0] for ratio in (1.0, 1.015))
    detuned = abs(1.0 - 1.015**2 + 2j * 0.002 * 1.015) / 0.004  # the oscillator's own formula
    assert at.drive.steady_amplitude / off.drive.steady_amplitude == pytest.approx(detuned, rel=1e-4)
    assert off.left_out is not None and off.left_out > 0.1 * off.drive.steady_amplitude
    all_move = scene_of(folder, 1.015 * natural, drive.replace('"driven"', '"all"')).driven[0]
    assert "left out" in off.doubt and "left out" not in all_move.doubt
    assert "damping ratio of 0.002" in at.doubt


def test_damping_is_said_where_it_is_assumed_and_can_be_set(tmp_path: Path) -> None:
    bare = {"bar": None, "mass": None, "actuator[0].loads": False, "actuator[1].loads": False}
    (tmp_path / "plate.toml").write_text(toml_of(PLATE, bare))
    (tmp_path / "damped.toml").write_text(toml_of(PLATE, bare | {"plate.damping_ratio": 0.004}))
    silent, damped = (feeder_sim("response", tmp_path / name, "--json") for name in ("plate.toml", "damped.toml"))
    assert "assumes a damping ratio of 0.002 for every mode" in silent.stderr and damped.stderr == ""
    peaks = [{row["mode"]: row["amplitude_um"] for row in json.loads(run.stdout)["peaks"]} for run in (silent, damped)]
    strongest = max(peaks[0], key=lambda mode: peaks[0][mode])
    assert peaks[0][strongest] / peaks[1][strongest] == pytest.approx(2.0, rel=0.02)
    assert all(
        len(run) == len(json.loads(done.stdout)["peaks"]) for run, done in zip(peaks, (silent, damped), strict=True)
    )
    write_mode_file(tmp_path / "modes.h5", compute_modes(load_plate_file(tmp_path / "damped.toml")))
    assert (oscillators(read_mode_file(tmp_path / "modes.h5")).damping_ratio == 0.004).all()


def test_power_is_what_damping_takes(held: ModeFile) -> None:
    """1/2 Re V* I without dielectric loss = sum of zeta_j w_j m_j w^2 |q_j|^2, at every frequency."""
    without = tuple(replace(a, loss_tangent=0.0) for a in held.actuators)
    lossless = ModeFile(held.modes, (), without, held.force_per_volt)
    volt = voltages(lossless, ["left", "right"], 30.0, [0.0, 1.0])
    response = frequency_response(lossless, volt, low=300.0, high=3000.0)
    modes, omega = oscillators(lossless), 2.0 * math.pi * response.frequency[:, None]
    q = modes.modal_coordinates(response.frequency, lossless.force_per_volt @ volt)
    omega_n = 2.0 * math.pi * modes.natural_frequency
    taken = (modes.damping_ratio * omega_n * modes.modal_mass * omega**2 * np.abs(q) ** 2).sum(axis=1)
    np.testing.assert_allclose(response.power, taken, rtol=1e-9)


@pytest.mark.slow
def test_measured_gain_goes_before_and_scales_other_actuators(folder: Path, held: ModeFile, tmp_path: Path) -> None:
    j = best_mode(held, 0)
    frequency = held.modes.natural_frequency[j]
    measured: Raw = {"frequency_hz": round(float(frequency), 4), "damping_ratio": 0.004, "amplitude_um_per_vpp": 0.05}
    measured |= {"driven_point_mm": [-20.0, 10.0], "actuator": ["left"]}
    (tmp_path / "plate.toml").write_text(toml_of(PLATE, {"resonance": [measured]}))
    write_mode_file(tmp_path / "modes.h5", compute_modes(load_plate_file(tmp_path / "plate.toml")))
    w = abs(float(held.modes.evaluate(j, -0.02, 0.01)[0]))
    right = abs(held.force_per_volt[j, 1] / held.force_per_volt[j, 0])
    for drive, ratio in (("", 1.0), ('actuator = ["left"]', 1.0), ('actuator = ["right"]', right)):
        drives = scene_of(tmp_path, frequency, drive).drives
        assert drives[0].amplitude == pytest.approx(40.0 * 0.05e-6 / w * ratio, rel=1e-6)


GAIN: Raw = {"frequency_hz": 4000.0, "mode": 1, "amplitude_um_per_vpp": 0.1, "driven_point_mm": [50.0, 40.0]}
WOOD: Raw = {"density_kg_m3": 600, "youngs_modulus_gpa": 12, "poisson_ratio": 0.3, "youngs_modulus_y_gpa": 1.0}
TWICE: list[Raw] = [{"frequency_hz": 700.0, "mode": 2}, {"frequency_hz": 710.0, "mode": 2}]


@pytest.mark.parametrize(
    ("key", "value", "expected"),
    [
        ("actuator[0].at_mm", [-58.0, 10.0], "actuator[0].at_mm ... [-58, 10] ... 60"),
        ("actuator[1].at_mm", [-12.0, 9.0], "actuator[1].at_mm ... overlaps actuator[0]"),
        ("bar[0].at_mm", [0.0, 3.0], "bar[0].at_mm ... overlaps actuator[0]"),
        ("mass[0].at_mm", [70.0, 40.0], "mass[0].at_mm ... [70, 40] ... on the plate"),
        ("actuator[1].name", "left", "actuator[1].name ... 'left' ... of its own"),
        ("actuator[0].ceramic", "PZT-9", "actuator[0].ceramic ... 'PZT-9' ... NCE46 ... PZT-8"),
        ("actuator[1].glue_thickness_um", 20.0, "actuator[1] ... moment_per_volt_n ... glue_thickness_um"),
        ("actuator[0].glue_thickness_um", -1.0, "actuator[0].glue_thickness_um ... -1"),
        ("actuator[0].side", "beside", "actuator[0].side ... 'beside' ... below"),
        ("resonance", [GAIN | {"actuator": ["nobody"]}], "resonance[0].actuator ... 'nobody' ... left, right"),
        ("resonance", TWICE, "resonance[1].frequency_hz ... 710 ... mode 2 ... resonance[0]"),
        ("bar[0].material", "silicon", "bar[0].material ... orthotropic"),
        ("actuator[0].d33", 3, "actuator[0].d33 ... unknown key"),
        ("plate.material", WOOD, "plate.material ... shear_modulus_gpa ... together"),
    ],
)
def test_plate_that_cannot_be_meant_is_refused(key: str, value: Any, expected: str, tmp_path: Path) -> None:
    (tmp_path / "plate.toml").write_text(toml_of(PLATE, {key: value}))
    check_refused(feeder_sim("modes", tmp_path / "plate.toml"), "plate.toml", expected)


def test_gain_of_an_actuator_that_does_not_drive_the_mode_is_refused(tmp_path: Path) -> None:
    """A patch in the middle of a bare plate does not drive its first mode, which is odd in x and y."""
    centre = LEFT | {"name": "centre", "at_mm": [0.0, 0.0], "size_mm": [10.0, 10.0], "loads": False}
    gain = GAIN | {"frequency_hz": 820.0, "driven_point_mm": [45.0, 35.0], "actuator": ["centre"]}
    plate = {"length_mm": 100.0, "width_mm": 80.0, "thickness_mm": 2.0, "highest_frequency_hz": 1500.0}
    (tmp_path / "plate.toml").write_text(toml_of({"plate": plate, "actuator": [centre], "resonance": [gain]}))
    check_refused(feeder_sim("modes", tmp_path / "plate.toml"), "plate.toml", "resonance", "centre", "does not drive")


@pytest.mark.parametrize(
    ("drive", "expected"),
    [
        ('actuator = ["lift"]', "drive[0].actuator ... 'lift' ... did you mean ... left, right"),
        ("", "drive[0].voltage_vpp ... no measured gain ... left, right"),
        ('actuator = ["left", "left"]', "drive[0].actuator ... twice"),
        ('actuator = ["left"]\nactuator_phase_deg = [0.0, 90.0]', "drive[0] ... 2 numbers ... 1"),
        ('actuator = ["left"]\nmodes = 1.5', "drive[0].modes ... 1.5"),
    ],
)
def test_drive_that_cannot_be_meant_is_refused(drive: str, expected: str, folder: Path, held: ModeFile) -> None:
    path = scenario_in(folder, held.modes.natural_frequency[best_mode(held, 0)], drive)
    check_refused(feeder_sim("check", path), "scenario.toml", expected)


def test_response_and_ranking_from_the_command_line(folder: Path, held: ModeFile, tmp_path: Path) -> None:
    source = folder / "modes.h5"
    options = ["--actuator", "left", "--at", "-20,10", "--volts", "40", "--damping", "0.003", "--json", "--data"]
    done = feeder_sim("response", source, *options, tmp_path / "r.csv")
    assert done.returncode == 0, done.stderr
    highest = max(json.loads(done.stdout)["peaks"], key=lambda peak: peak["amplitude_um"])
    assert highest["damping_ratio"] == pytest.approx(0.003, rel=0.05)
    lines = (tmp_path / "r.csv").read_text().splitlines()
    assert lines[0] == (
        "frequency_hz,amplitude_um,power_w,ceramic_heat_w,impedance_ohm,impedance_phase_deg,series_resistance_ohm,"
        "current_left_ma,current_right_ma"
    )
    largest = max(float(line.split(",")[1]) for line in lines[1:])
    assert largest == pytest.approx(highest["amplitude_um"], rel=1e-4)
    ranked = feeder_sim("modes", source, "--volts", 40, "--near", "-20,10", "--json")
    assert ranked.returncode == 0, ranked.stderr
    rows = json.loads(ranked.stdout)
    assert [row["amplitude_um"] for row in rows] == sorted((row["amplitude_um"] for row in rows), reverse=True)
    left = next(row for row in rows if row["mode"] == highest["mode"])
    acceleration = left["amplitude_um"] * 1e-6 * (2.0 * math.pi * left["frequency_hz"]) ** 2
    assert left["peak_acceleration_g"] == pytest.approx(acceleration / 9.81, rel=1e-9)


@pytest.mark.parametrize(
    ("command", "options", "expected"),
    [
        ("response", "--at 0,100", "--at ... 0,100 ... +-60"),
        ("response", "--actuator middle", "--actuator ... 'middle' ... left, right"),
        ("response", "--from 5000", "--from, --to ... 5000"),
        ("response", "--volts -3", "--volts ... -3 ... above 0"),
        ("response", "--damping 2", "--damping ... 2"),
        ("modes", "--near 0,0", "--near ... --volts"),
        ("modes", "--pairs", "--pairs ... --volts"),
        ("modes", "--volts 10 --near here", "--near ... here ... x,y"),
    ],
)
def test_options_that_cannot_be_meant_are_refused(command: str, options: str, expected: str, folder: Path) -> None:
    check_refused(feeder_sim(command, folder / "modes.h5", *options.split()), "modes.h5", expected)


def test_pairs_of_modes_are_those_of_the_experiment() -> None:
    """On the source's plate 2646 Hz gathers and 2797 Hz throws what lies on its lines, and the other way round."""
    done = feeder_sim("modes", REPOSITORY / "models/plate_180_piezos/modes.h5", "--volts", 120, "--pairs", "--json")
    assert done.returncode == 0, done.stderr
    rows = json.loads(done.stdout)
    scores = [row["moved"] * row["thrown"] for row in rows]
    assert scores == sorted(scores, reverse=True) or max(np.diff(scores)) < 1e-3
    assert (2646.0, 2797.0) in [(row["gather_hz"], row["throw_hz"]) for row in rows[:5]]
    weak = feeder_sim("modes", REPOSITORY / "models/plate_180_piezos/modes.h5", "--volts", 1, "--pairs")
    assert "a higher voltage may" in weak.stdout


def test_a_throwing_mode_throws_what_it_moves(held: ModeFile) -> None:
    """At ten times the voltage hops are a hundred times as high, and no place is thrown less."""
    low, high = ({(p.gather.mode, p.throw.mode): p for p in mode_pairs(held, volts)} for volts in (60.0, 600.0))
    assert low and set(low) <= set(high)
    for key, pair in low.items():
        assert high[key].hop == pytest.approx(100.0 * pair.hop) and high[key].thrown >= pair.thrown
        assert (pair.dead is None) == (pair.thrown == 1.0)


def test_check_says_what_moves_under_the_part_and_what_is_left_out(folder: Path, held: ModeFile) -> None:
    path = scenario_in(folder, held.modes.natural_frequency[best_mode(held, 0)], 'actuator = ["left"]')
    done = feeder_sim("check", path, "--json")
    assert done.returncode == 0, done.stderr
    drive = json.loads(done.stdout)["drives"][0]
    scene = build_scene(load_scenario(path))
    at_part = abs(float(scene.surface.deflection(0, np.zeros((1, 2)))[0])) * scene.drives[0].steady_amplitude
    assert drive["under_parts"][0]["amplitude_um"] == pytest.approx([1e6 * at_part] * 3)
    assert drive["left_out_um"] == pytest.approx(1e6 * (scene.driven[0].left_out or 0.0)) and drive["left_out_um"] > 0.0


MEASURED = """
[plate]
length_mm = 180
width_mm = 180
thickness_mm = 3
highest_frequency_hz = 3500
[[resonance]]
frequency_hz = {frequency}
damping_ratio = 0.0015
amplitude_um_per_vpp = 0.2
driven_point_mm = [0, 0]
"""


def measured_plate(folder: Path, frequency: float, *more: str) -> Path:
    plate = folder / "plate.toml"
    plate.write_text(MEASURED.format(frequency=frequency) + "\n".join(more))
    return plate


def scenario(mode_file: Path, **drive: object) -> Scenario:
    return Scenario(
        plate=ModePlate(kind="modes", mode_file=mode_file),
        drive=(Drive(**({"voltage_vpp": 10.0} | drive)),),  # type: ignore[arg-type]
        part=(HexNut(size="M2.5", start=Start(position_mm=(3.0, 0.0))),),
        run=Run(duration_s=0.1, seeds=1),
    )


def test_a_resonance_may_name_its_mode(tmp_path: Path) -> None:
    out = tmp_path / "modes.h5"
    done = feeder_sim("modes", measured_plate(tmp_path, 2860.0), "--out", out)
    check_refused(done, "resonance[0].frequency_hz", "2860", "name a mode")
    done = feeder_sim("modes", measured_plate(tmp_path, 2860.0, "mode = 14"), "--out", out)
    assert done.returncode == 0
    (warning,) = said(done)
    assert "warning: mode 14" in warning and "2860" in warning and "2 %" in warning.replace("2%", "2 %")
    prepared = prepare(scenario(out, frequency_hz=2860.0, mode=14))
    (mode,) = prepared.scene.driven
    assert "mode 14" in mode.label and mode.drive.damping_ratio == pytest.approx(0.0015)
    # Driven at the resonance that was measured, with the gain that was: 2 um in the middle of the plate.
    assert mode.drive.natural_frequency == mode.drive.drive_frequency == 2860.0
    at = prepared.scene.surface.deflection(0, prepared.cell.antinode[None])[0] if prepared.cell else math.nan
    assert abs(at) * mode.drive.amplitude == pytest.approx(2e-6, rel=1e-3)
    assert any("mode 14" in line and "2860" in line for line in prepared.warnings)
    with pytest.raises(InputError, match="no mode within"):  # nothing else has changed
        prepare(scenario(out, frequency_hz=2860.0))
    with pytest.raises(InputError, match=r"mode 14 lies at 2776.0 Hz, or 2860.0 Hz"):
        prepare(scenario(out, frequency_hz=3000.0, mode=14))


def test_a_mode_that_is_near_and_one_that_is_not_there(tmp_path: Path) -> None:
    done = feeder_sim("modes", measured_plate(tmp_path, 2797.0, "mode = 14"))
    assert done.returncode == 0 and said(done) == []
    # The nearest is 14; the one before it was meant.
    done = feeder_sim("modes", measured_plate(tmp_path, 2760.0, "mode = 13"))
    assert done.returncode == 0 and "mode 13" in said(done)[0]
    check_refused(feeder_sim("modes", measured_plate(tmp_path, 2797.0, "mode = 99")), "resonance[0].mode", "99", "1 to")
    check_refused(feeder_sim("modes", measured_plate(tmp_path, 2797.0, "mode = 0")), "resonance[0].mode")


def test_labels_of_peaks_stand_apart_and_within_the_picture() -> None:
    assert spaced([1.0, 5.0, 9.0], 1.0, 0.0, 10.0) == [1.0, 5.0, 9.0]
    assert spaced([5.0, 5.2, 8.0], 1.0, 0.0, 10.0) == pytest.approx([4.6, 5.6, 8.0])
    assert spaced([0.0, 0.1, 9.9, 9.9], 1.0, 0.0, 10.0) == pytest.approx([0.5, 1.5, 8.5, 9.5])
