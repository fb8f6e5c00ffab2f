"""Drops of parts on a plate at rest: both engines against each other, coins of all thicknesses, and the cost of throws.

    python benchmarks/drops.py --drops 2000 [--only smooth|friction|coins|throws]

Shares of the stable poses of hexagon nuts, of a bracket and of a screw by both engines, from the same attitudes. They
have to be within three joint standard errors of each other without friction (exit code 1 if not). With friction what is
farther apart is marked: MuJoCo's convex cone throws a part up that hits the plate sliding (docs/engines.md).

Then the share of a cylinder on its side over height / diameter, for several restitutions. A coin that is put down at a
random attitude and does not bounce lies on its side in h / sqrt(h^2 + d^2) of all cases, in a third at h/d = 0.354 =
1/sqrt(8) (Yong and Mahadevan, Am. J. Phys. 79 (2011) 1195, for a coin dropped without bouncing from a random attitude;
1/sqrt(3) for one that spins fast). Coins that bounce fall on their side less often, and need to be thicker.

Last what a thousand throws cost, without compilation: a cube, the nuts, the files, and a coin of corners.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from pathlib import Path

import numpy as np
import trimesh

from feeder_sim.part.mesh_part import mesh_part
from feeder_sim.part.rigid_part import RigidPart
from feeder_sim.part.solids import cylinder, hex_nut
from feeder_sim.scenario import Contact
from feeder_sim.studies.drops import ENGINES, Throw, drop

MODELS = Path(__file__).parents[1] / "models"
STEEL = 7850.0
ACROSS, BORE = 5e-3, 2.5e-3
HEIGHTS = (0.3, 0.6, 0.9)  # of nuts, over their width across flats
COINS = (0.2, 0.3, 0.354, 0.4, 0.5, 0.577, 0.7, 0.85)  # height over diameter
RESTITUTIONS = (0.0, 0.2, 0.5)
CORNER_ERROR = 50e-6
THROWS = 1000


def parts() -> dict[str, RigidPart]:
    nuts = {f"nut {h:g}": hex_nut(ACROSS, h * ACROSS, BORE, STEEL, f"nut {h:g}") for h in HEIGHTS}
    files = {
        name: mesh_part(MODELS / name / f"{name}.stl", 1.0, STEEL, name, corner_error=CORNER_ERROR)
        for name in ("bracket", "screw")
    }
    return nuts | files


def compare_engines(drops: int, seed: int, friction: float) -> bool:
    """Print the shares of each pose by each engine; whether all agree."""
    agree, contact = True, Contact(friction=friction)
    print(f"restitution {contact.restitution:g}, friction {friction:g}")
    print("part      pose  centre (mm)  put down    impulse         mujoco          difference / its se")
    for name, part in parts().items():
        studies, seconds = [], []
        for engine in ENGINES:
            began = time.perf_counter()
            studies.append(drop(part, drops, contact=contact, engine=engine, seed=seed))
            seconds.append(time.perf_counter() - began)
        for one, other in zip(studies[0].shares, studies[1].shares, strict=True):
            together = math.hypot(one.standard_error, other.standard_error)
            apart = (one.value - other.value) / together
            far = abs(apart) > 3.0
            agree &= not far
            shares = "   ".join(f"{s.value:.3f} +- {s.standard_error:.3f}" for s in (one, other))
            pose = one.pose
            print(
                f"{name:<9} {pose.name:<4}  {1e3 * pose.height:>11.3f}  {pose.chance:>8.3f}    {shares} {apart:+9.1f}"
            )
        rest = ", ".join(
            f"{study.engine}: {study.other} in no pose, {study.moving} rolling, {s:.0f} s"
            for study, s in zip(studies, seconds, strict=True)
        )
        alike = float((studies[0].pose == studies[1].pose).mean())
        print(f"{'':<9} {rest}; {100.0 * alike:.0f} % of the drops alike", flush=True)
    return agree


def coins(drops: int, seed: int) -> None:
    """Print the share of cylinders on their side over h/d."""
    print("\nshare of a cylinder on its side; restitution, friction 0.3")
    print("h/d     put down  " + "  ".join(f"e = {e:<11g}" for e in RESTITUTIONS))
    for ratio in COINS:
        part = cylinder(ACROSS, ratio * ACROSS, STEEL, "coin")
        line = f"{ratio:<6g}  {ratio / math.hypot(1.0, ratio):>8.3f}"
        for restitution in RESTITUTIONS:
            study = drop(part, drops, contact=Contact(restitution=restitution), seed=seed)
            (side,) = (share for share in study.shares if np.abs(share.pose.down[0][2]) < 0.5)
            line += f"  {side.value:.3f} +- {side.standard_error:.3f}"
        print(line, flush=True)


def throws(seed: int) -> None:
    """Print the wall time of a thousand throws of each part."""
    print(f"\n{THROWS} throws    wall (s)  still moving")
    for name, part in (parts() | solids()).items():
        drop(part, 1, throw=Throw.of(part))
        began = time.perf_counter()
        study = drop(part, THROWS, throw=Throw.of(part), seed=seed)
        print(f"{name:<14} {time.perf_counter() - began:>7.1f}  {study.moving:>12}", flush=True)


def solids() -> dict[str, RigidPart]:
    """A cube, and a coin of 32 corners around."""
    shapes = {
        "cube": trimesh.creation.box(extents=(ACROSS,) * 3),
        "coin": trimesh.creation.cylinder(ACROSS, 1e-3, sections=32),
    }
    bodies = {}
    for name, mesh in shapes.items():
        mesh.density = STEEL
        vertices = np.array(mesh.vertices)
        inertia = np.diag(mesh.moment_inertia).copy()
        bodies[name] = RigidPart(name, mesh.mass, inertia, vertices, 0.0, vertices, np.array(mesh.faces))
    return bodies


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--drops", type=int, default=2000, help="of each part by each engine [2000]")
    parser.add_argument("--seed", type=int, default=0, help="of the attitudes [0]")
    parser.add_argument("--only", choices=("smooth", "friction", "coins", "throws"), help="one part of it")
    options = parser.parse_args()
    agree = True
    if options.only in (None, "smooth"):
        agree = compare_engines(options.drops, options.seed, friction=0.0)
    if options.only in (None, "friction"):
        compare_engines(options.drops, options.seed, friction=Contact().friction)
    if options.only in (None, "coins"):
        coins(options.drops, options.seed)
    if options.only in (None, "throws"):
        throws(options.seed)
    if not agree:
        print("the engines differ by more than three standard errors")
    return 0 if agree else 1


if __name__ == "__main__":
    sys.exit(main())
