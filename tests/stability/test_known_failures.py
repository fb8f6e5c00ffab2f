"""Negative controls: settings that are known to fail have to go on failing as described, their neighbours to hold."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from chart_cases import APPROACH, FLAT_DROP, RESTITUTION, SLIDING_IMPACT, Drop
from conftest import NUT_ON_STRIP, piston_scenario, refusal
from stability_maps import FAST, Change, State, classify, compliant, falling, half_way, made_by, mujoco, soft, steps

from feeder_sim.engines.protocol import engine_class
from feeder_sim.plate.drive import ModalTerms
from feeder_sim.run.prepare import prepare
from feeder_sim.run.simulation import Result, simulate
from feeder_sim.scenario import Contact, MujocoSettings, Scenario, Start
from feeder_sim.scenario.changes import changed_values
from feeder_sim.scenario.engine_choice import choose_engine
from feeder_sim.scenario.tables import validated
from feeder_sim.scene.scene import Scene, build_scene

RIGID = Contact()
FILE = Path("strip.toml")


def ran(raw: dict[str, Any], seeds: int = 4) -> Result:
    raw["run"] |= {"seeds": seeds, "allow_unstable": True}
    return simulate(validated(raw, Scenario, FILE))


def at_8775(change: Change, setting: int = 40, seeds: int = 8) -> Result:
    return ran(made_by(change, setting, half_way(FAST)), seeds)


def drift(result: Result) -> float:
    assert result.failures == []
    return float(result.measures()["drift_velocity_x_mm_s"]["mean"])


def error(drop: Drop, change: Change, **contact: float) -> float:
    """Error of the velocity after the impact [%], computed by a method at 160 steps per millisecond."""
    raw = drop.scenario()
    change(raw, 160)
    raw["contact"] |= contact
    raw["run"]["allow_unstable"] = True
    result = simulate(validated(raw, Scenario, FILE))
    return drop.error(result.prepared, result.seeds[0])


@pytest.mark.slow
def test_nothing_drifts_on_a_mocap_plate() -> None:
    assert abs(drift(at_8775(mujoco(plate="mocap")))) < 0.1
    assert 3.0 < drift(at_8775(mujoco())) < 5.0


@pytest.mark.slow
def test_contact_of_one_step_explodes_and_of_five_does_not() -> None:
    reference = at_8775(steps, 80, 32)
    short = classify(at_8775(compliant(1, refsafe=False)), reference)
    assert short[0] == State.EXPLODING and "energy" in short[2]
    assert classify(at_8775(compliant(5)), reference)[0] in (State.STABLE, State.UNCLEAR)


def test_discrete_integrator_takes_the_rebound_out() -> None:
    assert error(FLAT_DROP, mujoco(integrator="discrete")) == pytest.approx(100.0, abs=5.0)
    assert error(FLAT_DROP, mujoco()) < 1.0


def test_without_in_plane_velocity_drift_is_a_third_or_less() -> None:
    def height_field(raw: dict[str, Any], setting: float) -> None:
        steps(raw, setting)
        raw["run"]["in_plane_velocity"] = False

    assert 0.1 < drift(at_8775(height_field, seeds=32)) / drift(at_8775(steps, seeds=32)) < 0.35


def test_sliding_impact_lifts_off_in_the_convex_cone_alone() -> None:
    """46 % of the approach too much; Coulomb's exact cone, or no friction, leaves what restitution asks for."""
    assert 40.0 < error(SLIDING_IMPACT, mujoco()) < 55.0
    assert error(SLIDING_IMPACT, steps) < 1e-4
    free = error(SLIDING_IMPACT, mujoco(), friction=0.0)
    stopped_by_friction = 100.0 * 0.3 * (1.0 + RESTITUTION)  # what the closed form still counts on
    assert free == pytest.approx(stopped_by_friction, rel=0.02)


def slope(angle: float, engine: str, contact: Contact, impedance: Literal["hard", "default"]) -> Scene:
    """A nut on a plate at rest that rises along x."""
    start = Start(drop_height_mm=(0.5, 0.5), tilt_deg=(0.0, 0.0), yaw_deg=(10.0, 10.0))
    run: dict[str, Any] = {"engine": engine, "frequency_hz": 1000.0, "duration_s": 1.0}
    scenario = piston_scenario(start=start, contact=contact, **run)
    scene = build_scene(scenario.model_copy(update={"mujoco": MujocoSettings(impedance=impedance)}))
    table = np.zeros_like(scene.surface.table)
    table[:, 0], table[:, 1] = np.tan(angle) * scene.surface.x[:, None], np.tan(angle)
    always = ModalTerms(
        np.zeros(1, np.int64), np.zeros(1), np.full(1, np.inf), np.ones(1, complex), np.zeros(1, complex)
    )
    return replace(scene, surface=replace(scene.surface, table=table, terms=always))


