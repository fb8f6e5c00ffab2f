"""Pairs of modes of the source's separation: the square and the rectangular one side by side, and higher ones.

    python benchmarks/mode_pairs.py [--picture FILE]
    python benchmarks/mode_pairs.py --plates
    python benchmarks/mode_pairs.py --seeds 16

D. Shi (EPFL thesis TH7124, 2016) has two pairs by finite elements: a square one, 2629 and 2778 Hz, and a rectangular
one, 2359 and 2338 Hz, whose nodes and antinodes do not match. The first table has both, and each the other way round.

- *Moved*: share of the plate where parts hop under the gathering mode. *Thrown*: share of its nodal lines from where
  the second mode throws them. *Score*: one times the other (feeder_sim.plate.pairs).
- *Overlap*: mean |w| of the second mode on these lines over that on the whole plate; above 1 the antinodes of one lie
  on the nodes of the other. It does not depend on the amplitude.
- *Places*: antinodes of the second mode inside the plate that lie on these lines.
- *Moves along*: amplitude of the second mode at the resonance of the first over that at its own resonance, at a
  damping ratio of `DAMPING` and equal forces.

All modes have one velocity at their antinode, that of the weaker mode of the square pair at 120 V peak to peak on
models/plate_180_piezos. Then comes what `feeder-sim modes --pairs` makes of the same pairs at 120 V. It leaves out
pairs nearer than `APART`, and modes that no actuator moves have a score of 0. Then the best pairs up to `HIGHEST`; of
two degenerate modes only one gathers, the other is the same turned.

With --plates: at which widths a plate 180 mm long, and a plate of 160 x 120 mm, has neighbours near 2338 and 2359 Hz.
With --seeds: picks in `CYCLES` cycles as in scenarios/separation_100.toml, of `NUTS` nuts, with the two pairs and the
higher one with most places; and with the first mode of the square pair in place of its second, which throws nothing
off its own lines.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from feeder_sim.document.figure import MM, empty_figure
from feeder_sim.plate.mode_file import ModeFile, read_mode_file
from feeder_sim.plate.modes import PlateModes, plate_modes
from feeder_sim.plate.pairs import APART, LEAST_MOVED, MOVES, ON_LINE, POINTS, THROWS, mode_pairs
from feeder_sim.plate.rectangle import RectangularPlate
from feeder_sim.plate.response import hop_height, rank_modes
from feeder_sim.pool.work import Work
from feeder_sim.run.simulation import simulate
from feeder_sim.scenario import Scenario, load_scenario
from feeder_sim.scenario.tables import validated

ROOT = Path(__file__).parents[1]
SCENARIO = ROOT / "scenarios" / "separation_100.toml"
PIEZOS = ROOT / "models" / "plate_180_piezos" / "modes.h5"
VOLTS_VPP = 120.0
SQUARE, RECTANGULAR = (12, 13), (10, 11)  # 0-based modes of the 180 mm plate, the gathering one first
SOURCE = {SQUARE: (2629.0, 2778.0), RECTANGULAR: (2359.0, 2338.0)}  # [Hz], by the finite elements of the source
HIGHEST = 12_000.0  # [Hz]
DAMPING = 0.002
SHOWN = 8  # pairs of a table
LEAST_OF_SQUARE = 0.9
SAME = 1e-4  # relative difference of degenerate frequencies
WIDTHS = np.arange(90.0, 270.1, 2.5)  # [mm]
CLOSE = 0.02  # of both frequencies, to be a candidate
NUTS, CYCLES, CLEARANCE_MM = 40, 3, 10.0
DEEP = 0.25  # of the antinode; a local maximum below it is no antinode
Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Match:
    """How two modes suit each other; see the head of this file.

    Attributes:
        gather, throw: 0-based modes.
        frequency: of both [Hz].
    """

    gather: int
    throw: int
    frequency: tuple[float, float]
    moved: float
    thrown: float
    overlap: float
    places: int

    @property
    def score(self) -> float:
        return self.moved * self.thrown

    @property
    def apart(self) -> float:
        return abs(self.frequency[1] / self.frequency[0] - 1.0)

    @property
    def along(self) -> float:
        """Response of the second mode at the first's frequency over that at its own."""
        return moves_along(*self.frequency)

    def row(self, name: str) -> str:
        first, second = self.frequency
        numbers = f"{self.moved:.2f} | {self.thrown:.2f} | {self.score:.2f} | {self.overlap:.2f} | {self.places}"
        return f"| {name} | {self.gather + 1}, {self.throw + 1} | {first:.0f}, {second:.0f} | {numbers} |"


