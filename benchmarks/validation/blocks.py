"""Which side is up: rolls of steel blocks with sides y, y, x, of which the share with a square face up was measured.

    python benchmarks/validation/blocks.py [--throws 2000] [--drops]

Data: Budden, Math. Gaz. 64 (1980) 196, in conformance/blocks.csv; of ratios x/y without a share there is a prediction
alone. How the blocks were rolled is not known. One throw is taken for all, the default of `feeder-sim part --throws`,
with the default contact; nothing is fitted. The range is that of throws from half and twice the height, with half and
twice the spin, and with restitutions of 0.1 and 0.4. `--drops`: dropped at rest, besides.
"""

from __future__ import annotations

import argparse
import csv
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh

from feeder_sim.part.rigid_part import RigidPart
from feeder_sim.pool.work import Work
from feeder_sim.scenario import Contact
from feeder_sim.studies.drops import Engine, Share, Throw, drop

SIDE = 12e-3  # y [m]; only the ratio counts, as all of the throw follows from the size
STEEL = 7850.0
MEASURED = Path(__file__).parents[2] / "conformance" / "blocks.csv"


@dataclass(frozen=True)
class Block:
    """A block with sides y, y, ratio * y.

    Attributes:
        ratio: x / y.
        rolls: how many there were.
        share: of them with a square face up; None where it is to be predicted.
    """

    ratio: float
    rolls: int
    share: float | None

    def part(self) -> RigidPart:
        """The block, with its square faces at the ends of z."""
        sides = np.array([SIDE, SIDE, self.ratio * SIDE])
        mesh, mass, squares = trimesh.creation.box(extents=sides), STEEL * sides.prod(), sides**2
        vertices, inertia = np.array(mesh.vertices), mass * (squares.sum() - squares) / 12.0
        return RigidPart("block", mass, inertia, vertices, 0.0, vertices, np.array(mesh.faces))

    def computed(
        self,
        throws: int,
        throw: Throw | None = None,
        contact: Contact | None = None,
        *,
        engine: Engine = "impulse",
        work: Work | None = None,
    ) -> float:
        """Share of so many throws, or drops at rest, after which a square face is up."""
        study = drop(self.part(), throws, throw=throw, contact=contact, engine=engine, work=work)
        return sum(share.value for share in study.shares if self._on_square(share))

    def _on_square(self, share: Share) -> bool:
        return math.isclose(share.pose.height, 0.5 * self.ratio * SIDE, rel_tol=1e-3)

    def over_throws(self, throws: int) -> list[float]:
        """Shares for other throws and restitutions than the usual ones."""
        part = self.part()
        usual = Throw.of(part)
        heights = [Throw.of(part, height=(k * usual.height[0],) * 2) for k in (0.5, 2.0)]
        spins = [Throw.of(part, spin=(k * usual.spin[0],) * 2) for k in (0.5, 2.0)]
        shares = [self.computed(throws, throw) for throw in heights + spins]
        return shares + [self.computed(throws, usual, Contact(restitution=e)) for e in (0.1, 0.4)]


def blocks() -> list[Block]:
    """Those that were rolled, in order of their ratios."""
    with MEASURED.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    return [
        Block(float(row["ratio"]), int(row["rolls"]), float(row["share"]) if row["share"] else None) for row in rows
    ]


def rms(differences: list[float]) -> float:
    """Root of the mean square."""
    return math.sqrt(sum(each**2 for each in differences) / len(differences))


def rms_beyond_chance(rolled: Sequence[Block], shares: Sequence[float], throws: int) -> tuple[float, float]:
    """Difference to the measured shares (rms) without what the throws scatter, and its standard error."""
    off = np.array([share - (block.share or 0.0) for block, share in zip(rolled, shares, strict=True)])
    variance = np.array([max(share * (1.0 - share), 1.0 / throws) / throws for share in shares])
    square = max(float((off**2 - variance).mean()), 0.0)
    se = math.sqrt(float((4.0 * off**2 * variance + 2.0 * variance**2).sum())) / len(rolled)
    return math.sqrt(square), se / max(2.0 * math.sqrt(square), math.sqrt(se))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--throws", type=int, default=2000)
    parser.add_argument("--drops", action="store_true")
    options = parser.parse_args()
    differences: dict[str, list[float]] = {"thrown": [], "dropped": []}
    print("x / y  rolls  measured  thrown        range         " + ("dropped" if options.drops else ""))
    for block in blocks():
        share = block.computed(options.throws, Throw.of(block.part()))
        se = math.sqrt(max(share * (1.0 - share), 1.0 / options.throws) / options.throws)
        others = [share, *block.over_throws(options.throws // 2)]
        dropped = block.computed(options.throws) if options.drops else math.nan
        measured = "-" if block.share is None else f"{block.share:.3f}"
        text = f"{block.ratio:5.2f}  {block.rolls:5d}  {measured:>8}  {share:.3f} +- {se:.3f}  "
        print(f"{text}{min(others):.3f} - {max(others):.3f}  {f'{dropped:.3f}' if options.drops else ''}", flush=True)
        if block.share is not None:
            differences["thrown"].append(share - block.share)
            differences["dropped"].append(dropped - block.share)
    print(f"rms difference of the measured ones: thrown {rms(differences['thrown']):.3f}", end="")
    print(f", dropped at rest {rms(differences['dropped']):.3f}" if options.drops else "")


if __name__ == "__main__":
    main()
