"""What a part can touch besides others in a window of time: the plate, what it can do at most, and walls over it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from feeder_sim.engines.surface_arrays import SurfaceArrays
from feeder_sim.scene.scene import Scene

TOUCHING, LEAST_TOUCH = 0.01, 1e-13  # share of the tolerance, and [m]: gaps from which on points touch
WINDOW = 2e-2  # [s]; bounds follow the ring-up of the plate
APPROACH = 1e-9  # [m/s]; round-off leaves as much of the speed of points that stay, or that have just been left
LONGEST, SWAYS, SLIP, SLIP_AT_REST = 5e-5, 0.5, 2e-5, 1e-7  # [s], [rad], [m/s]; see `Exactness`


class Exactness(NamedTuple):
    """How exact contacts are.

    tolerance: how far they may be off [m]; touch: from which gap on points touch [m]; noise: random speed of impacts
    [m/s]. approach: what comes nearer by less does not approach [m/s]. longest, sways: forces last no longer than that
    [s], and than the fastest motion of the plate takes to turn by so much [rad]: slip turns once at most. slip,
    slip_at_rest: what slides on by less sticks, on a plate that moves and on one that does not [m/s]. impacts: how
    closely those of several parts are solved [m/s], 0 for round-off.
    """

    tolerance: float
    touch: float
    noise: float
    approach: float
    longest: float
    sways: float
    slip: float
    slip_at_rest: float
    impacts: float = 0.0


class Bounds(NamedTuple):
    """What the surface can do at most within a window of time.

    end: of the window [s]; crest: height [m]; slope: steepest [1]; curvature: largest [1/m]; acceleration: of every
    mode shape at its antinode [m/s^2]; amplitude: the same [m]; speed: of any point [m/s]; rate: by which derivatives
    grow, see `bound_window`, and fastest, that of any term [rad/s]; step: the shortest flight [s] that is followed, and
    rest_step that of a part that hardly moves; calm: parts may come to rest.
    """

    end: float
    crest: float
    slope: float
    speed: float
    rest_step: float
    acceleration: NDArray[np.float64]
    amplitude: NDArray[np.float64]
    curvature: float
    rate: float
    fastest: float
    step: float
    calm: bool
    exact: Exactness


class Tube(NamedTuple):
    """The wall of a tube: a point of its axis [m], unit vector along it, inner radius [m]."""

    foot: NDArray[np.float64]
    axis: NDArray[np.float64]
    radius: float
    restitution: float
    friction: float


class Rim(NamedTuple):
    """Four walls around the plate, at plus and minus half of its length and width (2,) [m]."""

    half: NDArray[np.float64]


class Plate(NamedTuple):
    """The plate in a window: the terms that act, what they can do at most, and the walls over it, or None."""

    surface: SurfaceArrays
    bounds: Bounds
    wall: Tube | Rim | None


def read_walls(scene: Scene) -> Tube | Rim | None:
    """The wall of a guide with play, or of a rim; None without either."""
    guide = scene.guides[0]
    if scene.rim:
        return Rim(0.5 * np.array([scene.surface.length, scene.surface.width]))
    if guide is None or guide.radius is None or guide.restitution is None:
        return None
    return Tube(np.array([*guide.foot, 0.0]), guide.axis, guide.radius, guide.restitution, guide.friction)


def exactness_of(scene: Scene) -> Exactness:
    """How exact the contacts of a scene are."""
    tolerance = 1e-9 * scene.scenario.tolerance
    touch, noise = max(TOUCHING * tolerance, LEAST_TOUCH), scene.scenario.contact.noise_m_s
    return Exactness(tolerance, touch, noise, APPROACH, LONGEST, SWAYS, SLIP, SLIP_AT_REST)
