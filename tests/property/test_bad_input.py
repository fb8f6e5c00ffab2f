"""Every bad input gives one clear line that names file, key, value and what is allowed; nothing is overwritten."""

from __future__ import annotations

from math import inf, nan
from pathlib import Path
from typing import Any

import pytest
from command_line import check_refused, feeder_sim
from conftest import NUT_ON_STRIP, REPOSITORY, toml_of

MODES = REPOSITORY / "models/plate_180/modes.h5"
BOUNCING = REPOSITORY / "scenarios/ball_50hz.toml"
Document = dict[str, Any]
Cases = list[tuple[dict[str, Any], str]]  # changes, and what the line must contain

NUT = {"shape": "hex_nut", "size": "M2.5"}
BALL = {"shape": "ball", "diameter_mm": 3.0}
TUBE = {"kind": "tube", "inner_diameter_mm": 9.0}
DRIVE = {"frequency_hz": 500.0, "amplitude_um": 20.0}
SOFT = {"model": "compliant", "time_constant_us": 100}
OVER_THE_EDGE = {"kind": "scattered", "centre_mm": [25.0, 0.0], "size_mm": [20.0, 20.0]}
BLOCK = {"kind": "plate", "length_mm": 10.0, "width_mm": 9.0, "thickness_mm": 10.0}
STAGE = {"drive": [DRIVE], "duration_s": 0.1, "pause_s": 0.05, "pick": {"clearance_mm": 10.0}}
PLATE: Document = NUT_ON_STRIP | {
    "plate": {"kind": "modes", "mode_file": str(MODES)},
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
    ({"plate": {"kind": "plate", "length_mm": 100, "width_mm": 100}}, "plate.thickness_mm: is missing"),
    ({"drive[0].mode": 3}, "drive[0].mode: is 3, a strip takes amplitude_um only"),
    # Too thick for bending waves.
    ({"plate": BLOCK, "drive[0].frequency_hz": 196e3}, "drive[0].frequency_hz: is 196000 ... below 156232 Hz only"),
    ({"plate.thickness_mm": 10.0, "drive[0].frequency_hz": 160e3}, "drive[0].frequency_hz: is 160000 ... 156232"),
    ({"drive[0].frequency_hz": 2e6}, "drive[0].frequency_hz ... 2000000 ... below"),
    ({"plate.thickness_mm": None, "plate.thicknes_mm": 3.0}, "plate.thicknes_mm ... did you mean 'thickness_mm'"),
    ({"run": None, "runs": {"duration_s": 1.0}}, "runs: unknown key (did you mean 'run'"),
    ({"drive[0].amplitude_um": None}, "drive[0]: exactly one of amplitude_um and voltage_vpp"),
    ({"run.steps_per_period": 8}, "run.steps_per_period is 8, must be at least 20"),
    ({"contact": SOFT | {"time_constant_us": 10}}, "run.steps_per_period is 40 ... at least 106"),
    ({"contact.model": "compliant"}, "contact: time_constant_us"),
    ({"contact.restitution": 1.2}, "contact.restitution ... 1.2 ... less than or equal to 1"),
    ({"contact.restitution": "hertz"}, "contact.restitution: is 'hertz', must be a number"),
    ({"contact.restitution": nan}, "contact.restitution ... 0"),
    ({"contact.restitution_speed_m_s": 0.5}, "restitution_speed_m_s belongs to restitution_exponent"),
    ({"part[0].size": "M7"}, "part[0].size: is 'M7', must be 'M2', 'M2.5'"),
    ({"part[0].shape": "hexnut"}, "part[0].shape: is hexnut, must be 'hex_nut'"),
    ({"plate.kind": "disc"}, "plate.kind: is disc, must be 'strip'"),
    ({"plate.kind": None}, "plate.kind: is missing"),
    ({"plate.material": "wood"}, "plate.material: is 'wood', must be one of abs, acrylic, aluminium"),
    ({"part[0].start.position_mm": [900, 0]}, "part[0].start.position_mm ... 900 ... on the plate"),
    ({"part[0].start.tilt_deg": [5, 1]}, "part[0].start ... tilt_deg ... low <= high"),
    ({"part[0].start.position_mm": [10, 0], "run.stop": "passage"}, "part[0].start.position_mm ... 0.49 of the way"),
    ({"drive[0].amplitude_um": 5000.0}, "drive[0] ... 5000 um ... 3000 um"),
    ({"drive[0].amplitude_um": True}, "drive[0].amplitude_um: is True, must be a valid number"),
    ({"plate.material": {"density": 1.0}}, "plate.material.density ... did you mean 'density_kg_m3'"),
    ({"drive": {"frequency_hz": 4750.0, "amplitude_um": 1.0}}, "drive ... [[...]]"),
    ({"part": [{"shape": "ball", "diameter_mm": 0.02}]}, "part ... moment of inertia ... 1e-15"),
    ({"run.duration_s": 1e-6}, "run.duration_s: is 1e-06, must be at least one frame"),
    ({"part": [NUT, {"shape": "hex_nut", "size": "M3"}]}, "overlaps another part"),
    ({"run.engine": "bullet"}, "run.engine: is 'bullet', must be 'auto', 'impulse' or 'mujoco'"),
    ({"contact": SOFT, "run.engine": "impulse"}, "run.engine ... impulse ... mujoco"),
    ({"run.duration_s": inf}, "run.duration_s: is inf, must be less than or equal to 100000"),
]
OF_A_PLATE: Cases = [
    ({"drive[0].mode": 60}, "drive[0].mode: is 60, must be 1 to 59"),
    ({"drive[0].frequency_hz": 20000.0}, "drive[0].frequency_hz ... 20000 ... beyond the computed modes ... 13063"),
    ({"drive[0].frequency_hz": 2500.0}, "drive[0].frequency_hz ... 2500 ... nearest is mode"),
    ({"drive[0].frequency_hz": 2646.0, "drive[0].at_mm": [0, 0]}, "drive[0].at_mm ... nodal line of mode 13"),
    ({"drive": [{"frequency_hz": 12314.0, "voltage_vpp": 100}]}, "drive[0].voltage_vpp ... no measured gain ... 2797"),
    ({"drive[0].frequency_hz": 12000.0, "drive[0].mode": 1}, "drive[0].frequency_hz ... 12000 ... 298.9"),
]
OF_A_GUIDE: Cases = [
    ({"plate": {"kind": "strip", "thickness_mm": 3.0}}, 'plate.kind is "strip" ... part[0].guide'),
    ({"part[0].guide.inner_diameter_mm": 4.4}, "part[0].guide.inner_diameter_mm ... 4.4 ... at least 4.5"),
    ({"part[0].start.tilt_deg": 3.0}, "part[0].guide.inner_diameter_mm ... 4.6 ... at least 4.8"),
    ({"part[0].guide.tilt_deg": 45, "part[0].guide.friction": 1.5}, "part[0].guide.friction ... 1.5 ... below 1"),
    ({"part[0].guide.kind": "slide"}, "part[0].guide.inner_diameter_mm ... unknown key ... tilt_deg, friction"),
]
OF_A_SCHEDULE: Cases = [
    ({"schedule.stage": None}, "schedule.stage: is missing"),
    ({"schedule": {"stage": []}}, "schedule.stage: is [], must be a list with at least 1"),
    ({"schedule.stage": STAGE}, "schedule.stage ... [[...]]"),
    ({"stage[0].drive": DRIVE}, "schedule.stage[0].drive ... list"),
    ({"stage[0].drive": None}, "schedule.stage has no drive, must be at least one"),
    ({"drive": [{"frequency_hz": 500.0, "amplitude_um": 1.0}]}, "exactly one of [[drive]] and [schedule]"),
    ({"schedule": None}, "exactly one of [[drive]] and [schedule]"),
    ({"run.duration_s": 1.0}, "run.duration_s is that of the schedule"),
    ({"run.stop": "passage"}, 'run.stop is "passage", must be "time"'),
    ({"stage[0].duration_s": None}, "schedule.stage[0].duration_s ... missing ... above 0"),
    ({"stage[0].duration_s": 0}, "schedule.stage[0].duration_s: is 0, must be greater than 0"),
    ({"stage[0].duration_s": nan}, "schedule.stage[0].duration_s: is nan"),
    ({"cycles": 1.5}, "schedule.cycles: is 1.5, must be a valid integer"),
    ({"stage[0].pick": {"clearence_mm": 10.0}}, "schedule.stage[0].pick.clearence_mm ... did you mean 'clearance_mm'"),
    ({"stage[0].drive[0].amplitud_um": 20.0}, "schedule.stage[0].drive[0].amplitud_um ... did you mean 'amplitude_um'"),
    ({"stage[0].drive[0].start_s": 0.1}, "schedule.stage[0].drive[0].start_s: unknown key"),
    ({"stage[0].drive[0].amplitude_um": 5000.0}, "schedule.stage[0].drive[0] ... 5000 um ... 3000 um"),
    ({"stage[0].drive[0].mode": 3}, "schedule.stage[0].drive[0].mode: is 3, a piston"),
    ({"part[0].start.kind": "point"}, 'part[0] ... start.kind is "point" ... count = 4'),
    ({"part[0].start": None}, "part[0] ... start.kind ... count = 4"),
    ({"part[0].start.kind": "heap"}, "part[0].start.diameter_mm: is missing"),
    ({"part[0].start": OVER_THE_EDGE}, "part[0].start.size_mm ... 20 ... on the plate"),
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
    scenario, out = tmp_path / "bad.toml", tmp_path / "run"
    scenario.write_text(toml_of(DOCUMENTS[name], changes))
    check_refused(feeder_sim("run", scenario, "--out", out), str(scenario), expected)
    assert not out.exists()


PLATE_FILE = "[plate]\nlength_mm = 180\nwidth_mm = 180\nhighest_frequency_hz = 3000\n"

FILES: dict[str, str] = {
    "no_toml.toml": toml_of(NUT_ON_STRIP).replace("[plate]", "[plate", 1),
    "foreign.h5": "frequency,1\n",
    **{f"of_{name}.toml": toml_of(PLATE).replace(str(MODES), f"{name}.h5") for name in ("cut", "foreign", "missing")},
    "thickness.toml": PLATE_FILE,
    "resonance.toml": PLATE_FILE + "thickness_mm = 3\n[[resonance]]\nfrequency_hz = 700\n",
}


@pytest.mark.parametrize(
    ("command", "expected"),
    [
        ("run no_toml.toml", "no_toml.toml ... not valid TOML ... line"),
        ("run nowhere.toml", "nowhere.toml ... no such file"),
        ("run drift_4750hz --seeds 0", "--seeds"),
        ("run drift_4750hz --sed 1", "--sed"),
        ("run drift_4750hz --seeds many", "--seeds"),
        ("run drift_4750hz --engine bullet", "engine ... 'bullet' ... 'mujoco'"),
        ("run of_cut.toml --out out", "cut.h5 ... truncated"),
        ("run of_foreign.toml --out out", "foreign.h5 ... truncated"),
        ("run of_missing.toml --out out", "missing.h5 ... no such"),
        ("modes cut.h5", "cut.h5 ... truncated"),
        ("modes foreign.h5", "foreign.h5 ... truncated"),
        ("modes missing.h5", "missing.h5 ... no such"),
        ("modes thickness.toml", "thickness.toml ... plate.thickness_mm ... missing"),
        ("modes resonance.toml", "resonance.toml ... resonance[0].frequency_hz ... 700 ... 776.2"),
        (f"run {BOUNCING} --set contact.restitution=2", "contact.restitution: is 2"),
        (f"run {BOUNCING} --dry-run --set drive[0].amplitude_um=5000", "drive[0] ... 5000 um ... plate's thickness"),
        ("modes whole.h5 --picture d.xyz", "--picture ... '.xyz' ... .png"),
    ],
)
def test_bad_commands_and_files_are_one_line_and_write_nothing(command: str, expected: str, tmp_path: Path) -> None:
    for name, text in FILES.items():
        (tmp_path / name).write_text(text)
    (tmp_path / "cut.h5").write_bytes(MODES.read_bytes()[:100_000])
    (tmp_path / "whole.h5").write_bytes(MODES.read_bytes())
    before = {file.name: file.read_bytes() for file in tmp_path.iterdir()}
    check_refused(feeder_sim(*command.split(), cwd=tmp_path), expected)
    assert {file.name: file.read_bytes() for file in tmp_path.iterdir()} == before
