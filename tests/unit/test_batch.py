"""Drifts of which no frame is kept are those of the runs that keep them."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import numpy as np
import pytest
from conftest import piston_scenario, strip_scenario

from feeder_sim.errors import InputError
from feeder_sim.records.seed import Status
from feeder_sim.run import guard
from feeder_sim.run.batch import measure_drift
from feeder_sim.run.simulation import simulate
from feeder_sim.scenario import Excitation, HexNut, Scattered, Scenario, Start
from feeder_sim.scenario.schedule import Schedule, Stage


def test_many_ensembles_drift_as_the_same_seeds_that_keep_their_frames() -> None:
    passing = strip_scenario(frequency_hz=8775.0, duration_s=10.0, seeds=5, stop="passage")
    lasting = strip_scenario(frequency_hz=4750.0, amplitude_um=3.0, duration_s=1.0, seeds=3, frames_per_second=777.0)
    two = HexNut(size="M2.5", count=2, start=Scattered(kind="scattered"))
    many = strip_scenario(frequency_hz=4750.0, duration_s=0.1, seeds=2).model_copy(update={"part": (two,)})
    scenarios = [many, passing, lasting]
    for scenario, ensemble in zip(scenarios, measure_drift(scenarios, workers=2), strict=True):
        kept = simulate(scenario)
        assert ensemble.findings == kept.findings[0][1]
        assert ensemble.status == tuple(seed.status for seed in kept.seeds)
        assert ensemble.simulated_s == pytest.approx(kept.simulated_s)
    assert measure_drift([passing])[0].findings.arrived == 5


def test_parts_that_leave_the_plate_and_runs_that_diverge_do_not_count(monkeypatch: pytest.MonkeyPatch) -> None:
    off = piston_scenario(amplitude_um=0.0, start=Start(position_mm=(89.9, 0.0)), duration_s=1.0)
    (ensemble,) = measure_drift([off])
    assert ensemble.status == (Status.LEFT_PLATE,) and ensemble.findings.drift_velocity_x_mm_s.n == 0
    monkeypatch.setattr(guard, "ENERGY_FACTOR", 1e-3)
    (ensemble,) = measure_drift([strip_scenario(amplitude_um=3.0, seeds=2, duration_s=1.0)])
    assert ensemble.status == (Status.DIVERGED,) * 2 and ensemble.findings.highest_rise_mm.n == 0


def test_a_schedule_is_refused() -> None:
    stage = Stage(drive=(Excitation(frequency_hz=4750.0, amplitude_um=1.0),), duration_s=1.0)
    scheduled = strip_scenario().model_copy(update={"schedule": Schedule(stage=(stage,)), "drive": ()})
    with pytest.raises(InputError, match=r"^schedule: .*drifts"):
        measure_drift([scheduled])


def test_a_batch_stops_when_it_is_asked_to_and_keeps_what_has_ended() -> None:
    stop, scenario = threading.Event(), strip_scenario(duration_s=0.2, seeds=2)

    def many() -> Iterator[Scenario]:
        for number in range(1000):
            if number == 20:
                stop.set()
            yield scenario

    counts: list[int] = []
    done = measure_drift(many(), stop=stop, progress=counts.append)
    assert 0 < len(done) <= 20 and counts == list(range(1, len(done) + 1))
    assert all(np.isfinite(ensemble.findings.highest_rise_mm.mean) for ensemble in done)
