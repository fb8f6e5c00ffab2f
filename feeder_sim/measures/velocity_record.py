"""The vertical velocity of a part in a guide over time, as a laser vibrometer above it records it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feeder_sim.errors import InputError
from feeder_sim.measures.bounces import batched, seed_flights
from feeder_sim.measures.statistic import Statistic
from feeder_sim.records.recording import Recording
from feeder_sim.scenario import parse_scenario
from feeder_sim.scene.scene import build_scene


@dataclass(frozen=True)
class VelocityRecord:
    """The velocity of one seed, and the bounce intervals of all.

    Attributes:
        title: of the scenario, or the name of the run's folder.
        window: begin and end of what is shown [s]: as asked for, up to the end of the record.
        time: of the samples [s], shape (n,).
        velocity: of the part, upwards [m/s], shape (n,).
        plate_velocity: its amplitude [m/s], shape (n,); None for a plate with several drives.
        intervals: bounce intervals [s] of each seed, shape (n,).
    """

    title: str
    window: tuple[float, float]
    time: NDArray[np.float64]
    velocity: NDArray[np.float64]
    plate_velocity: NDArray[np.float64] | None
    intervals: tuple[NDArray[np.float64], ...]

    @property
    def bounce_interval_ms(self) -> Statistic:
        """Of all seeds, as the run's measure has it of those that ran to their end."""
        return batched([1e3 * seed for seed in self.intervals])

    def as_json_object(self) -> dict[str, Any]:
        """The numbers in it, as JSON takes them."""
        plate, intervals = self.plate_velocity, 1e3 * np.concatenate(self.intervals)
        return {
            "from_s": self.window[0],
            "to_s": self.window[1],
            "samples": len(self.time),
            "least_velocity_mm_s": 1e3 * float(self.velocity.min()),
            "largest_velocity_mm_s": 1e3 * float(self.velocity.max()),
            "plate_velocity_mm_s": None if plate is None else 1e3 * float(plate.max()),
            "bounce_interval_ms": self.bounce_interval_ms.as_dict(),
            "least_bounce_interval_ms": float(intervals.min()) if len(intervals) else None,
            "largest_bounce_interval_ms": float(intervals.max()) if len(intervals) else None,
        }


def velocity_record(recording: Recording, *, seed: int, start: float, stop: float) -> VelocityRecord:
    """Read the velocity of a guided part from a recording.

    Args:
        recording: of a run with a part in a guide.
        seed: index of the seed whose velocity is read; the bounce intervals are those of all seeds.
        start: of the velocity record [s].
        stop: of the velocity record [s].

    Raises:
        InputError: no such seed, no frames in that time, or no impacts were recorded.
    """
    impacts = [record.impacts for record in recording.records]
    if not any(len(impacts_of_seed) for impacts_of_seed in impacts):
        raise InputError("holds no impacts, allowed is a run of a part in a guide", file=recording.path)
    if not 0 <= seed < len(recording.seeds):
        raise InputError(
            f"is {seed}, allowed is 0 to {len(recording.seeds) - 1}", file=recording.path, key="--show-seed"
        )
    frames = recording.seeds[seed]
    in_window = (frames.time >= start) & (frames.time <= stop)
    if not in_window.any():
        raise InputError(f"no frames between {start:g} and {stop:g} s", file=recording.path)
    scenario = parse_scenario(recording.scenario_text, file=recording.path)
    scene, times = build_scene(scenario), frames.time[in_window]
    plate_velocity = None
    if len(scenario.drive) == 1:
        amplitude = np.abs(scene.surface.terms.phasor(times, 1)[:, 0])
        plate_velocity = amplitude * 2.0 * np.pi * scenario.drive[0].frequency_hz
    return VelocityRecord(
        title=scenario.title or recording.path.parent.name,
        window=(start, min(stop, float(frames.time[-1]))),
        time=times,
        velocity=frames.velocity[in_window, 0, 2],
        plate_velocity=plate_velocity,
        intervals=tuple(flights.interval for flights in seed_flights(scene, impacts)),
    )
