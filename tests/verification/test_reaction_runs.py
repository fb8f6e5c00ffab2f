"""Runs over a plate that parts act back on: the same bits with threads, frames and breaks; what is refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import StopsAfter
from pydantic import ValidationError
from test_reaction import BALL, NUT, PLATE, on_plate

from feeder_sim.engines.impulse.reaction.engine import ReactingEngine
from feeder_sim.errors import InputError
from feeder_sim.plate.mode_shapes import RitzShape
from feeder_sim.pool.work import Work
from feeder_sim.records.seed import Status
from feeder_sim.run.run_folder import record_run, resume_run
from feeder_sim.scenario import Scenario, with_run
from feeder_sim.scene.driven_mode import free_modes
from feeder_sim.scene.scene import build_scene

CROWD = on_plate(
    NUT | {"count": 12, "start": {"kind": "scattered", "size_mm": [60.0, 60.0]}}, amplitude_um=15.0, duration_s=0.3
)


def test_result_does_not_depend_on_threads() -> None:
    scene, frames = build_scene(CROWD), []
    for threads in (1, 3):
        engine = ReactingEngine(scene, np.random.default_rng(2), threads=threads)
        engine.advance(60)
        engine.remove(np.array([3]))
        frames.append((engine.advance(60), engine._reaction_opened, engine._account_opened))
    (one, reaction, books), (other, other_reaction, other_books) = frames
    assert one.position.tobytes() == other.position.tobytes()
    assert (reaction.tobytes(), books.tobytes()) == (other_reaction.tobytes(), other_books.tobytes())
    assert np.hypot(*reaction[1, :2]) > 1e-7 and np.ptp(one.position[..., 2]) > 1e-4


def test_frames_change_nothing() -> None:
    few, many = (
        ReactingEngine(build_scene(with_run(CROWD, frames_per_second=fps)), np.random.default_rng(2))
        for fps in (250.0, 1000.0)
    )
    times = few._scene.steps_per_frame // many._scene.steps_per_frame
    assert few._scene.steps_per_frame == times * many._scene.steps_per_frame and times > 2
    difference = few.advance(40).position - many.advance(40 * times).position[times - 1 :: times]
    assert np.abs(difference).max() < 1e-12


def test_a_run_with_a_break_is_the_same_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ReactingEngine, "frames_per_block", 30)
    whole = record_run(CROWD, tmp_path / "whole", replay=False)
    begun = record_run(CROWD, tmp_path / "run", work=Work(stop=StopsAfter(3)), replay=False)
    assert begun.interrupted
    resumed = resume_run(tmp_path / "run", replay=False)
    assert whole.seeds[0].status == Status.DONE
    assert whole.seeds[0].frames.position.tobytes() == resumed.seeds[0].frames.position.tobytes()


RING = [{"frequency_hz": 2797.0, "amplitude_um": 1.0}]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"plate": {"kind": "strip", "thickness_mm": 3.0}}, ("plate.kind", "strip", "modes")),
        ({"plate": {"kind": "piston"}}, ("plate.kind", "piston", "modes")),
        (
            {"plate": {"kind": "piston"}, "part": [BALL | {"guide": {"kind": "slide", "tilt_deg": 0.0}}]},
            ("part[0].guide", "must be none"),
        ),
        ({"drive": [RING[0] | {"ring_up": False}]}, ("drive[0].ring_up", "false", "must be true")),
        (
            {"run": {"duration_s": 0.1, "reaction": True, "engine": "mujoco"}},
            ("run.engine", "mujoco", 'must be "impulse" with run.reaction'),
        ),
    ],
)
def test_what_cannot_react_is_refused(change: dict[str, Any], words: tuple[str, ...]) -> None:
    raw = {"plate": PLATE, "drive": RING, "part": [NUT], "run": {"duration_s": 0.1, "reaction": True}}
    with pytest.raises(ValidationError) as error:
        Scenario.model_validate(raw | change)
    assert all(word in str(error.value) for word in words)


def test_modes_without_mass_are_refused() -> None:
    driven = build_scene(on_plate(NUT)).driven[0]
    assert isinstance(driven.shape, RitzShape)
    unknown = replace(driven.shape.modes, modal_mass=np.full(len(driven.shape.modes), np.nan))
    with pytest.raises(InputError, match=r"no modal mass.*run\.reaction"):
        free_modes([replace(driven, shape=replace(driven.shape, modes=unknown))])
