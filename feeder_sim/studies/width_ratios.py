"""Plates of one length and different widths: the best sequences of modes that carry a part along a line on each."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from feeder_sim.errors import InputError
from feeder_sim.plate.modes import plate_modes
from feeder_sim.plate.rectangle import RectangularPlate
from feeder_sim.plate.sequences import Route, Search, find_routes, nodes_on_line
from feeder_sim.scenario import PlateFile, resolve_material


@dataclass(frozen=True)
class RatioRoutes:
    """Routes of `find_routes` on a plate whose length is `ratio` times its width; empty if there is none."""

    ratio: float
    routes: tuple[Route, ...]


def compare_ratios(
    file: PlateFile, ratios: Sequence[float], *, start: float, end: float, y: float, search: Search
) -> Iterator[RatioRoutes]:
    """Search the routes on plates of the file's length, thickness and material, one plate after the other.

    Args:
        file: the plate, whose width is replaced.
        ratios: of length over width [1].
        start: of the route, x [m].
        end: of the route, x [m].
        y: of the line on which the part moves [m].
        search: conditions on a sequence of modes.

    Raises:
        InputError: the line is not on one of the plates, or its modes are not resolved.
    """
    body = file.plate
    if body.uniform_width:
        raise InputError("says that modes do not vary with the width", key="plate.uniform_width")
    if body.length_mm is None or file.by_elements:
        raise InputError("is no plain rectangle, must be one with --ratios", key="plate")
    length = 1e-3 * body.length_mm
    for name, place in (("from", start), ("to", end)):
        if abs(place) >= 0.5 * length:
            raise InputError(f"is {1e3 * place:g}, must be within +-{500.0 * length:g} mm", key=f"--{name}")
    for ratio in ratios:
        plate = RectangularPlate(length, length / ratio, 1e-3 * body.thickness_mm, resolve_material(body.material))
        if abs(y) >= 0.5 * plate.width:
            raise InputError(f"is {1e3 * y:g}, beside the plate of ratio {ratio:g}", key="--y")
        try:
            modes = plate_modes(plate, highest_frequency=body.highest_frequency_hz)
            nodes = nodes_on_line(modes, y=y)
        except ValueError as error:
            raise InputError(f"at {ratio:g}: {error}", key="--ratios") from error
        yield RatioRoutes(ratio, tuple(find_routes(nodes, start, end, search)))
