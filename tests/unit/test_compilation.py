"""What the terminal says while an engine is compiled."""

from __future__ import annotations

import time

import pytest

from feeder_sim import machine_code
from feeder_sim.run import compilation


def test_it_says_how_far_the_compilation_is(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compilation, "ANNOUNCED_S", 0.05)
    monkeypatch.setattr(compilation, "NOTIFY_EVERY_S", 0.05)
    lines: list[str] = []
    with compilation.compilation_announced("exact", lines.append):
        time.sleep(0.1)
        machine_code.COMPILED[0] += 700  # far more than expected
        time.sleep(0.5)
    machine_code.COMPILED[0] -= 700
    assert lines[0].endswith("a minute or more, once: the result is kept for the next time")
    assert all(line.startswith("compiling the engine: about ") for line in lines[1:])
    shares = [float(line.split()[4]) for line in lines[1:]]
    assert shares == sorted(shares) and len(shares) > 5
    assert shares[0] < 79.0 and shares[-1] == 99.0


def test_the_share_is_that_of_the_time() -> None:
    """As it was with the engine of one free part: 250 of 266 functions after 67 s, an end after 88 s."""
    assert compilation.time_share(125 / 270, 33.0, 33.0) == pytest.approx(33.0 / 88.0, abs=0.05)
    assert compilation.time_share(250 / 270, 67.0, 67.0) == pytest.approx(67.0 / 88.0, abs=0.05)
    assert compilation.time_share(250 / 270, 67.0, 83.0) == pytest.approx(83.0 / 88.0, abs=0.06)
    assert compilation.time_share(3.0, 67.0, 500.0) == compilation.MOST_SHARE < 1.0


def test_it_says_nothing_of_what_is_quick() -> None:
    lines: list[str] = []
    with compilation.compilation_announced("exact", lines.append):
        pass
    assert not lines
