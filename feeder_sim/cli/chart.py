"""The command `chart`: speed against accuracy of all methods, the model ladders and the stability maps."""

from __future__ import annotations

import platform
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from feeder_sim.cli.files import writable
from feeder_sim.errors import InputError, nearest

if TYPE_CHECKING:
    from feeder_sim.studies.chart.points import Point

PARTS = ("methods", "ladder", "stability")  # of the chart, each with files of its own
WITHIN_PERCENT = 5.0  # error up to which the fastest method of a case is named


def chart(
    out: Annotated[Path, typer.Option("--out", help="Folder for data and pictures.")] = Path("chart"),
    quick: Annotated[bool, typer.Option("--quick", help="Few seeds and coarse maps: does it all still work?")] = False,
    only: Annotated[list[str] | None, typer.Option("--only", help=f"One of {', '.join(PARTS)} [all].")] = None,
    case: Annotated[list[str] | None, typer.Option("--case", help="Case of the methods [all].")] = None,
    peers: Annotated[Path | None, typer.Option("--peers", help="CSV of other simulators to put beside.")] = None,
) -> None:
    """Chart speed against accuracy of every method; what simplifications save; where methods fail."""
    from feeder_sim.studies.chart.cases import CASES

    names = [c.name for c in CASES]
    for chosen, allowed, key in ((only, PARTS, "--only"), (case, names, "--case")):
        for name in chosen or ():
            if name not in allowed:
                hint = nearest(name, allowed)
                raise InputError(f"is {name!r}{hint}, allowed is {', '.join(allowed)}", key=key)
    if peers is not None:
        from feeder_sim.studies.chart.points import read_peers

        if not peers.is_file():
            raise InputError("no such file", file=peers, key="--peers")
        read_peers(peers, dict.fromkeys(names, (1.0, 0.0)))  # refuses a bad file before any work is done
    if out.exists() and not out.is_dir():
        raise InputError("is a file, allowed is a folder", file=out, key="--out")
    out.mkdir(parents=True, exist_ok=True)
    for part in only or PARTS:
        for suffix in (".csv", ".json", ".png", ".svg"):
            writable(out / f"{part}{suffix}")
    if "methods" in (only or PARTS):
        _chart_methods(out, [c for c in names if c in (case or names)], peers, quick)
    if "ladder" in (only or PARTS):
        _run_ladders(out, quick)
    if "stability" in (only or PARTS):
        _map_stability(out, quick)


def _chart_methods(out: Path, names: Sequence[str], peers: Path | None, quick: bool) -> None:
    """Compute cases by all methods; write, draw and print the points, with those of other simulators."""
    from feeder_sim.plots.chart import draw_points
    from feeder_sim.studies.chart.by_drift_map import points_by_drift_map
    from feeder_sim.studies.chart.cases import CASES
    from feeder_sim.studies.chart.methods import METHODS
    from feeder_sim.studies.chart.points import measure_all, read_peers, write_points

    cases = [c for c in CASES if c.name in names]
    points = measure_all(cases, METHODS, quick=quick, note=_note)
    references = {p.case: (p.reference, p.reference_se) for p in points}
    points += points_by_drift_map(references, quick=quick)
    if peers is not None:
        points += read_peers(peers, references)
    write_points(points, out)
    draw_points(points, out / "methods", machine())
    for c in cases:
        _print_case(c.title, [p for p in points if p.case == c.name])


def _run_ladders(out: Path, quick: bool) -> None:
    """Run the model ladders; write, draw and print them."""
    from feeder_sim.plots.chart import draw_ladder
    from feeder_sim.studies.chart.ladder import run_ladders, write_rungs

    rungs = run_ladders(quick=quick, note=_note)
    write_rungs(rungs, out)
    draw_ladder(rungs, out / "ladder")
    for rung in rungs:
        print(
            f"{rung.ladder:<18} {rung.model:<22} {rung.speed_mm_s:7.3f} +- {rung.se_mm_s:.3f} mm/s "
            f"{rung.change_percent:+6.1f} %  saves {rung.saves:.2f}"
        )


def _map_stability(out: Path, quick: bool) -> None:
    """Compute the stability maps; write and draw them, and print how many cells have which state."""
    from feeder_sim.plots.chart import draw_stability
    from feeder_sim.studies.chart.stability_map import fill, write_cells

    cells = fill(quick=quick, note=_note)
    write_cells(cells, out)
    draw_stability(cells, out / "stability")
    for state in sorted({cell.state for cell in cells}):
        print(f"{state}: {sum(cell.state == state for cell in cells)} of {len(cells)} cells")


def _print_case(title: str, points: Sequence[Point]) -> None:
    """Print the front of a case, the default, the fastest method within 5 % and the failures.

    Costs are relative to that of the default.
    """
    from feeder_sim.studies.chart.points import fastest_within, front, is_default

    default = next((p for p in points if is_default(p)), None)
    cost_unit = default.wall_s_per_simulated_s if default else 1.0
    best = front(points)
    print(title)
    for p in best:
        cost = p.wall_s_per_simulated_s / cost_unit
        print(f"  front  {p.method}, {p.setting}: error {p.error_percent:.2g} %, cost {cost:.3g}")
    if default is not None:
        print(f"  default on the front: {'yes' if default in best else 'no'}, error {default.error_percent:.2g} %")
    first = fastest_within(points, WITHIN_PERCENT)
    if first is not None:
        print(f"  fastest within {WITHIN_PERCENT:g} %: {first.method}, {first.setting}")
        others = [p for p in points if _family(p) != _family(first)]
        second = fastest_within(others, WITHIN_PERCENT)
        if second is not None:
            ratio = second.wall_s_per_simulated_s / first.wall_s_per_simulated_s
            print(f"  next: {second.method}, {second.setting}, {ratio:.3g} times its cost")
    for p in points:
        if not p.valid:
            print(f"  failed  {p.method}, {p.setting}: {p.failure}")


def _family(point: Point) -> str:
    """Name of the simulator, without the variant that follows the comma."""
    return point.method.split(",")[0]


def machine() -> str:
    """Name of this machine's processor, or of its architecture where Linux does not give the name."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()


def _note(line: str) -> None:
    """Print a line of progress on stderr."""
    print(line, file=sys.stderr, flush=True)
