"""Every bad input gives one clear line that names file, key, value and what is allowed; nothing is overwritten."""

from __future__ import annotations

from math import inf, nan
from pathlib import Path
from typing import Any

import pytest
from command_line import check_refused, feeder_sim, in_new_process
from conftest import NUT_ON_STRIP, REPOSITORY, toml_of

MODES = REPOSITORY / "models/plate_180/modes.h5"
BOUNCING = REPOSITORY / "scenarios/ball_50hz.toml"
Document = dict[str, Any]
Cases = list[tuple[dict[str, Any], str]]  # changes, and what the line must contain

NUT = {"shape": "hex_nut", "size": "M2.5"}
BALL = {"shape": "ball", "diameter_mm": 3.0}
TUBE = {"kind": "tube", "inner_diameter_mm": 9.0}
DRIVE = {"frequency_hz": 500.0, "amplitude_um": 20.0}
STAGE = {"drive": [DRIVE], "duration_s": 0.1, "pause_s": 0.05, "pick": {"clearance_mm": 10.0}}
PLATE: Document = NUT_ON_STRIP | {
    "plate": {"kind": "rectangle", "mode_file": str(MODES)},
    "drive": [{"frequency_hz": 2797.0, "amplitude_um": 1.0}],
}
GUIDED: Document = {
    "plate": {"kind": "piston"},
    "drive": [{"frequency_hz": 50.0, "amplitude_um": 220.0}],
    "part": [{"shape": "cylinder", "diameter_mm": 4.5, "height_mm": 6.0, "guide": TUBE | {"inner_diameter_mm": 4.6}}],
    "run": {"duration_s": 1.0},
}
SCHEDULED: Document = {
    "plate": {"kind": "piston", "length_mm": 60.0, "width_mm": 60.0},
    "schedule": {"cycles": 2, "stage": [STAGE]},
    "part": [NUT | {"count": 4, "start": {"kind": "scattered"}}],
    "run": {"seeds": 1},
}