HEAD = "| pair | modes | computed (Hz) | moved | thrown | score | overlap | places |\n|---|---|---|---|---|---|---|---|"


def moves_along(drive: float, resonance: float) -> float:
    """Amplitude at a drive frequency over that at resonance."""
    ratio = drive / resonance
    return 2.0 * DAMPING / math.hypot(1.0 - ratio**2, 2.0 * DAMPING * ratio)


def shapes_of(modes: PlateModes) -> Floats:
    """|w| of every mode over its antinode, (modes, POINTS, POINTS)."""
    x, y = (((np.arange(POINTS) + 0.5) / POINTS - 0.5) * side for side in (modes.plate.length, modes.plate.width))
    return np.abs(np.stack([modes.evaluate_grid(j, x, y)[0] for j in range(len(modes))]))


def antinodes(shape: Floats) -> NDArray[np.bool_]:
    """Local maxima of a shape (POINTS, POINTS) that are not on the edge."""
    from scipy.ndimage import maximum_filter

    peaks = (shape == maximum_filter(shape, size=7)) & (shape > DEEP)
    inside = np.zeros_like(peaks)
    inside[3:-3, 3:-3] = True
    return peaks & inside


def match(modes: PlateModes, shapes: Floats, gather: int, throw: int, velocity: float) -> Match:
    """How two modes suit each other when both move at one velocity [m/s] at their antinodes."""
    frequency = float(modes.natural_frequency[gather]), float(modes.natural_frequency[throw])
    hops = [
        hop_height(shapes[j] * velocity / (2.0 * math.pi * f), f)
        for j, f in zip((gather, throw), frequency, strict=True)
    ]
    lines = shapes[gather] < ON_LINE
    return Match(
        gather=gather,
        throw=throw,
        frequency=frequency,
        moved=float((hops[0] > MOVES).mean()),
        thrown=float((hops[1] > THROWS)[lines].mean()),
        overlap=float(shapes[throw][lines].mean() / shapes[throw].mean()),
        places=int((antinodes(shapes[throw]) & lines).sum()),
    )


def best(modes: PlateModes, shapes: Floats, velocity: float) -> list[Match]:
    """All pairs up to `HIGHEST` that are far enough apart, the best first."""
    return sorted(_matches(modes, shapes, velocity, APART), key=lambda m: (-m.score, -m.places))


def with_most_places(modes: PlateModes, shapes: Floats, velocity: float) -> list[Match]:
    """The pairs that come near the square one, those with most places first."""
    square = match(modes, shapes, *SQUARE, velocity)
    good = [
        m
        for m in best(modes, shapes, velocity)
        if m.score >= LEAST_OF_SQUARE * square.score and m.overlap >= LEAST_OF_SQUARE * square.overlap
    ]
    return sorted(good, key=lambda m: (-m.places, -m.score))


def _matches(modes: PlateModes, shapes: Floats, velocity: float, nearest: float) -> list[Match]:
    """All pairs up to `HIGHEST` that gather and whose frequencies are further apart than `nearest` (relative)."""
    frequency = modes.natural_frequency
    usable = [j for j in range(len(modes)) if frequency[j] <= HIGHEST]
    gathering = [j for j in usable if not _second_of_two(frequency, j)]
    pairs = [match(modes, shapes, i, j, velocity) for i in gathering for j in usable if i != j]
    return [m for m in pairs if m.moved >= LEAST_MOVED and m.apart > nearest]


def _second_of_two(frequency: Floats, j: int) -> bool:
    """Whether the mode is the last one, turned by a right angle."""
    return j > 0 and abs(frequency[j] / frequency[j - 1] - 1.0) < SAME


def equal_velocity(held: ModeFile) -> float:
    """Of the weaker of the square pair at the antinode at 120 V [m/s]."""
    ranked = {mode.mode: mode for mode in rank_modes(held, 0.5 * VOLTS_VPP, None)}
    return min(2.0 * math.pi * ranked[j].frequency * ranked[j].antinode for j in SQUARE)


def turned(pair: tuple[int, int]) -> tuple[int, int]:
    return pair[1], pair[0]


