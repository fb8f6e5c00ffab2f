"""Measures of a part that bounces in a guide, from its contacts with the plate; and the theory of the bouncing ball.

*Bounce interval*: time in the air between two contacts. Intervals shorter than 99 % of a plate period do not count,
which leaves out the chatter before a part sticks. *Flight height*: departure velocity squared over twice the
deceleration on the way up, above the point of departure. *Impact speed*: relative to the plate, at the end of a flight
that counts. Contacts before the plate has rung up do not count.

*Period*: number of impacts after which the motion repeats.

Where the phases of successive landings are independent of each other, the mean interval is near 4 pi f A (1 + e) / g.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from feeder_sim.constants import GRAVITY
from feeder_sim.measures.protocol import FindingsBase, Measure, labelled
from feeder_sim.measures.statistic import Statistic
from feeder_sim.notebook import counted
from feeder_sim.records.seed import Events, Seed
from feeder_sim.scene.prepared import Prepared
from feeder_sim.scene.scene import Scene
from feeder_sim.scene.timetable import timed

LEAST_INTERVAL = 0.99  # of a plate period; shorter bounce intervals do not count
LEAST_FLIGHT = 0.25  # of a plate period; shorter flights are chatter
STEADY_PERIODS = 2.0  # plate periods; a steady plate that has not thrown the part off within this time never will
PERIODS = (1, 2, 3, 4, 5, 6, 7, 8, 10, 12, 16)  # that `motion` looks for
LAST_IMPACTS = 4 * PERIODS[-1]  # from which `motion` finds the period
BATCHES = 20  # of `batched`
EXACT_TOLERANCE = 1e-4  # relative difference of impact speeds that counts as none, for the exact method of the slide
STEP_TOLERANCE = 4.0  # the same for methods that meet the plate in steps, times the steps per period


def expected_interval(frequency: float, amplitude: float, restitution: float, gravity: float) -> float:
    """Mean bounce interval [s] far above the periodic motions, 4 pi f A (1 + e) / g.

    Args:
        frequency: f of the plate [Hz].
        amplitude: A of the plate [m].
        restitution: coefficient e [1].
        gravity: deceleration g of the part [m/s^2].
    """
    return 4.0 * math.pi * frequency * amplitude * (1.0 + restitution) / gravity


@dataclass(frozen=True)
class Flights:
    """Flights of a part between two contacts.

    Attributes:
        interval: time in the air [s], shape (n,).
        height: above the point of departure [m], shape (n,).
        impact_speed: relative to the plate [m/s], shape (n,).
    """

    interval: NDArray[np.float64]
    height: NDArray[np.float64]
    impact_speed: NDArray[np.float64]


def flights(impacts: Events, plate_period: float, deceleration: float, *, after: float = 0.0) -> Flights:
    """The flights of one seed that count.

    Args:
        impacts: contacts of the part.
        plate_period: [s].
        deceleration: of the part on its way up [m/s^2].
        after: contacts before this time [s] are left out.
    """
    contacts = impacts[impacts.time >= after]
    interval = contacts.time[1:] - contacts.until[:-1]
    counts = interval >= LEAST_INTERVAL * plate_period
    height = contacts.departure_velocity[:-1] ** 2 / (2.0 * deceleration)
    return Flights(interval[counts], height[counts], contacts.approach_speed[1:][counts])


def motion(impacts: Events, plate_period: float, tolerance: float, *, end: float) -> str:
    """Name the motion at the end of one seed.

    Args:
        impacts: contacts of the part, of which the last `LAST_IMPACTS` count.
        plate_period: [s].
        tolerance: relative difference of impact speeds, and contact time in plate periods, that count as none.
        end: when the record ends [s].

    Returns:
        The period in impacts, "1", "2", ... "16"; "sticking" if at least half of the flights end in rest on the plate;
        "chaotic" without a period; "resting" if the part does not leave the plate any more; "undecided" after too few
        impacts.
    """
    if len(impacts) and np.isinf(impacts.until[-1]) and impacts.time[-1] < end - STEADY_PERIODS * plate_period:
        return "resting"
    last = impacts[slice(-LAST_IMPACTS - 1, -1)]  # without the very last contact, which may not be over
    if len(last) < LAST_IMPACTS:
        return "undecided"
    stuck = np.count_nonzero(last.until - last.time > tolerance * plate_period)
    if 2 * stuck >= np.count_nonzero(last.time[1:] - last.until[:-1] > LEAST_FLIGHT * plate_period):
        return "sticking"
    speed = last.approach_speed
    for period in PERIODS:
        if np.abs(speed[period:] - speed[:-period]).max() <= tolerance * speed.max():
            return str(period)
    return "chaotic"


def batched(seeds: Sequence[NDArray[np.float64]]) -> Statistic:
    """Statistic over the successive values (n,) of each seed; its standard error is that of the means of batches.

    Successive values may be correlated, which would make the standard error of independent values too small.
    """
    values = np.concatenate([*seeds, np.empty(0)])
    independent = Statistic.of(values)
    if independent.n < 2 * BATCHES:
        return independent
    means = [float(batch.mean()) for batch in np.array_split(values, BATCHES)]
    return Statistic(independent.mean, independent.sd, Statistic.of(means).se, independent.n)


@dataclass(frozen=True, repr=False)
class BounceFindings(FindingsBase):
    """Findings over the seeds that ran to their end; `motion`: number of seeds by the name of their motion."""

    bounce_interval_ms: Statistic
    flight_height_mm: Statistic
    impact_speed_mm_s: Statistic
    motion: dict[str, int]


@dataclass(frozen=True)
class SeedBounces:
    """What is read of a seed: its flights that count, and the name of its motion."""

    flights: Flights
    motion: str


class Bounces(Measure[BounceFindings, SeedBounces]):
    """Bounce interval, flight height, impact speed and motion of a part in a guide."""

    headline = ("bounce_interval_ms", "flight_height_mm", "impact_speed_mm_s")
    missing: ClassVar[Mapping[str, str]] = dict.fromkeys(headline, "no flight was longer than a period of the plate")

    def applies(self, prepared: Prepared) -> bool:
        return prepared.scene.guides[0] is not None

    def reader(self, prepared: Prepared) -> Callable[[Seed], SeedBounces]:
        scene = prepared.scene
        plate_period, tolerance = _plate_period(scene), impact_tolerance(prepared)

        def read(seed: Seed) -> SeedBounces:
            (flights,) = seed_flights(scene, [seed.impacts])
            return SeedBounces(flights, motion(seed.impacts, plate_period, tolerance, end=float(seed.frames.time[-1])))

        return read

    def findings(self, prepared: Prepared, readings: Sequence[SeedBounces]) -> BounceFindings:
        return BounceFindings(
            bounce_interval_ms=batched([1e3 * seed.flights.interval for seed in readings]),
            flight_height_mm=batched([1e3 * seed.flights.height for seed in readings]),
            impact_speed_mm_s=batched([1e3 * seed.flights.impact_speed for seed in readings]),
            motion=dict(Counter(seed.motion for seed in readings)),
        )

    def lines(self, prepared: Prepared, findings: BounceFindings) -> list[str]:
        lines = []
        for label, statistic, unit in (
            ("bounce interval", findings.bounce_interval_ms, "ms"),
            ("flight height", findings.flight_height_mm, "mm"),
            ("impact speed", findings.impact_speed_mm_s, "mm/s"),
        ):
            if statistic.n > 1:
                text = f"{statistic.mean:.4g} {unit} +- {statistic.se:.2g} (SE), n = {statistic.n}"
                lines.append(labelled(label, text))
        motions = ", ".join(f"{name} ({counted(n, 'seed')})" for name, n in findings.motion.items())
        return [*lines, labelled("motion", motions)]


def seed_flights(scene: Scene, seeds: Sequence[Events]) -> list[Flights]:
    """The flights that count, for every seed of a scene with a guide."""
    guide, after = scene.guides[0], settling_time(scene)
    deceleration = guide.deceleration(GRAVITY)[0] if guide and guide.slides else GRAVITY
    return [flights(impacts, _plate_period(scene), deceleration, after=after) for impacts in seeds]


def _plate_period(scene: Scene) -> float:
    """Period of the first excitation [s]."""
    return 1.0 / scene.scenario.excitations[0][1].frequency_hz


def settling_time(scene: Scene) -> float:
    """Time [s] at which the plate has rung up to within 1 %: 5 time constants after the start of every drive."""
    drives = timed(scene.drives, scene.times)
    times = [5.0 / (2.0 * math.pi * d.damping_ratio * d.natural_frequency) if d.damping_ratio else 0.0 for d in drives]
    return max(drive.start + time for drive, time in zip(drives, times, strict=True))


def impact_tolerance(prepared: Prepared) -> float:
    """Relative difference of impact speeds below the resolution of a method, which may meet the plate in steps."""
    exact = prepared.engine.method == "slide"
    return EXACT_TOLERANCE if exact else STEP_TOLERANCE / prepared.scenario.run.steps