OF_A_STRIP: Cases = [
    ({"plate.thickness_mm": -3.0}, "plate.thickness_mm ... -3.0 ... greater than or equal to 0.001"),
    ({"plate.thickness_mm": None}, "plate.thickness_mm ... missing ... at least 0.001"),
    (
        {"plate": {"kind": "rectangle", "length_mm": 100, "width_mm": 100}},
        "plate ... thickness_mm is missing ... above 0",
    ),
    ({"drive[0].mode": 3}, "drive[0].mode: is 3, a strip takes amplitude_um only"),
    ({"drive[0].frequency_hz": 2e6}, "drive[0].frequency_hz ... 2000000 ... below"),
    ({"plate.thickness_mm": None, "plate.thicknes_mm": 3.0}, "plate.thicknes_mm ... did you mean 'thickness_mm'"),
    ({"run": None, "runs": {"duration_s": 1.0}}, "runs: unknown key (did you mean 'run'"),
    ({"drive[0].amplitude_um": None, "drive[0].amplitude": 1.0}, "drive[0].amplitude ... did you mean 'amplitude_um'"),
    ({"drive[0].amplitude_um": "one"}, "drive[0].amplitude_um ... 'one' ... number"),
    ({"drive[0].amplitude_um": None}, "drive[0]: exactly one of amplitude_um and voltage_vpp"),
    ({"run.steps_per_period": 8}, "run.steps_per_period is 8, allowed is at least 20"),
    (
        {"contact": {"model": "compliant", "time_constant_us": 10}},
        "run.steps_per_period is 40 ... at least 106 ... time_constant_us = 10",
    ),
    ({"contact.model": "compliant"}, "contact: time_constant_us"),
    ({"contact.restitution": 1.2}, "contact.restitution ... 1.2 ... less than or equal to 1"),
    (
        {"contact.restitution": "hertz"},
        "contact.restitution: is 'hertz', allowed is a number from 0 to 1, or \"zener\"",
    ),
    ({"contact.restitution": nan}, "contact.restitution ... 0"),
    ({"contact.restitution": "zener"}, 'contact.restitution is "zener" ... part[0].shape = "hex_nut" ... balls'),
    ({"contact.restitution_speed_m_s": 0.5}, "restitution_speed_m_s belongs to restitution_exponent"),
    ({"part[0].size": "M7"}, "part[0].size: is 'M7', allowed is 'M2', 'M2.5'"),
    ({"part[0].shape": "hexnut"}, "part[0].shape: is hexnut, allowed is 'hex_nut'"),
    ({"plate.kind": "disc"}, "plate.kind: is disc, allowed is 'strip'"),
    ({"plate.kind": None}, "plate.kind: is missing"),
    ({"plate.material": "wood"}, "plate.material: is 'wood', allowed is one of acrylic, aluminium"),
    ({"part[0].start.position_mm": [900, 0]}, "part[0].start.position_mm ... 900 ... on the plate"),
    ({"part[0].start.tilt_deg": [5, 1]}, "part[0].start ... tilt_deg ... low <= high"),
    (
        {"part[0].start.position_mm": [10, 0], "run.stop": "passage"},
        "part[0].start.position_mm ... 0.49 of the way ... above 0.8",
    ),
    ({"drive[0].amplitude_um": 5000.0}, "drive[0] ... 5000 um ... 3000 um"),
    (
        {"plate": {"kind": "rectangle", "length_mm": 1000.0, "width_mm": 50.0, "thickness_mm": 3.0}},
        "frequency_hz ... 4750 ... not resolved",
    ),
    ({"drive[0].amplitude_um": True}, "drive[0].amplitude_um: is True, allowed is a valid number"),
    ({"plate.material": {"density": 1.0}}, "plate.material.density ... did you mean 'density_kg_m3'"),
    ({"drive": {"frequency_hz": 4750.0, "amplitude_um": 1.0}}, "drive ... [[...]]"),
    ({"part": [{"shape": "ball", "diameter_mm": 0.02}]}, "part ... moment of inertia ... 1e-15"),
    ({"run.duration_s": 1e-6}, "run.duration_s: is 1e-06, allowed is at least one frame"),
    ({"part": [NUT, {"shape": "hex_nut", "size": "M3"}]}, "overlaps another part"),
    ({"run.engine": "bullet"}, "run.engine: is 'bullet', allowed is 'auto', 'impulse' or 'mujoco'"),
    (
        {"contact": {"model": "compliant", "time_constant_us": 100}, "run.engine": "impulse"},
        "run.engine ... impulse ... mujoco",
    ),
    ({"run.duration_s": inf}, "run.duration_s: is inf, allowed is less than or equal to 100000"),
]
OF_A_PLATE: Cases = [
    ({"drive[0].mode": 60}, "drive[0].mode: is 60, allowed is 1 to 59"),
    ({"drive[0].frequency_hz": 20000.0}, "drive[0].frequency_hz ... 20000 ... beyond the computed modes ... 13063"),
    ({"drive[0].frequency_hz": 2500.0}, "drive[0].frequency_hz ... 2500 ... nearest is mode"),
    ({"drive[0].frequency_hz": 2646.0, "drive[0].at_mm": [0, 0]}, "drive[0].at_mm ... nodal line of mode 13"),
    ({"drive": [{"frequency_hz": 12314.0, "voltage_vpp": 100}]}, "drive[0].voltage_vpp ... no measured gain ... 2797"),
    (
        {"drive[0].frequency_hz": 12000.0, "drive[0].mode": 1},
        "drive[0].frequency_hz ... 12000 ... 298.9 ... natural_frequency_hz",
    ),
]
OF_A_GUIDE: Cases = [
    (
        {"plate": {"kind": "strip", "thickness_mm": 3.0}},
        'plate.kind is "strip", allowed is "piston" with part[0].guide',
    ),
    ({"part[0].guide.kind": "rail"}, "part[0].guide.kind: is rail, allowed is 'slide', 'tube'"),
    ({"part[0].guide.inner_diameter_mm": 4.4}, "part[0].guide.inner_diameter_mm ... 4.4 ... at least 4.5"),
    ({"part[0].start.tilt_deg": 3.0}, "part[0].guide.inner_diameter_mm ... 4.6 ... at least 4.8"),
    (
        {"part[0].guide.tilt_deg": 45, "part[0].guide.friction": 1.5},
        "part[0].guide.friction ... 1.5 ... below 1 at tilt_deg = 45",
    ),
    ({"part[0].guide.tilt_deg": 80}, "part[0].guide.tilt_deg ... 80 ... equal to 60"),
    ({"part[0].guide.kind": "slide"}, "part[0].guide.inner_diameter_mm ... unknown key ... tilt_deg, friction"),
    ({"part[0].guide.friction": 0.2, "run.engine": "mujoco"}, "part[0].guide.friction is 0.2, allowed is 0 in MuJoCo"),
]
OF_A_SCHEDULE: Cases = [
    ({"schedule.stage": None}, "schedule.stage: is missing"),
    ({"schedule": {"stage": []}}, "schedule.stage: is [], allowed is a list with at least 1"),
    ({"schedule.stage": STAGE}, "schedule.stage ... [[...]]"),
    ({"stage[0].drive": DRIVE}, "schedule.stage[0].drive ... list"),
    ({"stage[0].drive": None}, "schedule.stage has no drive, allowed is at least one"),
    ({"drive": [{"frequency_hz": 500.0, "amplitude_um": 1.0}]}, "exactly one of [[drive]] and [schedule]"),
    ({"schedule": None}, "exactly one of [[drive]] and [schedule]"),
    ({"run.duration_s": 1.0}, "run.duration_s is that of the schedule"),
    ({"run.stop": "passage"}, 'run.stop is "passage", allowed is "time"'),
    ({"stage[0].duration_s": -0.1}, "schedule.stage[0].duration_s ... -0.1 ... than 0"),
    ({"stage[0].duration_s": None}, "schedule.stage[0].duration_s ... missing ... above 0"),
    ({"stage[0].duration_s": 0}, "schedule.stage[0].duration_s: is 0, allowed is greater than 0"),
    ({"stage[0].pause_s": -1.0}, "schedule.stage[0].pause_s ... -1.0 ... equal to 0"),
    ({"stage[0].duration_s": inf}, "schedule.stage[0].duration_s: is inf"),
    ({"stage[0].duration_s": nan}, "schedule.stage[0].duration_s: is nan"),
    ({"cycles": 0}, "schedule.cycles: is 0, allowed is greater than or equal to 1"),
    ({"cycles": 1.5}, "schedule.cycles: is 1.5, allowed is a valid integer"),
    ({"stage[0].pause_s": None, "stage[0].pause": 0.05}, "schedule.stage[0].pause ... did you mean 'pause_s'"),
    ({"cycles": None, "schedule.cycle": 2}, "schedule.cycle ... did you mean 'cycles'"),
    ({"stage[0].pick": {"clearence_mm": 10.0}}, "schedule.stage[0].pick.clearence_mm ... did you mean 'clearance_mm'"),
    (
        {"stage[0].drive": [{"frequency_hz": 500.0, "amplitud_um": 20.0}]},
        "schedule.stage[0].drive[0].amplitud_um ... did you mean 'amplitude_um'",
    ),
    ({"stage[0].drive[0].start_s": 0.1}, "schedule.stage[0].drive[0].start_s: unknown key"),
    ({"stage[0].pick.clearance_mm": 0}, "schedule.stage[0].pick.clearance_mm: is 0"),
    ({"stage[0].pick.clearance_mm": -3.0}, "schedule.stage[0].pick.clearance_mm: is -3.0"),
    ({"stage[0].drive[0].amplitude_um": 5000.0}, "schedule.stage[0].drive[0] ... 5000 um ... 3000 um"),
    ({"stage[0].drive[0].mode": 3}, "schedule.stage[0].drive[0].mode: is 3, a piston"),
    ({"part[0].start.kind": "point"}, 'part[0] ... start.kind is "point" ... count = 4'),
    ({"part[0].start": None}, "part[0] ... start.kind ... count = 4"),
    ({"part[0].start.kind": "grid"}, "part[0].start.kind: is grid, allowed is 'point', 'scattered'"),
    ({"part[0].start.kind": "heap"}, "part[0].start.diameter_mm: is missing"),
    (
        {"part[0].start": {"kind": "scattered", "centre_mm": [25.0, 0.0], "size_mm": [20.0, 20.0]}},
        "part[0].start.size_mm ... 20 ... on the plate",
    ),
    ({"part[0].count": 0}, "part[0].count: is 0, allowed is greater than or equal to 1"),
    ({"part[0].count": 5001}, "part[0].count ... 5001 ... 5000"),
    ({"part[0].guide": TUBE}, "part[0] ... start.kind ... guide"),
    ({"part": [NUT | {"guide": TUBE}, BALL]}, "part[0].guide ... only part ... 2"),
    ({"part[0].count": 400}, "part[0].start: has no room left for 400"),
    ({"part": [NUT, BALL]}, "part[1].start.position_mm: overlaps"),
]

