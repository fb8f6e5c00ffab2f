"""The velocity of a guided part over time, as a laser vibrometer above it records it, and its bounce intervals.

    python docs/examples/velocity.py RUN --picture FILE --from 1.0 --to 1.5

It prints the least and the largest velocity of the part, the largest of the plate where one drive moves it, and the
bounce intervals of all seeds.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

import feeder_sim
from feeder_sim.document.figure import MM, MS, empty_figure
from feeder_sim.errors import FeederSimError, InputError
from feeder_sim.measures.bounces import batched, seed_flights


def draw_velocity(run: Path, picture: Path, *, seed: int = 0, start: float = 0.0, stop: float = 1.0) -> dict[str, Any]:
    """Draw the vertical velocity of one seed with that of the plate, and the bounce intervals of all seeds.

    Args:
        run: folder of a run with a part in a guide, or its trajectory file.
        picture: file to draw to.
        seed: index of the seed whose velocity is drawn.
        start: of the velocity record [s].
        stop: of the velocity record [s].

    Returns:
        The numbers in it.

    Raises:
        InputError: no such seed, no frames in that time, or no impacts were recorded.
    """
    result = feeder_sim.open(run)
    if not any(len(each.impacts) for each in result.seeds):
        raise InputError("holds no impacts, must be a run of a part in a guide", file=run)
    if not 0 <= seed < len(result.seeds):
        raise InputError(f"is {seed}, must be 0 to {len(result.seeds) - 1}", file=run, key="--show-seed")
    frames = result.seeds[seed].frames
    in_window = (frames.time >= start) & (frames.time <= stop)
    if not in_window.any():
        raise InputError(f"no frames between {start:g} and {stop:g} s", file=run)
    time, velocity = frames.time[in_window], frames.velocity[in_window, 0, 2]
    figure = empty_figure(10.0, 3.8)
    left, right = figure.subplots(1, 2, width_ratios=[3, 1])
    left.plot(time, velocity * MM, linewidth=0.8, color="tab:orange")
    largest = None
    if len(result.scenario.drive) == 1:
        amplitude = np.abs(result.scene.surface.terms.phasor(time, 1)[:, 0])
        envelope = amplitude * 2.0 * np.pi * result.scenario.drive[0].frequency_hz * MM
        largest = float(envelope.max())
        left.fill_between(time, -envelope, envelope, alpha=0.3, color="tab:blue", linewidth=0.0, label="plate")
        left.legend(loc="lower left", fontsize=8)
    window = (start, min(stop, float(frames.time[-1])))
    left.set(xlabel="time (s)", ylabel="vertical velocity (mm/s)", xlim=window)
    intervals = [
        flights.interval * MS for flights in seed_flights(result.scene, [each.impacts for each in result.seeds])
    ]
    right.hist(np.concatenate(intervals), bins=40, color="tab:orange")
    right.set(xlabel="bounce interval (ms)", ylabel=f"number of {sum(map(len, intervals))}, all seeds")
    left.set_title(result.title, fontsize=10)
    figure.savefig(picture, dpi=150)
    return {
        "from_s": window[0],
        "to_s": window[1],
        "samples": len(time),
        "least_velocity_mm_s": MM * float(velocity.min()),
        "largest_velocity_mm_s": MM * float(velocity.max()),
        "plate_velocity_mm_s": largest,
        "bounce_interval_ms": batched(intervals).as_dict(),
    }


def main(
    run: Path,
    picture: Annotated[Path, typer.Option(help="file to draw to")],
    start: Annotated[float, typer.Option("--from", min=0.0, help="begin of the record [s]")] = 0.0,
    stop: Annotated[float, typer.Option("--to", min=0.0, help="end of the record [s]")] = 1.0,
    show_seed: Annotated[int, typer.Option(min=0, help="index of the seed shown")] = 0,
) -> None:
    try:
        print(json.dumps(draw_velocity(run, picture, seed=show_seed, start=start, stop=stop)))
    except FeederSimError as error:
        sys.exit(f"{Path(__file__).name}: {error}")


if __name__ == "__main__":
    typer.run(main)
