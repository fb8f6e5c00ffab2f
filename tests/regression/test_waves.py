"""Nuts on quasi-travelling waves: they run round with the sense of the wave, and gather at its still points."""

from __future__ import annotations

import pytest
from conftest import REPOSITORY

from feeder_sim.measures.circulation import circulation, stage_waves
from feeder_sim.measures.statistic import Statistic
from feeder_sim.plate.wave import Track
from feeder_sim.run.simulation import simulate
from feeder_sim.scenario import Scenario, load_scenario, with_run
from feeder_sim.scene.scene import build_scene

RUNNING, GATHERING = (REPOSITORY / f"scenarios/wave_{name}.toml" for name in ("circulation", "gather"))
SEEDS, PLACES = 4, 8
DURATION_S, COUNTED_FROM_S = 3.0, 1.0


def on_track(track: Track, phase_deg: float) -> Scenario:
    """Eight nuts along the track, too far apart to meet, on the wave with another phase between its modes."""
    raw = load_scenario(RUNNING).model_dump(exclude_none=True)
    raw["schedule"]["stage"][0]["drive"][1]["phase_deg"] = phase_deg
    raw["schedule"]["stage"][0]["duration_s"] = DURATION_S
    places = 1e3 * track.points[:: len(track.points) // PLACES]
    start = {"drop_height_mm": [0.05, 0.3], "yaw_deg": [0.0, 360.0]}
    raw["part"] = [
        {"shape": "hex_nut", "size": "M2.5", "start": start | {"position_mm": place.tolist()}} for place in places
    ]
    raw["run"]["seeds"] = SEEDS
    return Scenario.model_validate(raw)


@pytest.fixture(scope="module")
def speeds() -> dict[float, Statistic]:
    """Circulation [mm/s] along the crest's track of the wave at 90 degrees, for three phases."""
    (wave,) = stage_waves(build_scene(load_scenario(RUNNING)))
    assert wave.track is not None
    found = {}
    for phase in (90.0, -90.0, 0.0):
        result = simulate(on_track(wave.track, phase))
        speed = [
            1e3 * circulation(result.scene, wave.track, frames, COUNTED_FROM_S, DURATION_S)
            for frames in result.trajectories
        ]
        found[phase] = Statistic.of(speed)
        print(f"{phase:+.0f} degrees: {found[phase].mean:+.3f} +- {found[phase].se:.3f} mm/s")
    return found


@pytest.mark.slow
def test_nuts_run_the_way_of_the_wave(speeds: dict[float, Statistic]) -> None:
    assert speeds[90.0].mean > 3.0 * speeds[90.0].se
    assert speeds[-90.0].mean < -3.0 * speeds[-90.0].se


@pytest.mark.slow
def test_nuts_do_not_run_round_on_a_standing_wave(speeds: dict[float, Statistic]) -> None:
    standing = speeds[0.0]
    assert abs(standing.mean) < 3.0 * standing.se
    assert standing.se < speeds[90.0].mean


@pytest.mark.slow
def test_nuts_gather_at_still_points() -> None:
    scenario = with_run(load_scenario(GATHERING), seeds=2)
    (wave,) = simulate(scenario).measures()["waves"]
    assert wave["still_points"] == 9
    assert wave["at_still_points"]["mean"] >= 0.8
