"""Ways of one free part from starts of one's own, by the impulse engine and without guard, measures or files."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from feeder_sim.engines.impulse.alone import Alone, advance_alone
from feeder_sim.engines.impulse.engine import WINDOW_ALONE
from feeder_sim.engines.impulse.frame_rows import POSITION, QUATERNION, ROW, FrameRows
from feeder_sim.engines.impulse.kinds import read_kinds
from feeder_sim.engines.impulse.scratch import new_scratch
from feeder_sim.engines.impulse.state import new_parts
from feeder_sim.engines.impulse.surroundings import exactness_of
from feeder_sim.engines.impulse.window import Drive
from feeder_sim.engines.surface_arrays import surface_arrays
from feeder_sim.scene.scene import Scene

Floats = NDArray[np.float64]


def follow(scene: Scene, places: Floats, attitudes: Rotation, time: Floats) -> tuple[Floats, Floats]:
    """Follow the one free part of a scene from many starts at rest.

    Args:
        scene: its own starts are not used.
        places: of the centre of mass, (starts, 3) [m].
        attitudes: as many.
        time: of frames (times,) [s], the first of them 0.

    Returns:
        Places (starts, times, 3) [m] and attitudes (starts, times, 4), w first.
    """
    kinds, quaternions = read_kinds(scene), attitudes.as_quat(scalar_first=True)
    turned = Rotation.from_quat(scene.principal_attitudes(quaternions[:, None])[:, 0], scalar_first=True).as_matrix()
    parts = new_parts(places, turned, np.zeros(len(places), np.int64))
    work = new_scratch(kinds, scene.surface.n_shapes)
    surface = surface_arrays(scene)
    drive = Drive(surface, scene.surface.extremes, exactness_of(scene), scene.timestep, WINDOW_ALONE)
    rows = np.empty((len(places), len(time), 1, ROW))
    for k in range(len(places)):
        alone = Alone(parts[k : k + 1], kinds, work)
        advance_alone(alone, drive, np.zeros(3), FrameRows(time[1:], rows[k, 1:], np.zeros(1, np.int64)))
    place, attitude = rows[:, :, 0, POSITION], scene.attitudes(rows[:, :, :, QUATERNION])[:, :, 0]
    place[:, 0], attitude[:, 0] = places, quaternions
    return place, attitude
