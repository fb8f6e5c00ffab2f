"""Scenes at the ends of what is allowed: refused in one line, computed as they should be, and stopped when asked."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from command_line import check_refused, feeder_sim, in_new_process
from conftest import StopsAfter, opened, refusal, toml_of
from threadpoolctl import threadpool_limits

from feeder_sim.engines.impulse.engine import ImpulseEngine
from feeder_sim.engines.protocol import ENDED, engine_class, new_interrupt
from feeder_sim.plate.materials import MATERIALS
from feeder_sim.plate.modes import plate_modes
from feeder_sim.plate.rectangle import RectangularPlate
from feeder_sim.pool.work import Work
from feeder_sim.records.seed import Status
from feeder_sim.run.guard import Guard
from feeder_sim.run.plan import plan_run
from feeder_sim.run.prepare import prepare
from feeder_sim.run.simulation import Result, simulate
from feeder_sim.run.state_check import DEPTH
from feeder_sim.scenario import Scenario
from feeder_sim.scenario.tables import validated

NUT: dict[str, Any] = {"shape": "hex_nut", "size": "M2.5"}
DRIVE: dict[str, Any] = {"frequency_hz": 500.0, "amplitude_um": 5.0}
SCATTERED = {"kind": "scattered"}
REST = toml_of({"plate": {"kind": "piston"}, "part": [NUT], "run": {"duration_s": 1.0}})
Engine = Literal["impulse", "mujoco"]


def scenario_of(**changes: Any) -> Scenario:
    """A nut over a piston, with other tables."""
    raw = {"plate": {"kind": "piston"}, "drive": [DRIVE], "part": [NUT], "run": {"duration_s": 0.2, "seeds": 1}}
    return validated(raw | changes, Scenario, Path("scenario.toml"))


def deepest(result: Result) -> float:
    """How deep [m] the part of a run without failures was in the plate."""
    assert not result.failures
    frames = result.seeds[0].frames
    return float(Guard(result.prepared, frames[slice(1)]).states(frames).of_frames(DEPTH).max())


@pytest.mark.parametrize("engine", ["impulse", "mujoco"])
@pytest.mark.parametrize("frequency_hz", [0.5, 2.0, 5.0])
def test_a_nut_rests_on_a_plate_that_is_driven_slowly_or_not(engine: Engine, frequency_hz: float) -> None:
    """A step of a fortieth of the period let it sink in by 0.8 mm, or fall through."""
    still = {"frequency_hz": frequency_hz, "amplitude_um": 0.0}
    scenario = scenario_of(drive=[still], run={"duration_s": 1.0, "seeds": 1, "engine": engine})
    assert deepest(simulate(scenario)) < 4e-5


def test_a_ball_stays_on_a_plate_that_moves_far_and_slowly_beside_a_fast_drive() -> None:
    """Where only a slow drive acts, steps become longer; the plate went through the ball within one."""
    far = {"frequency_hz": 10.0, "amplitude_um": 8e3, "ring_up": False}
    scenario = scenario_of(
        plate={"kind": "piston", "thickness_mm": 20.0},
        drive=[far, {"frequency_hz": 1e3, "amplitude_um": 0.0}],
        part=[{"shape": "ball", "diameter_mm": 3.0}],
        contact={"restitution": 0.0},
        run={"duration_s": 0.3, "seeds": 1, "frames_per_second": 1000.0},
    )
    result = simulate(scenario)
    assert not result.failures
    frames, surface = result.seeds[0].frames, result.prepared.scene.surface
    height = [surface.displacement(np.zeros((1, 2)), t)[0, 2] for t in frames.time]
    over = frames.position[:, 0, 2] - result.prepared.scene.kinds[0].size - height
    assert over.min() > -1e-6


@pytest.mark.parametrize(("part", "hertz", "um"), [("ball", 25.0, 1e3), ("hex_nut", 10.0, 2.9e3)])
def test_a_fast_part_does_not_enter_a_plate_that_moves_far_and_slowly(part: str, hertz: float, um: float) -> None:
    shape = {"shape": "ball", "diameter_mm": 20.0} if part == "ball" else {"shape": "hex_nut", "size": "M5"}
    scenario = scenario_of(
        drive=[{"frequency_hz": hertz, "amplitude_um": um, "ring_up": False}],
        part=[shape | {"start": {"drop_height_mm": 60.0}}],
        contact={"restitution": 0.7},
        run={"duration_s": 0.5, "seeds": 1},
    )
    assert deepest(simulate(scenario)) < 1e-4


def test_a_step_is_no_longer_than_a_fast_part_allows() -> None:
    """A share of a part is what it may enter; the guard's limit follows the step."""
    slow, fast = (
        prepare(scenario_of(part=[{"shape": "ball", "diameter_mm": 0.5, "start": {"drop_height_mm": height}}]))
        for height in (0.1, 1000.0)
    )
    assert slow.scene.timestep == pytest.approx(1.0 / (500.0 * 40))
    assert fast.scene.timestep * np.sqrt(2 * 9.81) < 0.25 * 0.5e-3 < slow.scene.timestep * np.sqrt(2 * 9.81)


