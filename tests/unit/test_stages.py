"""Drives and stages in time: what acts when, how pulses add up, and stages that end when their parts have settled."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import REPOSITORY, StopsAfter, from_python, ready, refusal, resting, strip_scenario
from scipy.integrate import solve_ivp

from feeder_sim.measures.arrivals import Arrivals, arrived
from feeder_sim.measures.protocol import as_json
from feeder_sim.measures.stage_lines import settled, stage_lines
from feeder_sim.plate import compiled
from feeder_sim.plate.drive import ModalDrive, ModalTerms, modal_terms
from feeder_sim.pool.work import Work
from feeder_sim.records.trajectory import Frames
from feeder_sim.records.trajectory_file import read_recording
from feeder_sim.run.run_folder import record_run, resume_run
from feeder_sim.run.simulation import simulate
from feeder_sim.scenario import (
    Drive,
    Excitation,
    HexNut,
    ModePlate,
    RigidPlate,
    Run,
    Scattered,
    Scenario,
    Start,
    Strip,
)
from feeder_sim.scenario.schedule import Goal, Pick, Schedule, Settled, Stage
from feeder_sim.scene.scene import Scene, build_scene
from feeder_sim.scene.timetable import Occurrence, TimedStage, Timetable, largest_together, timed, timetable

LONG, PAUSE = 3.0, 0.05  # [s]
DRIVE = {"frequency_hz": 4750.0, "amplitude_um": 1.0}


def scenario(*, start_mm: float = 16.0, seeds: int = 1, within_mm: float = 2.0, for_s: float = 0.2) -> Scenario:
    """A nut beside the node of 4750 Hz, 19.5 mm from the middle; then another mode, with a node farther in."""
    until = Settled(within_mm=within_mm, for_s=for_s)
    first, second = (Excitation(frequency_hz=f, amplitude_um=2.0) for f in (4750.0, 8775.0))
    wait = Stage(name="wait", duration_s=0.1)
    out = Stage(name="out", drive=(first,), duration_s=LONG, until=until, pause_s=PAUSE)
    back = Stage(name="in", drive=(second,), duration_s=0.2)
    return Scenario(
        plate=Strip(thickness_mm=3.0),
        schedule=Schedule(stage=(wait, out, back)),
        part=(HexNut(size="M2.5", start=Start(position_mm=(start_mm, 0.0), tilt_deg=(0.0, 0.0))),),
        goal=Goal(x_mm=18.0, within_mm=4.0),
        run=Run(seeds=seeds, frames_per_second=200.0),
    )


@pytest.fixture(scope="module")
def scene() -> Scene:
    return build_scene(scenario())


def node(scene: Scene) -> float:
    return float(0.5 * math.pi / scene.driven[0].shape.wavenumber)  # type: ignore[attr-defined]


def standing(scene: Scene, x: list[float]) -> Frames:
    """Frames of the nut at places [m] along x, a frame apart."""
    n = len(x)
    position = np.zeros((n, 1, 3))
    position[:, 0, 0], position[:, 0, 2] = x, 1e-3
    return resting(scene.frame_interval * np.arange(n, dtype=np.float64), position)


def test_settled_is_near_a_node_without_a_break(scene: Scene) -> None:
    lines, at = stage_lines(scene), node(scene)
    hold = round(0.2 / scene.frame_interval)
    waited = round(0.1 / scene.frame_interval)
    there = [at + 1e-3] * (waited + hold + 1)
    assert settled(scene, lines, 1, standing(scene, there))
    assert not settled(scene, lines, 1, standing(scene, there[:-2]))  # the stage has not lasted that long
    assert not settled(scene, lines, 1, standing(scene, [*there[:-3], at + 3e-3, at, at]))
    assert settled(scene, lines, 1, standing(scene, [0.0, *there]))
    assert not settled(scene, lines, 0, standing(scene, there)) and not settled(scene, lines, 2, standing(scene, there))
    empty = standing(scene, there)
    empty.present[:] = False
    assert not settled(scene, lines, 1, empty)


def test_stops_shift_what_follows() -> None:
    planned, actual = timetable(scenario()), timetable(scenario(), [0.1, 0.6])
    expected = np.array([(0.0, 0.1, 0.1), (0.1, 0.6, 0.65), (0.65, 0.85, 0.85)])
    assert np.array([(s.start, s.stop, s.end) for s in actual.stages]) == pytest.approx(expected)
    assert actual.duration == pytest.approx(0.85)
    assert planned.duration == pytest.approx(0.1 + LONG + PAUSE + 0.2)
    acting = np.array([(o.start, o.stop) for o in actual.occurrences])
    assert acting == pytest.approx(np.array([(0.1, 0.6), (0.65, 0.85)]))


def test_the_plate_moves_as_the_stops_say(scene: Scene) -> None:
    stopped = scene.stopped([0.1, 0.6])
    before, after = np.array([0.3, 0.599]), np.array([0.7, 0.8])
    q = stopped.surface.terms.phasor(before, 2)
    assert np.array_equal(q, scene.surface.terms.phasor(before, 2))
    assert np.abs(stopped.surface.terms.phasor(after, 2)[:, 1]).min() > 1e-6
    assert np.abs(scene.surface.terms.phasor(after, 2)[:, 1]).max() == 0.0
    assert stopped.n_frames < scene.n_frames


def test_a_run_ends_stages_when_the_nut_has_settled() -> None:
    result = simulate(scenario(seeds=2))
    for seed in result.seeds:
        wait, out = seed.stops
        assert wait == pytest.approx(0.1) and 0.3 <= out < 0.1 + LONG
        assert seed.frames.time[-1] == pytest.approx(out + PAUSE + 0.2, abs=2.0 * result.scene.frame_interval)
        held = seed.frames[slice(*np.searchsorted(seed.frames.time, [out - 0.2, out + 1e-9]))]
        assert np.abs(np.abs(held.position[:, 0, 0]) - node(result.scene)).max() < 2.01e-3
    found = result.measures()
    assert [stage["settled"] for stage in found["transport_stages"]] == [0, 2, 0]
    assert found["at_goal"] == found["at_goal_of"] == 2
    assert found["stages"][1]["on_nodal_line"]["mean"] == 1.0


def test_a_stage_that_nothing_settles_in_lasts_to_its_limit() -> None:
    (seed,) = simulate(scenario(start_mm=2.0, within_mm=0.01, for_s=1.0)).seeds
    assert len(seed.stops) == 0
    assert seed.frames.time[-1] == pytest.approx(0.1 + LONG + PAUSE + 0.2, abs=0.01)


@pytest.mark.parametrize(("looks", "count"), [(2, 1), (5, 1), (6, 1), (4, 4), (5, 4), (6, 4)])
def test_a_resumed_run_ends_its_stages_at_the_same_times(looks: int, count: int, tmp_path: Path) -> None:
    """Broken before a stage has ended by its parts, at that moment, and after it."""
    wanted = scenario(start_mm=16.9)
    if count > 1:
        start = {"kind": "scattered", "centre_mm": (18.0, 0.0), "size_mm": (9.0, 50.0)}
        wanted = wanted.changed({"part[0].count": count, "part[0].start": start})
    record_run(wanted, tmp_path / "whole", replay=False)
    begun = record_run(wanted, tmp_path / "broken", work=Work(stop=StopsAfter(looks)), replay=False)
    assert begun.interrupted
    resume_run(tmp_path / "broken")
    whole, resumed = (read_recording(tmp_path / name).records[0] for name in ("whole", "broken"))
    assert len(whole.stops) == 2
    assert np.array_equal(whole.stops, resumed.stops)
    assert all(np.array_equal(values, getattr(resumed.frames, name)) for name, values in vars(whole.frames).items())
    summaries = [json.loads((tmp_path / name / "summary.json").read_text()) for name in ("whole", "broken")]
    assert summaries[0]["transport_stages"] == summaries[1]["transport_stages"]


def test_arrival_is_told_from_the_last_frame(scene: Scene) -> None:
    assert arrived(scene, standing(scene, [0.0, 21.9e-3])).all()
    assert not arrived(scene, standing(scene, [19e-3, 22.1e-3])).any()
    fallen = standing(scene, [0.0, 19e-3])
    fallen.position[-1, 0, 2] = -0.01
    assert not arrived(scene, fallen).any()
    point = build_scene(scenario().model_copy(update={"goal": Goal(x_mm=19.0, y_mm=4.0, within_mm=3.0)}))
    assert not arrived(point, standing(scene, [0.0, 19e-3])).any()
    nothing = Arrivals().compute(ready(scene), [])
    assert nothing.at_goal == nothing.at_goal_of == 0
    assert as_json(nothing)["arrival_time_s"] == {"mean": None, "sd": None, "se": None, "n": 0}


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"plate": {"kind": "piston"}}, "no nodal lines"),
        ({"schedule": None, "drive": [DRIVE], "run.duration_s": 1.0}, "goal belongs to a"),
        ({"stage[2]": {"duration_s": 1.0, "until": {}}}, "a stage with a drive"),
        ({"goal": {"x_mm": 900.0}}, "goal.x_mm: is 900, must be within"),
        ({"stage[1].pause_s": 0.005, "stage[1].pick": {"clearance_mm": 10.0}}, "stage[1].pause_s: is 0.005"),
    ],
)
def test_what_cannot_settle_or_arrive_is_refused(changes: dict[str, Any], says: str) -> None:
    assert says in refusal(lambda: build_scene(scenario().changed(changes)))


def test_a_settled_nut_is_picked_at_the_end_of_the_pause() -> None:
    wait, out, _ = scenario(start_mm=16.9).model_dump(exclude_none=True)["schedule"]["stage"]
    picked = {"schedule.stage": [wait, out | {"pick": {"clearance_mm": 10.0}}]}
    (seed,) = simulate(scenario(start_mm=16.9).changed(picked)).seeds
    assert seed.removals.time == pytest.approx(seed.stops[1] + PAUSE, abs=0.01)
    assert seed.frames.time[-1] == seed.removals.time[0]


FREQUENCY = 4750.0
ON, OFF = 0.02, 0.004  # [s] of the pulses below; the strip rings down with a time constant of 17 ms


def pulse(amplitude_um: float = 1.0, **changes: Any) -> Excitation:
    return Excitation(frequency_hz=FREQUENCY, amplitude_um=amplitude_um, **changes)


def scheduled(schedule: Schedule, **plate: Any) -> Scenario:
    return Scenario(
        plate=plate.get("plate", Strip(thickness_mm=3.0)),
        schedule=schedule,
        part=(HexNut(size="M2.5", count=2, start=Scattered(kind="scattered")),),
        run=Run(seeds=1),
    )


def two_cycles() -> Scenario:
    low, high = (Excitation(frequency_hz=f, amplitude_um=1.0) for f in (500.0, 800.0))
    prepare = Stage(drive=(low,), duration_s=1.0, pause_s=0.5), Stage(name="rest", duration_s=0.25)
    gather = Stage(name="gather", drive=(high, low), duration_s=2.0)
    pick = Stage(drive=(low,), duration_s=0.5, pause_s=0.25, pick=Pick(clearance_mm=7.0))
    schedule = Schedule(cycles=2, prepare=prepare, stage=(gather, pick))
    return scheduled(schedule, plate=RigidPlate(kind="piston"))


def test_stages_follow_one_another_over_the_cycles() -> None:
    found = timetable(two_cycles())
    assert found.stages == (
        TimedStage("prepare 1", 0, 0, 0.0, 1.0, 1.5, (0,), ()),
        TimedStage("rest", 0, 1, 1.5, 1.75, 1.75, (), ()),
        TimedStage("gather", 1, 0, 1.75, 3.75, 3.75, (1, 2), ()),
        TimedStage("stage 2", 1, 1, 3.75, 4.25, 4.5, (3,), (Pick(clearance_mm=7.0),)),
        TimedStage("gather", 2, 0, 4.5, 6.5, 6.5, (1, 2), ()),
        TimedStage("stage 2", 2, 1, 6.5, 7.0, 7.25, (3,), (Pick(clearance_mm=7.0),)),
    )
    assert found.duration == 7.25


def test_every_pulse_acts_in_its_own_stage() -> None:
    found = timetable(two_cycles())
    acting = [(o.excitation, o.start, o.stop) for o in found.occurrences]
    first = [(1, 1.75, 3.75), (2, 1.75, 3.75), (3, 3.75, 4.25)]
    second = [(1, 4.5, 6.5), (2, 4.5, 6.5), (3, 6.5, 7.0)]
    assert acting == [(0, 0.0, 1.0), *first, *second]


def test_excitations_are_numbered_as_their_keys_in_the_file() -> None:
    scenario = two_cycles()
    keys = ["prepare[0].drive[0]", "stage[0].drive[0]", "stage[0].drive[1]", "stage[1].drive[0]"]
    assert [key for key, _ in scenario.excitations] == [f"schedule.{key}" for key in keys]
    frequencies = [drive.frequency_hz for _, drive in scenario.excitations]
    by_stage = {s.name: [frequencies[i] for i in s.excitations] for s in timetable(scenario).stages}
    assert by_stage == {"prepare 1": [500.0], "rest": [], "gather": [800.0, 500.0], "stage 2": [500.0]}


def test_drives_without_a_schedule_are_one_stage() -> None:
    scenario = strip_scenario(duration_s=0.3)
    late = Drive(frequency_hz=FREQUENCY, amplitude_um=1.0, start_s=0.1, duration_s=0.15)
    found = timetable(scenario.model_copy(update={"drive": (*scenario.drive, late)}))
    assert found.stages == (TimedStage("", 0, 0, 0.0, 0.3, 0.3, (0, 1), ()),)
    assert [(o.excitation, o.start, o.stop) for o in found.occurrences] == [(0, 0.0, math.inf), (1, 0.1, 0.25)]
    assert found.duration == 0.3


def test_a_run_lasts_as_long_as_its_schedule() -> None:
    scene = build_scene(two_cycles())
    assert (scene.n_frames - 1) * scene.frame_interval == pytest.approx(7.25, abs=scene.frame_interval)
    assert scene.times == timetable(scene.scenario)


def twice(first: Excitation, second: Excitation) -> Scenario:
    """Two pulses of one mode with a break too short for the ring-down."""
    stages = (Stage(drive=(first,), duration_s=ON, pause_s=OFF), Stage(drive=(second,), duration_s=ON, pause_s=0.1))
    return scheduled(Schedule(stage=stages))


def test_a_mode_of_several_stages_is_one_shape() -> None:
    scene = build_scene(twice(pulse(1.0), pulse(2.0)))
    assert scene.surface.n_shapes == 1
    assert [mode.drive.shape for mode in scene.driven] == [0, 0]
    assert [mode.drive.amplitude for mode in scene.driven] == pytest.approx([1e-6, 2e-6])
    acting = timed(scene.drives, scene.times)
    assert [(drive.start, drive.stop) for drive in acting] == [(0.0, ON), (ON + OFF, ON + OFF + ON)]


def test_a_plate_mode_of_several_stages_is_one_shape() -> None:
    gather = Excitation(frequency_hz=2646.0, voltage_vpp=120.0)
    separate = Excitation(frequency_hz=2797.0, voltage_vpp=120.0)
    stages = tuple(Stage(drive=(drive,), duration_s=0.1) for drive in (gather, separate, gather))
    plate = ModePlate(kind="modes", mode_file=REPOSITORY / "models/plate_180/modes.h5")
    surface = build_scene(scheduled(Schedule(stage=stages), plate=plate)).surface
    assert surface.n_shapes == 2
    assert set(surface.terms.shape) == {0, 1}
    assert np.abs(surface.table[0] - surface.table[1]).max() > 0.1  # and they are not the same one twice


def test_ring_down_of_a_pulse_adds_to_the_ring_up_of_the_next() -> None:
    both = build_scene(twice(pulse(1.0), pulse(2.0, phase_deg=40.0))).surface
    alone = [
        build_scene(strip_scenario().model_copy(update={"drive": (drive,)})).surface
        for drive in (
            Drive(frequency_hz=FREQUENCY, amplitude_um=1.0, start_s=0.0, duration_s=ON),
            Drive(frequency_hz=FREQUENCY, amplitude_um=2.0, phase_deg=40.0, start_s=ON + OFF, duration_s=ON),
        )
    ]
    t = np.linspace(0.0, 2 * (ON + OFF) + 0.1, 20_001)
    first, second = (surface.terms.phasor(t, 1)[:, 0] for surface in alone)
    overlap = (t > ON + OFF) & (t < 2 * ON + OFF)
    assert np.abs(first[overlap]).max() > 0.3e-6  # there is something to superpose
    assert both.terms.phasor(t, 1)[:, 0] == pytest.approx(first + second, abs=1e-17)


def test_the_same_pulse_in_two_cycles_begins_anew_in_each() -> None:
    stage = Stage(drive=(pulse(),), duration_s=ON, pause_s=OFF)
    cycles = build_scene(scheduled(Schedule(cycles=2, stage=(stage,)))).surface
    spelt_out = build_scene(scheduled(Schedule(stage=(stage, stage)))).surface
    t = np.linspace(0.0, 2 * (ON + OFF), 5_001)
    assert cycles.n_shapes == spelt_out.n_shapes == 1
    assert np.array_equal(cycles.terms.phasor(t, 1), spelt_out.terms.phasor(t, 1))
    second = cycles.terms.phasor(t, 1)[t > 2 * ON + OFF - 1e-3]
    assert np.abs(second).max() > np.abs(cycles.terms.phasor(t, 1)[t < ON]).max()  # on top of what still rings


def test_nothing_moves_before_the_first_drive() -> None:
    stage = Stage(drive=(pulse(),), duration_s=ON, pause_s=OFF)
    scene = build_scene(scheduled(Schedule(cycles=2, prepare=(Stage(duration_s=0.1),), stage=(stage,))))
    q = np.abs(scene.surface.terms.phasor(np.array([0.05, 0.1 + 0.9 * ON]), 1)[:, 0])
    assert q[0] == 0.0 and q[1] > 0.5e-6


def test_drives_that_begin_apart_do_not_cancel() -> None:
    """The same drive in antiphase from the same moment on is stillness; half a period later it doubles the motion."""
    first = ModalDrive(0, 500.0, 500.0, 1e-6)
    other = replace(first, phase=math.pi)
    together = Timetable((), (Occurrence(0, 0.0, 1.0), Occurrence(1, 0.0, 1.0)), 1.0)
    apart = Timetable((), (Occurrence(0, 0.0, 1.0), Occurrence(1, 1e-3, 1.0)), 1.0)
    assert largest_together(together, [[first], [other]]) == pytest.approx(0.0, abs=1e-18)
    assert largest_together(apart, [[first], [other]]) == pytest.approx(2e-6)
    assert largest_together(apart, [[first], [other]], speeds=True) == pytest.approx(2e-6 * 2.0 * math.pi * 500.0)


modal_motion = from_python(compiled.modal_motion)


def oscillator(drive: ModalDrive, times: np.ndarray) -> np.ndarray:
    """The oscillator of the module's docstring, integrated numerically."""
    assert drive.damping_ratio is not None
    zeta, omega_n, omega = drive.damping_ratio, 2 * np.pi * drive.natural_frequency, 2 * np.pi * drive.drive_frequency

    def rate(t: float, state: np.ndarray) -> list[float]:
        on = drive.start <= t < drive.stop
        angle = omega * (t - drive.start) + drive.phase
        force = 2 * zeta * omega_n**2 * drive.amplitude * math.cos(angle) if on else 0.0
        return [state[1], force - 2 * zeta * omega_n * state[1] - omega_n**2 * state[0]]

    solution = solve_ivp(rate, (0.0, times[-1]), [0.0, 0.0], t_eval=times, rtol=1e-9, atol=1e-12, max_step=1e-4)
    return np.asarray(solution.y[0])