def print_both(held: ModeFile, shapes: Floats, velocity: float) -> None:
    modes = held.modes
    print(f"velocity at every antinode {velocity:.3f} m/s\n\n{HEAD}")
    for name, pair in (("square", SQUARE), ("rectangular", RECTANGULAR)):
        for suffix, (i, j) in (("", pair), (", other way round", turned(pair))):
            print(match(modes, shapes, i, j, velocity).row(name + suffix))
    print("\n| pair | of the source (Hz) | apart | second moves along |\n|---|---|---|---|")
    for name, pair in (("square", SQUARE), ("rectangular", RECTANGULAR)):
        first, second = SOURCE[pair]
        apart = f"{100.0 * abs(second / first - 1.0):.1f} %"
        print(f"| {name} | {first:.0f}, {second:.0f} | {apart} | {100.0 * moves_along(first, second):.0f} % |")


def print_ranks(held: ModeFile, shapes: Floats, velocity: float) -> None:
    pairs = mode_pairs(held, 0.5 * VOLTS_VPP)
    every = [m.score for m in _matches(held.modes, shapes, velocity, nearest=-1.0)]
    print(
        f"\n`feeder-sim modes models/plate_180_piezos/plate.toml --volts {VOLTS_VPP:g} --pairs`, all it ranks; and at"
    )
    print("equal velocities, with pairs nearer than 1 % and modes that no actuator moves\n")
    print("| pair | modes | rank | score | rank, equal velocities | score |\n|---|---|---|---|---|---|")
    for name, both in (("square", SQUARE), ("rectangular", RECTANGULAR)):
        for pair in (both, turned(both)):
            ranks = [k for k, p in enumerate(pairs, 1) if (p.gather.mode, p.throw.mode) == pair]
            cells = f"{ranks[0]} of {len(pairs)} | {pairs[ranks[0] - 1].score:.2f}" if ranks else "left out | -"
            score = match(held.modes, shapes, *pair, velocity).score
            rank = 1 + sum(other > score for other in every)
            print(f"| {name} | {pair[0] + 1}, {pair[1] + 1} | {cells} | {rank} of {len(every)} | {score:.2f} |")


def print_best(modes: PlateModes, shapes: Floats, velocity: float) -> None:
    matches = best(modes, shapes, velocity)
    print(f"\nbest pairs up to {HIGHEST:g} Hz, of {len(matches)}\n\n{HEAD}")
    for rank, pair in enumerate(matches[:SHOWN], 1):
        print(pair.row(f"{rank}"))
    print(f"\nmost places, of those with at least {LEAST_OF_SQUARE:g} of the square pair's score and overlap\n\n{HEAD}")
    for pair in with_most_places(modes, shapes, velocity)[:SHOWN]:
        print(pair.row(f"{matches.index(pair) + 1}"))


def print_plates(plate: RectangularPlate, velocity: float) -> None:
    """Plates that have two neighbours near the source's rectangular pair."""
    print(
        "| plate (mm) | modes | frequencies (Hz) | off by | thrown | score | overlap |\n|---|---|---|---|---|---|---|"
    )
    low, high = sorted(SOURCE[RECTANGULAR])
    sizes = [(180.0, float(width)) for width in WIDTHS] + [(160.0, 120.0)]
    for length, width in sizes:
        size = replace(plate, length=1e-3 * length, width=1e-3 * width)
        modes = plate_modes(size, highest_frequency=1.1 * high)
        frequency = modes.natural_frequency
        off = np.maximum(np.abs(frequency[:-1] / low - 1.0), np.abs(frequency[1:] / high - 1.0))
        k = int(off.argmin())
        if off[k] < CLOSE or length != 180.0:
            both = f"{frequency[k]:.0f}, {frequency[k + 1]:.0f}"
            pair = match(modes, shapes_of(modes), k + 1, k, velocity)
            how = f"{pair.thrown:.2f} | {pair.score:.2f} | {pair.overlap:.2f}"
            print(f"| {length:g} x {width:g} | {k + 2}, {k + 1} | {both} | {100.0 * off[k]:.1f} % | {how} |")


