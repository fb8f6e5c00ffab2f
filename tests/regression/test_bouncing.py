"""Bouncing ball and guided cylinder: boundaries of periodic motion, mean intervals, as they stand in the scenarios."""

from __future__ import annotations

import csv
import subprocess
import sys
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bifurcation import bisect, period_one_threshold, period_two_threshold, sweep_amplitude, theoretical_boundaries
from conftest import REPOSITORY
from pinned import BOUNCE_INTERVAL, BOUNCE_RATIO, CYLINDER_INTERVAL
from velocity import draw_velocity

from feeder_sim.constants import GRAVITY
from feeder_sim.errors import InputError
from feeder_sim.measures.bounces import expected_interval
from feeder_sim.run.run_folder import record_run
from feeder_sim.run.simulation import simulate
from feeder_sim.scenario import Scenario, load_scenario, with_run


def scenario(
    name: str, *, amplitude_um: float | None = None, frequency_hz: float | None = None, **run: Any
) -> Scenario:
    """A scenario as it stands, but for the arguments."""
    found = load_scenario(REPOSITORY / f"scenarios/{name}.toml")
    changes = {"amplitude_um": amplitude_um, "frequency_hz": frequency_hz}
    drive = found.drive[0].model_copy(update={key: value for key, value in changes.items() if value is not None})
    return with_run(found.model_copy(update={"drive": (drive,)}), **run)


def boundaries(found: Scenario, settle: int) -> dict[str, float]:
    """Where period one begins and ends, bisected from brackets 4 % wide to each side of the theory, over the theory."""
    ratios = {}
    for name, theory in theoretical_boundaries(found).items():
        low, high = 0.96 * theory, 1.04 * theory
        ratios[name] = bisect(found, low, high, "1", begins=name == "1", settle=settle)[0] / theory
    return ratios


