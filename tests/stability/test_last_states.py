"""What a run that diverged, or whose next frame never comes, keeps of its last states; its seed can be run again."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import pytest
from command_line import check_refused
from command_line import feeder_sim as command
from conftest import NUT_ON_STRIP, REPOSITORY, piston_scenario, strip_scenario
from failing import check_runs_again, exploding, fail_at, same

import feeder_sim
from feeder_sim.engines.impulse.free_part.engine import FreePartEngine
from feeder_sim.engines.protocol import ENDED, WHOLE, engine_class, new_interrupt
from feeder_sim.errors import Divergence, InputError
from feeder_sim.pool.work import Work
from feeder_sim.records.seed import LAST_FRAMES, LastStates, Seed, Status
from feeder_sim.records.trajectory import Frames
from feeder_sim.records.trajectory_file import read_recording
from feeder_sim.run.run_folder import record_run
from feeder_sim.run.simulation import simulate
from feeder_sim.run.watchdog import STALLED, Watchdog
from feeder_sim.scenario import HexNut, Scenario, Start, load_scenario, with_run


def check_fits(result: Seed) -> LastStates:
    """The valid ones of the last frames end the trajectory; the next one is the failure."""
    last, failure = result.last, result.failure
    assert last is not None and failure is not None and result.status == Status.DIVERGED
    assert last.frames.time[last.valid] == failure.time_s
    n = last.valid
    ending = result.frames[slice(len(result.frames) - n, None)]
    assert ending.time.tolist() == last.frames.time[:n].tolist()
    assert (ending.position == last.frames.position[:n]).all()
    return last


def test_exploding_run_names_the_file_with_its_last_states(tmp_path: Path) -> None:
    scenario = exploding(seeds=2)
    result = record_run(scenario, tmp_path, replay=False)
    assert read_recording(tmp_path).status == (Status.DIVERGED, Status.DIVERGED)
    opened, kinds = feeder_sim.open(tmp_path), [failure.divergence for failure in result.failures]
    assert [str(failure) for failure in opened.failures] == [str(failure) for failure in result.failures]
    assert [failure.divergence for failure in opened.failures] == kinds
    assert opened.summary()["failures"] == result.summary()["failures"] and "2 diverged" in repr(opened)
    for index, seed in enumerate(result.seeds):
        name = f"seeds/{index:03d}.h5"
        assert seed.failure is not None and seed.failure.divergence == Divergence.TOO_MUCH_ENERGY
        assert str(seed.failure).endswith(f"frames up to that time are kept, last states in {name}")
        last = check_fits(seed)
        kept = opened.seeds[index]
        assert kept.last is not None and same(kept.last, last)
        assert kept.failure is not None and (kept.failure.cause, kept.failure.part) == (seed.failure.cause, "part_0")
        check_runs_again(scenario, seed, index)
    assert (tmp_path / "summary.json").read_text().count("last states in seeds/") == 2
    assert not list(tmp_path.glob("seeds/*.partial"))


def test_without_a_recorder_the_result_carries_the_last_states() -> None:
    (seed,) = simulate(exploding()).seeds
    assert "last states" not in str(seed.failure)
    check_fits(seed)
    check_runs_again(exploding(), seed)
    (valid,) = simulate(strip_scenario()).seeds
    assert valid.last is None


@pytest.mark.parametrize("time_s", [0.0003, 0.11, 0.3999])
def test_of_a_long_block_the_frames_around_the_failure_are_kept(monkeypatch: pytest.MonkeyPatch, time_s: float) -> None:
    """A part on a slide is advanced by 2000 frames at once."""
    scenario = with_run(load_scenario(REPOSITORY / "scenarios/ball_500hz.toml"), duration_s=0.5, seeds=1)
    fail_at(monkeypatch, time_s)
    (seed,) = simulate(scenario).seeds
    last = check_fits(seed)
    assert len(last.frames) == LAST_FRAMES
    assert last.valid >= min(50, int(time_s * 5000))
    check_runs_again(scenario, seed)


def test_last_states_after_a_stage_that_ended_by_its_event_run_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """The plate moves as it did: the stage had stopped long before the schedule says."""
    stage = {"drive": [{"frequency_hz": 4750.0, "amplitude_um": 2.0}], "duration_s": 5.0}
    stages = [stage | {"until": {"within_mm": 20.0, "for_s": 0.1}}, stage]
    part = NUT_ON_STRIP["part"][0] | {"start": {"position_mm": [1.95, 0.0]}}
    changes = {
        "drive": [],
        "schedule": {"stage": stages},
        "part": [part],
        "run": {"frames_per_second": 500.0, "seeds": 1},
    }
    scenario = Scenario.model_validate(NUT_ON_STRIP | changes)
    fail_at(monkeypatch, 0.5)
    (seed,) = simulate(scenario).seeds
    check_fits(seed)
    assert len(seed.stops) == 1 and seed.stops[0] < 0.4
    check_runs_again(scenario, seed)


def test_parts_that_are_lost_in_the_last_block_are_kept_as_the_engine_had_them(monkeypatch: pytest.MonkeyPatch) -> None:
    nuts = tuple(HexNut(size="M2.5", start=Start(position_mm=(x, 0.0))) for x in (89.9, 0.0))
    scenario = piston_scenario(part=nuts, duration_s=1.0)
    lost = float(simulate(scenario).seeds[0].removals.time[0])
    fail_at(monkeypatch, lost + 0.01)
    result = simulate(scenario).seeds[0]
    last = check_fits(result)
    assert last.frames.time[0] < lost and not result.frames.present[-1, 0]
    check_runs_again(scenario, result)


PATIENCE = 0.4  # [s]
STUCK_AT = 20  # frames


class Stuck(FreePartEngine):
    """The frame after STUCK_AT never comes."""

    def advance(self, n_frames: int) -> Frames:
        if self._frame + n_frames > STUCK_AT:
            whole = super().advance(STUCK_AT - self._frame)
            while not self._interrupt[ENDED]:
                time.sleep(0.01)
            return whole
        return super().advance(n_frames)


@pytest.fixture
def second_is_stuck(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of seeds that run one after the other, the second one."""
    made: list[Any] = []

    def chosen(choice: Any) -> Any:
        made.append(choice)
        return Stuck if len(made) == 2 else engine_class(choice)

    monkeypatch.setattr("feeder_sim.run.seed_run.engine_class", chosen)


