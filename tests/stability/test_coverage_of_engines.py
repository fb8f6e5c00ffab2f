"""What no engine covers is refused before anything runs, and what is accepted gets an engine that starts.

Also here: rules that several measures share, which have been wrong in one of them.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import REPOSITORY, ready
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from feeder_sim.engines.lookup import engine_class
from feeder_sim.errors import InputError
from feeder_sim.measures.drift import Drift, drift_velocity
from feeder_sim.records.events import Cause, removed
from feeder_sim.records.seed import Seed, Status
from feeder_sim.records.trajectory import Frames
from feeder_sim.scenario import MujocoSettings, Scenario
from feeder_sim.scenario.engine_choice import choose_engine
from feeder_sim.scenario.tables import validated
from feeder_sim.scene.scene import Scene, build_scene

Raw = dict[str, Any]  # a scenario as it stands in a file

COMPLIANT = {"model": "compliant", "time_constant_us": 1000.0}
TUBE = {"kind": "tube", "inner_diameter_mm": 8.0}
ONE_YAW = {"yaw_deg": 0.0}
OTHER_SETTINGS = {
    "plate": "mocap",
    "contact_set": "hull",
    "cone": "pyramidal",
    "integrator": "implicitfast",
    "iterations": 50,
    "impratio": 2.0,
    "impedance": "default",
    "tolerance": "default",
    "refsafe": False,
}


def raw(**tables: Any) -> Raw:
    """A ball over a piston, with more in its tables."""
    part = {"shape": "ball", "diameter_mm": 3.0} | tables.pop("part", {})
    scenario: Raw = {
        "plate": {"kind": "piston"},
        "drive": [{"frequency_hz": 500.0, "amplitude_um": 5.0}],
        "part": [part],
        "run": {"duration_s": 0.1, "seeds": 1},
    }
    return scenario | {name: scenario.get(name, {}) | table for name, table in tables.items()}


def accepted(scenario: Raw) -> Scenario:
    return validated(scenario, Scenario, Path("case.toml"))


def refusal(scenario: Raw) -> str:
    """The message with which a scenario is refused."""
    with pytest.raises(InputError) as refused:
        accepted(scenario)
    return str(refused.value)


def test_planar_motion_with_a_compliant_contact_is_refused_for_every_engine() -> None:
    """The impulse engine has no compliance, and MuJoCo no plane; `auto` is no way past that."""
    for engine in ("auto", "impulse", "mujoco"):
        case = raw(part={"start": ONE_YAW}, contact=COMPLIANT, run={"planar": True, "engine": engine})
        assert "run." in refusal(case) and "allowed is" in refusal(case)
    auto = raw(part={"start": ONE_YAW}, contact=COMPLIANT, run={"planar": True})
    assert "run.planar is true, allowed is false in MuJoCo" in refusal(auto)
    assert choose_engine(accepted(raw(part={"start": ONE_YAW}, run={"planar": True}))).method == "impulse"


@pytest.mark.parametrize("name", OTHER_SETTINGS)
def test_settings_of_mujoco_go_with_mujoco_alone(name: str) -> None:
    """Where `auto` takes impulses they would be ignored; where it takes MuJoCo they count."""
    table = {name: OTHER_SETTINGS[name]}
    run = {"allow_unstable": True}
    assert f'run.engine is "auto", allowed is "mujoco" with mujoco.{name}' in refusal(raw(mujoco=table, run=run))
    impulse = raw(mujoco=table, run=run | {"engine": "impulse"})
    assert f'run.engine is "impulse", allowed is "mujoco" with mujoco.{name}' in refusal(impulse)
    for case in (raw(mujoco=table, contact=COMPLIANT, run=run), raw(mujoco=table, run=run | {"engine": "mujoco"})):
        assert choose_engine(accepted(case)).name == "mujoco"


def test_every_setting_of_mujoco_is_tried_with_another_value() -> None:
    defaults = MujocoSettings().model_dump()
    assert OTHER_SETTINGS.keys() == defaults.keys()
    assert all(OTHER_SETTINGS[name] != value for name, value in defaults.items())


def test_settings_of_mujoco_as_they_are_by_default_go_with_every_engine() -> None:
    scenario = accepted(raw(mujoco=MujocoSettings().model_dump()))
    assert choose_engine(scenario).name == "impulse"


def test_friction_in_a_tube_goes_with_impulses_alone() -> None:
    rough = {"guide": TUBE | {"friction": 0.2}}
    for case in (raw(part=rough, contact=COMPLIANT), raw(part=rough, run={"engine": "mujoco"})):
        assert "part[0].guide.friction is 0.2, allowed is 0 in MuJoCo" in refusal(case)
    assert choose_engine(accepted(raw(part=rough))).method == "impulse"
    assert choose_engine(accepted(raw(part={"guide": TUBE}, contact=COMPLIANT))).method == "mujoco"


STRIP: Raw = {"kind": "strip", "thickness_mm": 3.0}
SLIDE = {"kind": "slide"}
NUT: Raw = {"shape": "hex_nut", "size": "M3"}
EXPONENT = {"restitution": 0.3, "restitution_exponent": 0.2}
TANGENTIAL, ZENER = {"tangential_restitution": 0.3}, {"restitution": "zener"}
IN_MUJOCO: Raw = {"engine": "mujoco"}
EXACT: Raw = {"tolerance_nm": 0.1}
ROD: Raw = {"shape": "cylinder", "diameter_mm": 3.0, "height_mm": 6.0}
LAWS_REFUSED: dict[str, tuple[Raw, str]] = {
    "noise in MuJoCo": ({"contact": {"noise_m_s": 1e-6}, "run": IN_MUJOCO}, "noise_m_s is 1e-06, allowed is 0 or"),
    "noise with steps": (
        {"contact": {"noise_m_s": 1e-6}, "run": {"steps_per_period": 40}},
        "noise_m_s is 1e-06, allowed is 0 or",
    ),
    "noise in a tube": ({"contact": {"noise_m_s": 1e-6}, "part": {"guide": TUBE}}, "noise_m_s is 1e-06, allowed is 0"),
    "steps and a tolerance": (
        {"run": {"steps_per_period": 40, "tolerance_nm": 1.0}},
        "steps_per_period is 40, allowed",
    ),
    "a tolerance in MuJoCo": (
        {"run": IN_MUJOCO | {"tolerance_nm": 1.0}},
        "run.tolerance_nm is 1, allowed is none in Mu",
    ),
    "a tolerance for two parts": ({"part": {"count": 2, "start": {"kind": "scattered"}}, "run": EXACT}, "with 2 parts"),
    "a tolerance in a tube": ({"part": {"guide": TUBE}, "run": EXACT}, 'none with part[0].guide.kind = "tube"'),
    "a tolerance for a cylinder": ({"part": ROD, "run": EXACT}, 'none with part[0].shape = "cylinder"'),
    "a tolerance in a plane": (
        {"part": {"start": {"yaw_deg": 0.0}}, "run": EXACT | {"planar": True}},
        "none with run.planar = true",
    ),
    "a power in MuJoCo": ({"contact": EXPONENT, "run": IN_MUJOCO}, "contact.restitution_exponent is 0.2"),
    "a power, compliant": (
        {"contact": EXPONENT | COMPLIANT},
        "contact.restitution_exponent is 0.2, allowed is 0 in Mu",
    ),
    "a power on a slide": (
        {"contact": EXPONENT, "part": {"guide": SLIDE}},
        'allowed is 0 with part[0].guide.kind = "sl',
    ),
    "a power and Zener": (
        {"contact": ZENER | {"restitution_exponent": 0.2}, "plate": STRIP},
        "restitution_exponent is",
    ),
    "Zener in MuJoCo": (
        {"contact": ZENER, "plate": STRIP, "run": {"engine": "mujoco"}},
        "allowed is a number in MuJoCo",
    ),
    "Zener on a piston": ({"contact": ZENER}, 'plate.kind = "piston", which does not bend'),
    "Zener of a nut": (
        {"contact": ZENER, "plate": STRIP, "part": NUT},
        'part[0].shape = "hex_nut": its law is for balls',
    ),
    "tangential in MuJoCo": ({"contact": TANGENTIAL, "run": {"engine": "mujoco"}}, "allowed is none in MuJoCo"),
    "tangential of a nut": ({"contact": TANGENTIAL, "part": NUT}, 'allowed is none with part[0].shape = "hex_nut"'),
    "tangential in a tube": ({"contact": TANGENTIAL, "part": {"guide": TUBE}}, "allowed is none with part[0].guide"),
    "tangential in a plane": (
        {"contact": TANGENTIAL, "part": {"start": ONE_YAW}, "run": {"planar": True}},
        "allowed is none with run.planar = true",
    ),
}


@pytest.mark.parametrize("name", LAWS_REFUSED)
def test_laws_of_impact_go_where_they_hold(name: str) -> None:
    tables, line = LAWS_REFUSED[name]
    part = tables.get("part", {})
    case = raw(**tables | {"part": {}})
    case["part"] = [part if "shape" in part else case["part"][0] | part]
    case["plate"] = tables.get("plate", case["plate"])
    assert line in refusal(case)


def test_no_noise_is_no_choice_in_mujoco() -> None:
    """What MuJoCo does anyway may be said; so a comparison of engines can leave the noise out of both."""
    assert choose_engine(accepted(raw(contact={"noise_m_s": 0.0}, run=IN_MUJOCO))).name == "mujoco"


def test_zener_needs_one_modulus_of_plate_and_balls() -> None:
    silicon = raw(contact=ZENER)
    silicon["plate"] = STRIP | {"material": "silicon"}
    with pytest.raises(InputError, match="allowed is a number for an orthotropic material"):
        build_scene(accepted(silicon))
    plate = {"kind": "rectangle", "mode_file": "modes.h5"}
    rim = raw(contact=ZENER) | {"plate": plate | {"rim": True}}
    assert "plate.rim = true" in refusal(rim)
    assert "run.reaction = true" in refusal(raw(contact=ZENER, run={"reaction": True}) | {"plate": plate})


PLATES: list[Raw] = [
    {"kind": "piston"},
    {"kind": "piston", "rim": True},
    {"kind": "strip", "thickness_mm": 3.0},
    {"kind": "rectangle", "mode_file": str(REPOSITORY / "models/plate_180/modes.h5")},
    {"kind": "rectangle", "mode_file": str(REPOSITORY / "models/plate_180/modes.h5"), "rim": True},
]
SHAPES: list[Raw] = [
    {"shape": "ball", "diameter_mm": 3.0},
    {"shape": "hex_nut", "size": "M2.5"},
    {"shape": "cylinder", "diameter_mm": 3.0, "height_mm": 2.0},
]
GUIDES: list[Raw | None] = [None, {"kind": "slide"}, TUBE, {"kind": "slide", "friction": 0.2}, TUBE | {"friction": 0.2}]
STARTS: list[Raw] = [{}, {"start": ONE_YAW}, {"count": 3, "start": {"kind": "scattered"}}]
NAMED_KEY = re.compile(r"\b(run|contact|mujoco|plate|part\[0\])(\.|: )[a-z]\w*")


@st.composite
def cases(draw: st.DrawFn) -> Raw:
    """Everything that has a say in which engine a scenario gets; each value by itself is allowed."""
    part = draw(st.sampled_from(SHAPES)) | draw(st.sampled_from(STARTS))
    guide = draw(st.sampled_from(GUIDES))
    if guide is not None:
        part |= {"guide": guide | {"tilt_deg": draw(st.sampled_from([0.0, 2.0]))}}
    setting = draw(st.sampled_from([None, *OTHER_SETTINGS]))
    return {
        "plate": draw(st.sampled_from(PLATES)),
        "drive": [{"frequency_hz": 2797.0, "amplitude_um": 1.0}],
        "part": [part],
        "contact": draw(st.sampled_from([{}, COMPLIANT])),
        "mujoco": {} if setting is None else {setting: OTHER_SETTINGS[setting]},
        "run": {
            "duration_s": 0.1,
            "engine": draw(st.sampled_from(["auto", "impulse", "mujoco"])),
            "planar": draw(st.booleans()),
            "tangent_surface": draw(st.booleans()),
            "allow_unstable": draw(st.booleans()),
        },
    }


@given(case=cases())
@settings(max_examples=300, deadline=None)
def test_a_scenario_is_refused_by_its_key_or_gets_an_engine_that_starts(case: Raw) -> None:
    assume(not (case["run"]["planar"] and case["plate"].get("rim")))  # has its own test below
    check_refused_or_started(case)


def test_planar_motion_inside_a_rim_is_refused_or_starts() -> None:
    nut = {"shape": "hex_nut", "size": "M2.5", "start": ONE_YAW}
    check_refused_or_started(raw(plate={"kind": "piston", "rim": True}, run={"planar": True}) | {"part": [nut]})


def test_a_rim_around_a_guide_is_refused() -> None:
    with pytest.raises(InputError, match=r"plate\.rim is true, allowed is false with part\[0\]\.guide"):
        accepted(raw(part={"guide": TUBE}, plate={"kind": "piston", "rim": True}))


def check_refused_or_started(case: Raw) -> None:
    try:
        scenario = accepted(case)
    except InputError as error:
        message = str(error)
        assert NAMED_KEY.search(message), message
        assert "\n" not in message
        return
    choice = choose_engine(scenario)
    scene = build_scene(scenario)
    engine = engine_class(choice)(scene, np.random.default_rng(0))
    assert engine.name == choice.name
    assert choice.name == scenario.run.engine or scenario.run.engine == "auto"
    start = engine.current()
    assert start.position.shape == (1, scenario.n_parts, 3) and np.isfinite(start.position).all()


def test_a_tube_holds_its_part() -> None:
    part = {"guide": TUBE | {"inner_diameter_mm": 3.1}, "start": {"drop_height_mm": 1.0}}
    drive = [{"frequency_hz": 50.0, "amplitude_um": 250.0}]
    case = raw(part=part, run={"engine": "impulse"}) | {"drive": drive}
    scene = build_scene(accepted(case))
    engine = engine_class(choose_engine(scene.scenario))(scene, np.random.default_rng(0))
    frames = engine.advance(scene.n_frames - 1)
    assert np.hypot(*frames.position[:, 0, :2].T).max() < 0.06e-3
    assert len(engine.take_impacts(end=True)) > 0


def some_parts(scene: Scene, n_frames: int = 5) -> Frames:
    """As many parts as the scene has, lying still in the middle of the plate."""
    shape = (n_frames, len(scene.parts))
    position = np.zeros((*shape, 3))
    position[..., 2] = 1e-3
    upright = np.tile([1.0, 0.0, 0.0, 0.0], (*shape, 1))
    time = 0.5 * np.arange(n_frames, dtype=np.float64)
    return Frames(time, position, upright, position * 0, position * 0, np.ones(shape, bool))


@pytest.fixture(scope="module")
def crowd() -> Scene:
    """Three balls on a piston of 60 x 40 mm, without a schedule."""
    part = {"count": 3, "start": {"kind": "scattered"}}
    return build_scene(accepted(raw(plate={"length_mm": 60.0, "width_mm": 40.0}, part=part)))


def test_drift_of_several_parts_is_the_mean_over_those_that_are_there_at_the_end(crowd: Scene) -> None:
    frames = some_parts(crowd)
    velocity = np.array([[40e-3, 0.0], [1e-3, -2e-3], [3e-3, 4e-3]])  # the first part is about to leave
    frames.position[..., :2] += frames.time[:, None, None] * velocity
    assert drift_velocity(frames) == pytest.approx(velocity.mean(axis=0))
    frames.present[3:, 0] = False
    assert drift_velocity(frames) == pytest.approx(velocity[1:].mean(axis=0))
    lost = removed([0], float(frames.time[2]), Cause.LOST)
    seed = Seed(frames, removals=lost, status=Status.DONE)
    prepared = ready(crowd)
    assert Drift().applies(prepared)
    found = Drift().compute(prepared, [seed])
    assert found.drift_velocity_x_mm_s.mean == pytest.approx(2.0)
    assert found.drift_velocity_y_mm_s.mean == pytest.approx(1.0)
    assert found.transport_speed_mm_s.n == 0  # which part's would it be?


def test_drift_of_parts_that_are_all_gone_is_none(crowd: Scene) -> None:
    frames = some_parts(crowd)
    frames.present[-1] = False
    assert np.isnan(drift_velocity(frames)).all()


def test_on_the_plate_is_what_is_there_over_it_and_above_it(crowd: Scene) -> None:
    """On a plate of 60 x 40 mm; how high does not matter, how far below does."""
    places_mm = {
        (0.0, 0.0, 1.0): True,
        (29.9, -19.9, 1.0): True,
        (0.0, 0.0, 500.0): True,  # high over the plate
        (30.1, 0.0, 1.0): False,
        (0.0, -20.1, 1.0): False,
        (31.0, 21.0, 500.0): False,  # high, and beside it
        (0.0, 0.0, -0.1): False,  # fell past the edge and swung under the plate
        (31.0, 0.0, -1.0): False,
    }
    for place, expected in places_mm.items():
        frames = some_parts(crowd)
        frames.position[2:, 1] = 1e-3 * np.array(place)
        found = frames.on_plate(crowd.surface)
        assert found.shape == (5, 3)
        assert found[:2].all() and found[:, [0, 2]].all()
        assert (found[2:, 1] == expected).all(), place
        frames.present[3:, 1] = False
        assert (frames.on_plate(crowd.surface)[2:, 1] == [expected, False, False]).all(), place
