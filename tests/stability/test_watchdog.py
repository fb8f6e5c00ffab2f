"""A seed whose next frame never comes: it ends as failed with what there is of it, and the others go on."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import pytest
from command_line import feeder_sim as command
from conftest import strip_scenario

import feeder_sim
from feeder_sim.engines.impulse.lone.engine import LoneEngine
from feeder_sim.engines.lookup import engine_class
from feeder_sim.engines.protocol import ENDED, WHOLE, new_interrupt
from feeder_sim.errors import Divergence, InputError
from feeder_sim.records.seed import Status
from feeder_sim.records.trajectory import Frames
from feeder_sim.run.run_folder import record_run
from feeder_sim.run.watchdog import STALLED, Watchdog

PATIENCE = 0.4  # [s]
STUCK_AT = 20  # frames


class Stuck(LoneEngine):
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


def scenario(**run: Any) -> Any:
    return strip_scenario(frequency_hz=4750.0, **({"duration_s": 0.2, "seeds": 3} | run))


def test_a_seed_that_does_not_get_on_ends_as_failed_and_the_others_go_on(
    second_is_stuck: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("feeder_sim.run.simulation.available_cores", lambda: 1)
    result = record_run(scenario(), tmp_path, replay=False, stall_after=PATIENCE)
    second = result.seeds[1]
    assert [seed.status for seed in result.seeds] == [Status.DONE, Status.DIVERGED, Status.DONE]
    assert [seed.status for seed in feeder_sim.open(tmp_path).seeds] == [seed.status for seed in result.seeds]
    assert second.failure is not None and second.failure.divergence == Divergence.STALLED
    assert len(second.frames) == STUCK_AT + 1 and second.failure.time_s == pytest.approx(second.frames.time[-1])
    assert second.last is not None and (tmp_path / "failure_seed_1.npz").exists()
    line = str(second.failure)
    assert line.startswith("seed 1: part_0 at 0.0") and "takes more than 0.4 s; it is at (" in line and "\n" not in line


def test_patience_that_is_none_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"stall_after: is -1\.0, allowed is a time in seconds over 0"):
        feeder_sim.simulate(scenario(), stall_after=-1.0)
    done = command("run", "drift_4750hz", "--stall-after", "0", cwd=tmp_path)
    assert done.returncode == 2 and "--stall-after" in done.stderr and not (tmp_path / "runs").exists()


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
