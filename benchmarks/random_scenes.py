"""Random scenes of one free part, and of several: whether every run ends, in time, and mechanics keeps its laws.

    python benchmarks/random_scenes.py [--scenes 5000] [--kinds edge,hole] [--first 0] [--failing FOLDER] [--law L]

Prints a row for each kind of scene, and every scene that fails; it is written as a scenario file that anyone can run.
What must hold, and what the kinds are: tests/judged_scenes.py. Kinds of tests/judged_crowds.py, for several parts, of
tests/judged_walls.py and of tests/judged_fixtures.py have to be asked for. With 5000 of each of the others it takes
about two hours on two cores.
"""

from __future__ import annotations

import multiprocessing
import os
import sys
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import judged_crowds
import judged_fixtures
import judged_scenes
import judged_walls
from judged_scenes import ALL, Finding

ASKED_FOR = {kind: scenes for scenes in (judged_crowds, judged_fixtures, judged_walls) for kind in scenes.KINDS}
AT_ONCE = 20  # scenes that a worker takes
HEAD = "kind          scenes  refused  failed  late contacts  budgets spent  unresolved  s per s: median   99 %   worst"


def several(kind: str, first: int, last: int, law: str) -> list[tuple[int, Finding | None]]:
    """What is found in scenes from one number to before another."""
    found, scenes = [], ASKED_FOR.get(kind, judged_scenes)
    for seed in range(first, last):
        try:
            found.append((seed, scenes.judged(kind, seed, law)))
        except Exception as error:  # of an engine that breaks down; the others go on
            found.append((seed, Finding(scenes.scene(kind, seed), (f"{type(error).__name__}: {error}",), 0.0)))
    return found


def main(
    scenes: Annotated[int, typer.Option(help="of each kind")] = 5000,
    kinds: Annotated[str, typer.Option(help="separated by commas")] = ",".join(ALL),
    first: Annotated[int, typer.Option(help="number of the first scene")] = 0,
    failing: Annotated[Path | None, typer.Option(help="folder for the scenes that fail")] = None,
    law: Annotated[str, typer.Option(help="contact.law of all of them")] = "newton",
    workers: Annotated[int, typer.Option()] = os.cpu_count() or 1,
) -> None:
    import tomli_w

    print(HEAD, flush=True)
    total = 0
    with ProcessPoolExecutor(workers, multiprocessing.get_context("spawn")) as pool:
        for kind in kinds.split(","):
            pieces = [(n, min(n + AT_ONCE, first + scenes)) for n in range(first, first + scenes, AT_ONCE)]
            futures = [pool.submit(several, kind, *piece, law) for piece in pieces]
            run: list[Finding] = []
            refused = failed = 0
            for future in futures:
                for seed, finding in future.result():
                    if finding is None:
                        refused += 1
                        continue
                    run.append(finding)
                    if not finding.faults:
                        continue
                    failed += 1
                    print(f"  {kind} {seed}: {'; '.join(finding.faults)}", flush=True)
                    if failing is not None:
                        failing.mkdir(parents=True, exist_ok=True)
                        (failing / f"{kind.replace('/', '_')}_{seed}.toml").write_text(tomli_w.dumps(finding.scene))
            late, spent, unresolved = (sum(getattr(f.counts, name) for f in run) for name in COUNTED)
            wall = np.array([finding.wall_s for finding in run])
            print(
                f"{kind:<12}{len(run):>8}{refused:>9}{failed:>8}{late:>15}{spent:>15}{unresolved:>12}"
                f"{np.median(wall):>17.3f}{np.quantile(wall, 0.99):>8.2f}{wall.max():>8.1f}",
                flush=True,
            )
            total += failed
    raise typer.Exit(1 if total else 0)


COUNTED = ("late_contacts", "budgets_spent", "unresolved_impacts")

if __name__ == "__main__":
    typer.run(main)
