"""The surface in slow motion in a replay: a few periods of every stage, magnified, on a timeline of their own."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feeder_sim.plate.drive import ModalDrive, ModalTerms
from feeder_sim.records.recording import PlateRecord
from feeder_sim.replay.area import area_of
from feeder_sim.replay.plate import MM, TIMELINE, diverging
from feeder_sim.scene.timetable import TimedStage

SLOW = "slow_motion"
PERIOD_S = 2.0  # [s] on the slow timeline for one period of the plate
PERIODS = 2  # shown of every stage
PICTURES = 20  # per period
POINTS = 61  # largest number of grid points per axis of the plate
HEIGHT = 0.06  # of the highest crest as drawn, over the length of the plate


def log_wave(
    stream: Any, plate: PlateRecord, terms: ModalTerms, stages: Sequence[TimedStage], last: float
) -> list[tuple[float, float]]:
    """Log the motion at the end of every different stage that was reached, one after the other on the slow timeline.

    On the real timeline the same view shows the surface at its largest amplitude, from the begin of each stage on.

    Args:
        stream: rerun's recording stream.
        plate: its mode shapes and drives.
        terms: modal coordinates in time.
        stages: of the shown seed.
        last: time of the last frame [s].

    Returns:
        For every different stage its begin on the slow timeline [s], and the time of the run that is shown last [s].
    """
    import rerun as rr

    rows, columns = (_thinned(len(axis)) for axis in (plate.x, plate.y))
    area = area_of(plate.x[rows], plate.y[columns], plate.outline)
    shapes = np.stack([area.carried(shape) for shape in plate.mode_shape[:, rows[:, None], columns]])

    scale = HEIGHT * plate.length * MM

    def log(field: NDArray[np.float64]) -> None:
        """Log a deflection (n,), whose largest value over time is 1."""
        vertices = np.column_stack([MM * area.points, scale * field])
        mesh = rr.Mesh3D(vertex_positions=vertices, triangle_indices=area.triangles, vertex_colors=diverging(field))
        stream.log("wave/surface", mesh)

    front = [[0.0, -0.56 * MM * plate.width, -scale]]
    caption = rr.Points3D(front, radii=[0.0], colors=[(255, 255, 255)], labels=["surface, magnified"], show_labels=True)
    stream.log("wave/caption", caption, static=True)
    slow_stages: dict[frozenset[ModalDrive], tuple[float, float]] = {}
    for stage in stages:
        if not stage.excitations or stage.start > last:
            continue
        frequency = max(plate.drives[i].drive_frequency for i in stage.excitations)
        times = min(stage.stop, last) + (np.arange(PERIODS * PICTURES) / PICTURES - PERIODS) / frequency
        motion = np.tensordot(terms.phasor(times, len(shapes)).real, shapes, axes=1)
        motion /= max(float(np.abs(motion).max()), 1e-300)
        stream.set_time(TIMELINE, duration=stage.start)
        log(motion[np.abs(motion).max(axis=1).argmax()])
        stream.reset_time()
        if (drives := frozenset(plate.drives[i] for i in stage.excitations)) in slow_stages:
            continue
        begin = PERIODS * PERIOD_S * len(slow_stages)
        slow_stages[drives] = begin, float(times[-1])
        for i, field in enumerate(motion):
            stream.set_time(SLOW, duration=begin + PERIOD_S * i / PICTURES)
            if i == 0:
                text = f"cycle {stage.cycle}, {stage.name}: {frequency:.0f} Hz" if stage.name else f"{frequency:.0f} Hz"
                stream.log("stage", rr.TextLog(text))
            log(field)
        stream.reset_time()
    return list(slow_stages.values())


def _thinned(n: int) -> NDArray[np.int64]:
    """Indices of at most `POINTS` of n grid lines, evenly spaced, including the first and the last."""
    return np.unique(np.linspace(0, n - 1, min(n, POINTS)).round().astype(np.int64))
