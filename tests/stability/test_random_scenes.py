"""One free part in random scenes: every run ends, in time, nothing falls through, no energy comes from nowhere.

`benchmarks/random_scenes.py` runs tens of thousands of them.
"""

from __future__ import annotations

import judged_fixtures
import judged_walls
import pytest
from judged_scenes import ALL, Finding, judged

# Each of these has been endless, has lost its part through the plate or has gained energy.
ONCE_WRONG = [
    *(("still", seed) for seed in (770097, 770139, 770171, 770240, 770321, 770390, 770407)),
    *(("edge", seed) for seed in (770130, 770153, 770168, 770256)),
    *(("plate", seed) for seed in (770006, 770035, 770111, 770382, 770477)),
    *(("piston", seed) for seed in (770005, 770019, 770038, 770103, 770192)),
    *(("balls", seed) for seed in range(880000, 880020)),
    ("switch", 45),  # a frame between a jump of the surface and the next look
]
IN_TUBES = (1000003, 1000016, 1000222, 1000757)  # were endless, took minutes, or were in the wall
MANY = 40


def held(kind: str, seed: int) -> Finding | None:
    finding = judged(kind, seed)
    assert finding is None or not finding.faults, (kind, seed, finding.faults, finding.scene)
    return finding


@pytest.mark.parametrize("kind", dict(ONCE_WRONG))
def test_what_was_wrong_once_is_right(kind: str) -> None:
    found = [held(kind, seed) for which, seed in ONCE_WRONG if which == kind]
    assert None not in found


@pytest.mark.slow
@pytest.mark.parametrize("kind", ALL)
def test_random_scenes_end_and_nothing_falls_through(kind: str) -> None:
    found = [held(kind, seed) for seed in range(10_000_000, 10_000_000 + MANY)]
    assert sum(finding is not None for finding in found) > MANY // 3  # some starts are refused


@pytest.mark.slow
@pytest.mark.parametrize("kind", judged_walls.KINDS)
def test_parts_between_random_walls_stay_out_of_them(kind: str) -> None:
    for seed in (*range(MANY), *(IN_TUBES if kind == "tube" else ())):
        finding = judged_walls.judged(kind, seed)
        assert finding is not None
        assert not finding.faults, (seed, finding.faults, finding.scene)


@pytest.mark.parametrize(
    ("kind", "seed"),
    [("standing", 0), ("standing", 7), ("standing", 36), *(("gates", seed) for seed in (12, 23, 101, 105))],
)
def test_what_was_wrong_beside_fixtures_is_right(kind: str, seed: int) -> None:
    finding = judged_fixtures.judged(kind, seed)
    assert finding is not None
    assert not finding.faults, (finding.faults, finding.scene)


@pytest.mark.slow
@pytest.mark.parametrize("kind", judged_fixtures.KINDS)
def test_parts_among_random_fixtures_stay_out_of_them(kind: str) -> None:
    for seed in range(2 * MANY):
        finding = judged_fixtures.judged(kind, seed)
        assert finding is None or not finding.faults, (seed, finding.faults, finding.scene)
