"""A run that leaves the range of valid states stops with time, part and cause, and keeps what it computed."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from command_line import feeder_sim, said
from conftest import changing, piston_scenario, ready, resting, strip_scenario, toml_of
from failing import same
from scipy.spatial.transform import Rotation

from feeder_sim.engines.impulse.engine import ImpulseEngine
from feeder_sim.engines.mujoco.engine import MujocoEngine
from feeder_sim.errors import Divergence
from feeder_sim.records.seed import Status
from feeder_sim.records.trajectory import Frames
from feeder_sim.records.trajectory_file import read_recording
from feeder_sim.run.guard import ENERGY_FACTOR, Guard
from feeder_sim.run.prepare import prepare
from feeder_sim.run.run_folder import record_run
from feeder_sim.run.simulation import simulate
from feeder_sim.run.state_check import ALLOWED, DEPTH, ENERGY, FALLEN, MOST_ENERGY
from feeder_sim.scenario import Contact, Drive, Excitation, HexNut, Run, Scattered, Scenario, Start
from feeder_sim.scenario.schedule import Schedule, Stage
from feeder_sim.scene.scene import Scene, build_scene

LEVEL = [1.0, 0.0, 0.0, 0.0]
TUNNELLING = {
    "plate": {"kind": "piston"},
    "drive": [{"frequency_hz": 50.0, "amplitude_um": 1.0}],
    # Arrives at 20 m/s: 150 mm within a contact so soft, through a plate of 3 mm.
    "part": [{"shape": "hex_nut", "size": "M2.5", "start": {"drop_height_mm": 20000.0, "tilt_deg": 0.0}}],
    "contact": {"model": "compliant", "time_constant_us": 20000.0},
    "run": {"engine": "mujoco", "duration_s": 5.0, "seeds": 2},
}


def test_tunnelling_part_stops_the_run_and_keeps_its_frames(tmp_path: Path) -> None:
    scenario, folder = tmp_path / "fast.toml", tmp_path / "run"
    scenario.write_text(toml_of(TUNNELLING))
    done = feeder_sim("run", scenario, "--out", folder, "--json")
    assert done.returncode == 1
    assert "Traceback" not in done.stderr
    lines = [line for line in said(done) if "warning" not in line]
    assert len(lines) == 2 and all(f"last states in seeds/{i:03d}.h5" in line for i, line in enumerate(lines))
    assert all("part_0 at 2.0" in line and "below the plate" in line for line in lines)
    recording = read_recording(folder)
    assert recording.status == (Status.DIVERGED, Status.DIVERGED)
    for frames in recording.seeds:
        assert frames.time[-1] == pytest.approx(np.sqrt(2 * 20 / 9.81), abs=0.01)
        assert (frames.position[:, 0, 2] > 0).all()


def test_slow_part_on_the_same_plate_does_not_tunnel() -> None:
    start = Start(drop_height_mm=(20.0, 20.0), tilt_deg=(0.0, 0.0))
    scenario = piston_scenario(frequency_hz=50.0, amplitude_um=1.0, start=start, duration_s=0.5)
    assert simulate(scenario).seeds[0].status == Status.DONE


@pytest.mark.parametrize(
    ("scenario", "poison", "expected"),
    [
        (strip_scenario(duration_s=2.0, engine="mujoco"), ("qvel", 0, np.nan), Divergence.NOT_FINITE),
        (piston_scenario(duration_s=1.0, engine="mujoco"), ("qvel", 5, 2e4), Divergence.TOO_MUCH_ENERGY),
        (piston_scenario(duration_s=1.0, engine="mujoco"), ("qpos", 2, -5e-5), Divergence.TOO_DEEP),
    ],
)
def test_what_comes_from_nowhere_is_noticed_in_a_run(
    scenario: Scenario, poison: tuple[str, int, float], expected: Divergence, tmp_path: Path, monkeypatch: Any
) -> None:
    """A nut gets a velocity that is no number; one at rest on a plate at rest is spun to 2e4 rad/s, or pushed in."""
    original, (of, number, by) = MujocoEngine.advance, poison

    def poisoned(self: MujocoEngine, n_frames: int) -> object:
        if 0.3 < self.data.time < 0.6:
            joint = self.model.joint("part_0")
            first = joint.dofadr[0] if of == "qvel" else joint.qposadr[0]
            getattr(self.data, of)[first + number] += by
        return original(self, n_frames)

    monkeypatch.setattr(MujocoEngine, "advance", poisoned)
    result = record_run(scenario, tmp_path, replay=False)
    assert result.seeds[0].status == Status.DIVERGED
    (failure,) = result.failures
    assert failure.divergence == expected and failure.part == "part_0" and 0.3 < failure.time_s < 0.7
    assert np.isfinite(result.trajectories[0].position).all()
    assert result.trajectories[0].time[-1] < failure.time_s
    kept, last = read_recording(tmp_path).records[0].last, result.seeds[0].last
    assert (
        last is not None
        and kept is not None
        and same(kept, last)
        and np.isfinite(kept.frames.velocity[: kept.valid]).all()
    )
    assert np.isfinite(kept.frames.velocity[kept.valid]).all() == (expected != Divergence.NOT_FINITE)


def test_part_that_falls_off_the_plate_is_counted_and_no_failure() -> None:
    result = simulate(piston_scenario(start=Start(position_mm=(89.9, 0.0)), duration_s=1.0))
    assert result.failures == []
    assert result.seeds[0].status == Status.LEFT_PLATE
    assert result.summary()["left_plate"] == 1
    last = result.trajectories[0].position[-1, 0]
    assert last[2] < 0 and last[0] > 0.09


def frames_at(scene: Scene, n: int = 10, **states: np.ndarray) -> Frames:
    """Frames of parts at rest, level, 2 mm over the middle of the plate; `states` replace theirs."""
    middle = np.tile([0.0, 0.0, 2e-3], (n, len(scene.parts), 1))
    frames = resting(np.asarray(scene.frame_interval * np.arange(n), float), middle)
    for name, values in states.items():
        getattr(frames, name)[:] = values
    return frames


def watched(scene: Scene, n: int = 10, **states: np.ndarray) -> tuple[Frames, Guard]:
    """Frames as `frames_at` has them, and the guard of a run that begins with the first of them."""
    frames = frames_at(scene, n, **states)
    return frames, Guard(ready(scene), frames[slice(1)])


def verdict(guard: Guard, frames: Frames) -> tuple[int, Divergence | None, str]:
    """How many frames are valid, and what is wrong with the next: kind and cause, "" for nothing."""
    valid, failure = guard.check(frames, 0)
    return (valid, failure.divergence, failure.cause) if failure else (valid, None, "")


def test_earliest_violation_is_the_one_reported() -> None:
    """Also of a part that is thrown through the plate and off it within a frame."""
    frames, guard = watched(build_scene(strip_scenario()), 100)
    frames.position[5:, 0], frames.velocity[5:, 0] = [3.0, 0.0, -1.0], [1500.0, 0.0, -500.0]
    frames.position[50:] = np.nan
    valid, failure = guard.check(frames, 0)
    assert failure is not None and failure.time_s == pytest.approx(frames.time[5])
    assert (valid, failure.divergence) == (5, Divergence.TOO_MUCH_ENERGY)


@pytest.mark.parametrize("field", ["position", "quaternion", "velocity", "angular_velocity"])
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_every_part_of_a_state_has_to_be_finite(field: str, value: float) -> None:
    frames, guard = watched(build_scene(strip_scenario()))
    assert guard.check(frames, 0) == (10, None)
    getattr(frames, field)[7, 0, -1] = value
    assert verdict(guard, frames) == (7, Divergence.NOT_FINITE, "its state is not finite")


def test_energy_is_that_of_motion_height_and_spin_about_the_principal_axes() -> None:
    """A nut on its side, that spins about the vertical: about one of its own transverse axes, or about its bore."""
    scene = build_scene(strip_scenario())
    (kind,) = scene.kinds
    side = [np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0]  # the bore, z, points along -y
    turned = np.array([LEVEL, side, side])[:, None]
    frames, guard = watched(scene, 3, velocity=np.array([0.3, 0.0, 0.4]), quaternion=turned)
    frames.angular_velocity[:, 0] = [[0.0, 0.0, 100.0], [0.0, 0.0, 100.0], [0.0, 100.0, 0.0]]
    found = guard.states(frames).of_frames(ENERGY)[:, 0]
    common = kind.mass * (0.5 * 0.5**2 + 9.81 * 2e-3)
    assert kind.inertia[2] > 1.3 * kind.inertia[1]
    assert found == pytest.approx(common + 0.5e4 * kind.inertia[[2, 1, 2]], rel=1e-12)


@pytest.mark.parametrize("form", ["motion", "height", "spin"])
@pytest.mark.parametrize("factor", [0.99, 1.01])
def test_energy_beyond_what_the_plate_can_give_is_a_failure_in_any_form(form: str, factor: float) -> None:
    scene = build_scene(strip_scenario())
    (kind,) = scene.kinds
    frames, guard = watched(scene)
    states = guard.states(frames)
    limit, rest = states.of_frames(MOST_ENERGY)[6, 0], states.of_frames(ENERGY)[6, 0]
    assert 10.0 * rest < limit
    more = 2.0 * (factor * limit - rest)
    field, axis, value = {
        "motion": (frames.velocity, 1, np.sqrt(more / kind.mass)),
        "height": (frames.position, 2, factor * limit / (kind.mass * 9.81)),
        "spin": (frames.angular_velocity, 2, np.sqrt(more / kind.inertia[2])),
    }[form]
    field[6, 0, axis] = value
    expected = (10, None, "") if factor < 1.0 else (6, Divergence.TOO_MUCH_ENERGY)
    assert verdict(guard, frames)[: len(expected)] == expected


def test_the_plate_gives_elastic_parts_more_and_more_and_others_no_more() -> None:
    """Momentum: an elastic ball in step with a plate of speed u comes to v^2 = 2 u (v + g t), others to 1.5 u."""
    given = {}
    for e in (0.2, 1.0):
        scene = build_scene(piston_scenario(amplitude_um=1.0, contact=Contact(restitution=e), start=Start()))
        frames, guard = watched(scene, 2, position=np.zeros(3))
        frames.time[:] = 0.0, 100.0
        limit = guard.states(frames).of_frames(MOST_ENERGY)[:, 0] / ENERGY_FACTOR
        given[e] = np.sqrt(2.0 * limit / scene.kinds[0].mass)
    u = 2 * np.pi * 4750.0 * 1e-6
    assert given[0.2] == pytest.approx([1.5 * u] * 2)
    v = given[1.0][1]
    assert given[1.0][0] == pytest.approx(2.0 * u) and v**2 == pytest.approx(2.0 * u * (v + 9.81 * 100.0))


@pytest.mark.parametrize("engine", ["impulse", "mujoco"])
def test_elastic_part_gains_much_and_is_no_failure(engine: Literal["impulse", "mujoco"]) -> None:
    run: dict[str, Any] = {"duration_s": 0.5, "seeds": 2, "engine": engine}
    elastic = Contact(restitution=1.0)
    result = simulate(piston_scenario(frequency_hz=2797.0, amplitude_um=5.0, contact=elastic, **run))
    assert result.failures == []
    fastest = max(np.abs(frames.velocity[..., 2]).max() for frames in result.trajectories)
    assert fastest > 3.0 * 2 * np.pi * 2797.0 * 5e-6


def moving_piston(**changes: Any) -> Scene:
    """A nut over a plate that moves by 60 um from the start."""
    drive = Drive(frequency_hz=500.0, amplitude_um=60.0, ring_up=False)
    return build_scene(piston_scenario(drive=(drive,), frames_per_second=3100.0).model_copy(update=changes))


@pytest.mark.parametrize("factor", [0.99, 1.01])
def test_corner_deeper_in_the_moving_plate_than_allowed_is_a_failure(factor: float) -> None:
    """The plate goes up and down by more than what is allowed."""
    scene = moving_piston()
    frames = frames_at(scene, 100)
    height = np.array([scene.surface.displacement(np.zeros((1, 2)), t)[0, 2] for t in frames.time])
    frames.position[:, 0, 2] = 1e-3 + height  # the nut is 2 mm high
    guard = Guard(ready(scene), frames[slice(1)])
    assert np.ptp(height) > 1.9 * 60e-6 and np.abs(guard.states(frames).of_frames(DEPTH)).max() < 1e-15
    for _ in range(9):  # the limit depends on the height, a little
        allowed = guard.states(frames).of_frames(ALLOWED)[81, 0]
        frames.position[81, 0, 2] = 1e-3 + height[81] - factor * allowed
    assert 1e-5 < allowed < 6e-5
    expected = (100, None, "") if factor < 1.0 else (81, Divergence.TOO_DEEP)
    assert verdict(guard, frames)[: len(expected)] == expected


@pytest.mark.parametrize("tangent", [False, True])
def test_depth_is_that_of_the_deepest_corner_below_the_surface_the_engine_uses(tangent: bool) -> None:
    drives = (Drive(frequency_hz=4750.0, amplitude_um=50.0), Drive(frequency_hz=8775.0, amplitude_um=30.0))
    run = Run(duration_s=2.0, seeds=1, tangent_surface=tangent)
    scene = build_scene(strip_scenario().model_copy(update={"drive": drives, "run": run}))
    rng, surface, (kind,) = np.random.default_rng(1), scene.surface, scene.kinds
    places = np.column_stack([rng.uniform(-5e-3, 5e-3, (400, 2)), rng.uniform(1e-3, 2e-3, 400)])
    turned = Rotation.random(400, random_state=2).as_quat(scalar_first=True)
    frames, guard = watched(scene, 400, position=places[:, None], quaternion=turned[:, None])
    found = guard.states(frames).of_frames(DEPTH)[:, 0]
    expected = []
    for t, centre, turn in zip(frames.time, frames.position[:, 0], frames.quaternion[:, 0], strict=True):
        corners = centre + Rotation.from_quat(turn, scalar_first=True).apply(kind.corners)
        height = surface.displacement(corners[:, :2], t)[:, 2]
        if tangent:  # along the normal's tilt, which is the rotation: displacement = -h/2 beta
            x, y, z = surface.displacement(centre[None, :2], t)[0]
            height = z + (corners[:, :2] - centre[:2]) @ [x, y] / (-0.5 * surface.thickness)
        expected.append(max(0.0, float((height - corners[:, 2]).max())))
    assert (found > 0.0).mean() > 0.3
    assert found == pytest.approx(expected, abs=1e-15)
    _, guard = watched(scene, 1)
    failed = 0
    for row in range(400):  # what the check finds, which leaves out most of the work
        alone = frames[slice(row, row + 1)]
        valid, _, cause = verdict(guard, alone)
        failed += valid == 0
        if valid == 0:
            assert f"a corner lies {1e6 * found[row]:.1f} um" in cause
        else:
            assert found[row] <= guard.states(alone).of_frames(ALLOWED)[0, 0]
    assert 0.1 < failed / 400 < 0.99


def test_centre_below_the_surface_is_said_before_its_corners_are() -> None:
    scene = moving_piston()
    for height, expected in ((-59e-6, Divergence.TOO_DEEP), (-61e-6, Divergence.THROUGH_PLATE)):
        frames, guard = watched(scene)
        frames.position[5:, 0, 2] = height
        assert verdict(guard, frames)[:2] == (5, expected)


def test_the_plate_that_stopped_earlier_is_the_one_looked_at() -> None:
    """A stage that was ended by its event: from then on the surface rests."""
    drive = Excitation(frequency_hz=500.0, amplitude_um=60.0, ring_up=False)
    schedule = Schedule(stage=(Stage(drive=(drive,), duration_s=1.0), Stage(duration_s=1.0)))
    scene = moving_piston(drive=(), schedule=schedule, run=Run(seeds=1, frames_per_second=3100.0))
    frames, guard = watched(scene, 200, position=np.array([0.0, 0.0, 1e-3]))
    later = frames[slice(100, 200)]
    assert verdict(guard, later)[1] == Divergence.TOO_DEEP
    guard.redrive(scene.stopped([0.5 * float(later.time[0])]))
    assert guard.check(later, 0)[1] is None


def test_what_has_come_into_the_plate_over_its_edge_is_no_failure() -> None:
    """A nut that tips over the edge, swings back under it and moves on: the sides of the plate stop nothing."""
    scene = moving_piston()
    for first_mm, fails in ((88.0, False), (70.0, True)):
        frames = frames_at(scene)
        frames.position[:, 0, 0], frames.position[:, 0, 2] = 60e-3, 0.5e-3  # half of it in the plate
        frames.position[0, 0] = [1e-3 * first_mm, 0.0, 2e-3]
        guard = Guard(ready(scene), frames[slice(1)])
        assert guard.check(frames, 0)[0] == (1 if fails else 10)
        guard.remember(3)
        if not fails:
            assert guard.check(frames[slice(3, 10)], 0)[0] == 7


def test_soft_contact_lets_a_part_in_by_what_it_covers_in_its_time_constant() -> None:
    limits = []
    for update in ({}, {"contact": Contact(model="compliant", time_constant_us=1000.0, damping_ratio=1.0)}):
        frames, guard = watched(moving_piston(**update), velocity=np.array([0.0, 0.0, -0.5]))
        limits.append(guard.states(frames).of_frames(ALLOWED)[3, 0])
    pace = np.sqrt(0.5**2 + 2 * 9.81 * 2e-3) + 2 * np.pi * 500.0 * 60e-6
    assert limits[1] - limits[0] == pytest.approx(1e-3 * (pace + 9.81 * 1e-3))


@pytest.mark.parametrize("falls_at_mm", [0.0, 91.0])
def test_a_part_below_the_plate_is_lost_if_it_has_fallen_past_the_edge_else_a_failure(falls_at_mm: float) -> None:
    """Below the middle in the end, straight through it or from beside the plate; over two blocks of frames."""
    scene = build_scene(strip_scenario())
    frames = frames_at(scene, 100, position=np.zeros(3))
    frames.time[:] = 0.002 * np.arange(100.0)
    frames.position[:, 0, 0] = np.linspace(1e-3 * falls_at_mm, 0.0, 100)
    frames.position[:, 0, 2] = 1e-3 - 0.5 * 9.81 * frames.time**2
    frames.velocity[:, 0, 2] = -9.81 * frames.time
    guard = Guard(ready(scene), frames[slice(1)])
    lost = []
    for rows in (slice(0, 50), slice(50, 100)):
        assert (guard.check(frames[rows], 0)[1] is None) == (falls_at_mm > 0.0)
        lost += guard.lost(50)[:, 0].tolist()
        guard.remember(50)
    assert lost == [falls_at_mm > 0.0 and z < -0.05 for z in frames.position[:, 0, 2]]


def test_a_part_that_dips_beside_the_edge_and_comes_back_is_watched_again() -> None:
    places = np.array([[[0.09, 0.0, -1e-3]], [[0.09, 0.0, 1e-3]], [[0.0, 0.0, -1e-3]]])
    frames, guard = watched(build_scene(strip_scenario()), 3, position=places)
    frames.time[:] = 0.002 * np.arange(3.0)
    assert guard.states(frames).mark[1:, 0, FALLEN].tolist() == [1, 0, 0]
    assert guard.check(frames, 0)[0] == 2


def test_compliant_contact_of_five_steps_is_stable_and_hops_like_the_others() -> None:
    step_us = 1e6 / (4750 * 40)
    compliant = Contact(model="compliant", time_constant_us=5.0 * step_us)
    scenario = strip_scenario(duration_s=1.0, seeds=2).model_copy(update={"contact": compliant})
    result = simulate(scenario)
    assert [seed.status for seed in result.seeds] == [Status.DONE] * 2
    assert all(frames.position[100:, 0, 2].max() < 2e-3 for frames in result.trajectories)


@pytest.mark.parametrize("amplitude_um", [0.1, 1.0, 10.0, 90.0])
def test_strong_drives_stay_within_what_the_plate_can_give(amplitude_um: float) -> None:
    scenario = piston_scenario(frequency_hz=2797.0, amplitude_um=amplitude_um, duration_s=0.5, seeds=4)
    result = simulate(scenario)
    assert result.failures == []
    # At 90 um, 1.6 m/s, nuts hop 20 cm high, and some of them off the plate.
    allowed = {Status.DONE, Status.LEFT_PLATE} if amplitude_um > 10.0 else {Status.DONE}
    assert {seed.status for seed in result.seeds} <= allowed


def test_an_infinite_position_among_many_parts_is_seen_by_the_guard() -> None:
    """The search for pairs passes it on instead of failing on it."""
    nuts = HexNut(size="M2.5", count=3, start=Scattered(kind="scattered"))
    prepared = prepare(piston_scenario(frequency_hz=1000.0, amplitude_um=1.0, part=nuts, duration_s=0.1))
    engine = ImpulseEngine(prepared.scene, np.random.default_rng(0))
    guard = Guard(prepared, engine.current())
    with changing(engine) as state:
        state["position"][1, 0] = np.inf
    valid, failure = guard.check(engine.advance(3), 0)
    assert valid == 0
    assert failure is not None and failure.divergence == Divergence.NOT_FINITE and failure.part == "part_1"
