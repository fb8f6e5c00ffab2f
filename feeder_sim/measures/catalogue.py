"""All measures, in the order of a report."""

from __future__ import annotations

from typing import Any

from feeder_sim.measures.arrivals import Arrivals
from feeder_sim.measures.bounces import Bounces
from feeder_sim.measures.circulation import Circulation
from feeder_sim.measures.drift import Drift
from feeder_sim.measures.poses import Poses
from feeder_sim.measures.protocol import Measure
from feeder_sim.measures.rate import Rate
from feeder_sim.measures.refills import Refills
from feeder_sim.measures.separation import Separation

MEASURES: tuple[Measure[Any, Any], ...] = (
    Drift(),
    Bounces(),
    Separation(),
    Poses(),
    Refills(),
    Rate(),
    Arrivals(),
    Circulation(),
)