@pytest.mark.parametrize("detuning", [0.0, -0.02, 0.03])
def test_response_solves_the_driven_oscillator(detuning: float) -> None:
    drive = ModalDrive(0, 400.0 * (1 + detuning), 400.0, 1.0, phase=0.7, damping_ratio=0.02, start=0.004, stop=0.05)
    times = np.linspace(0.0, 0.09, 400)
    q = modal_terms([drive]).phasor(times, 1)[:, 0].real
    assert np.abs(q - oscillator(drive, times)).max() < 2e-5


def test_envelope_rings_up_and_decays_as_at_resonance() -> None:
    zeta, f = 0.002, 2797.0
    terms = modal_terms([ModalDrive(0, f, f, 3e-6, damping_ratio=zeta, stop=0.1)])
    decay = zeta * 2 * np.pi * f
    t = np.array([0.01, 0.03, 0.08])
    assert np.abs(terms.phasor(t, 1)[:, 0]) == pytest.approx(3e-6 * (1 - np.exp(-decay * t)), rel=2 * zeta)
    after = np.abs(terms.phasor(np.array([0.1, 0.12]), 1)[:, 0])
    assert after[1] / after[0] == pytest.approx(np.exp(-decay * 0.02), rel=1e-6)


def test_motion_is_continuous_when_the_drive_stops() -> None:
    terms = modal_terms([ModalDrive(0, 500.0, 505.0, 1.0, damping_ratio=0.01, stop=0.0321)])
    before, after = terms.phasor(np.array([0.0321 - 1e-9, 0.0321 + 1e-9]), 1)[:, 0].real
    assert after == pytest.approx(before, abs=1e-5)


