"""The command `chart`: speed against accuracy of all methods, the model ladders and the stability maps."""

from __future__ import annotations

import json
import platform
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from feeder_sim.cli.files import writable
from feeder_sim.cli.options import AsJson
from feeder_sim.cli.terminal import notify, progress_bar
from feeder_sim.errors import InputError, nearest

if TYPE_CHECKING:
    from feeder_sim.studies.chart.summary import CaseSummary

PARTS = ("methods", "ladder", "stability")  # of the chart, each with files of its own
SUFFIXES = (".csv", ".json", ".png", ".svg")
AVERAGED_S = 600.0  # the time left follows from that long: pieces of the work differ, and each takes long


def chart(
    out: Annotated[Path, typer.Option("--out", help="Folder for data and pictures.")] = Path("chart"),
    quick: Annotated[bool, typer.Option("--quick", help="Few seeds and coarse maps: does it all still work?")] = False,
    only: Annotated[list[str] | None, typer.Option("--only", help=f"One of {', '.join(PARTS)} [all].")] = None,
    case: Annotated[list[str] | None, typer.Option("--case", help="Case of the methods [all].")] = None,
    peers: Annotated[Path | None, typer.Option("--peers", help="CSV of other simulators to put beside.")] = None,
    as_json: AsJson = False,
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
    wanted = [part for part in PARTS if part in (only or PARTS)]
    for part in wanted:
        for file in _files(out, part):
            writable(file)
    told: dict[str, Any] = {"folder": str(out), "quick": quick, "machine": machine()}
    for part in wanted:
        if part == "methods":
            found = _chart_methods(out, [c for c in names if c in (case or names)], peers, quick, as_json)
        else:
            found = (_run_ladders if part == "ladder" else _map_stability)(out, quick, as_json)
        told[part] = {"files": [str(file) for file in _files(out, part)]} | found
    if as_json:
        print(json.dumps(told))


def _files(folder: Path, part: str) -> list[Path]:
    """What is written of a part of the chart."""
    return [folder / f"{part}{suffix}" for suffix in SUFFIXES]


def _chart_methods(out: Path, names: Sequence[str], peers: Path | None, quick: bool, as_json: bool) -> dict[str, Any]:
    """Compute cases by all methods; write, draw, print and return the points, with those of other simulators."""
    from feeder_sim.plots.chart import draw_points
    from feeder_sim.studies.chart.by_drift_map import maps_cost, points_by_drift_map
    from feeder_sim.studies.chart.cases import CASES
    from feeder_sim.studies.chart.methods import METHODS
    from feeder_sim.studies.chart.points import costs_of, measure_all, read_peers, rows_of, write_points
    from feeder_sim.studies.chart.shares import shares
    from feeder_sim.studies.chart.summary import CaseSummary

    cases = [c for c in CASES if c.name in names]
    costs = sum(costs_of(cases, METHODS, quick=quick)), maps_cost(names, quick=quick)
    with progress_bar("methods", averaged_s=AVERAGED_S) as progress:
        by_methods, by_maps = shares(progress, costs)
        points = measure_all(cases, METHODS, quick=quick, note=notify, progress=by_methods)
        references = {p.case: (p.reference, p.reference_se) for p in points}
        points += points_by_drift_map(references, quick=quick, note=notify, progress=by_maps)
    if peers is not None:
        points += read_peers(peers, references)
    write_points(points, out)
    draw_points(points, out / "methods", machine())
    summaries = [CaseSummary.of(c.name, c.title, points) for c in cases]
    if not as_json:
        for summary in summaries:
            _print_case(summary)
    return {"points": rows_of(points), "cases": [summary.as_json_object() for summary in summaries]}


def _run_ladders(out: Path, quick: bool, as_json: bool) -> dict[str, Any]:
    """Run the model ladders; write, draw, print and return them."""
    from feeder_sim.plots.chart import draw_ladder
    from feeder_sim.studies.chart.ladder import rows_of, run_ladders, write_rungs

    with progress_bar("ladder", averaged_s=AVERAGED_S) as progress:
        rungs = run_ladders(quick=quick, note=notify, progress=progress)
    write_rungs(rungs, out)
    draw_ladder(rungs, out / "ladder")
    for rung in () if as_json else rungs:
        print(
            f"{rung.ladder:<18} {rung.model:<22} {rung.speed_mm_s:7.3f} +- {rung.se_mm_s:.3f} mm/s "
            f"{rung.change_percent:+6.1f} %  saves {rung.saves:.2f}"
        )
    return {"rungs": rows_of(rungs)}


def _map_stability(out: Path, quick: bool, as_json: bool) -> dict[str, Any]:
    """Compute the stability maps; write, draw and return them, and print how many cells have which state."""
    from feeder_sim.plots.chart import draw_stability
    from feeder_sim.studies.chart.stability_map import count_states, fill, rows_of, write_cells

    with progress_bar("stability", averaged_s=AVERAGED_S) as progress:
        cells = fill(quick=quick, note=notify, progress=progress)
    write_cells(cells, out)
    draw_stability(cells, out / "stability")
    states = count_states(cells)
    for state, number in {} if as_json else states.items():
        print(f"{state}: {number} of {len(cells)} cells")
    return {"cells": rows_of(cells), "states": states}


def _print_case(found: CaseSummary) -> None:
    """Print the front of a case, the default, the fastest method within 5 % and the failures.

    Costs are relative to that of the default.
    """
    from feeder_sim.studies.chart.summary import WITHIN_PERCENT

    print(found.title)
    for p in found.front:
        print(f"  front  {p.method}, {p.setting}: error {p.error_percent:.2g} %, cost {found.cost(p):.3g}")
    if found.default is not None:
        on_front = "yes" if found.default_on_front else "no"
        print(f"  default on the front: {on_front}, error {found.default.error_percent:.2g} %")
    first, second = found.fastest, found.following
    if first is not None:
        print(f"  fastest within {WITHIN_PERCENT:g} %: {first.method}, {first.setting}")
    if first is not None and second is not None:
        ratio = second.wall_s_per_simulated_s / first.wall_s_per_simulated_s
        print(f"  next: {second.method}, {second.setting}, {ratio:.3g} times its cost")
    for p in found.failed:
        print(f"  failed  {p.method}, {p.setting}: {p.failure}")


def machine() -> str:
    """Name of this machine's processor, or of its architecture where Linux does not give the name."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()