@pytest.mark.parametrize("name", ["ball_50hz", pytest.param("ball_500hz", marks=pytest.mark.slow)])
def test_exact_method_finds_the_boundaries_of_periodic_motion(name: str) -> None:
    found = boundaries(scenario(name), settle=4000)
    assert found["1"] == pytest.approx(1.0, abs=1e-5)
    assert found["2"] == pytest.approx(1.0, abs=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ball_50hz", "ball_500hz"])
def test_mujoco_finds_the_boundaries_of_periodic_motion(name: str) -> None:
    found = boundaries(scenario(name, engine="mujoco", steps_per_period=200, seeds=4), settle=300)
    assert found["1"] == pytest.approx(1.0, abs=0.02)
    assert found["2"] == pytest.approx(1.0, abs=0.02)


def test_sweep_shows_the_cascade_and_its_scaling() -> None:
    diagram = sweep_amplitude(scenario("ball_50hz", seeds=2), np.linspace(250e-6, 280e-6, 31).tolist(), settle=3000)
    assert [b.motion for b in diagram.boundaries] == ["2", "4", "8", "16"]
    first, second = diagram.feigenbaum_ratios()
    assert first == pytest.approx(4.32, abs=0.05)
    assert second == pytest.approx(4.669, abs=0.15)  # Feigenbaum's constant, in the limit
    assert "chaotic" in diagram.sweep[-1].motions


@cache
def mean_interval(frequency: float, amplitude: float) -> float:
    """Mean over amplitudes within 3 % [ms]: at one amplitude it depends on which phases of rest recur."""
    each = expected_interval(frequency, 1e-6 * amplitude, 0.2, GRAVITY)
    means = []
    for factor in np.linspace(0.97, 1.03, 15):
        here = {"frequency_hz": frequency, "amplitude_um": float(factor * amplitude)}
        found = simulate(scenario("ball_558hz", **here, duration_s=1.0 + 50 * each, seeds=4)).measures()
        means.append(found["bounce_interval_ms"]["mean"])
    return float(np.mean(means))


@pytest.mark.parametrize(("frequency", "amplitude"), BOUNCE_INTERVAL)
def test_mean_bounce_interval(frequency: float, amplitude: float) -> None:
    expected = BOUNCE_INTERVAL[frequency, amplitude]
    assert mean_interval(frequency, amplitude) == pytest.approx(expected.mean, abs=expected.within)


def test_mean_intervals_lie_below_the_estimate_without_rest() -> None:
    ratios = [mean_interval(f, a) / (1e3 * expected_interval(f, 1e-6 * a, 0.2, GRAVITY)) for f, a in BOUNCE_INTERVAL]
    assert np.mean(ratios) == pytest.approx(BOUNCE_RATIO.mean, abs=BOUNCE_RATIO.within)


@pytest.mark.parametrize("tilt", CYLINDER_INTERVAL)
def test_guided_cylinder(tilt: float) -> None:
    expected = CYLINDER_INTERVAL[tilt]
    found = scenario("cylinder_558hz", duration_s=5.0, frames_per_second=100.0)
    assert found.guide is not None
    part = found.part[0].model_copy(update={"guide": found.guide.model_copy(update={"tilt_deg": tilt})})
    interval = simulate(found.model_copy(update={"part": (part,)})).measures()["bounce_interval_ms"]
    assert interval["n"] > 200
    assert interval["mean"] == pytest.approx(expected.mean, abs=expected.within)


def test_a_sweep_too_coarse_for_the_cascade_makes_no_boundaries_up() -> None:
    diagram = sweep_amplitude(scenario("ball_50hz", seeds=6), [215e-6, 345e-6], settle=600)
    assert [b.motion for b in diagram.boundaries] == ["2"]
    assert diagram.feigenbaum_ratios() == []


def test_boundaries_are_compared_with_theory_only_where_it_holds() -> None:
    found = scenario("ball_50hz")
    compliant = found.contact.model_copy(update={"model": "compliant", "time_constant_us": 5000.0})
    assert set(theoretical_boundaries(found)) == {"1", "2"}
    assert theoretical_boundaries(found.model_copy(update={"contact": compliant})) == {}


def test_thresholds_of_the_bouncing_ball() -> None:
    assert period_one_threshold(0.2) == pytest.approx(2.0944, abs=5e-5)
    assert period_two_threshold(0.2) == pytest.approx(2.5442, abs=5e-5)
    assert period_one_threshold(1.0) == 0.0
    assert period_two_threshold(1.0) == pytest.approx(1.0)


@pytest.mark.slow
def test_the_example_prints_draws_and_writes_what_it_computes(tmp_path: Path) -> None:
    script, ball = REPOSITORY / "docs/examples/bifurcation.py", REPOSITORY / "scenarios/ball_50hz.toml"
    files = ("--picture", str(tmp_path / "d.svg"), "--data", str(tmp_path / "d.csv"))
    options = ("--from", "249", "--to", "257", "--points", "5", "--settle", "1500")
    done = subprocess.run([sys.executable, script, ball, *options, *files], capture_output=True, text=True, check=True)
    period, begin, exact = done.stdout.splitlines()[1].split()[:3]
    assert (period, exact) == ("2", "252.88") and float(begin) == pytest.approx(252.88, rel=1e-3)
    assert "<svg" in (tmp_path / "d.svg").read_text()
    rows = list(csv.DictReader((tmp_path / "d.csv").read_text().splitlines()))
    assert {r["motion"] for r in rows if r["amplitude_um"] == "249"} == {"1"}
    assert {r["motion"] for r in rows if r["amplitude_um"] == "257"} == {"2"}
    # One impact per period: w = g T / (1 + e).
    assert float(rows[0]["impact_speed_mm_s"]) == pytest.approx(9810 * 0.02 / 1.2, rel=1e-4)
    other = [sys.executable, str(script), str(REPOSITORY / "scenarios/drift_4750hz.toml"), "--from", "1", "--to", "2"]
    refused = subprocess.run(other, capture_output=True, text=True, check=False)
    assert refused.returncode == 1 and 'part[0].guide: must be kind = "slide"' in refused.stderr


def test_the_velocity_of_a_guided_part_is_drawn(tmp_path: Path) -> None:
    ball = scenario("ball_50hz", amplitude_um=240.0, duration_s=8.0, seeds=4)
    bounces = record_run(ball, tmp_path / "run", replay=False).measures()["bounce_interval_ms"]
    drawn = draw_velocity(tmp_path / "run", tmp_path / "v.png", stop=0.5)
    assert (tmp_path / "v.png").read_bytes().startswith(b"\x89PNG")
    # The plate moves at A omega; the ball falls onto it from 2 mm at most, and is nowhere faster than that.
    assert drawn["to_s"] == 0.5 and drawn["plate_velocity_mm_s"] == pytest.approx(240e-3 * 2 * np.pi * 50.0, rel=1e-6)
    assert -300.0 < drawn["least_velocity_mm_s"] < -90.0 < 90.0 < drawn["largest_velocity_mm_s"] < 300.0
    assert drawn["bounce_interval_ms"] == bounces
    wrong: tuple[dict[str, Any], ...] = ({"seed": 4}, {"start": 9.0, "stop": 10.0})
    for arguments in wrong:
        with pytest.raises(InputError, match=r"must be 0 to 3|no frames between"):
            draw_velocity(tmp_path / "run", tmp_path / "w.png", **arguments)