def scenario_of(pair: tuple[int, int], modes: PlateModes, velocity: float, seeds: int) -> Scenario:
    """Nuts on the 180 mm plate, gathered and thrown by a pair at one velocity [m/s] of both antinodes."""
    raw = load_scenario(SCENARIO).model_dump(exclude_none=True)
    raw["run"]["seeds"], raw["schedule"]["cycles"] = seeds, CYCLES
    stages = []
    for stage, mode in zip(raw["schedule"]["stage"], pair, strict=True):
        frequency = float(modes.natural_frequency[mode])
        amplitude = 1e6 * velocity / (2.0 * math.pi * frequency)
        drive = {"mode": mode + 1, "frequency_hz": frequency, "natural_frequency_hz": frequency}
        stages.append(stage | {"drive": [drive | {"amplitude_um": amplitude, "damping_ratio": DAMPING}]})
    stages[1]["pick"] = {"clearance_mm": CLEARANCE_MM}
    raw["schedule"]["stage"] = stages
    raw["part"] = [raw["part"][0] | {"count": NUTS}]
    return validated(raw, Scenario, SCENARIO)


def print_picks(
    pairs: Sequence[tuple[str, tuple[int, int]]], modes: PlateModes, velocity: float, options: argparse.Namespace
) -> None:
    print(f"\n{NUTS} nuts, {CYCLES} cycles, {options.seeds} seeds, mean +- SE\n")
    print("| pair | modes | picked | lost |\n|---|---|---|---|")
    for name, pair in pairs:
        result = simulate(scenario_of(pair, modes, velocity, options.seeds), work=Work(options.workers))
        measures = result.measures()
        cells = " | ".join(f"{m['mean']:.1f} +- {m['se'] or 0.0:.1f}" for m in (measures["picked"], measures["lost"]))
        print(f"| {name} | {pair[0] + 1}, {pair[1] + 1} | {cells} |", flush=True)


def draw(modes: PlateModes, pairs: Sequence[tuple[str, Match]], path: Path) -> None:
    """Draw the nodal lines of each gathering mode on the amplitude of the throwing one, side by side."""
    figure = empty_figure(9.6, 3.9)
    axes = figure.subplots(1, len(pairs), sharey=True)
    x, y = (np.linspace(-0.5, 0.5, 121) * side for side in (modes.plate.length, modes.plate.width))
    for place, (name, pair) in zip(axes, pairs, strict=True):
        throw = np.abs(modes.evaluate_grid(pair.throw, x, y)[0])
        gather = modes.evaluate_grid(pair.gather, x, y)[0]
        filled = place.contourf(x * MM, y * MM, throw.T, levels=np.linspace(0.0, 1.0, 11), cmap="YlOrRd")
        place.contour(x * MM, y * MM, gather.T, levels=[0.0], colors="black", linewidths=1.4)
        first, second = pair.frequency
        place.set_title(
            f"{name}: {first:.0f}, {second:.0f} Hz\nthrown {pair.thrown:.2f}, places {pair.places}", fontsize=9
        )
        place.set(aspect="equal", xlabel="x (mm)")
    axes[0].set(ylabel="y (mm)")
    figure.colorbar(filled, ax=axes, label="amplitude of the second mode", shrink=0.8)
    figure.savefig(path, dpi=85)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--plates", action="store_true", help="only search the plate of the rectangular pair")
    parser.add_argument("--seeds", type=int, default=0, help="of picks; none by default")
    parser.add_argument("--workers", type=int, help="processes of a run; all processors by default")
    parser.add_argument("--picture", type=Path)
    options = parser.parse_args()
    held = read_mode_file(PIEZOS)
    modes = held.modes
    if options.plates:
        print_plates(modes.plate, equal_velocity(held))
        return
    shapes, velocity = shapes_of(modes), equal_velocity(held)
    higher = with_most_places(modes, shapes, velocity)[0]
    print_both(held, shapes, velocity)
    print_ranks(held, shapes, velocity)
    print_best(modes, shapes, velocity)
    if options.picture:
        square, rectangular = (match(modes, shapes, *pair, velocity) for pair in (SQUARE, RECTANGULAR))
        draw(modes, [("square", square), ("rectangular", rectangular), ("higher", higher)], options.picture)
    if options.seeds:
        picked = [("square", SQUARE), ("rectangular", RECTANGULAR), ("higher", (higher.gather, higher.throw))]
        alone = [("square, first mode alone", (SQUARE[0], SQUARE[0]))]
        print_picks(picked + alone, modes, velocity, options)


if __name__ == "__main__":
    main()
