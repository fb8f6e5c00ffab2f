"""A feeder that a program runs: what each call does, what it refuses, and that it is recorded like any other run."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import refusal, strip_scenario

import feeder_sim
from feeder_sim.feeder.feeder import Feeder
from feeder_sim.records.trajectory import Frames
from feeder_sim.run.recorded_run import RESOLVED
from feeder_sim.run.run_folder import SUMMARY
from feeder_sim.run.simulation import Result
from feeder_sim.scenario import (
    Excitation,
    HexNut,
    Pick,
    Refill,
    Robot,
    Run,
    Scattered,
    Scenario,
    Schedule,
    Settled,
    Stage,
    Strip,
)
from feeder_sim.scene.scene import build_scene

OUT, IN = (Excitation(frequency_hz=f, amplitude_um=2.0) for f in (4750.0, 8775.0))
FRAME = 0.01  # [s], about
EXTRA = {"frequency_hz": 6000.0, "amplitude_um": 1.0}  # that no stage below drives


def scenario(**changes: Any) -> Scenario:
    """Four nuts on a strip, to be thrown by one mode or another; what lies 20 mm from all others is picked after IN."""
    held: dict[str, Any] = {
        "plate": Strip(thickness_mm=3.0),
        "schedule": Schedule(
            stage=(
                Stage(name="out", drive=(OUT,), duration_s=0.043),
                Stage(name="in", drive=(IN,), duration_s=0.05, pause_s=0.033, pick=Pick(clearance_mm=20.0)),
            )
        ),
        "part": (HexNut(size="M2.5", count=4, start=Scattered(kind="scattered")),),
        "run": Run(frames_per_second=100.0),
    }
    return Scenario(**held | changes)


def with_refill() -> Scenario:
    schedule = Schedule(stage=(Stage(name="out", drive=(OUT,), duration_s=0.05),), by_hand=True)
    return scenario(schedule=schedule, refill=Refill(), robot=Robot(camera_s=1.0, pick_s=0.5))


def same(one: Frames, other: Frames) -> bool:
    names = ("time", "position", "quaternion", "velocity", "angular_velocity", "present")
    return all(np.array_equal(getattr(one, name), getattr(other, name)) for name in names)


def finished(feeder: Feeder) -> Result:
    """What a feeder that records ends with."""
    result = feeder.close()
    assert result is not None
    return result


def as_simulated(made: Scenario, sequence: tuple[str, ...], seed: int) -> Scenario:
    return made.changed({"schedule.sequence": sequence, "run.seeds": 1, "run.seed": seed})


def test_a_loop_moves_as_its_sequence_does_in_a_run(tmp_path: Path) -> None:
    sequence = ("out", "in", "in", "out")
    feeder = Feeder(scenario(), 3).record(tmp_path / "run", replay=False)
    by_rule = [feeder.vibrate(name) for name in sequence]
    assert feeder.sequence == sequence
    result = finished(feeder)
    run = feeder_sim.simulate(as_simulated(scenario(), sequence, 3))
    assert same(run.trajectories[0], result.trajectories[0])
    assert len(np.concatenate(by_rule)) > 0  # or picks have not been compared
    assert np.concatenate(by_rule).tolist() == run.seeds[0].removals.part.tolist()
    assert result.wall_s >= result.seeds[0].wall_s > 0.0
    assert feeder_sim.open(tmp_path / "run").wall_s >= result.seeds[0].wall_s
    again = feeder_sim.simulate(feeder_sim.load_scenario(tmp_path / "run" / RESOLVED))
    assert same(again.trajectories[0], result.trajectories[0])


@pytest.mark.slow
@pytest.mark.parametrize("changes", [{"run.engine": "mujoco"}, {"run.engine": "impulse", "part[0].count": 1}])
def test_other_engines_move_alike(changes: dict[str, Any], tmp_path: Path) -> None:
    made = scenario().changed({"stage[1].pick": None, "part[0].count": 2} | changes)
    feeder = Feeder(made, 1).record(tmp_path / "run", replay=False)
    for name in ("in", "out", "in"):
        feeder.vibrate(name)
    run = feeder_sim.simulate(as_simulated(made, ("in", "out", "in"), 1))
    assert same(run.trajectories[0], finished(feeder).trajectories[0])


def test_the_plate_rings_on_from_one_stage_into_the_next() -> None:
    feeder = Feeder(scenario())
    feeder.vibrate("out")
    feeder.vibrate(duration_s=np.float32(0.02))
    scene = feeder.scene.up_to_stage(2)
    ringing = abs(scene.surface.terms.phasor(feeder.scene.times.stages[1].start, 2)[0])
    assert ringing[0] > 1e-6  # of 2 um
    assert ringing[1] == 0.0


def test_stages_end_with_a_frame() -> None:
    made = as_simulated(scenario(), ("out", "in", "out"), 0)
    scene = build_scene(made)
    ends = np.array([stage.end for stage in scene.times.stages]) / scene.frame_interval
    np.testing.assert_allclose(ends, np.round(ends), atol=1e-9)
    assert [stage.stop - stage.start for stage in scene.times.stages] == pytest.approx([0.043, 0.05, 0.043])
    assert scene.times.duration == pytest.approx(0.05 + 0.09 + 0.05, abs=2.0 * FRAME)


def test_poses_say_what_lies_on_the_plate() -> None:
    feeder = Feeder(scenario())
    poses = feeder.poses()
    assert len(poses) == 4
    assert poses.part.tolist() == [0, 1, 2, 3]
    assert poses.kind == ("hex_nut",) * 4
    assert set(poses.pose) <= {"A", "B", None}
    assert poses.position.shape == (4, 3)
    feeder.pick(2)
    assert feeder.poses().part.tolist() == [0, 1, 3]
    feeder.vibrate("out")
    assert 2 not in feeder.poses().part
    assert feeder.picked.tolist() == [2]
    assert len(feeder.lost) == 0


def test_picks_by_hand_and_refills_are_recorded(tmp_path: Path) -> None:
    with Feeder(with_refill(), 1).record(tmp_path / "run") as feeder:
        feeder.vibrate("out")
        feeder.pick([0, 3])
        feeder.vibrate("out")
        came = feeder.refill(2)
        assert came.tolist() == [0, 3]
        feeder.vibrate("out")
        assert len(feeder.poses()) == 4
        feeder.pick(1)
        time = feeder.time
    recording = feeder_sim.read_recording(tmp_path / "run")
    record = recording.records[0]
    assert record.removals.part.tolist() == [0, 3, 1]
    assert record.removals.time[-1] == record.frames.time[-1] == time
    assert record.arrivals.part.tolist() == [0, 3]
    assert record.frames.present[:, 0].tolist().count(False) > 0
    summary = json.loads((tmp_path / "run" / SUMMARY).read_text())
    assert summary["refilled"]["mean"] == 2.0
    assert summary["not_refilled"]["mean"] == 0.0
    # Three looks of 1 s and three picks of 0.5 s.
    assert summary["counted_s"]["mean"] == pytest.approx(time + 3.0 + 1.5, abs=FRAME)
    assert summary["picks_per_minute"]["mean"] == pytest.approx(60.0 * 3 / (time + 4.5), rel=1e-3)
    assert (tmp_path / "run" / "replay.rrd").stat().st_size > 0
    assert len((tmp_path / "run" / "picks.csv").read_text().splitlines()) == 4


def test_an_error_in_the_loop_keeps_what_was_done(tmp_path: Path) -> None:
    with pytest.raises(ZeroDivisionError), Feeder(scenario()).record(tmp_path / "run", replay=False) as feeder:
        feeder.vibrate("out")
        raise ZeroDivisionError
    assert (tmp_path / "run" / SUMMARY).is_file()


def test_new_stages_drive_the_same_modes_in_other_ways() -> None:
    feeder = Feeder(scenario())
    feeder.vibrate({"drive": [{"frequency_hz": 4750.0, "amplitude_um": 3.0}], "duration_s": 0.02})
    feeder.vibrate(Stage(drive=(OUT, IN), duration_s=0.02))
    feeder.vibrate(drive=[{"frequency_hz": 4750.0, "amplitude_um": 3.0}], duration_s=0.02)
    assert feeder.sequence == ("stage 3", "stage 4", "stage 3")


def test_a_stage_ends_when_its_parts_have_settled(tmp_path: Path) -> None:
    until = Stage(name="wait", drive=(OUT,), duration_s=1.0, until=Settled(within_mm=50.0, for_s=0.1), pause_s=0.05)
    feeder = Feeder(scenario(), stages=[until]).record(tmp_path / "run", replay=False)
    feeder.vibrate("wait")
    assert feeder.time < 0.5
    feeder.vibrate("in")
    result = finished(feeder)
    assert same(result.trajectories[0], feeder_sim.simulate(result.prepared).trajectories[0])


def test_preparing_stages_run_at_once() -> None:
    shake = [{"drive": [drive.model_dump(exclude_unset=True)], "duration_s": 0.02} for drive in (OUT, IN)]
    feeder = Feeder(scenario().changed({"schedule.prepare": shake}))
    assert feeder.time == pytest.approx(0.04, abs=3.0 * FRAME)


def test_another_seed_begins_as_a_new_feeder_does() -> None:
    first = Feeder(scenario())
    first.vibrate("out")
    other, new = first.again(5), Feeder(scenario(), 5)
    assert np.array_equal(other.poses().position, new.poses().position)
    assert not np.array_equal(other.poses().position, Feeder(scenario()).poses().position)
    assert other.time == 0.0


REFUSED: list[tuple[str, Any]] = [
    ("stage: is 'on'(?s:.*)must be out, in", lambda feeder: feeder.vibrate("on")),
    ("stage: is 2, must be 0 to 1", lambda feeder: feeder.vibrate(2)),
    ("stage: is True, must be a stage", lambda feeder: feeder.vibrate(True)),
    ("vibrate: must be exactly one", lambda feeder: feeder.vibrate()),
    ("vibrate: must be exactly one", lambda feeder: feeder.vibrate("out", duration_s=1.0)),
    ("duration_s: is missing", lambda feeder: feeder.vibrate(name="x")),
    ("unknown key", lambda feeder: feeder.vibrate(duration_s=1.0, length=3)),
    ("another stage has", lambda feeder: feeder.vibrate(name="out", duration_s=1.0)),
    ("drives a mode that no other", lambda feeder: feeder.vibrate(drive=[EXTRA], duration_s=1.0)),
    ("pick: is 9, must be the numbers of the 4 parts", lambda feeder: feeder.pick([0, 9])),
    ("pick: is 0.5, must be the number", lambda feeder: feeder.pick(0.5)),
    ("pick: names a part twice", lambda feeder: feeder.pick([1, 1])),
    ("clearance_mm: is -1", lambda feeder: feeder.pick_by({"clearance_mm": -1.0})),
    ('up: has "Q", must be A, B', lambda feeder: feeder.pick_by({"clearance_mm": 1.0, "up": ["Q"]})),
    ("refill: is missing, must be a scenario that", lambda feeder: feeder.refill(1)),
    ("refill: is 0, must be a whole number", lambda feeder: feeder.refill(0)),
    ("refill: is 1000000000, must be a whole number from 1 to", lambda feeder: feeder.refill(10**9)),
    ("stage: duration_s: is 1000000000.0, must be", lambda feeder: feeder.vibrate(duration_s=1e9)),
]


@pytest.fixture(scope="module")
def idle() -> Feeder:
    return Feeder(scenario())


@pytest.mark.parametrize(("line", "call"), REFUSED)
def test_what_cannot_be_is_refused_and_nothing_happens(line: str, call: Any, idle: Feeder) -> None:
    assert re.search(line, refusal(call, idle))
    assert idle.time == 0.0
    assert len(idle.poses()) == 4
    assert idle.stage_names == ("out", "in")


def test_recording_begins_at_the_start_and_ends_once(tmp_path: Path) -> None:
    feeder = Feeder(scenario())
    feeder.vibrate("out")
    assert "before the first one" in refusal(feeder.record, tmp_path / "run")
    assert feeder.close() is None
    assert "is closed" in refusal(feeder.vibrate, "out")
    (tmp_path / "held").mkdir()
    (tmp_path / "held" / "file").touch()
    line = refusal(Feeder(scenario()).record, tmp_path / "held")
    assert line.endswith("held: folder: is not empty (file), must be a new or an empty folder")
    assert "nothing to record" in refusal(Feeder(scenario()).record(tmp_path / "none").close)


def test_an_empty_plate_is_the_end() -> None:
    feeder = Feeder(scenario())
    feeder.pick(feeder.poses().part)
    assert "no part is left" in refusal(feeder.vibrate, "out")


def test_scenarios_that_no_program_can_run_are_refused() -> None:
    assert "schedule: is missing" in refusal(Feeder, strip_scenario())
    twice = Stage(name="out", drive=(OUT,), duration_s=0.043)
    assert "which another stage has" in refusal(Feeder, scenario(), stages=[twice])


def test_a_sequence_names_stages() -> None:
    change = scenario().changed
    assert 'sequence[1] is "inn" (did you mean' in refusal(change, {"schedule.sequence": ["out", "inn"]})
    twice = {"schedule.sequence": ["out"], "stage[1].name": "out"}
    assert "must be a name of its own" in refusal(change, twice)


def test_reprs_say_where_it_is_and_stay_short(tmp_path: Path) -> None:
    feeder = Feeder(scenario(title="two ways")).record(tmp_path / "run", replay=False)
    assert "has run          nothing" in feeder._repr_html_()
    feeder.vibrate("out")
    feeder.pick(feeder.poses().part[0])
    line = r"<Feeder 'two ways' at 0\.05\d* s: 3 parts on the plate, 1 picked, 0 lost, 1 stage run>"
    assert re.fullmatch(line, repr(feeder))
    shown = feeder._repr_html_()
    assert "can run          out, in" in shown and "has run          out\n" in shown and str(tmp_path) in shown
    poses = feeder.poses()
    assert repr(poses) == f"<Poses at {feeder.time:.6g} s: 3 parts on the plate>"
    assert poses._repr_html_().count("<tr>") == 4 and "<td>hex_nut</td>" in poses._repr_html_()
    feeder.close()
    assert repr(feeder).endswith("1 stage run, closed>")
