"""What to keep of every seed in memory: all frames, every n-th, the impacts alone, or nothing but what was measured.

Whatever is kept, the measures read all frames of a seed first. So they come out the same, to the last bit.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

from feeder_sim.errors import InputError, quoted
from feeder_sim.measures.catalogue import measures_of
from feeder_sim.measures.picking import has_picks, picks_of
from feeder_sim.measures.protocol import Measure, SeedReader
from feeder_sim.records.seed import IMPACTS, Seed, no_events
from feeder_sim.records.trajectory import Frames
from feeder_sim.scene.prepared import Prepared


@dataclass(frozen=True)
class AllFrames:
    """Keep everything."""


@dataclass(frozen=True)
class EveryNth:
    """Keep the first frame and every n-th after it, and all impacts.

    Raises:
        InputError: n is no whole number of at least 1.
    """

    n: int

    def __post_init__(self) -> None:
        if not isinstance(self.n, int) or isinstance(self.n, bool) or self.n < 1:
            raise InputError(f"is {quoted(self.n)}, must be a whole number of at least 1", key="EveryNth(n)")


@dataclass(frozen=True)
class ImpactsOnly:
    """Keep the impacts of a part in a guide, and no frames."""


@dataclass(frozen=True)
class StatisticsOnly:
    """Keep neither frames nor impacts: only what is measured, and which parts were picked, lost and refilled."""


Retention = AllFrames | EveryNth | ImpactsOnly | StatisticsOnly


def check_retention(prepared: Prepared, retention: Retention) -> None:
    """Refuse what cannot be kept of a scene.

    Raises:
        InputError: `retention` is none of the four, or impacts where no part is in a guide.
    """
    if not isinstance(retention, Retention):
        allowed = "AllFrames(), EveryNth(n), ImpactsOnly(), StatisticsOnly()"
        raise InputError(f"is {quoted(retention)}, must be {allowed}", key="record")
    if isinstance(retention, ImpactsOnly) and prepared.scene.guides[0] is None:
        problem = "is ImpactsOnly(), must be another choice: impacts are recorded of a part in a guide alone"
        raise InputError(problem, key="record")


class Keeper:
    """Lets every measure read the frames of a seed, then drops those that are not to be kept.

    Args:
        prepared: what is run.
        retention: what to keep.
        measures: that read frames. Default: all that apply.

    Raises:
        InputError: as for `check_retention`.
    """

    def __init__(
        self, prepared: Prepared, retention: Retention, measures: Iterable[Measure[Any, Any]] | None = None
    ) -> None:
        check_retention(prepared, retention)
        self._retention, self._prepared = retention, prepared
        measures = measures_of(prepared) if measures is None else measures
        self._readers = {measure.name: SeedReader(measure, prepared) for measure in measures}

    def __call__(self, seed: Seed) -> Seed:
        """The seed with what is kept of it."""
        if isinstance(self._retention, AllFrames):
            return seed
        return replace(
            seed,
            frames=_thinned(seed.frames, self._retention.n if isinstance(self._retention, EveryNth) else None),
            impacts=no_events(IMPACTS) if isinstance(self._retention, StatisticsOnly) else seed.impacts,
            readings=self._readings(seed),
            reached_s=seed.reached,
        )

    def _readings(self, seed: Seed) -> Mapping[str, Any]:
        readings: dict[str, Any] = {name: read(seed) for name, read in self._readers.items()}
        if has_picks(self._prepared.scene):
            readings[picks_of.__name__] = picks_of(self._prepared.scene, seed)
        return readings


def _thinned(frames: Frames, n: int | None) -> Frames:
    """A copy of every n-th frame, or of none: a view would keep all of them in memory."""
    rows = slice(None, None, n) if n is not None else slice(0)
    return Frames(*(getattr(frames, entry.name)[rows].copy() for entry in fields(Frames)))
