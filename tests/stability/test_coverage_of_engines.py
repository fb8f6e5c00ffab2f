"""What no engine covers is refused before anything runs, and what is accepted gets an engine that starts.

Also here: rules that several measures share, which have been wrong in one of them.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import REPOSITORY, ready, refusal, resting
from hypothesis import example, given, settings
from hypothesis import strategies as st

from feeder_sim.engines.protocol import engine_class
from feeder_sim.errors import InputError
from feeder_sim.measures.drift import Drift, drift_velocity
from feeder_sim.records.seed import Cause, Seed, Status, removed
from feeder_sim.records.trajectory import Frames
from feeder_sim.scenario import MujocoSettings, Scenario
from feeder_sim.scenario.changes import changed_values
from feeder_sim.scenario.engine_choice import choose_engine
from feeder_sim.scenario.tables import validated
from feeder_sim.scene.scene import Scene, build_scene

Raw = dict[str, Any]  # a scenario as it stands in a file, or values at dotted keys
FILE = Path("case.toml")

COMPLIANT = {"model": "compliant", "time_constant_us": 1000.0}
TUBE = {"kind": "tube", "inner_diameter_mm": 8.0}
ONE_YAW = {"yaw_deg": 0.0}
STRIP: Raw = {"kind": "strip", "thickness_mm": 3.0}
SLIDE = {"kind": "slide"}
SCATTERED = {"kind": "scattered"}
NUT: Raw = {"shape": "hex_nut", "size": "M3"}
DIMER: Raw = {"shape": "dimer", "ball_diameter_mm": 3.0, "length_mm": 12.0}
NOISE: Raw = {"contact.noise_m_s": 1e-6}
EXACT: Raw = {"run.tolerance_nm": 0.1}
EXPONENT: Raw = {"contact.restitution": 0.3, "contact.restitution_exponent": 0.2}
TANGENTIAL: Raw = {"contact.tangential_restitution": 0.3}
ROLLING: Raw = {"contact.rolling_friction_um": 5.0}
POISSON: Raw = {"contact.law": "poisson"}
ZENER: Raw = {"contact.restitution": "zener"}
IN_MUJOCO: Raw = {"run.engine": "mujoco"}
IN_A_TUBE: Raw = {"part[0].guide": TUBE}
IN_A_PLANE: Raw = {"part[0].start": ONE_YAW, "run.planar": True}
ROUGH: Raw = {"part[0].guide": TUBE | {"friction": 0.2}}
MODES: Raw = {"kind": "modes", "mode_file": str(REPOSITORY / "models/plate_180/modes.h5")}
OF_COMPLIANT: Raw = {f"contact.{key}": value for key, value in COMPLIANT.items()}
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


def raw(changes: Raw) -> Raw:
    """A ball over a piston, with other values at dotted keys."""
    scenario: Raw = {
        "plate": {"kind": "piston"},
        "drive": [{"frequency_hz": 500.0, "amplitude_um": 5.0}],
        "part": [{"shape": "ball", "diameter_mm": 3.0}],
        "run": {"duration_s": 0.1, "seeds": 1},
    }
    return changed_values(scenario, changes, FILE)


def accepted(changes: Raw) -> Scenario:
    return validated(raw(changes), Scenario, FILE)


def refused(changes: Raw) -> str:
    """The message with which a scenario is refused."""
    return refusal(accepted, changes)


@pytest.mark.parametrize(
    ("changes", "engine"),
    [
        (IN_A_PLANE, "impulse"),
        ({"mujoco": MujocoSettings().model_dump()}, "impulse"),  # as they are by default
        (ROUGH, "impulse"),
        (IN_A_TUBE | OF_COMPLIANT, "mujoco"),
        (IN_MUJOCO | {"contact.noise_m_s": 0.0}, "mujoco"),  # what MuJoCo does anyway may be said
    ],
)
def test_the_engine_is_the_one_that_can(changes: Raw, engine: str) -> None:
    assert choose_engine(accepted(changes)).name == engine


def test_several_parts_are_computed_without_a_step_at_rest_and_on_trays() -> None:
    several = {"part[0].count": 2, "part[0].start": SCATTERED}
    assert choose_engine(accepted(several)).method == "impulse"
    assert choose_engine(accepted(EXACT | several)).method == "joint"
    tray = several | {"plate": {"kind": "tray"}, "drive": [{"frequency_hz": 50.0, "stroke_um": 50.0}]}
    assert choose_engine(accepted(tray)).method == "joint"
    assert choose_engine(accepted(tray | {"run.steps_per_period": 40})).method == "impulse"


@pytest.mark.parametrize("name", OTHER_SETTINGS)
def test_settings_of_mujoco_go_with_mujoco_alone(name: str) -> None:
    """Where `auto` takes impulses they would be ignored; where it takes MuJoCo they count."""
    other = {f"mujoco.{name}": OTHER_SETTINGS[name], "run.allow_unstable": True}
    for engine in ("auto", "impulse"):
        line = f'run.engine is "{engine}", must be "mujoco" with mujoco.{name}'
        assert line in refused(other | {"run.engine": engine})
    for changes in (OF_COMPLIANT, IN_MUJOCO):
        assert choose_engine(accepted(other | changes)).name == "mujoco"


def test_every_setting_of_mujoco_is_tried_with_another_value() -> None:
    defaults = MujocoSettings().model_dump()
    assert OTHER_SETTINGS.keys() == defaults.keys()
    assert all(OTHER_SETTINGS[name] != value for name, value in defaults.items())


@pytest.mark.parametrize(
    ("changes", "line"),
    [
        (IN_A_PLANE | OF_COMPLIANT, "run.planar is true, must be false in MuJoCo"),
        (IN_A_PLANE | OF_COMPLIANT | {"run.engine": "impulse"}, "run."),
        (IN_A_PLANE | OF_COMPLIANT | IN_MUJOCO, "run."),
        ({"run.planar": True, "part": [NUT]}, "part[0].start.yaw_deg is [0, 360], must be one angle"),
        (ROUGH | OF_COMPLIANT, "part[0].guide.friction is 0.2, must be 0 in MuJoCo"),
        (ROUGH | IN_MUJOCO, "part[0].guide.friction is 0.2, must be 0 in MuJoCo"),
        (IN_A_TUBE | {"plate.rim": True}, "plate.rim is true, must be false with part[0].guide"),
        (ZENER | {"plate": MODES | {"rim": True}}, "plate.rim = true"),
        (ZENER | {"plate": MODES, "run.reaction": True}, "run.reaction = true"),
        (NOISE | IN_MUJOCO, "noise_m_s is 1e-06, must be 0 or"),
        (NOISE | {"run.steps_per_period": 40}, "noise_m_s is 1e-06, must be 0 or"),
        ({"run.steps_per_period": 40, "run.tolerance_nm": 1.0}, "steps_per_period is 40, must be"),
        (IN_MUJOCO | {"run.tolerance_nm": 1.0}, "run.tolerance_nm is 1, must be none in Mu"),
        (NOISE | {"plate": MODES, "part[0].count": 2, "part[0].start": SCATTERED}, "noise_m_s is 1e-06, must be 0"),
        ({"run.steps_per_period": 40} | IN_A_TUBE, 'none with part[0].guide.kind = "tube"'),
        (EXACT | {"part": [DIMER]}, 'none with part[0].shape = "dimer"'),
        (EXACT | IN_A_PLANE, "none with run.planar = true"),
        (EXPONENT | IN_MUJOCO, "contact.restitution_exponent is 0.2"),
        (EXPONENT | OF_COMPLIANT, "contact.restitution_exponent is 0.2, must be 0 in Mu"),
        (EXPONENT | {"part[0].guide": SLIDE}, 'must be 0 with part[0].guide.kind = "sl'),
        (ZENER | {"contact.restitution_exponent": 0.2, "plate": STRIP}, "restitution_exponent is"),
        (ZENER | {"plate": STRIP} | IN_MUJOCO, "must be a number in MuJoCo"),
        (ZENER, 'plate.kind = "piston", which does not bend'),
        (ZENER | {"plate": STRIP, "part": [NUT]}, 'part[0].shape = "hex_nut": its law is for balls'),
        (TANGENTIAL | IN_MUJOCO, "must be none in MuJoCo"),
        (TANGENTIAL | {"part": [NUT]}, 'must be none with part[0].shape = "hex_nut"'),
        (TANGENTIAL | IN_A_TUBE, "must be none with part[0].guide"),
        (TANGENTIAL | IN_A_PLANE, "must be none with run.planar = true"),
        (POISSON | IN_MUJOCO, 'contact.law is "poisson", must be "newton" in MuJoCo'),
        (
            POISSON | {"part[0].guide": SLIDE},
            'contact.law is "poisson", must be "newton" with part[0].guide.kind = "slide"',
        ),
        (POISSON | TANGENTIAL, 'must be none with contact.law = "poisson"'),
        ({"contact.law": "stronge"}, "contact.law: is 'stronge', must be 'newton' or 'poisson'"),
        (ROLLING | IN_MUJOCO, "contact.rolling_friction_um is 5, must be 0 in MuJoCo"),
        (ROLLING | TANGENTIAL, "contact.rolling_friction_um is 5, must be 0 with contact.tangential"),
        (ROLLING | {"part[0].guide": SLIDE}, "contact.rolling_friction_um is 5, must be 0 with part[0].guide"),
    ],
)
def test_what_no_engine_can_do_is_refused_by_its_key(changes: Raw, line: str) -> None:
    assert line in refused(changes)


def test_zener_needs_one_modulus_of_plate_and_balls() -> None:
    silicon = accepted(ZENER | {"plate": STRIP | {"material": "silicon"}})
    assert "must be a number for an orthotropic material" in refusal(build_scene, silicon)


PLATES: list[Raw] = [
    {"kind": "piston"},
    {"kind": "piston", "rim": True},
    STRIP,
    MODES,
    MODES | {"rim": True},
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
@example(case=raw({"plate.rim": True, "run.planar": True, "part": [NUT | {"start": ONE_YAW}]}))
@settings(max_examples=300, deadline=None)
def test_a_scenario_is_refused_by_its_key_or_gets_an_engine_that_starts(case: Raw) -> None:
    try:
        scenario = validated(case, Scenario, FILE)
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
    guide = {"part[0].guide": TUBE | {"inner_diameter_mm": 3.1}, "part[0].start.drop_height_mm": 1.0}
    drive = {"drive[0].frequency_hz": 50.0, "drive[0].amplitude_um": 250.0}
    scene = build_scene(accepted(guide | drive | {"run.engine": "impulse"}))
    engine = engine_class(choose_engine(scene.scenario))(scene, np.random.default_rng(0))
    frames = engine.advance(scene.n_frames - 1)
    assert np.hypot(*frames.position[:, 0, :2].T).max() < 0.06e-3
    assert len(engine.take_impacts(end=True)) > 0


def some_parts(scene: Scene, n_frames: int = 5) -> Frames:
    """As many parts as the scene has, lying still in the middle of the plate."""
    position = np.tile([0.0, 0.0, 1e-3], (n_frames, len(scene.parts), 1))
    return resting(0.5 * np.arange(n_frames, dtype=np.float64), position)


@pytest.fixture(scope="module")
def crowd() -> Scene:
    """Three balls on a piston of 60 x 40 mm, without a schedule."""
    plate = {"plate.length_mm": 60.0, "plate.width_mm": 40.0}
    return build_scene(accepted(plate | {"part[0].count": 3, "part[0].start": SCATTERED}))


def test_drift_of_several_parts_is_the_mean_over_those_that_are_there_at_the_end(crowd: Scene) -> None:
    frames = some_parts(crowd)
    velocity = np.array([[40e-3, 0.0], [1e-3, -2e-3], [3e-3, 4e-3]])  # the first part is about to leave
    frames.position[..., :2] += frames.time[:, None, None] * velocity
    assert drift_velocity(frames) == pytest.approx(velocity.mean(axis=0))
    frames.present[3:, 0] = False
    assert drift_velocity(frames) == pytest.approx(velocity[1:].mean(axis=0))
    seed = Seed(frames, removals=removed([0], float(frames.time[2]), Cause.LOST), status=Status.DONE)
    prepared = ready(crowd)
    assert Drift().applies(prepared)
    found = Drift().compute(prepared, [seed])
    assert found.drift_velocity_x_mm_s.mean == pytest.approx(2.0)
    assert found.drift_velocity_y_mm_s.mean == pytest.approx(1.0)
    assert found.transport_speed_mm_s.n == 0  # which part's would it be?
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
        found = crowd.on_plate(frames)
        assert found.shape == (5, 3)
        assert found[:2].all() and found[:, [0, 2]].all()
        assert (found[2:, 1] == expected).all(), place
        frames.present[3:, 1] = False
        assert (crowd.on_plate(frames)[2:, 1] == [expected, False, False]).all(), place