DOCUMENTS = {"strip": NUT_ON_STRIP, "plate": PLATE, "guided": GUIDED, "scheduled": SCHEDULED}
SPOILT = {"strip": OF_A_STRIP, "plate": OF_A_PLATE, "guided": OF_A_GUIDE, "scheduled": OF_A_SCHEDULE}


@pytest.mark.parametrize("name", DOCUMENTS)
def test_the_documents_that_are_spoilt_below_are_good_ones(name: str, tmp_path: Path) -> None:
    (tmp_path / "good.toml").write_text(toml_of(DOCUMENTS[name]))
    done = feeder_sim("check", tmp_path / "good.toml")
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(("name", "changes", "expected"), [(name, *case) for name in SPOILT for case in SPOILT[name]])
def test_bad_scenario_is_one_line_and_writes_nothing(
    name: str, changes: dict[str, Any], expected: str, tmp_path: Path
) -> None:
    check_spoilt(toml_of(DOCUMENTS[name], changes), expected, tmp_path)


def test_text_that_is_not_toml(tmp_path: Path) -> None:
    check_spoilt(toml_of(NUT_ON_STRIP).replace("[plate]", "[plate", 1), "not valid TOML ... line", tmp_path)


def check_spoilt(text: str, expected: str, folder: Path) -> None:
    scenario, out = folder / "bad.toml", folder / "run"
    scenario.write_text(text)
    check_refused(feeder_sim("run", scenario, "--out", out), str(scenario), expected)
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
            target.write_text(toml_of(PLATE, {"plate.mode_file": str(file)}))
        check_refused(feeder_sim(command, target), str(file), "no such" if "missing" in file.name else "truncated")


