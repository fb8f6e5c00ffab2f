"""What is written into the picture of a replay: the stage under way with its drives, a scale bar, a legend."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feeder_sim.records.recording import PlateRecord
from feeder_sim.replay.colours import Entry
from feeder_sim.replay.plate import MM, TIMELINE
from feeder_sim.scene.timetable import TimedStage, Timetable

WHITE, BLACK = (255, 255, 255), (0, 0, 0)
PAUSE = "pause"
AT_REST = "plate at rest"
FAR, NEAR = 0.15, 0.045  # of the size of a box: from its edges to the text behind it and to the bar before it
BELOW = 0.055  # of the size: what the text below the bar takes
LARGEST_BAR = 0.25  # of the length of a box
DRIVES_PER_LINE = 2
LEGEND_PER_LINE = 3


@dataclass(frozen=True)
class Box:
    """What a view is to show [mm]: its lowest and its highest corner, each (3,)."""

    low: NDArray[np.float64]
    high: NDArray[np.float64]

    @property
    def size(self) -> float:
        """The side of a square as large as it is."""
        return float(np.sqrt(np.prod((self.high - self.low)[:2])))

    @property
    def corners(self) -> NDArray[np.float64]:
        """Its corners (8, 3)."""
        return np.stack(np.meshgrid(*zip(self.low, self.high, strict=True)), axis=-1).reshape(-1, 3)

    @property
    def stage_place(self) -> NDArray[np.float64]:
        """Where the text about the stage hangs: behind the box."""
        top = (1.0 + FAR) * max(float(self.high[2]), 0.0)
        return np.array([0.5 * (self.low[0] + self.high[0]), self.high[1] + FAR * self.size, top])

    @property
    def bar_place(self) -> NDArray[np.float64]:
        """Left end of the scale bar: before the box."""
        return np.array([self.low[0] + 0.03 * self.size, self.low[1] - NEAR * self.size, 0.0])

    def framed(self, legend_lines: int = 1) -> NDArray[np.float64]:
        """Points (n, 3) that a view has to show: the box and what is written around it."""
        below = self.bar_place - [0.0, max(legend_lines, 1) * BELOW * self.size, 0.0]
        return np.vstack([self.corners, self.stage_place, below])


def plate_box(plate: PlateRecord) -> Box:
    """The whole plate."""
    half = 0.5 * MM * np.array([plate.length, plate.width])
    return Box(np.array([*-half, -MM * plate.thickness]), np.array([*half, 0.0]))


def log_labels(stream: Any, box: Box, legend: Sequence[Entry]) -> None:
    """Log what does not change: the scale bar and, of several entries, the legend."""
    import rerun as rr

    bar = bar_length(LARGEST_BAR * float(box.high[0] - box.low[0]))
    left, tick = box.bar_place, np.array([0.0, 0.012 * box.size, 0.0])
    right = left + np.array([bar, 0.0, 0.0])
    strip = [left + tick, left - tick, left, right, right + tick, right - tick]
    rim = rr.LineStrips3D([strip], colors=[BLACK], radii=[-2.5])  # so that it shows on a light plate, too
    stream.log("labels/scale_bar/rim", rim, static=True)
    raised = strip + np.array([0.0, 0.0, 0.002 * box.size])
    drawn = rr.LineStrips3D([raised], colors=[WHITE], radii=[-1.2], labels=[f"{bar:g} mm"], show_labels=True)
    stream.log("labels/scale_bar", drawn, static=True)
    if len(legend) > 1:
        places, names = legend_places(box, len(legend)), [entry.name for entry in legend]
        colours = [entry.colour for entry in legend]
        dots = rr.Points3D(places, radii=[-6.0], colors=colours, labels=names, show_labels=True)
        stream.log("labels/legend", dots, static=True)


def legend_places(box: Box, entries: int) -> NDArray[np.float64]:
    """Places (entries, 3) of the entries of a legend: in lines before the box, to the right of the scale bar."""
    number = np.arange(entries)
    column, line = number % LEGEND_PER_LINE, number // LEGEND_PER_LINE
    left = box.bar_place[0] + 0.4 * (box.high[0] - box.low[0])
    step = (box.high[0] - 0.1 * box.size - left) / (LEGEND_PER_LINE - 1)
    skipped = LEGEND_PER_LINE - min(entries, LEGEND_PER_LINE)  # few entries stand at the right end
    y = box.bar_place[1] - line * BELOW * box.size
    return np.column_stack([left + (column + skipped) * step, y, np.zeros(entries)])


def legend_lines(entries: int) -> int:
    """Lines that the legend takes."""
    return -(-entries // LEGEND_PER_LINE) if entries > 1 else 1


def bar_length(largest: float) -> float:
    """The largest of 1, 2, 5, 10, 20, ... (and of 0.5, 0.2, ...) that is not above `largest`."""
    power = 10.0 ** np.floor(np.log10(largest))
    return float(max(step * power for step in (1.0, 2.0, 5.0) if step * power <= largest * (1.0 + 1e-9)))


def log_stage_texts(stream: Any, box: Box, texts: Sequence[tuple[float, str]], timeline: str = TIMELINE) -> None:
    """Log texts, each from its time [s] on."""
    import rerun as rr

    label = rr.Points3D.from_fields(positions=[box.stage_place], radii=[0.0], colors=[WHITE], show_labels=True)
    stream.log("labels/stage", label, static=True)
    for time, text in texts:
        stream.set_time(timeline, duration=time)
        stream.log("labels/stage", rr.Points3D.from_fields(labels=[text]))
    stream.reset_time()


def stage_texts(plate: PlateRecord, times: Timetable, last: float) -> list[tuple[float, str]]:
    """Times [s] up to `last` at which the stage or the drives that act change, and what is then to be read."""
    changes = {stage.start for stage in times.stages} | {o.start for o in times.occurrences}
    changes |= {o.stop for o in times.occurrences} | {0.0}
    texts: list[tuple[float, str]] = []
    for time in sorted(change for change in changes if change <= last):
        stage = next((s for s in times.stages if s.start <= time < s.end), times.stages[-1])
        acting = [o.excitation for o in times.occurrences if o.start <= time < o.stop]
        text = stage_text(plate, stage, acting, cycles=times.stages[-1].cycle)
        if not texts or text != texts[-1][1]:
            texts.append((time, text))
    return texts


def stage_text(plate: PlateRecord, stage: TimedStage, acting: Sequence[int], *, cycles: int) -> str:
    """Name and cycle of a stage, then frequency and largest amplitude on the plate of each drive that acts."""
    head = f"{stage.name}, cycle {stage.cycle} of {cycles}" if stage.cycle else stage.name
    drives = [_drive_text(plate, i) for i in acting] or [PAUSE if plate.drives else AT_REST]
    groups = [drives[i : i + DRIVES_PER_LINE] for i in range(0, len(drives), DRIVES_PER_LINE)]
    return "\n".join(line for line in (head, *(" + ".join(group) for group in groups)) if line)


def _drive_text(plate: PlateRecord, number: int) -> str:
    drive = plate.drives[number]
    amplitude = drive.steady_amplitude * float(np.abs(plate.mode_shape[drive.shape]).max())
    frequency = drive.drive_frequency
    frequency_text = f"{frequency:.5g} Hz" if frequency < 1e4 else f"{frequency / 1e3:.4g} kHz"
    return f"{frequency_text}, {amplitude * 1e6:.3g} µm"