def test_without_ring_up_the_motion_is_a_sine_at_once() -> None:
    terms = modal_terms([ModalDrive(0, 100.0, 100.0, 2.0, start=0.5, stop=0.6)])
    t = np.array([0.4999, 0.5025, 0.5975, 0.6001])
    assert terms.phasor(t, 1)[:, 0].real == pytest.approx([0.0, 2.0, -2.0, 0.0], abs=1e-9)


def test_compiled_motion_equals_the_numpy_one() -> None:
    drives = [
        ModalDrive(0, 400.0, 400.0, 1.0, damping_ratio=0.01, stop=0.02),
        ModalDrive(1, 410.0, 400.0, 0.5, phase=1.0, damping_ratio=0.02, start=0.01),
        ModalDrive(0, 400.0, 400.0, 0.3, start=0.015),
    ]
    terms = modal_terms(drives)
    rates = ModalTerms(terms.shape, terms.start, terms.stop, terms.coefficient * terms.rate, terms.rate)
    q, velocity = np.zeros(2), np.zeros(2)
    for t in np.linspace(0.0, 0.05, 37):
        modal_motion(t, terms.shape, terms.start, terms.stop, terms.coefficient, terms.rate, q, velocity)
        assert q == pytest.approx(terms.phasor(t, 2)[0].real, abs=1e-12)
        assert velocity == pytest.approx(rates.phasor(t, 2)[0].real, abs=1e-9)


@pytest.mark.parametrize("ratio", [0.002, 0.02, 0.1, 0.5, 0.9])
def test_motion_stays_within_its_bounds(ratio: float) -> None:
    """Place and speed of a mode from its start to after its stop, against `largest` and `largest_speed`."""
    for detuning in (0.1, 0.5, 0.95, 1.0, 1.05, 2.0, 10.0):
        for phase in np.linspace(0.0, 2.0 * math.pi, 7):
            for periods in (0.3, 3.1, 200.0):
                drive = ModalDrive(0, 1000.0 * detuning, 1000.0, 1e-6, float(phase), ratio, stop=periods * 1e-3)
                terms = modal_terms([drive])
                t = np.concatenate([np.linspace(0.0, 3.0 * drive.stop, 2000), np.linspace(0.0, 0.02, 2000)])
                place = np.abs(terms.phasor(t, 1)[:, 0].real)
                rates = ModalTerms(terms.shape, terms.start, terms.stop, terms.coefficient * terms.rate, terms.rate)
                assert place.max() <= 1.0001 * drive.largest
                assert np.abs(rates.phasor(t, 1)[:, 0].real).max() <= 1.0001 * drive.largest_speed
