"""What one part costs in the impulse engine: where it rides a plate, where it just hops, and in the usual scenes.

    python benchmarks/rides.py [--repeats 3] [--only pause]

Prints, for each scene, processor time per simulated second (median of the repeats) and what the engine counted. In the
pause after a pulse a plate of 180 mm rings down under the part.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from feeder_sim.constants import GRAVITY
from feeder_sim.engines.impulse.free_part.engine import FreePartEngine
from feeder_sim.scenario import Scenario, load_scenario
from feeder_sim.scene.scene import Scene, build_scene

ROOT = Path(__file__).parents[1]
NUT = {"shape": "hex_nut", "size": "M2.5"}
SCREW = {"shape": "mesh", "file": str(ROOT / "models/screw/screw.stl")}
PLATE = {"kind": "modes", "mode_file": str(ROOT / "models/plate_180/modes.h5")}
PISTON = {"kind": "piston", "length_mm": 400.0, "width_mm": 400.0}
PLACES = ((40.0, 10.0), (0.0, 0.0), (20.0, 35.0), (-52.0, 61.0))  # [mm]
GATHER, PULSE, PAUSE = 1.0, 0.1, 0.4  # [s]
BLOCK = 20  # frames advanced at once
Raw = dict[str, Any]


def scene(
    plate: dict[str, Any], drive: list[dict[str, Any]], part: dict[str, Any], place: Any, duration: float
) -> Scene:
    start = {"position_mm": list(place), "drop_height_mm": [0.02, 0.05]}
    run = {"duration_s": duration, "seeds": 1, "frames_per_second": 1000.0}
    raw = {"plate": plate, "drive": drive, "part": [part | {"start": start}], "run": run}
    return build_scene(Scenario.model_validate(raw))


def at_volts(frequency: float, start: float, duration: float | None = None) -> Raw:
    stop = {} if duration is None else {"duration_s": duration}
    return {"frequency_hz": frequency, "voltage_vpp": 120.0, "start_s": start} | stop


def over_piston(part: Raw, acceleration: float) -> Scene:
    """Acceleration [g] at 4750 Hz."""
    amplitude = 1e6 * acceleration * GRAVITY / (2.0 * np.pi * 4750.0) ** 2
    drive = {"frequency_hz": 4750.0, "amplitude_um": float(amplitude), "ring_up": False}
    return scene(PISTON, [drive], part, (0.0, 0.0), 1.0)


def shipped(name: str) -> Scene:
    return build_scene(load_scenario(ROOT / f"scenarios/{name}.toml"))


def scenes() -> Iterator[tuple[str, Scene, float]]:
    """Name, scene, and the time from which on it counts [s]."""
    pulse = [at_volts(2646.0, 0.0, GATHER), at_volts(2797.0, GATHER, PULSE)]
    for place in PLACES:
        yield f"pause {place}", scene(PLATE, pulse, NUT, place, GATHER + PULSE + PAUSE), GATHER + PULSE
    for place in PLACES:
        yield f"2646 Hz {place}", scene(PLATE, [at_volts(2646.0, 0.0)], NUT, place, 2.0), 0.0
    for place in PLACES[:2]:
        yield f"screw, 2646 Hz {place}", scene(PLATE, [at_volts(2646.0, 0.0)], SCREW, place, 2.0), 0.0
    for g in (0.95, 1.1, 1.5, 3.0, 20.0):
        yield f"nut at {g} g", over_piston(NUT, g), 0.0
    for g in (0.95, 3.0):
        yield f"screw at {g} g", over_piston(SCREW, g), 0.0
    for name in ("drift_4750hz", "drift_8775hz", "ball_500hz", "cube_toss"):
        yield name, shipped(name), 0.0


def cost(scene: Scene, since: float, seed: int) -> tuple[float, tuple[int, ...]]:
    """Processor time per simulated second [s], and what was counted since then."""
    engine = FreePartEngine(scene, np.random.default_rng(seed))
    first, last = round(since / scene.frame_interval), scene.n_frames - 1
    for at in range(0, first, BLOCK):
        engine.advance(min(BLOCK, first - at))
    before, started = counts(engine), time.process_time()
    for at in range(first, last, BLOCK):
        engine.advance(min(BLOCK, last - at))
    spent = time.process_time() - started
    return spent / ((last - first) * scene.frame_interval), tuple(np.subtract(counts(engine), before).tolist())


def counts(engine: FreePartEngine) -> list[int]:
    found = engine.counts
    return [found.unresolved_impacts, found.late_contacts, found.budgets_spent]


def main(
    repeats: Annotated[int, typer.Option(help="seeds")] = 3,
    only: Annotated[str, typer.Option(help="scenes whose name holds this")] = "",
) -> None:
    print(f"{'scene':<26}{'ms per s: median':>18}{'worst':>10}{'unresolved':>12}{'late':>8}{'budgets':>9}")
    for name, made, since in scenes():
        if only not in name:
            continue
        cost(made, since, 99)  # compiled
        found = [cost(made, since, seed) for seed in range(repeats)]
        times, counted = [1e3 * spent for spent, _ in found], np.sum([counted for _, counted in found], axis=0)
        print(
            f"{name:<26}{statistics.median(times):>18.2f}{max(times):>10.2f}{counted[0]:>12}{counted[1]:>8}{counted[2]:>9}",
            flush=True,
        )


if __name__ == "__main__":
    typer.run(main)
