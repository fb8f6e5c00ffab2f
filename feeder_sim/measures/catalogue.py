"""All measures, in the order of a report; those that a result has by name."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from typing import Any, TypeVar

from feeder_sim import extensions
from feeder_sim.errors import NotMeasured
from feeder_sim.measures.arrivals import ArrivalFindings, Arrivals
from feeder_sim.measures.bounces import BounceFindings, Bounces
from feeder_sim.measures.circulation import Circulation, WaveFindings
from feeder_sim.measures.conveying import CircularConveying, CircularFindings, Conveying, ConveyingFindings
from feeder_sim.measures.drift import Drift, DriftFindings
from feeder_sim.measures.function import as_measure
from feeder_sim.measures.outlets import OutletFindings, Outlets
from feeder_sim.measures.poses import PoseFindings, Poses
from feeder_sim.measures.protocol import Measure, as_json
from feeder_sim.measures.rate import Rate, RateFindings
from feeder_sim.measures.refills import RefillFindings, Refills
from feeder_sim.measures.separation import Separation, SeparationFindings
from feeder_sim.measures.wander import Wander, WanderFindings
from feeder_sim.records.seed import Seed
from feeder_sim.scene.prepared import Prepared

# Every measure of a single seed as one number by a dotted name: what tables, sweeps and comparisons are made of.

_STATISTIC = {"mean", "sd", "se", "n"}
_LABELS = ("kind", "pose", "outlet")  # of entries that have no number of their own


def values_of_seed(prepared: Prepared, seed: Seed) -> dict[str, float]:
    """All measures of one seed that are means over seeds, as numbers; NaN where the seed has no value.

    The mean of a number over seeds is the mean that the measure itself finds for them.
    """
    return _values_over(prepared, [seed])


def names_of_measures(prepared: Prepared) -> list[str]:
    """The names that `values_of_seed` has for every seed of a scene, in order; known before any is run."""
    return list(_values_over(prepared, []))


def _values_over(prepared: Prepared, seeds: Sequence[Seed]) -> dict[str, float]:
    values: dict[str, float] = {}
    for measure in measures_of(prepared):
        values |= dict(_numbers(as_json(measure.compute(prepared, seeds)), ""))
    return values


def _numbers(value: Any, name: str) -> Iterator[tuple[str, float]]:
    """The means within nested findings, with the names that lead to them."""
    if isinstance(value, dict) and set(value) == _STATISTIC:
        yield name, math.nan if value["mean"] is None else float(value["mean"])
    elif isinstance(value, dict):
        for key, entry in value.items():
            yield from _numbers(entry, f"{name}.{key}" if name else key)
    elif isinstance(value, list):
        for number, entry in enumerate(value):
            label = next((entry[key] for key in _LABELS if isinstance(entry, dict) and key in entry), number)
            yield from _numbers(entry, f"{name}[{label}]")


MEASURES: tuple[Measure[Any, Any], ...] = (
    Conveying(),
    Drift(),
    Wander(),
    Bounces(),
    Separation(),
    Poses(),
    Refills(),
    Outlets(),
    Rate(),
    Arrivals(),
    CircularConveying(),
    Circulation(),
)
# The most telling values of all, the first of them where several are measured.
HEADLINES = tuple(
    name
    for measure in (
        *(Outlets, Conveying, CircularConveying, Drift, Rate, Arrivals, Bounces, Separation, Refills, Circulation),
    )
    for name in measure.headline
)
Findings = TypeVar("Findings")


def measures_of(prepared: Prepared) -> list[Measure[Any, Any]]:
    """Those that apply to a scene: ours, those of other packages, those that its user gives.

    Raises:
        InputError: another package adds what is no measure, or cannot be imported.
    """
    added = [as_measure(measure, name) for name, measure in extensions.all_of("measures").items()]
    return [measure for measure in (*MEASURES, *added, *prepared.measures) if measure.applies(prepared)]


class Measured(ABC):
    """Findings by name. One that does not apply to the scenario is an `InputError` that names those that do.

    Then `hasattr` says False.
    """

    @property
    @abstractmethod
    def findings(self) -> tuple[tuple[Measure[Any, Any], Any], ...]:
        """Every measure that applies, with what it finds."""

    @property
    def drift(self) -> DriftFindings:
        """Transport speed, drift velocity and highest rise; not with a schedule."""
        return self._findings_of(Drift)

    @property
    def wander(self) -> WanderFindings:
        """How far places and headings scatter within half a second; not with a schedule."""
        return self._findings_of(Wander)

    @property
    def conveying(self) -> ConveyingFindings:
        """How fast a tray carries parts along."""
        return self._findings_of(Conveying)

    @property
    def circularconveying(self) -> CircularFindings:
        """How fast a tray that turns about z carries parts round its middle."""
        return self._findings_of(CircularConveying)

    @property
    def bounces(self) -> BounceFindings:
        """Bounce interval, flight height, impact speed and motion; of a part in a guide."""
        return self._findings_of(Bounces)

    @property
    def separation(self) -> SeparationFindings:
        """Counts at the end of every stage, parts picked and lost; of many parts, or with a schedule."""
        return self._findings_of(Separation)

    @property
    def poses(self) -> PoseFindings:
        """Which side up the parts lie; of many parts, or with a schedule."""
        return self._findings_of(Poses)

    @property
    def refills(self) -> RefillFindings:
        """Parts that came with refills."""
        return self._findings_of(Refills)

    @property
    def outlets(self) -> OutletFindings:
        """Parts that go through outlets, how many per minute, how many of them right, and jams."""
        return self._findings_of(Outlets)

    @property
    def rate(self) -> RateFindings:
        """Picks per minute, and where the time goes; of cycles with a pick."""
        return self._findings_of(Rate)

    @property
    def arrivals(self) -> ArrivalFindings:
        """Parts that reach the goal of a schedule."""
        return self._findings_of(Arrivals)

    @property
    def circulation(self) -> WaveFindings:
        """Waves of modes that are driven together, and what they do to parts."""
        return self._findings_of(Circulation)

    def _findings_of(self, measure: type[Measure[Findings, Any]]) -> Findings:
        for applied, findings in self.findings:
            if type(applied) is measure:
                return findings
        names = ", ".join(applied.name for applied, _ in self.findings)
        raise NotMeasured(f"is not measured of this scenario, measured are {names}", key=measure.__name__.lower())
