"""Commands about plates without parts: modes, sequences of modes, waves that several modes make."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from feeder_sim.cli.files import (
    ScenarioFile,
    file_in_errors,
    modes_of,
    new_picture,
    scenario_of,
    scenario_of_plate,
    writable,
)
from feeder_sim.cli.report import print_modes, print_ratios, print_routes, print_waves
from feeder_sim.cli.response import print_mode_pairs, print_ranked
from feeder_sim.errors import InputError

if TYPE_CHECKING:
    from feeder_sim.plate.sequences import LineNodes, Route, Search

NO_LIMIT = 1e9  # growth of an offset that no route reaches


def modes(
    source: Annotated[
        Path, typer.Argument(help="Plate file or scenario (.toml), or mode file (.h5).", show_default=False)
    ],
    out: Annotated[Path | None, typer.Option("--out", help="Write the modes to this HDF5 file.")] = None,
    picture: Annotated[Path | None, typer.Option("--picture", help="Draw the mode of --mode to this file.")] = None,
    mode: Annotated[int, typer.Option("--mode", min=1, help="Mode number for --picture.")] = 1,
    volts: Annotated[
        float | None, typer.Option("--volts", help="Rank the modes by what this voltage does, peak to peak [V].")
    ] = None,
    near: Annotated[
        str | None, typer.Option("--near", help="With --volts: amplitude at x,y [mm]; else at the highest antinode.")
    ] = None,
    pairs: Annotated[
        bool, typer.Option("--pairs", help="With --volts: pairs of modes that gather parts and throw them apart.")
    ] = False,
    gallery: Annotated[Path | None, typer.Option("--gallery", help="Draw all modes on one sheet to this file.")] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace an existing --out file.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout.")] = False,
) -> None:
    """Compute or read plate modes; list, rank, store and draw them. Your own are brought in by `modes import`."""
    from feeder_sim.scene.plate_modes import far_resonances

    mode_file = modes_of(source)
    if out is not None:
        from feeder_sim.plate.mode_file import write_mode_file

        write_mode_file(writable(out, force=force), mode_file)
    if picture is not None:
        if mode > len(mode_file.modes):
            raise InputError(f"is {mode}, must be 1 to {len(mode_file.modes)}", file=source, key="--mode")
        from feeder_sim.plots.pictures import draw_mode

        draw_mode(mode_file.modes, mode - 1, new_picture(picture))
    if gallery is not None:
        from feeder_sim.plots.pictures import draw_gallery

        draw_gallery(mode_file, new_picture(gallery))
    if near is not None and volts is None:
        raise InputError("belongs to --volts, which is missing", file=source, key="--near")
    if pairs:
        if volts is None:
            raise InputError("belongs to --volts, which is missing", file=source, key="--pairs")
        print_mode_pairs(mode_file, volts, source, as_json)
        return
    if volts is not None:
        print_ranked(mode_file, volts, near, source, as_json)
        return
    print_modes(mode_file, as_json)
    _say_origin(source)
    for _, warning in far_resonances(mode_file):
        print(f"feeder-sim: warning: {warning}", file=sys.stderr)


def _say_origin(source: Path) -> None:
    """Say what was taken of the drawing of a plate file, and by how much its places were moved."""
    from feeder_sim.scenario import BendingPlate, load_plate_file
    from feeder_sim.scene.plate_modes import shift_of

    if source.suffix != ".toml":
        return
    scenario = scenario_of_plate(source)
    plate = None if scenario is None else scenario.plate
    file = plate.as_file(1.0) if isinstance(plate, BendingPlate) else load_plate_file(source)
    if file.plate.drawing_account is not None:
        print(f"feeder-sim: of the drawing {file.plate.drawing_account}", file=sys.stderr)
    x, y = shift_of(file)
    if x or y:
        print(
            f"feeder-sim: moved by ({x:g}, {y:g}) mm, so that the middle of the plate is at (0, 0), in the mode file "
            "and in scenarios",
            file=sys.stderr,
        )


def sequence(
    source: Annotated[
        Path, typer.Argument(help="Plate file or scenario (.toml), or mode file (.h5).", show_default=False)
    ],
    start: Annotated[float, typer.Option("--from", help="Where the part lies, x from the centre [mm].")],
    end: Annotated[float, typer.Option("--to", help="Where it is to go [mm].")],
    *,
    y: Annotated[float, typer.Option("--y", help="The line along x it moves on, from the centre [mm].")] = 0.0,
    order: Annotated[str | None, typer.Option("--modes", help="Follow these modes, such as 1,4,3.")] = None,
    limit: Annotated[float, typer.Option("--limit", min=0.01, max=1.0, help="Every k stays below.")] = 1.0,
    most: Annotated[int, typer.Option("--most", min=1, max=12, help="Modes in a sequence at most.")] = 6,
    growth: Annotated[
        float, typer.Option("--growth", min=0.01, help="An offset from the line grows by less than this in a mode.")
    ] = NO_LIMIT,
    tolerance: Annotated[float, typer.Option("--tolerance", min=0.0, help="Of the place to go to [mm].")] = 2.0,
    ratios: Annotated[
        str | None, typer.Option("--ratios", help="Compare plates of this length and other widths: 1:2:11.")
    ] = None,
    picture: Annotated[Path | None, typer.Option("--picture", help="Draw the best sequence, or all ratios.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout.")] = False,
) -> None:
    """Find the sequences of modes whose nodes carry a part along a line, or follow one."""
    from feeder_sim.plate.sequences import Search, find_routes, nodes_on_line

    search = Search(1e-3 * tolerance, limit, growth, most)
    if y != 0.0 and growth < NO_LIMIT:
        raise InputError("belongs to the middle of the plate, must be --y 0 with it", file=source, key="--growth")
    if ratios is not None:
        if order is not None:
            raise InputError("follows one plate's modes, not allowed with --ratios", file=source, key="--modes")
        _print_ratios(source, ratios, (1e-3 * start, 1e-3 * end, 1e-3 * y), search, picture, as_json)
        return
    modes = modes_of(source).modes
    for name, value, size in (
        ("from", start, modes.plate.length),
        ("to", end, modes.plate.length),
        ("y", y, modes.plate.width),
    ):
        if abs(value) >= 500.0 * size:
            raise InputError(f"is {value:g}, must be within +-{500.0 * size:g} mm", file=source, key=f"--{name}")
    try:
        nodes = nodes_on_line(modes, y=1e-3 * y)
    except ValueError as error:  # too thick for its highest modes to be bending waves
        raise InputError(str(error), file=source) from error
    if order is None:
        routes = find_routes(nodes, 1e-3 * start, 1e-3 * end, search)
        if not routes:
            raise InputError(
                f"no sequence of up to {most} modes reaches {end:g} mm with every k below {limit:g}"
                + (f" and an offset that grows by less than {growth:g}" if growth < NO_LIMIT else ""),
                file=source,
            )
    else:
        routes = [_followed(nodes, order, 1e-3 * start, len(modes), source)]
    if picture is not None:
        from feeder_sim.plots.pictures import draw_route

        draw_route(modes, routes[0], new_picture(picture), y=1e-3 * y)
    print_routes(routes, modes.natural_frequency, as_json)


def _print_ratios(
    source: Path,
    ratios: str,
    line: tuple[float, float, float],
    search: Search,
    picture: Path | None,
    as_json: bool,
) -> None:
    """Compare plates of the same length and other widths on a line: start, end and y [m]."""
    from feeder_sim.scenario import load_plate_file
    from feeder_sim.studies.width_ratios import compare_ratios

    values = _parsed_ratios(ratios, source)
    if picture is not None:
        new_picture(picture)
    if source.suffix != ".toml":
        raise InputError("holds the modes of one plate, allowed with --ratios is a plate file (.toml)", file=source)
    start, end, y = line
    with file_in_errors(source):
        rows = list(compare_ratios(load_plate_file(source), values, start=start, end=end, y=y, search=search))
    if picture is not None:
        from feeder_sim.plots.pictures import draw_ratios

        draw_ratios(rows, picture)
    print_ratios(rows, as_json)


def _parsed_ratios(ratios: str, source: Path) -> list[float]:
    """The ratios that LEAST:LARGEST:NUMBER stands for, evenly spaced."""
    try:
        low, high, n = (number(text) for number, text in zip((float, float, int), ratios.split(":"), strict=True))
    except ValueError:
        low, high, n = 0.0, 0.0, 0
    if not (0.1 <= low < high <= 10.0 and 2 <= n <= 1000):
        raise InputError(
            f"is {ratios}, must be LEAST:LARGEST:NUMBER within 0.1 to 10, such as 1:2:11",
            file=source,
            key="--ratios",
        )
    return [low + (high - low) * i / (n - 1) for i in range(int(n))]


def _followed(nodes: list[LineNodes], order: str, start: float, n_modes: int, source: Path) -> Route:
    """The route from `start` [m] under the modes that the option --modes lists, such as 1,4,3."""
    from feeder_sim.plate.sequences import follow

    try:
        numbers = [int(number) for number in order.split(",")]
    except ValueError:
        numbers = [0]
    if not all(1 <= number <= n_modes for number in numbers):
        raise InputError(f"is {order}, must be numbers from 1 to {n_modes}, such as 1,4,3", file=source, key="--modes")
    try:
        return follow(nodes, [number - 1 for number in numbers], start)
    except ValueError as error:
        raise InputError(f"is {order}, {error}", file=source, key="--modes") from error


def wave(
    scenario_file: ScenarioFile,
    picture: Annotated[Path | None, typer.Option("--picture", help="Draw the first wave to this file.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout.")] = False,
) -> None:
    """Describe the wave that modes driven together make: still points, the track of its crest, how far it travels."""
    from feeder_sim.measures.circulation import stage_waves

    scenario = scenario_of(scenario_file, None, None, None)
    if picture is not None:
        new_picture(picture)
    with file_in_errors(scenario_file):
        from feeder_sim.scene.scene import build_scene

        scene = build_scene(scenario)
        waves = stage_waves(scene)
        if not waves:
            raise InputError("no stage drives several modes at one frequency, which a wave needs", key="drive")
    if picture is not None:
        from feeder_sim.plots.pictures import draw_wave

        draw_wave(waves[0], picture)
    print_waves(waves, as_json)
