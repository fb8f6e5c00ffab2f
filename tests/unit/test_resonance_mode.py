"""`[[resonance]] mode`: a measured resonance that names its mode, and drives that name one."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from command_line import check_refused, feeder_sim, said

from feeder_sim.errors import InputError
from feeder_sim.run.prepare import prepare
from feeder_sim.scenario import Drive, HexNut, Rectangle, Run, Scenario, Start

PLATE = """
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


def made(folder: Path, frequency: float, *more: str) -> Path:
    plate = folder / "plate.toml"
    plate.write_text(PLATE.format(frequency=frequency) + "\n".join(more))
    return plate


def scenario(mode_file: Path, **drive: object) -> Scenario:
    return Scenario(
        plate=Rectangle(kind="rectangle", mode_file=mode_file),
        drive=(Drive(**({"voltage_vpp": 10.0} | drive)),),  # type: ignore[arg-type]
        part=(HexNut(size="M2.5", start=Start(position_mm=(3.0, 0.0))),),
        run=Run(duration_s=0.1, seeds=1),
    )


def test_a_resonance_may_name_its_mode(tmp_path: Path) -> None:
    out = tmp_path / "modes.h5"
    done = feeder_sim("modes", made(tmp_path, 2860.0), "--out", out)
    check_refused(done, "resonance[0].frequency_hz", "2860", "name a mode")
    done = feeder_sim("modes", made(tmp_path, 2860.0, "mode = 14"), "--out", out)
    assert done.returncode == 0
    (caution,) = said(done)
    assert "caution: mode 14" in caution and "2860" in caution and "2 %" in caution.replace("2%", "2 %")
    prepared = prepare(scenario(out, frequency_hz=2860.0, mode=14))
    (mode,) = prepared.scene.driven
    assert "mode 14" in mode.label and mode.drive.damping_ratio == pytest.approx(0.0015)
    # Driven at the resonance that was measured, with the gain that was: 2 um in the middle of the plate.
    assert mode.drive.natural_frequency == mode.drive.drive_frequency == 2860.0
    at = prepared.scene.surface.deflection(0, prepared.cell.antinode[None])[0] if prepared.cell else math.nan
    assert abs(at) * mode.drive.amplitude == pytest.approx(2e-6, rel=1e-3)
    assert any("mode 14" in line and "2860" in line for line in prepared.cautions)
    with pytest.raises(InputError, match="no mode within"):  # nothing else has changed
        prepare(scenario(out, frequency_hz=2860.0))
    with pytest.raises(InputError, match=r"mode 14 lies at 2776.0 Hz, or 2860.0 Hz"):
        prepare(scenario(out, frequency_hz=3000.0, mode=14))


def test_a_mode_that_is_near_and_one_that_is_not_there(tmp_path: Path) -> None:
    done = feeder_sim("modes", made(tmp_path, 2797.0, "mode = 14"))
    assert done.returncode == 0 and said(done) == []
    # The nearest is 14; the one before it was meant.
    done = feeder_sim("modes", made(tmp_path, 2760.0, "mode = 13"))
    assert done.returncode == 0 and "mode 13" in said(done)[0]
    check_refused(feeder_sim("modes", made(tmp_path, 2797.0, "mode = 99")), "resonance[0].mode", "99", "1 to")
    check_refused(feeder_sim("modes", made(tmp_path, 2797.0, "mode = 0")), "resonance[0].mode")
