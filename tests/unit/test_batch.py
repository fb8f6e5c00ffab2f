"""Drifts measured without frames are those of the runs that keep them."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import piston_scenario, strip_scenario

import feeder_sim
from feeder_sim.errors import InputError
from feeder_sim.records.trajectory import Status
from feeder_sim.run import guard
from feeder_sim.run.batch import measure_drift
from feeder_sim.run.simulation import simulate
from feeder_sim.scenario import (
    Cylinder,
    Excitation,
    HexNut,
    PistonPlate,
    Run,
    Scattered,
    Scenario,
    Slide,
    Start,
    with_run,
)
from feeder_sim.scenario.schedule import Schedule, Stage

SCENARIOS = Path(feeder_sim.__file__).resolve().parent.parent / "scenarios"


def test_many_ensembles_drift_as_the_same_seeds_that_keep_their_frames() -> None:
    """Bit by bit until the passage; beyond its end frames are still recorded, but not measured without them."""
    passing = strip_scenario(frequency_hz=8775.0, duration_s=10.0, seeds=5, stop="passage")
    lasting = strip_scenario(frequency_hz=4750.0, amplitude_um=3.0, duration_s=1.0, seeds=3, frames_per_second=777.0)
    plate = with_run(
        feeder_sim.load_scenario(SCENARIOS / "drift_2797hz_plate.toml"), seeds=2, duration_s=1.0, stop="time"
    )
    tilted = Cylinder(shape="cylinder", diameter_mm=3.0, height_mm=4.0, start=Start(tilt_deg=(0.0, 60.0)))
    toppled = passing.model_copy(update={"part": (tilted,)})
    scattered = [
        strip_scenario(frequency_hz=hertz, duration_s=0.1, seeds=2).model_copy(
            update={"part": (HexNut(size="M2.5", start=Scattered(kind="scattered")),)}
        )
        for hertz in (4750.0, 8775.0)  # the strip is as long as the wave asks for
    ]
    scenarios = [*scattered, passing, lasting, plate, with_run(toppled, duration_s=0.5, stop="time", seed=3)]
    for scenario, ensemble in zip(scenarios, measure_drift(scenarios, workers=2), strict=True):
        kept = simulate(scenario)
        found, expected = ensemble.findings, kept.findings[0][1]
        assert ensemble.status == tuple(seed.status for seed in kept.seeds)
        assert found.arrived == expected.arrived and found.antinode_to_node_mm == expected.antinode_to_node_mm
        if expected.arrived:
            assert found.transport_speed_mm_s.mean == pytest.approx(expected.transport_speed_mm_s.mean, rel=1e-12)
        if scenario.run.stop == "time":
            assert found.drift_velocity_x_mm_s.mean == pytest.approx(expected.drift_velocity_x_mm_s.mean, rel=1e-12)
            assert found.drift_velocity_y_mm_s.se == pytest.approx(expected.drift_velocity_y_mm_s.se, rel=1e-9)
            assert found.highest_rise_mm.mean == pytest.approx(expected.highest_rise_mm.mean, rel=1e-12)
            assert ensemble.simulated_s == pytest.approx(sum(frames.time[-1] for frames in kept.trajectories))
    assert measure_drift([passing])[0].findings.arrived == 5


def test_parts_that_leave_the_plate_and_runs_that_diverge_do_not_count(monkeypatch: pytest.MonkeyPatch) -> None:
    off = piston_scenario(amplitude_um=0.0, start=Start(position_mm=(89.9, 0.0)), duration_s=1.0)
    (ensemble,) = measure_drift([off])
    assert ensemble.status == (Status.LEFT_PLATE,) and ensemble.findings.drift_velocity_x_mm_s.n == 0
    frames = simulate(off).trajectories[0]
    assert ensemble.simulated_s == pytest.approx(frames.time[frames.present[:, 0]][-1])
    monkeypatch.setattr(guard, "ENERGY_FACTOR", 1e-3)
    driven = strip_scenario(amplitude_um=3.0, seeds=2, duration_s=1.0)
    (ensemble,) = measure_drift([driven])
    kept = simulate(driven)
    assert ensemble.status == tuple(seed.status for seed in kept.seeds) == (Status.DIVERGED,) * 2
    assert ensemble.simulated_s == pytest.approx(sum(frames.time[-1] for frames in kept.trajectories))
    assert ensemble.findings.highest_rise_mm.n == 0


def test_other_scenes_are_refused() -> None:
    nut = strip_scenario()
    stage = Stage(drive=(Excitation(frequency_hz=4750.0, amplitude_um=1.0),), duration_s=1.0)
    two = HexNut(size="M2.5", count=2, start=Scattered(kind="scattered"))
    changes: dict[str, dict[str, Any]] = {
        "part": {"part": (two,)},
        "schedule": {"schedule": Schedule(stage=(stage,)), "drive": ()},
        r"run\.engine": {"run": Run(engine="mujoco", seeds=1, duration_s=0.1)},
        r"plate\.rim": {"plate": PistonPlate(kind="piston", rim=True)},
    }
    for key, change in changes.items():
        with pytest.raises(InputError, match=f"^{key}: .*without frames"):
            measure_drift([nut.model_copy(update=change)])
    guided = piston_scenario(part=HexNut(size="M2.5", start=Start(), guide=Slide(kind="slide")))
    with pytest.raises(InputError, match=r"part\[0\]\.guide"):
        measure_drift([guided])


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
