"""Stages in time: when each begins and ends, what acts in it, and how pulses of one mode add up."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from conftest import REPOSITORY, strip_scenario

from feeder_sim.plate.drive import ModalDrive
from feeder_sim.scenario import Drive, Excitation, HexNut, PistonPlate, Rectangle, Run, Scattered, Scenario, Strip
from feeder_sim.scenario.schedule import Pick, Schedule, Stage
from feeder_sim.scene.scene import build_scene
from feeder_sim.scene.timetable import Occurrence, TimedStage, Timetable, largest_together, timed, timetable

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
    return scheduled(schedule, plate=PistonPlate(kind="piston"))


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
    plate = Rectangle(kind="rectangle", mode_file=REPOSITORY / "models/plate_180/modes.h5")
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