def creep(
    angle: float, engine: str, *, contact: Contact = RIGID, impedance: Literal["hard", "default"] = "hard"
) -> float:
    """Speed [m/s] along the slope once the nut has come to rest."""
    scene = slope(angle, engine, contact, impedance)
    frames = engine_class(choose_engine(scene.scenario))(scene, np.random.default_rng(0)).advance(scene.n_frames - 1)
    late = frames.time > 0.5
    x, t = frames.position[late, 0, 0], frames.time[late]
    return float(abs(x[-1] - x[0]) / (t[-1] - t[0]))


def test_resting_part_creeps_on_a_slope_with_the_default_impedance_of_mujoco_alone() -> None:
    """150 um/s with MuJoCo's default time constant of 20 ms; the hardest impedance makes that 0.15 um/s."""
    angle = np.radians(5.0)  # it holds up to 16.7 degrees
    soft = Contact(model="compliant", time_constant_us=20_000.0)
    assert 1e-4 < creep(angle, "mujoco", contact=soft, impedance="default") < 2e-4
    assert creep(angle, "mujoco", contact=soft) < 1e-6
    assert creep(angle, "mujoco") < 1e-8
    assert creep(angle, "impulse") < 1e-5  # it rattles within a step
    assert creep(np.radians(20.0), "impulse") > 0.1


@pytest.mark.parametrize(
    ("speed", "time_constant_ms", "expected"),
    [(1.0, 10.0, State.TUNNELLING), (1.0, 0.3, State.STABLE), (0.1, 10.0, State.STABLE), (10.0, 1.0, State.TUNNELLING)],
)
def test_soft_contact_lets_a_fast_part_through(speed: float, time_constant_ms: float, expected: State) -> None:
    result = ran(falling(speed, soft(time_constant_ms), 20), seeds=1)
    assert classify(result, None)[0] == expected
    warned = any("out of it below" in line for line in result.prepared.warnings)
    assert warned == (expected == State.TUNNELLING)


def test_rigid_contact_holds_at_one_metre_per_second() -> None:
    for method in (mujoco(), steps):
        assert classify(ran(falling(1.0, method, 40), seeds=1), None)[0] == State.STABLE


@pytest.mark.slow
def test_mujoco_needs_more_than_ten_steps_per_period() -> None:
    reference = at_8775(steps, 80, 64)
    state, deviation, _ = classify(at_8775(mujoco(), 10, 24), reference)
    assert state == State.BIASED and deviation.mean < -0.15
    assert classify(at_8775(mujoco(), 40, 16), reference)[0] == State.STABLE


def strip(changes: dict[str, Any]) -> Scenario:
    """A nut on a strip at 8775 Hz, with other values at dotted keys."""
    return validated(changed_values(NUT_ON_STRIP, {"drive[0].frequency_hz": 8775.0} | changes, FILE), Scenario, FILE)


IN_MUJOCO = {"run.engine": "mujoco"}
SHORT_CONTACT = {"contact": {"model": "compliant", "time_constant_us": 3.0}}
COMPLIANT = {"contact": {"model": "compliant", "time_constant_us": 30.0}}


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"mujoco.plate": "mocap"}, "a mocap body has no velocity in contact"),
        ({"mujoco.integrator": "discrete"}, "it takes the rebound out"),
        (SHORT_CONTACT, "a shorter contact throws parts"),
        ({"run.steps_per_period": 10}, "speeds come out wrong"),
    ],
)
def test_settings_that_fail_are_refused_with_the_reason_unless_asked_for(changes: dict[str, Any], why: str) -> None:
    assert why in refusal(strip, IN_MUJOCO | changes)
    scenario = strip(IN_MUJOCO | changes | {"run.allow_unstable": True})
    assert any(why in line for line in prepare(scenario).warnings)


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"run.in_plane_velocity": False}, "a third of their speed"),
        ({"mujoco.cone": "pyramidal"}, "20 % too fast"),
        ({"mujoco.iterations": 1}, "not resolved"),
        (COMPLIANT, "resemble no coefficient"),
        ({"mujoco.impedance": "default"}, "creeps"),
        ({}, "a sliding impact leaves the plate too fast"),
    ],
)
def test_settings_that_mislead_get_a_warning(changes: dict[str, Any], why: str) -> None:
    assert any(why in line for line in prepare(strip(IN_MUJOCO | changes)).warnings)


def test_default_settings_get_no_warning() -> None:
    assert prepare(strip({})).warnings == ()


def test_approach_is_that_of_the_drop() -> None:
    assert pytest.approx(0.3132, abs=1e-4) == APPROACH
    assert simulate(validated(falling(1.0, steps, 40), Scenario, FILE)).failures == []
