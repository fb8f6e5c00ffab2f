"""Every bad schedule, and every bad choice of parts, gives one line that names the key; nothing is written."""

from __future__ import annotations

from pathlib import Path

import pytest
from command_line import check_refused, feeder_sim

SCHEDULED = """
[plate]
kind = "piston"
length_mm = 60.0
width_mm = 60.0
[schedule]
cycles = 2
[[schedule.stage]]
drive = [{ frequency_hz = 500.0, amplitude_um = 20.0 }]
duration_s = 0.1
pause_s = 0.05
pick = { clearance_mm = 10.0 }
[[part]]
shape = "hex_nut"
size = "M2.5"
count = 4
[part.start]
kind = "scattered"
[run]
seeds = 1
"""
STAGE = SCHEDULED[SCHEDULED.index("[[schedule.stage]]") : SCHEDULED.index("[[part]]")]
DRIVE = "drive = [{ frequency_hz = 500.0, amplitude_um = 20.0 }]\n"
GUIDE = '[part.guide]\nkind = "tube"\ninner_diameter_mm = 9.0\n'

# name: (text to replace, replacement, what the line must contain)
CASES = {
    "no stage": (STAGE, "", ["schedule.stage", "missing"]),
    "empty list of stages": (f"cycles = 2\n{STAGE}", "stage = []\n", ["schedule.stage", "at least 1"]),
    "one stage not a list": ("[[schedule.stage]]", "[schedule.stage]", ["schedule.stage", "[[...]]"]),
    "one drive not a list": (DRIVE, DRIVE.replace("[{", "{").replace("}]", "}"), ["schedule.stage[0].drive", "list"]),
    "no drive in any stage": (DRIVE, "", ["schedule.stage", "at least one"]),
    "drive and schedule": (
        "[schedule]",
        "[[drive]]\nfrequency_hz = 500.0\namplitude_um = 1.0\n[schedule]",
        ["exactly one of [[drive]] and [schedule]"],
    ),
    "neither drive nor schedule": (
        f"[schedule]\ncycles = 2\n{STAGE}",
        "",
        ["exactly one of [[drive]] and [schedule]"],
    ),
    "duration beside a schedule": ("[run]", "[run]\nduration_s = 1.0", ["run.duration_s", "schedule"]),
    "stop rule beside a schedule": ("[run]", '[run]\nstop = "passage"', ["run.stop", '"passage"', '"time"']),
    "negative duration": ("duration_s = 0.1", "duration_s = -0.1", ["schedule.stage[0].duration_s", "-0.1", "than 0"]),
    "no duration": ("duration_s = 0.1\n", "", ["schedule.stage[0].duration_s", "missing", "above 0"]),
    "stage of no length": ("duration_s = 0.1", "duration_s = 0", ["schedule.stage[0].duration_s", "greater than 0"]),
    "negative pause": ("pause_s = 0.05", "pause_s = -1.0", ["schedule.stage[0].pause_s", "-1.0", "equal to 0"]),
    "infinite duration": ("duration_s = 0.1", "duration_s = inf", ["schedule.stage[0].duration_s", "inf"]),
    "duration that is no number": ("duration_s = 0.1", "duration_s = nan", ["schedule.stage[0].duration_s", "nan"]),
    "no cycle": ("cycles = 2", "cycles = 0", ["schedule.cycles", "0", "equal to 1"]),
    "half a cycle": ("cycles = 2", "cycles = 1.5", ["schedule.cycles", "1.5", "integer"]),
    "misspelt key of a stage": ("pause_s", "pause", ["schedule.stage[0].pause", "did you mean 'pause_s'"]),
    "misspelt key of a schedule": ("cycles", "cycle", ["schedule.cycle", "did you mean 'cycles'"]),
    "misspelt key of a pick": (
        "clearance_mm",
        "clearence_mm",
        ["schedule.stage[0].pick.clearence_mm", "did you mean 'clearance_mm'"],
    ),
    "misspelt key of a drive": (
        "amplitude_um",
        "amplitud_um",
        ["schedule.stage[0].drive[0].amplitud_um", "did you mean 'amplitude_um'"],
    ),
    "start of a drive in a stage": (
        "amplitude_um = 20.0",
        "amplitude_um = 20.0, start_s = 0.1",
        ["schedule.stage[0].drive[0].start_s", "unknown key"],
    ),
    "no clearance": ("clearance_mm = 10.0", "clearance_mm = 0", ["schedule.stage[0].pick.clearance_mm", "is 0"]),
    "negative clearance": (
        "clearance_mm = 10.0",
        "clearance_mm = -3.0",
        ["schedule.stage[0].pick.clearance_mm", "-3.0"],
    ),
    "amplitude beyond linear theory": (
        "amplitude_um = 20.0",
        "amplitude_um = 5000.0",
        ["schedule.stage[0].drive[0]", "5000 um", "3000 um"],
    ),
    "mode on a piston": (
        "amplitude_um = 20.0",
        "amplitude_um = 20.0, mode = 3",
        ["schedule.stage[0].drive[0].mode", "piston"],
    ),
    "many parts on one point": (
        'kind = "scattered"',
        'kind = "point"',
        ["part[0]", 'start.kind is "point"', "count = 4"],
    ),
    "no start for many parts": ('[part.start]\nkind = "scattered"\n', "", ["part[0]", "start.kind", "count = 4"]),
    "unknown start": ('kind = "scattered"', 'kind = "grid"', ["part[0].start.kind", "grid", "'scattered'"]),
    "heap without a diameter": ('kind = "scattered"', 'kind = "heap"', ["part[0].start.diameter_mm", "missing"]),
    "place off the plate": (
        'kind = "scattered"',
        'kind = "scattered"\ncentre_mm = [25.0, 0.0]\nsize_mm = [20.0, 20.0]',
        ["part[0].start.size_mm", "20", "on the plate"],
    ),
    "no part at all": ("count = 4", "count = 0", ["part[0].count", "is 0", "equal to 1"]),
    "more parts than allowed": ("count = 4", "count = 5001", ["part[0].count", "5001", "5000"]),
    "guide for scattered parts": (
        "[run]",
        f"{GUIDE}[run]",
        ["part[0]", "start.kind", "guide"],
    ),
    "guide beside another part": (
        'count = 4\n[part.start]\nkind = "scattered"\n',
        f'{GUIDE}[[part]]\nshape = "ball"\ndiameter_mm = 3.0\n',
        ["part[0].guide", "only part", "2"],
    ),
    "parts that do not fit": ("count = 4", "count = 400", ["part[0].start", "no room", "400"]),
    "starts that overlap": (
        'count = 4\n[part.start]\nkind = "scattered"\n',
        '[[part]]\nshape = "ball"\ndiameter_mm = 3.0\n',
        ["part[1].start.position_mm", "overlaps"],
    ),
}


def test_the_schedule_that_is_spoilt_below_is_a_good_one(tmp_path: Path) -> None:
    path = tmp_path / "good.toml"
    path.write_text(SCHEDULED)
    done = feeder_sim("check", path)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("name", CASES)
def test_bad_schedule_is_one_line_and_writes_nothing(name: str, tmp_path: Path) -> None:
    old, new, expected = CASES[name]
    assert old in SCHEDULED
    path = tmp_path / "bad.toml"
    path.write_text(SCHEDULED.replace(old, new, 1))
    out = tmp_path / "run"
    check_refused(feeder_sim("run", path, "--out", out), str(path), *expected)
    assert not out.exists()
