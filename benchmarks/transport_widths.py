"""Modes that carry a part along plates of one length and different widths: how transverse they are, and the best k.

    python benchmarks/transport_widths.py [--step 2.5] [--picture FILE] [--json]

Free plates of aluminium, 160 mm long and 3 mm thick, 160 to 80 mm wide; those in steps of 10 mm are D1 to D9 of the
source (D. Shi, EPFL thesis TH7124, 2016). The source carries parts by M1 to M5, the modes with two to six nodal lines
across the plate. The source's plates carry bars of a size it does not give, so no frequency is compared.

A mode is transverse as far as its deflection does not vary across the plate. Its share is that of the mean square of w
which is left when w is replaced by its mean over the width. Of the modes whose mean has n zeros along the plate, M(n-1)
is the one with the largest share. Where a bending across the width comes near, two modes share the transverse one: at
0.5 each has half of it, and neither is one to carry parts by.

k is the largest of a sequence of modes that carries a part from 75 mm beside the middle to the middle: of the best
sequence of M1 to M5, of the source's own (M1, M4, M3, M5, M2), and of the best of all modes that multiply an offset
from the line by less than 1.5 each. Takes 2 minutes.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from feeder_sim.document.figure import Figure
from feeder_sim.plate.materials import MATERIALS
from feeder_sim.plate.modes import PlateModes, plate_modes
from feeder_sim.plate.rectangle import RectangularPlate
from feeder_sim.plate.ritz.matrices import orthonormal_legendre
from feeder_sim.plate.sequences import LineNodes, Route, Search, find_routes, follow, nodes_on_line

LENGTH, THICKNESS = 0.160, 0.003  # [m]
WIDEST_MM, NARROWEST_MM, SOURCE_STEP_MM = 160.0, 80.0, 10.0
LINES = (2, 3, 4, 5, 6)  # across the plate, of M1 to M5
HIGHEST_HZ = 9000.0  # M5 of a strip lies at 8457 Hz
START_MM, EDGE_MM = -75.0, -79.9  # a part on the very edge is in no cell of a node
SOURCE_ORDER = (1, 4, 3, 5, 2)
GROWTH = 1.5  # of an offset from the line, as in docs/studies.md
PURE, VANISHES = 0.8, 0.6  # share [1]; two modes that share the transverse one equally have 0.5
SAMPLES = 801
ANY = Search()
NEAR_LINE = Search(growth=GROWTH)


@dataclass(frozen=True)
class TransverseMode:
    """The most transverse mode of a number of nodal lines.

    Attributes:
        lines: across the plate.
        mode: 0-based.
        frequency: [Hz].
        share: of its mean square deflection that does not vary across the plate [1].
    """

    lines: int
    mode: int
    frequency: float
    share: float

    @property
    def mark(self) -> str:
        """Whether the mode is transverse, disturbed (-) or vanishes (x)."""
        return " " if self.share >= PURE else "-" if self.share >= VANISHES else "x"


@dataclass(frozen=True)
class Width:
    """One plate.

    Attributes:
        width_mm: [mm].
        modes: M1 to M5.
        k: largest of the best sequence of M1 to M5 from `START_MM`; NaN where there is none.
        order: of that sequence, 1 for M1.
        k_source: largest k of `SOURCE_ORDER` from `START_MM`; NaN where it does not end in the middle.
        k_all: as `k`, of all modes that leave an offset from the line below `GROWTH` times it.
        order_all: of that sequence, by the number of the mode.
    """

    width_mm: float
    modes: tuple[TransverseMode, ...]
    k: float
    order: tuple[int, ...]
    k_source: float
    k_all: float
    order_all: tuple[int, ...]

    @property
    def least(self) -> float:
        """Share of the least transverse of M1 to M5 [1]."""
        return min(mode.share for mode in self.modes)


def transverse_modes(modes: PlateModes) -> list[TransverseMode]:
    """M1 to M5 of a plate."""
    w = modes.coefficients[:, 0]
    # The Legendre products are orthonormal, and the first of them across the plate is the mean over the width.
    share = (w[:, :, 0] ** 2).sum(axis=1) / (w**2).sum(axis=(1, 2))
    mean = w[:, :, 0] @ orthonormal_legendre(np.linspace(-1.0, 1.0, SAMPLES), w.shape[1]).T
    lines = (np.diff(np.signbit(mean), axis=1)).sum(axis=1)
    even = modes.parity[:, 1] == 0  # of the others the mean is nothing but round-off
    chosen = []
    for n in LINES:
        best = int(np.where(even & (lines == n), share, 0.0).argmax())
        chosen.append(TransverseMode(n, best, float(modes.natural_frequency[best]), float(share[best])))
    return chosen


def best_route(nodes: list[LineNodes], start_mm: float, search: Search) -> Route | None:
    """The sequence with the smallest largest k to the middle of the plate."""
    return next(iter(find_routes(nodes, 1e-3 * start_mm, 0.0, search)), None)


def k_in_order(nodes: list[LineNodes], order: Sequence[int], start_mm: float) -> float:
    """Largest k of modes (0-based) in a given order; NaN where they do not carry a part to the middle."""
    try:
        route = follow(nodes, order, 1e-3 * start_mm)
    except ValueError:
        return math.nan
    return route.largest_k if abs(route.end) <= ANY.tolerance and route.largest_k < ANY.limit else math.nan


def look_at(width_mm: float) -> Width:
    """Modes and sequences of the plate of a width [mm]."""
    plate = RectangularPlate(LENGTH, 1e-3 * width_mm, THICKNESS, MATERIALS["aluminium"])
    modes = plate_modes(plate, highest_frequency=HIGHEST_HZ)
    transverse = transverse_modes(modes)
    number = {mode.mode: mode.lines - 1 for mode in transverse}
    nodes = nodes_on_line(modes)
    own = [line for line in nodes if line.mode in number]
    route, every = best_route(own, START_MM, ANY), best_route(nodes, START_MM, NEAR_LINE)
    return Width(
        width_mm=width_mm,
        modes=tuple(transverse),
        k=route.largest_k if route else math.nan,
        order=tuple(number[mode] for mode in route.modes) if route else (),
        k_source=k_in_order(own, [transverse[m - 1].mode for m in SOURCE_ORDER], START_MM),
        k_all=every.largest_k if every else math.nan,
        order_all=tuple(mode + 1 for mode in every.modes) if every else (),
    )


def strip_k(start_mm: float) -> float:
    """Largest k of the source's sequence on a strip, whose modes do not vary across it at all."""
    plate = RectangularPlate(LENGTH, LENGTH, THICKNESS, MATERIALS["aluminium"])
    nodes = nodes_on_line(plate_modes(plate, highest_frequency=HIGHEST_HZ, uniform_width=True))
    return k_in_order(nodes, [m - 1 for m in SOURCE_ORDER], start_mm)