def test_modes_are_the_same_bits_on_any_number_of_threads() -> None:
    plate = RectangularPlate(0.18, 0.16, 0.003, MATERIALS["aluminium"])
    found = []
    for threads in (1, 2):
        with threadpool_limits(threads):
            found.append(plate_modes(plate, highest_frequency=3000.0))
    one, two = found
    assert np.array_equal(one.natural_frequency, two.natural_frequency)
    assert np.array_equal(one.coefficients, two.coefficients)


@pytest.mark.parametrize("engine", ["impulse", "mujoco"])
@pytest.mark.parametrize("count", [1, 5])
def test_an_engine_is_interrupted_within_an_advance(engine: Engine, count: int) -> None:
    part = NUT | {"count": count, "start": SCATTERED if count > 1 else {"kind": "point"}}
    run = {"duration_s": 1.0, "seeds": 1, "engine": engine}
    prepared, interrupt = prepare(scenario_of(part=[part], run=run)), new_interrupt()
    make = engine_class(prepared.engine)
    undisturbed = make(prepared.scene, np.random.default_rng(0))
    disturbed = make(prepared.scene, np.random.default_rng(0), interrupt=interrupt)
    assert np.array_equal(undisturbed.advance(10).position, disturbed.advance(10).position)
    threading.Timer(0.3, interrupt.__setitem__, [ENDED, 1]).start()
    whole = disturbed.advance(300_000)  # ten minutes of simulated time
    assert 0 < len(whole) < 300_000
    assert np.array_equal(undisturbed.advance(len(whole)).position, whole.position)


def test_what_acts_on_the_parts_is_computed_whole_also_when_interrupted() -> None:
    """What has been taken out at a frame acts from there on; a window that is cut short would be kept as it is."""
    prepared = prepare(scenario_of(part=[NUT | {"count": 5, "start": SCATTERED}]))
    states = []
    for asked in (0, 1):
        interrupt = new_interrupt()
        engine = engine_class(prepared.engine)(prepared.scene, np.random.default_rng(0), interrupt=interrupt)
        engine.advance(41)
        interrupt[ENDED] = asked
        engine.remove(np.array([0]))
        assert isinstance(engine, ImpulseEngine)
        states.append(opened(engine))
    for name in states[0].dtype.names or ():
        assert states[0][name].tobytes() == states[1][name].tobytes(), name


def test_a_run_whose_frames_take_for_ever_ends_when_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    """A frame that takes minutes: between two looks of the time loop nothing else could end it."""
    scenario = scenario_of(run={"duration_s": 3600.0, "seeds": 2, "frames_per_second": 1.0})
    monkeypatch.setattr("feeder_sim.run.seed_run.FIRST_PIECE", 3000)
    stop = threading.Event()
    threading.Timer(0.5, stop.set).start()
    started = time.perf_counter()
    result = simulate(scenario, work=Work(stop=stop))
    assert result.interrupted
    assert time.perf_counter() - started < 60.0  # of an hour of a nut in flight


def test_a_run_of_which_seeds_have_not_begun_is_interrupted() -> None:
    """Also where those that had begun have ended."""
    scenario = scenario_of(run={"duration_s": 0.05, "seeds": 5})
    ended = []
    for looks in range(16):
        result = simulate(scenario, work=Work(1, stop=StopsAfter(looks)))
        done = [seed.status == Status.DONE for seed in result.seeds]
        assert result.interrupted == (done != [True] * 5)
        ended.append(sum(done))
    assert {*range(1, 5)} & {*ended}


PISTON = {"kind": "piston", "length_mm": 3.0, "width_mm": 3.0}
HALL = PISTON | {"length_mm": 1e5, "width_mm": 1e5}
HEAPED = NUT | {"count": 9, "start": {"kind": "heap", "diameter_mm": 1e5}}


@pytest.mark.parametrize(
    ("changes", "line"),
    [
        ({"drive": [{"frequency_hz": 1.0, "amplitude_um": 3000.0}] * 20}, "adds up to 6e+04 um"),
        ({"drive": [{"frequency_hz": 1e6, "amplitude_um": 3000.0}]}, "must be up to 100"),
        ({"plate": PISTON}, "must be up to the plate's longer side"),
        ({"plate": PISTON | {"length_mm": 1e-3, "width_mm": 1e-3}}, "longer side"),
        ({"drive": [DRIVE | {"start_s": 1e9}]}, "drive[0].start_s: is 1e+09, must be before the end"),
        ({"plate": HALL, "part": [HEAPED]}, "diameter_mm: is 100000, must be up to 500 times"),
    ],
)
def test_what_nobody_can_mean_is_refused(changes: dict[str, Any], line: str) -> None:
    assert line in refusal(simulate, scenario_of(**changes))


