"""Ensemble means of the two drift scenarios, nothing fitted, inside the measured intervals."""

from __future__ import annotations

from pathlib import Path

import pytest

from feeder_sim.scenario import load_scenario
from feeder_sim.simulation import simulate


@pytest.mark.parametrize(
    ("name", "low", "high"),
    [("drift_4750hz", 1.17, 1.71), ("drift_8775hz", 3.53, 4.81)],  # 1.44 +- 0.27 and 4.17 +- 0.64 mm/s measured
)
def test_transport_speed_lies_in_the_measured_interval(repository: Path, name: str, low: float, high: float) -> None:
    scenario = load_scenario(repository / f"scenarios/{name}.toml")
    assert (scenario.contact.restitution, scenario.contact.friction) == (0.2, 0.3)
    assert scenario.drive[0].amplitude_um == 1.0
    speed = simulate(scenario).measures()["transport_speed_mm_s"]
    print(f"{name}: {speed['mean']:.3f} +- {speed['se']:.3f} mm/s, n = {speed['n']}")
    assert speed["n"] == scenario.run.seeds == 12
    assert low < speed["mean"] < high
    assert speed["se"] < 0.25 * (high - low)


def test_nut_drifts_on_a_mode_of_the_real_plate(repository: Path) -> None:
    scenario = load_scenario(repository / "scenarios/drift_2797hz_plate.toml")
    speed = simulate(scenario).measures()["transport_speed_mm_s"]
    assert speed["n"] == 12
    # No measurement: pinned to what it gave when it was added, 1.69 +- 0.06 mm/s.
    assert abs(speed["mean"] - 1.69) < 4 * (0.06**2 + speed["se"] ** 2) ** 0.5
