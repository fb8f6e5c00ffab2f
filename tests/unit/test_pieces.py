"""A block is computed in pieces that depend on the machine's speed; what comes out must not."""

from __future__ import annotations

import threading

import numpy as np
import pytest
from conftest import strip_scenario

from feeder_sim.engines.impulse.free_part.engine import FreePartEngine
from feeder_sim.pool.work import Work
from feeder_sim.records.seed import Status
from feeder_sim.records.trajectory import Frames
from feeder_sim.run import seed_run
from feeder_sim.run.simulation import simulate


def positions(frames: Frames) -> bytes:
    return frames.position.tobytes() + frames.quaternion.tobytes()


@pytest.mark.parametrize("engine", ["impulse", "mujoco"])
def test_pieces_change_nothing(engine: str, monkeypatch: pytest.MonkeyPatch) -> None:
    scenario = strip_scenario(duration_s=0.1, engine=engine)
    whole = simulate(scenario).trajectories[0]
    monkeypatch.setattr(seed_run, "PIECE_S", 0.0)  # one frame at a time
    assert positions(simulate(scenario).trajectories[0]) == positions(whole)


def test_a_block_that_is_stopped_is_dropped_as_a_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    stop, calls = threading.Event(), []
    advance = FreePartEngine.advance

    def counted(self: FreePartEngine, n_frames: int) -> Frames:
        calls.append(n_frames)
        if len(calls) == 5:
            stop.set()
        return advance(self, n_frames)

    monkeypatch.setattr(FreePartEngine, "advance", counted)
    monkeypatch.setattr(seed_run, "PIECE_S", 0.0)
    seed = simulate(strip_scenario(duration_s=0.3), work=Work(stop=stop)).seeds[0]
    assert len(calls) == 5 and seed.status == Status.UNFINISHED
    assert len(seed.frames) == 1 and seed.frames.time[0] == 0.0
    assert np.isfinite(seed.frames.position).all()