def test_what_somebody_may_mean_is_not_refused() -> None:
    """Drives after each other, or a quarter of a period apart; long parts in a guide."""
    slow = {"frequency_hz": 5.0, "amplitude_um": 2000.0}
    after = [slow | {"duration_s": 0.05}, slow | {"frequency_hz": 7.0, "start_s": 0.1}]
    apart = [slow | {"phase_deg": angle} for angle in (0.0, 90.0)]
    for drive in (after, apart):
        drives = prepare(scenario_of(drive=drive)).scene.drives
        assert [of.drive_frequency for of in drives] == [entry["frequency_hz"] for entry in drive]
    rod = {"shape": "cylinder", "diameter_mm": 3.0, "height_mm": 260.0, "guide": {"kind": "slide"}}
    assert prepare(scenario_of(part=[rod])).scene.guides[0] is not None


def test_the_step_does_not_depend_on_how_many_stages_there_are() -> None:
    disc = {"shape": "cylinder", "diameter_mm": 6.0, "height_mm": 0.5}
    stage = {"duration_s": 0.1, "drive": [{"frequency_hz": 500.0, "amplitude_um": 60.0}]}
    for stages in (1, 100):
        scenario = scenario_of(schedule={"stage": [stage] * stages}, drive=[], part=[disc], run={})
        assert prepare(scenario).scene.timestep == 1.0 / (500.0 * 40)


def test_what_hardly_anybody_means_is_said() -> None:
    plate = {"kind": "strip", "thickness_mm": 3.0, "width_mm": 4.0}
    prepared = prepare(scenario_of(plate=plate, drive=[{"frequency_hz": 4750.0, "amplitude_um": 300.0}]))
    assert any("would break before long" in line for line in prepared.warnings)
    assert any("more than the plate's side, 4 mm" in line for line in prepared.warnings)
    assert not prepare(scenario_of(plate=plate | {"width_mm": 60.0})).warnings


MANY_STAGES = REST + "[schedule]\ncycles = 10000\n" + "[[schedule.stage]]\nduration_s = 1.0\n" * 1000


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("a." * 60_000 + "a = 1\n", "nested too deep"),
        ("x = {" + "a." * 60_000 + "a = 1}\n", "nested too deep"),
        ('title = "' + "x" * 3_000_000 + '"\n', "3.0 MB long"),
        (REST + "[[drive]]\nfrequency_hz = 1.0\namplitude_um = 0.0\n" * 10_000, "at most 100 items"),
        (MANY_STAGES, "must be up to 100000"),
    ],
    ids=["key", "key in a table", "text", "drives", "stages"],
)
def test_absurdly_large_scenarios_are_refused_at_once(text: str, said: str, tmp_path: Path) -> None:
    """Some of them took minutes; that is seen by the time limit of the process."""
    (tmp_path / "large.toml").write_text(text)
    check_refused(in_new_process("check", tmp_path / "large.toml"), said)


def test_a_title_of_many_dots_is_no_nesting(tmp_path: Path) -> None:
    file = tmp_path / "dots.toml"
    text = "# " + "." * 300 + "\n" + 'title = "' + "." * 300 + '"\nplate = { kind = "piston" }\n'
    file.write_text(text)
    check_refused(feeder_sim("check", file), "part: is missing")


@pytest.mark.parametrize("command", ["check", "run", "modes", "list", "replay"])
def test_a_pipe_is_not_read(command: str, tmp_path: Path) -> None:
    """Nobody writes to it: opening it waits for ever."""
    (tmp_path / "scenarios").mkdir()
    pipe = tmp_path / "scenarios" / "pipe.toml"
    os.mkfifo(pipe)
    if command == "list":
        assert "unusable" in in_new_process(command, tmp_path).stdout
    else:
        check_refused(in_new_process(command, pipe), "pipe.toml")


def test_a_long_schedule_of_short_stages_is_planned() -> None:
    """Its trial is of one stage, which is shorter than a frame."""
    stage = {"duration_s": 1e-3, "drive": [DRIVE]}
    scenario = scenario_of(schedule={"cycles": 100, "stage": [stage]}, drive=[], run={"seeds": 1})
    assert plan_run(prepare(scenario))["estimated_wall_s"] > 0.0


def test_ctrl_c_while_objects_are_cleaned_up_is_not_reported() -> None:
    """What is raised in a clean-up cannot go anywhere; Python would print a traceback of a run that is complete."""
    script = """
import sys
from feeder_sim.cli import main

class Closing:
    def __init__(self, error): self.error = error
    def __del__(self): raise self.error

main.app = lambda: (Closing(KeyboardInterrupt()), Closing(ValueError("a fault"))) and None
main.main()
"""
    ended = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert ended.returncode == 0
    assert "KeyboardInterrupt" not in ended.stderr and "a fault" in ended.stderr