def is_of_source(width_mm: float) -> bool:
    """Whether a width [mm] is one of D1 to D9."""
    return width_mm % SOURCE_STEP_MM == 0.0


def draw_widths(widths: Sequence[Width], path: Path) -> None:
    """Draw shares and k over the width; dots are D1 to D9."""
    x = np.array([each.width_mm for each in widths])
    dots = [i for i, each in enumerate(widths) if is_of_source(each.width_mm)]

    def draw(figure: Any) -> None:
        upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(1.4, 1.0))
        for i in range(len(LINES)):
            share = [each.modes[i].share for each in widths]
            upper.plot(x, share, marker=".", markersize=8.0, markevery=dots, linewidth=1.0, label=f"M{i + 1}")
        upper.axhline(VANISHES, color="gray", linewidth=0.8, linestyle=":")
        upper.set(ylabel="share without variation across", ylim=(0.4, 1.02), title="How transverse a mode is")
        curves = {
            "best of M1 to M5": "k",
            "M1, M4, M3, M5, M2": "k_source",
            f"best of all, offset x {GROWTH:g}": "k_all",
        }
        for label, name in curves.items():
            k = [getattr(each, name) for each in widths]
            lower.plot(x, k, marker=".", markersize=8.0, markevery=dots, linewidth=1.0, label=label)
        lower.set(
            xlabel="width of the plate (mm)",
            ylabel="largest k",
            ylim=(0.4, 1.0),
            title="Largest k of a sequence",
        )
        for axes in (upper, lower):
            axes.grid(True, alpha=0.3)
            axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))

    path.write_bytes(Figure(draw, 5.0, alt="", caption="").picture.content)


def show(widths: Sequence[Width]) -> None:
    """Print a row per width, then the best ones."""
    heads = "".join(f"{f'M{n - 1} (Hz) share':>16}" for n in LINES)
    print(f"width (mm){heads}   least   k M1-M5  k source  k all  best sequence of M1-M5; of all modes")
    for each in widths:
        name = f"D{1 + round((WIDEST_MM - each.width_mm) / SOURCE_STEP_MM)}" if is_of_source(each.width_mm) else ""
        cells = "".join(f"{mode.frequency:>10.0f} {mode.share:.2f}{mode.mark}" for mode in each.modes)
        k = "".join(f"{value:>9.3f}" for value in (each.k, each.k_source, each.k_all))
        orders = "; ".join(",".join(map(str, order)) or "none" for order in (each.order, each.order_all))
        print(f"{each.width_mm:>6g} {name:>3}{cells}   {each.least:.2f} {k}  {orders}")
    print(f"- disturbed, share below {PURE:g}; x vanishes, below {VANISHES:g}")
    for text, some in (
        ("of D1 to D9", [each for each in widths if is_of_source(each.width_mm)]),
        ("of all widths", widths),
    ):
        pure = max(some, key=lambda each: each.least)
        print(f"{text}: all five modes most transverse at {pure.width_mm:g} mm, least share {pure.least:.2f}")
        for kind, name in (("M1 to M5", "k"), ("all modes", "k_all")):
            known = [each for each in some if math.isfinite(getattr(each, name))]
            best = min(known, key=lambda each: getattr(each, name))
            print(f"{text}: smallest largest k of {kind} at {best.width_mm:g} mm, {getattr(best, name):.3f}")
    for start in (START_MM, EDGE_MM):
        print(f"strip, the source's sequence from {start:g} mm: largest k {strip_k(start):.3f}")


def main(
    step: Annotated[float, typer.Option(help="between two widths [mm]", min=0.5, max=SOURCE_STEP_MM)] = 2.5,
    picture: Annotated[Path | None, typer.Option(help="draw shares and k over the width")] = None,
    as_json: Annotated[bool, typer.Option("--json")] = False,
) -> None:
    n = round((WIDEST_MM - NARROWEST_MM) / step)
    widths = [look_at(float(width)) for width in np.linspace(WIDEST_MM, NARROWEST_MM, n + 1)]
    if picture is not None:
        draw_widths(widths, picture)
    if as_json:
        print(json.dumps([asdict(each) for each in widths]))
        return
    show(widths)


if __name__ == "__main__":
    typer.run(main)
