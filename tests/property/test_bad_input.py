"""Every bad input gives one clear line that names file, key, value and what is allowed; nothing is overwritten."""

from __future__ import annotations

from pathlib import Path

import pytest
from command_line import check_refused, feeder_sim, in_new_process
from conftest import REPOSITORY

MODES = REPOSITORY / "models/plate_180/modes.h5"

STRIP = """
[plate]
kind = "strip"
thickness_mm = 3.0
[[drive]]
frequency_hz = 4750.0
amplitude_um = 1.0
[[part]]
shape = "hex_nut"
size = "M2.5"
[run]
duration_s = 1.0
"""
PLATE = STRIP.replace('kind = "strip"\nthickness_mm = 3.0', f'kind = "rectangle"\nmode_file = "{MODES}"').replace(
    "4750.0", "2797.0"
)

GUIDED = """
[plate]
kind = "piston"
[[drive]]
frequency_hz = 50.0
amplitude_um = 220.0
[[part]]
shape = "cylinder"
diameter_mm = 4.5
height_mm = 6.0
[part.guide]
kind = "tube"
inner_diameter_mm = 4.6
[run]
duration_s = 1.0
"""

# name: (scenario, text to replace, replacement, what the line must contain)
CASES = {
    "negative thickness": (
        STRIP,
        "thickness_mm = 3.0",
        "thickness_mm = -3.0",
        ["plate.thickness_mm", "-3.0", "greater than or equal to 0.001"],
    ),
    "missing thickness": (STRIP, "thickness_mm = 3.0", "", ["plate.thickness_mm", "missing", "at least 0.001"]),
    "missing thickness of a rectangle": (
        STRIP,
        'kind = "strip"\nthickness_mm = 3.0',
        'kind = "rectangle"\nlength_mm = 100\nwidth_mm = 100',
        ["plate", "thickness_mm is missing", "above 0"],
    ),
    "unknown mode": (PLATE, "amplitude_um = 1.0", "amplitude_um = 1.0\nmode = 60", ["drive[0].mode", "60", "1 to 59"]),
    "mode on a strip": (
        STRIP,
        "amplitude_um = 1.0",
        "amplitude_um = 1.0\nmode = 3",
        ["drive[0].mode", "amplitude_um only"],
    ),
    "frequency beyond the modes": (
        PLATE,
        "2797.0",
        "20000.0",
        ["drive[0].frequency_hz", "20000", "beyond the computed modes", "13063"],
    ),
    "frequency between the modes": (PLATE, "2797.0", "2500.0", ["drive[0].frequency_hz", "2500", "nearest is mode"]),
    "frequency above the cut-off": (STRIP, "4750.0", "2e6", ["drive[0].frequency_hz", "2000000", "below"]),
    "misspelt key": (STRIP, "thickness_mm", "thicknes_mm", ["plate.thicknes_mm", "did you mean 'thickness_mm'"]),
    "misspelt table": (STRIP, "[run]", "[runs]", ["runs", "did you mean 'run'"]),
    "amplitude without unit": (
        STRIP,
        "amplitude_um",
        "amplitude",
        ["drive[0].amplitude", "did you mean 'amplitude_um'"],
    ),
    "amplitude as text": (
        STRIP,
        "amplitude_um = 1.0",
        'amplitude_um = "one"',
        ["drive[0].amplitude_um", "'one'", "number"],
    ),
    "no amplitude": (STRIP, "amplitude_um = 1.0", "", ["drive[0]", "exactly one of amplitude_um and voltage_vpp"]),
    "amplitude on a nodal line": (
        PLATE.replace("2797.0", "2646.0"),
        "amplitude_um = 1.0",
        "amplitude_um = 1.0\nat_mm = [0, 0]",
        ["drive[0].at_mm", "nodal line of mode 13"],
    ),
    "voltage without gain": (
        PLATE.replace("2797.0", "12314.0"),
        "amplitude_um = 1.0",
        "voltage_vpp = 100",
        ["drive[0].voltage_vpp", "no measured gain", "2797"],
    ),
    "too few steps": (
        STRIP,
        "duration_s = 1.0",
        "duration_s = 1.0\nsteps_per_period = 8",
        ["run.steps_per_period", "8", "20"],
    ),
    "too few steps for a compliant contact": (
        STRIP,
        "[run]",
        '[contact]\nmodel = "compliant"\ntime_constant_us = 10\n[run]',
        ["run.steps_per_period is 40", "at least 106", "time_constant_us = 10"],
    ),
    "no time constant": (STRIP, "[run]", '[contact]\nmodel = "compliant"\n[run]', ["contact", "time_constant_us"]),
    "restitution above one": (
        STRIP,
        "[run]",
        "[contact]\nrestitution = 1.2\n[run]",
        ["contact.restitution", "1.2", "less than or equal to 1"],
    ),
    "restitution by another theory": (
        STRIP,
        "[run]",
        '[contact]\nrestitution = "hertz"\n[run]',
        ["contact.restitution: is 'hertz', allowed is a number from 0 to 1, or \"zener\""],
    ),
    "restitution that is no number": (
        STRIP,
        "[run]",
        "[contact]\nrestitution = nan\n[run]",
        ["contact.restitution", "0"],
    ),
    "zener for a nut": (
        STRIP,
        "[run]",
        '[contact]\nrestitution = "zener"\n[run]',
        ['contact.restitution is "zener"', 'part[0].shape = "hex_nut"', "balls"],
    ),
    "a speed without an exponent": (
        STRIP,
        "[run]",
        "[contact]\nrestitution_speed_m_s = 0.5\n[run]",
        ["restitution_speed_m_s belongs to restitution_exponent"],
    ),
    "unknown nut": (STRIP, '"M2.5"', '"M7"', ["part[0].size", "'M7'", "'M2.5'"]),
    "unknown shape": (STRIP, '"hex_nut"', '"hexnut"', ["part[0].shape", "hexnut", "'hex_nut'"]),
    "unknown plate": (STRIP, '"strip"', '"disc"', ["plate.kind", "disc", "'strip'"]),
    "no plate kind": (STRIP, 'kind = "strip"', "", ["plate.kind", "missing"]),
    "unknown material": (
        STRIP,
        "thickness_mm = 3.0",
        'thickness_mm = 3.0\nmaterial = "wood"',
        ["plate.material", "'wood'", "aluminium"],
    ),
    "start off the plate": (
        STRIP,
        "[run]",
        "[part.start]\nposition_mm = [900, 0]\n[run]",
        ["part[0].start.position_mm", "900", "on the plate"],
    ),
    "range upside down": (
        STRIP,
        "[run]",
        "[part.start]\ntilt_deg = [5, 1]\n[run]",
        ["part[0].start", "tilt_deg", "low <= high"],
    ),
    "start behind the line": (
        STRIP,
        "[run]\nduration_s = 1.0",
        '[part.start]\nposition_mm = [10, 0]\n[run]\nduration_s = 1.0\nstop = "passage"',
        ["part[0].start.position_mm", "0.49 of the way", "above 0.8"],
    ),
    "amplitude beyond linear theory": (
        STRIP,
        "amplitude_um = 1.0",
        "amplitude_um = 5000.0",
        ["drive[0]", "5000 um", "3000 um"],
    ),
    "mode and frequency apart": (
        PLATE.replace("2797.0", "12000.0"),
        "amplitude_um = 1.0",
        "amplitude_um = 1.0\nmode = 1",
        ["drive[0].frequency_hz", "12000", "298.9", "natural_frequency_hz"],
    ),
    "unresolved modes": (
        STRIP,
        'kind = "strip"\nthickness_mm = 3.0',
        'kind = "rectangle"\nlength_mm = 1000.0\nwidth_mm = 50.0\nthickness_mm = 3.0',
        ["frequency_hz", "4750", "not resolved"],
    ),
    "flag as number": (STRIP, "amplitude_um = 1.0", "amplitude_um = true", ["drive[0].amplitude_um", "True", "number"]),
    "custom material misspelt": (
        STRIP,
        "thickness_mm = 3.0",
        "thickness_mm = 3.0\nmaterial = {density = 1.0}",
        ["plate.material.density", "did you mean 'density_kg_m3'"],
    ),
    "one drive not a list": (STRIP, "[[drive]]", "[drive]", ["drive", "[[...]]"]),
    "microscopic part": (
        STRIP,
        'shape = "hex_nut"\nsize = "M2.5"',
        'shape = "ball"\ndiameter_mm = 0.02',
        ["part", "moment of inertia", "1e-15"],
    ),
    "shorter than a frame": (STRIP, "duration_s = 1.0", "duration_s = 1e-6", ["run.duration_s", "1e-06", "one frame"]),
    "two parts": (STRIP, "[run]", '[[part]]\nshape = "hex_nut"\nsize = "M3"\n[run]', ["part", "overlaps another part"]),
    "not TOML": (STRIP, "[plate]", "[plate", ["not valid TOML", "line"]),
    "unknown engine": (STRIP, "[run]", '[run]\nengine = "bullet"', ["run.engine", "'bullet'", "'mujoco'"]),
    "impulses with a compliant contact": (
        STRIP,
        "[run]",
        '[contact]\nmodel = "compliant"\ntime_constant_us = 100\n[run]\nengine = "impulse"',
        ["run.engine", "impulse", "mujoco"],
    ),
    "guide over a flexible plate": (
        GUIDED,
        'kind = "piston"',
        'kind = "strip"\nthickness_mm = 3.0',
        ["plate.kind", '"strip"', 'allowed is "piston" with part[0].guide'],
    ),
    "unknown guide": (GUIDED, '"tube"', '"rail"', ["part[0].guide.kind", "rail", "'slide', 'tube'"]),
    "part wider than its tube": (GUIDED, "4.6", "4.4", ["part[0].guide.inner_diameter_mm", "4.4", "at least 4.5"]),
    "part tilted into its tube": (
        GUIDED,
        "[part.guide]",
        "[part.start]\ntilt_deg = 3.0\n[part.guide]",
        ["part[0].guide.inner_diameter_mm", "4.6", "at least 4.8"],
    ),
    "guide that never lets go": (
        GUIDED,
        "4.6",
        "4.6\ntilt_deg = 45\nfriction = 1.5",
        ["part[0].guide.friction", "1.5", "below 1 at tilt_deg = 45"],
    ),
    "guide on its side": (GUIDED, "4.6", "4.6\ntilt_deg = 80", ["part[0].guide.tilt_deg", "80", "equal to 60"]),
    "diameter of a slide": (
        GUIDED,
        '"tube"',
        '"slide"',
        ["part[0].guide.inner_diameter_mm", "unknown key", "tilt_deg, friction"],
    ),
    "friction in MuJoCo's tube": (
        GUIDED,
        "4.6\n[run]",
        '4.6\nfriction = 0.2\n[run]\nengine = "mujoco"',
        ["part[0].guide.friction", "0.2", "allowed is 0 in MuJoCo"],
    ),
    "infinite duration": (
        STRIP,
        "duration_s = 1.0",
        "duration_s = inf",
        ["run.duration_s", "inf", "less than or equal to 100000"],
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_bad_scenario_is_one_line_and_writes_nothing(name: str, tmp_path: Path) -> None:
    text, old, new, expected = CASES[name]
    assert old in text
    scenario = tmp_path / "bad.toml"
    scenario.write_text(text.replace(old, new, 1))
    out = tmp_path / "run"
    check_refused(feeder_sim("run", scenario, "--out", out), str(scenario), *expected)
    assert not out.exists()


def test_missing_scenario() -> None:
    check_refused(in_new_process("run", "nowhere.toml"), "nowhere.toml", "no such file")


def test_wrong_options() -> None:
    scenario = REPOSITORY / "scenarios/drift_4750hz.toml"
    for options in (["--seeds", "0"], ["--sed", "1"], ["--seeds", "many"]):
        done = feeder_sim("run", scenario, *options)
        assert done.returncode == 2
        assert "Traceback" not in done.stderr and options[0] in done.stderr
    check_refused(feeder_sim("run", scenario, "--engine", "bullet"), "engine", "'bullet'", "'mujoco'")


@pytest.mark.parametrize("command", ["run", "modes"])
def test_truncated_and_foreign_mode_files(command: str, tmp_path: Path) -> None:
    cut, foreign = tmp_path / "cut.h5", tmp_path / "foreign.h5"
    cut.write_bytes(MODES.read_bytes()[:100_000])
    foreign.write_text("frequency,1\n")
    for file in (cut, foreign, tmp_path / "missing.h5"):
        target = file
        if command == "run":
            target = tmp_path / "scenario.toml"
            target.write_text(PLATE.replace(str(MODES), str(file)))
        check_refused(feeder_sim(command, target), str(file), "no such" if "missing" in file.name else "truncated")


def test_open_mesh(tmp_path: Path) -> None:
    import trimesh

    box = trimesh.creation.box()
    trimesh.Trimesh(box.vertices, box.faces[:-1]).export(tmp_path / "open.stl")
    scenario = tmp_path / "mesh.toml"
    scenario.write_text(STRIP.replace('shape = "hex_nut"\nsize = "M2.5"', 'shape = "mesh"\nfile = "open.stl"'))
    check_refused(feeder_sim("run", scenario), "open.stl", "part.file", "open mesh", "closed")


def test_bad_plate_file(tmp_path: Path) -> None:
    plate = tmp_path / "plate.toml"
    plate.write_text("[plate]\nlength_mm = 180\nwidth_mm = 180\nhighest_frequency_hz = 3000\n")
    check_refused(feeder_sim("modes", plate), str(plate), "plate.thickness_mm", "missing")
    plate.write_text(plate.read_text() + "thickness_mm = 3\n[[resonance]]\nfrequency_hz = 700\n")
    check_refused(feeder_sim("modes", plate), str(plate), "resonance[0].frequency_hz", "700", "776.2")


def test_bifurcation_of_something_else(tmp_path: Path) -> None:
    sweep = ("--from", 1, "--to", 2)
    drift = REPOSITORY / "scenarios/drift_4750hz.toml"
    check_refused(feeder_sim("bifurcation", drift, *sweep), str(drift), "part[0].guide", 'kind = "slide"')
    ball = tmp_path / "ball.toml"
    ball.write_text((REPOSITORY / "scenarios/ball_50hz.toml").read_text() + DRIVE)
    check_refused(feeder_sim("bifurcation", ball, *sweep), str(ball), "drive", "2 entries", "allowed is one")


DRIVE = """
[[drive]]
frequency_hz = 60.0
amplitude_um = 10.0
"""


def test_bifurcation_with_bad_options_does_no_work(tmp_path: Path) -> None:
    ball = REPOSITORY / "scenarios/ball_50hz.toml"
    check_refused(feeder_sim("bifurcation", ball, "--from", 3, "--to", 2), "--from", "3 and 2", "--from < --to")
    check_refused(feeder_sim("bifurcation", ball, "--from", "nan", "--to", 2), "--from", "nan")
    sweep = ("--from", 200, "--to", 300)
    check_refused(
        feeder_sim("bifurcation", ball, *sweep, "--set", "contact.restitution=2"), "contact.restitution: is 2"
    )
    thick = feeder_sim("bifurcation", ball, "--from", 200, "--to", 5000)
    check_refused(thick, str(ball), "drive[0]", "5000 um", "plate's thickness")
    both = feeder_sim("bifurcation", ball, *sweep, "--picture", tmp_path / "d.png", "--data", tmp_path / "d.png")
    check_refused(both, "--data", "same file as --picture")
    unknown = feeder_sim("bifurcation", ball, *sweep, "--picture", tmp_path / "d.xyz")
    check_refused(unknown, "--picture", "'.xyz'", ".png")
    kept = tmp_path / "kept.csv"
    kept.write_text("mine")
    check_refused(feeder_sim("bifurcation", ball, *sweep, "--data", kept), str(kept), "exists already")
    assert kept.read_text() == "mine"


def test_vibrometer_of_something_else(tmp_path: Path) -> None:
    picture = tmp_path / "v.png"
    reverse = feeder_sim("vibrometer", tmp_path, "--picture", picture, "--from", 2, "--to", 1)
    check_refused(reverse, "2 and 1", "--from < --to")
    check_refused(feeder_sim("vibrometer", tmp_path, "--picture", picture), str(tmp_path), "no run here")
    scenario = tmp_path / "free.toml"
    scenario.write_text(STRIP.replace("duration_s = 1.0", "duration_s = 0.02\nseeds = 1"))
    assert feeder_sim("run", scenario, "--out", tmp_path / "run").returncode == 0
    check_refused(feeder_sim("vibrometer", tmp_path / "run", "--picture", picture), "no impacts", "part in a guide")
    assert not picture.exists()
