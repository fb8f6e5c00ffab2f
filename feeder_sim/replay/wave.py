"""The surface in slow motion: a few periods of every stage's motion, magnified, on a timeline of its own."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feeder_sim.plate.drive import ModalDrive, ModalTerms
from feeder_sim.records.trajectory import PlateRecord
from feeder_sim.replay.plate import MM, TIMELINE, diverging, grid_triangles
from feeder_sim.scene.timetable import TimedStage

SLOW = "slow_motion"
PERIOD_S = 2.0  # [s] of the slow timeline that a period of the plate takes
PERIODS, PICTURES = 2, 20  # of every stage, and in each period
POINTS = 61  # per axis of the plate, at most
HEIGHT = 0.06  # of the plate's length: the highest crest as drawn


def log_wave(
    stream: Any, plate: PlateRecord, terms: ModalTerms, stages: Sequence[TimedStage], last: float
) -> list[tuple[float, float]]:
    """Put the motion at the end of every different stage that was reached one after the other on the slow timeline.

    On the real timeline the same view shows the surface at its largest, from the begin of each stage on. Returns where
    the stages begin on the slow timeline, and the moment shown [s].
    """
    import rerun as rr

    rows, columns = (_spread(len(axis)) for axis in (plate.x, plate.y))
    x, y = np.meshgrid(plate.x[rows] * MM, plate.y[columns] * MM, indexing="ij")
    shapes = plate.mode_shape[:, rows[:, None], columns]
    triangles = grid_triangles(len(rows), len(columns))

    def log(field: NDArray[np.float64]) -> None:
        scale = HEIGHT * plate.length * MM
        vertices = np.column_stack([x.ravel(), y.ravel(), scale * field.ravel()])
        mesh = rr.Mesh3D(vertex_positions=vertices, triangle_indices=triangles, vertex_colors=diverging(field.ravel()))
        stream.log("wave/surface", mesh)

    shown: dict[frozenset[ModalDrive], tuple[float, float]] = {}
    for stage in stages:
        if not stage.excitations or stage.start > last:
            continue
        frequency = max(plate.drives[i].drive_frequency for i in stage.excitations)
        times = min(stage.stop, last) + (np.arange(PERIODS * PICTURES) / PICTURES - PERIODS) / frequency
        motion = np.tensordot(terms.phasor(times, len(shapes)).real, shapes, axes=1)
        motion /= max(float(np.abs(motion).max()), 1e-300)
        stream.set_time(TIMELINE, duration=stage.start)
        log(motion[np.abs(motion).max(axis=(1, 2)).argmax()])
        stream.reset_time()
        if (kind := frozenset(plate.drives[i] for i in stage.excitations)) in shown:
            continue
        begin = PERIODS * PERIOD_S * len(shown)
        shown[kind] = begin, float(times[-1])
        for i, field in enumerate(motion):
            stream.set_time(SLOW, duration=begin + PERIOD_S * i / PICTURES)
            if i == 0:
                text = f"cycle {stage.cycle}, {stage.name}: {frequency:.0f} Hz" if stage.name else f"{frequency:.0f} Hz"
                stream.log("stage", rr.TextLog(text))
            log(field)
        stream.reset_time()
    return list(shown.values())


def _spread(n: int) -> NDArray[np.int64]:
    """At most `POINTS` of n grid lines, with the first and the last."""
    return np.unique(np.linspace(0, n - 1, min(n, POINTS)).round().astype(np.int64))
