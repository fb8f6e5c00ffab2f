from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest
from conftest import strip_scenario

from feeder_sim.engines.impulse.engine import ImpulseEngine
from feeder_sim.engines.impulse.kinds import read_kinds
from feeder_sim.engines.mujoco.engine import MujocoEngine
from feeder_sim.engines.mujoco.mjcf import build_mjcf
from feeder_sim.run.run_folder import mjcf_text, scenario_toml
from feeder_sim.scenario import Contact, Drive, HexNut, Start, load_scenario, parse_scenario
from feeder_sim.scenario.engine_choice import choose_engine
from feeder_sim.scene.cell import transport_cell
from feeder_sim.scene.scene import build_scene


def test_compiled_bodies_carry_the_parts_inertia_at_their_origin() -> None:
    scene = build_scene(strip_scenario())
    model = build_mjcf(scene).compile()
    nut = model.body("part_0")
    assert nut.mass[0] == pytest.approx(scene.parts[0].mass)
    assert nut.inertia == pytest.approx(scene.parts[0].inertia)
    # Left unset, MuJoCo would put the centre of mass at the body's own position.
    assert model.body_ipos == pytest.approx(0.0)


def test_solver_tolerance_does_not_depend_on_the_patch_mass() -> None:
    model = build_mjcf(build_scene(strip_scenario())).compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    dense = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, dense)
    part = np.diag(dense)[3:].sum()
    assert model.opt.tolerance * np.trace(dense) / part == pytest.approx(1e-8, rel=0.01)


MODELS = [
    ("hex_nut_m2_5/hex_nut_m2_5", None),
    ("strip_3mm/scene", "drift_4750hz"),
    ("plate_180/scene", "drift_2797hz_plate"),
]


@pytest.mark.parametrize(("model", "scenario"), MODELS)
def test_models_are_what_their_scenario_makes_and_step(repository: Path, model: str, scenario: str | None) -> None:
    assert len(list(repository.glob("models/*/*.xml"))) == len(MODELS)
    file = repository / f"models/{model}.xml"
    loaded = mujoco.MjModel.from_xml_path(str(file))
    data = mujoco.MjData(loaded)
    mujoco.mj_step(loaded, data, nstep=2000)
    assert np.isfinite(data.qpos).all()
    if scenario:
        scene = build_scene(load_scenario(repository / f"scenarios/{scenario}.toml"))
        assert file.read_text() == mjcf_text(scene)
        assert data.body("part_0").xpos[2] == pytest.approx(1e-3, abs=1e-4)  # it rests on the plate


def test_patch_follows_the_surface_under_the_part() -> None:
    """After a step the patch's plane passes through the surface point below the part."""
    scene = build_scene(strip_scenario(x_mm=8.0))
    engine = MujocoEngine(scene, np.random.default_rng(0))
    engine._flight = engine._flight._replace(corners=np.empty((0, 3)))  # steps in the air need no patch
    engine.advance(20)
    t_placed = engine.data.time - scene.timestep
    point = engine.data.body("part_0").xpos[:2].copy()
    lift = engine.data.qpos[0] - scene.timestep * engine.data.qvel[0]
    tilt = engine.data.qpos[1:3] - scene.timestep * engine.data.qvel[1:3]
    height = lift + tilt[0] * point[1] - tilt[1] * point[0]
    expected = scene.surface.displacement(point[None], t_placed)[0]
    assert height == pytest.approx(expected[2], abs=1e-9)
    half = 0.5 * scene.surface.thickness
    assert half * tilt[1] == pytest.approx(expected[0], abs=1e-10)


def test_every_scenario_can_be_written_out_and_read_again(repository: Path, tmp_path: Path) -> None:
    for path in sorted(repository.glob("scenarios/*.toml")):
        scenario = load_scenario(path)
        assert parse_scenario(scenario_toml(scenario), file=tmp_path / "scenario.toml") == scenario


def test_step_resolves_the_ringing_at_the_natural_frequency_too() -> None:
    drive = Drive(frequency_hz=100.0, natural_frequency_hz=4000.0, amplitude_um=1.0)
    scene = build_scene(strip_scenario().model_copy(update={"drive": (drive,)}))
    assert scene.timestep == pytest.approx(1 / (4000 * 40))


def test_a_part_on_a_nodal_crossing_belongs_to_no_cell(repository: Path) -> None:
    scenario = load_scenario(repository / "scenarios/drift_2797hz_plate.toml")
    crossing = scenario.model_copy(
        update={
            "drive": (Drive(frequency_hz=2646.0, amplitude_um=1.0),),
            "part": (HexNut(size="M2.5", start=Start(position_mm=(0.0, 0.0))),),
        }
    )
    assert transport_cell(build_scene(crossing)) is None
    beside = crossing.model_copy(update={"part": (HexNut(size="M2.5", start=Start(position_mm=(30.0, 0.0))),)})
    cell = transport_cell(build_scene(beside))
    assert cell is not None
    assert cell.antinode == pytest.approx([0.0523, 0.0], abs=1e-3)


def test_engine_is_chosen_by_what_the_scene_needs() -> None:
    rigid = strip_scenario()
    compliant = rigid.model_copy(update={"contact": Contact(model="compliant", time_constant_us=50.0)})
    assert choose_engine(rigid).name == "impulse"
    assert choose_engine(compliant).name == "mujoco"
    assert choose_engine(strip_scenario(engine="mujoco")) == ("mujoco", "mujoco", "asked for")


def test_both_engines_start_alike() -> None:
    scene = build_scene(strip_scenario())
    one, other = (engine(scene, np.random.default_rng(3)).current() for engine in (ImpulseEngine, MujocoEngine))
    assert one.position == pytest.approx(other.position)
    assert np.abs(np.abs((one.quaternion * other.quaternion).sum(axis=-1)) - 1).max() < 1e-12


def test_impulse_engine_takes_the_part_from_the_scene() -> None:
    scene = build_scene(strip_scenario())
    kinds, part = read_kinds(scene), scene.parts[0]
    kind = kinds.record[0]
    assert kind["mass"] == pytest.approx(part.mass)
    assert kind["inertia"] == pytest.approx(part.inertia)
    assert kinds.corners[kind["corner_from"] : kind["corner_to"]] == pytest.approx(part.corners)
    assert (kind["restitution"][0], kind["friction"][0], kind["axis"]) == (0.2, 0.3, 2)
