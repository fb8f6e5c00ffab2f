"""Stages that end when their parts have settled: when that is, what follows from it, and that it survives a break."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import StopsAfter, ready, refusal, resting

from feeder_sim.measures.arrivals import Arrivals, arrived
from feeder_sim.measures.protocol import as_json
from feeder_sim.measures.stage_lines import settled, stage_lines
from feeder_sim.records.trajectory import Frames
from feeder_sim.records.trajectory_file import TRAJECTORY, read_recording
from feeder_sim.run.run_folder import record_run, resume_run
from feeder_sim.run.simulation import simulate
from feeder_sim.scenario import Excitation, HexNut, Run, Scenario, Start, Strip
from feeder_sim.scenario.schedule import Goal, Schedule, Settled, Stage
from feeder_sim.scene.scene import Scene, build_scene
from feeder_sim.scene.timetable import timetable

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
    begun = record_run(wanted, tmp_path / "broken", stop=StopsAfter(looks), replay=False)
    assert begun.interrupted
    resume_run(tmp_path / "broken")
    whole, resumed = (read_recording(tmp_path / name / TRAJECTORY).records[0] for name in ("whole", "broken"))
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
        ({"goal": {"x_mm": 900.0}}, "goal.x_mm: is 900, allowed is within"),
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