def test_a_seed_that_does_not_get_on_ends_as_failed_and_the_others_go_on(second_is_stuck: None, tmp_path: Path) -> None:
    result = record_run(
        strip_scenario(duration_s=0.2, seeds=3), tmp_path, replay=False, work=Work(1, stall_after=PATIENCE)
    )
    second = result.seeds[1]
    assert [seed.status for seed in result.seeds] == [Status.DONE, Status.DIVERGED, Status.DONE]
    assert [seed.status for seed in feeder_sim.open(tmp_path).seeds] == [seed.status for seed in result.seeds]
    assert second.failure is not None and second.failure.divergence == Divergence.STALLED
    assert len(second.frames) == STUCK_AT + 1 and second.failure.time_s == pytest.approx(second.frames.time[-1])
    assert second.last is not None and feeder_sim.open(tmp_path).seeds[1].last is not None
    line = str(second.failure)
    assert line.startswith("seed 1: part_0 at 0.0") and "takes more than 0.4 s; it is at (" in line and "\n" not in line


def test_patience_that_is_none_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"stall_after: is -1\.0, must be a time in seconds over 0"):
        feeder_sim.simulate(strip_scenario(), stall_after=-1.0)
    check_refused(command("run", "drift_4750hz", "--stall-after", "0", cwd=tmp_path), "--stall-after")
    assert not (tmp_path / "runs").exists()


def test_a_call_that_is_over_in_time_is_not_interrupted() -> None:
    interrupt = new_interrupt()
    with Watchdog(interrupt, 0.2) as watchdog:
        for _ in range(3):
            watchdog.begin()
            time.sleep(0.1)
            assert not watchdog.end()
        watchdog.begin()
        for frame in range(1, 8):  # slow, but each frame comes in time
            time.sleep(0.08)
            interrupt[WHOLE] = frame
        assert not watchdog.end()
        watchdog.begin()
        time.sleep(0.5)
        assert interrupt[ENDED] == STALLED
        assert watchdog.end() and interrupt[ENDED] == 0
