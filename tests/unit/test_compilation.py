"""What the terminal says while an engine is compiled."""

from __future__ import annotations

import time

import pytest

from feeder_sim import machine_code
from feeder_sim.run import compilation


def test_it_says_how_far_the_compilation_is(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compilation, "ANNOUNCED_S", 0.05)
    monkeypatch.setattr(compilation, "TOLD_EVERY_S", 0.05)
    lines: list[str] = []
    with compilation.compilation_announced("exact", lines.append):
        machine_code.COMPILED[0] += 7
        time.sleep(0.5)
    machine_code.COMPILED[0] -= 7
    assert lines[0].endswith("kept for the next time")
    assert lines[1] == f"compiling the engine: 7 of about {compilation.FUNCTIONS['exact']} functions"


def test_it_says_nothing_of_what_is_quick() -> None:
    lines: list[str] = []
    with compilation.compilation_announced("exact", lines.append):
        pass
    assert not lines
