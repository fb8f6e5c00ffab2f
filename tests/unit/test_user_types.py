"""The types that a user's mypy sees: the package says that it has them, and they are right."""

from __future__ import annotations

import subprocess
import sys
import sysconfig
import venv
from pathlib import Path

import pytest
from conftest import REPOSITORY

SCRIPT = """
from pathlib import Path

import feeder_sim
from feeder_sim.scenario import Drive, HexNut, Run, Scenario, Start, Strip

scenario = Scenario(
    plate=Strip(thickness_mm=3.0, material="aluminium"),
    drive=(Drive(frequency_hz=4750.0, amplitude_um=1.5),),
    part=(HexNut(size="M3", start=Start(position_mm=(1.95, 0.0))),),
    run=Run(duration_s=30.0, stop="passage", seeds=4),
)
stronger = scenario.changed({"drive[0].amplitude_um": 2.0})
result = feeder_sim.simulate(stronger, progress=True, record=feeder_sim.EveryNth(10))
reveal_type(result.drift.transport_speed_mm_s.mean)
reveal_type(result.rate.picks_per_minute.n)
reveal_type(feeder_sim.open(Path("runs/x")).scenario)
reveal_type(result.plot.path())
reveal_type(result.to_xarray())
reveal_type(feeder_sim.measure_drift([scenario])[0].findings.arrived)
reveal_type(feeder_sim.scenario.with_run(scenario, seeds=3))
feeder_sim.simulate(scenario, record="all")
feeder_sim.simulate(scenario, recorder=None)
"""
REVEALED = [
    "float",
    "int",
    "feeder_sim.scenario.scenario.Scenario",
    "matplotlib.axes._axes.Axes",
    "xarray.core.dataset.Dataset",
    "int",
    "feeder_sim.scenario.scenario.Scenario",
]


@pytest.mark.slow  # mypy reads numpy, matplotlib, xarray and the package
def test_a_users_mypy_sees_the_types(tmp_path: Path) -> None:
    """In an environment in which the package is installed: its own sources are not looked at, as those of others."""
    environment = tmp_path / "environment"
    venv.create(environment, with_pip=False, symlinks=True)
    (site,) = environment.glob("lib/python*/site-packages")
    (site / "installed.pth").write_text(f"{REPOSITORY}\n{sysconfig.get_path('purelib')}\n")
    (tmp_path / "script.py").write_text(SCRIPT)
    command = [sys.executable, "-m", "mypy", "--strict", "--python-executable", str(environment / "bin/python")]
    found = subprocess.run(
        [*command, "--cache-dir", str(tmp_path / "cache"), "script.py"],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        check=False,
    )
    notes = [line.split('"')[1] for line in found.stdout.splitlines() if "Revealed type" in line]
    assert [note.removeprefix("builtins.") for note in notes] == REVEALED, found.stdout + found.stderr
    errors = [line for line in found.stdout.splitlines() if ": error:" in line]
    assert len(errors) == 2, found.stdout
    assert '"record" to "simulate" has incompatible type "str"' in errors[0]
    assert 'Unexpected keyword argument "recorder"' in errors[1]
