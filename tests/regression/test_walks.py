"""A part that walks by its drift map comes as far as one that is simulated."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import REPOSITORY
from drift_map_errors import compare_passage, map_around, steered_ball, ways

from feeder_sim.scenario import Strip, load_scenario
from feeder_sim.studies.drift_map.making import make_map


@pytest.mark.slow
def test_a_map_gives_the_transport_speed_of_full_runs() -> None:
    """Its own error counts, too. Without drift in the map, or with twice of it, this is far off."""
    scenario = load_scenario(REPOSITORY / "scenarios/drift_4750hz.toml")
    strip, grid = Strip(thickness_mm=3.0), ((4200.0, 5400.0), (0.01, 0.02, 0.035, 0.06))
    drift_map = make_map(scenario, strip, frequencies_hz=grid[0], speeds_m_s=grid[1], seeds=120)
    share = (drift_map.drift[:, 1:, 8:16] / np.sin((np.arange(8, 16) + 0.5) * np.pi / 48)).mean()
    print(f"\ndrift over the speed of the surface to and fro: {share:.3f}")
    assert 0.6 < share < 0.85
    found = compare_passage(drift_map, scenario, 24, 300)
    print(found.line())
    assert abs(found.error_percent) < 3.0 * found.error_se_percent + 2.0
    assert found.error_se_percent < 4.0
    assert found.speed_up > 5.0


@pytest.mark.slow
def test_walkers_come_as_far_as_balls_that_roll_but_do_not_spread_as_they_do() -> None:
    """On an orthotropic plate. A ball remembers its speed, so that its spread grows faster than the root of time."""
    ball = steered_ball()
    drift_map = map_around(ball, 60)
    note, long = ways(drift_map, ball, 32, times=(0.5, 4.0))
    print(f"\n{note.line()}\n{long.line()}")
    for at in (note, long):
        assert at.full.n == 32
        assert abs(at.walked.mean / at.full.mean - 1.0) < 0.05 + 3.0 * at.full.se / at.full.mean
    assert 0.5 < note.full.sd / note.walked.sd < 2.0
    assert long.full.sd > 3.0 * long.walked.sd