def test_open_mesh(tmp_path: Path) -> None:
    import trimesh

    box = trimesh.creation.box()
    trimesh.Trimesh(box.vertices, box.faces[:-1]).export(tmp_path / "open.stl")
    scenario = tmp_path / "mesh.toml"
    scenario.write_text(toml_of(NUT_ON_STRIP, {"part": [{"shape": "mesh", "file": "open.stl"}]}))
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
    second = "[[drive]]\nfrequency_hz = 60.0\namplitude_um = 10.0\n"
    ball.write_text(BOUNCING.read_text() + second)
    check_refused(feeder_sim("bifurcation", ball, *sweep), str(ball), "drive", "2 entries", "allowed is one")


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        ("--from 3 --to 2", "--from ... 3 and 2 ... --from < --to"),
        ("--from nan --to 2", "--from ... nan"),
        ("--from 200 --to 300 --set contact.restitution=2", "contact.restitution: is 2"),
        ("--from 200 --to 5000", f"{BOUNCING} ... drive[0] ... 5000 um ... plate's thickness"),
        ("--from 200 --to 300 --picture d.png --data d.png", "--data ... same file as --picture"),
        ("--from 200 --to 300 --picture d.xyz", "--picture ... '.xyz' ... .png"),
        ("--from 200 --to 300 --data kept.csv", "kept.csv ... exists already"),
    ],
)
def test_bifurcation_with_bad_options_does_no_work(options: str, expected: str, tmp_path: Path) -> None:
    (tmp_path / "kept.csv").write_text("mine")
    check_refused(feeder_sim("bifurcation", BOUNCING, *options.split(), cwd=tmp_path), expected)
    assert [(file.name, file.read_text()) for file in tmp_path.iterdir()] == [("kept.csv", "mine")]


def test_vibrometer_of_something_else(tmp_path: Path) -> None:
    picture = tmp_path / "v.png"
    reverse = feeder_sim("vibrometer", tmp_path, "--picture", picture, "--from", 2, "--to", 1)
    check_refused(reverse, "2 and 1", "--from < --to")
    check_refused(feeder_sim("vibrometer", tmp_path, "--picture", picture), str(tmp_path), "no run here")
    scenario = tmp_path / "free.toml"
    scenario.write_text(toml_of(NUT_ON_STRIP, {"run": {"duration_s": 0.02, "seeds": 1}}))
    assert feeder_sim("run", scenario, "--out", tmp_path / "run").returncode == 0
    check_refused(feeder_sim("vibrometer", tmp_path / "run", "--picture", picture), "no impacts", "part in a guide")
    assert not picture.exists()
