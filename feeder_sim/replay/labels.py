"""What is written into the picture of a replay: the stage under way with its drives, a scale bar, a legend."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from feeder_sim.records.recording import PlateRecord
from feeder_sim.replay.colours import LegendEntry
from feeder_sim.replay.scenery import BELOW, MM, SLOW, TIMELINE, Box, Entry, Lines, Texts
from feeder_sim.replay.seed_view import SeedView
from feeder_sim.scene.timetable import TimedStage, Timetable

WHITE, BLACK = (255, 255, 255), (0, 0, 0)
PAUSE = "pause"
AT_REST = "plate at rest"
LARGEST_BAR = 0.25  # of the length of a box
DRIVES_PER_LINE = 2
LEGEND_PER_LINE = 3


def plate_box(plate: PlateRecord) -> Box:
    """The whole plate."""
    half = 0.5 * MM * np.array([plate.length, plate.width])
    return Box(np.array([*-half, -MM * plate.thickness]), np.array([*half, 0.0]))


def label_entries(box: Box, legend: Sequence[LegendEntry]) -> Iterator[Entry]:
    """What does not change: the scale bar and, of several entries, the legend."""
    bar = bar_length(LARGEST_BAR * float(box.high[0] - box.low[0]))
    left, tick = box.bar_place, np.array([0.0, 0.012 * box.size, 0.0])
    right = left + np.array([bar, 0.0, 0.0])
    strip = np.array([left + tick, left - tick, left, right, right + tick, right - tick])
    yield "labels/scale_bar/rim", Lines([strip], BLACK, -2.5), {}  # so that it shows on a light plate, too
    raised = strip + np.array([0.0, 0.0, 0.002 * box.size])
    yield "labels/scale_bar", Lines([raised], WHITE, -1.2, f"{bar:g} mm"), {}
    if len(legend) > 1:
        names, colours = [entry.name for entry in legend], [entry.colour for entry in legend]
        yield "labels/legend", Texts(names, legend_places(box, len(legend)), colours, -6.0), {}


def stage_label(view: SeedView, box: Box) -> Iterator[Entry]:
    """The stage under way, and in slow motion that which is shown."""
    yield "labels/stage", Texts(None, [box.stage_place], [WHITE], 0.0), {}
    texts = stage_texts(view.plate, view.times, view.last)
    for time, text in texts:
        yield "labels/stage", Texts([text]), {TIMELINE: time}
    for begin, stage in view.slow_stages:
        moment = view.slow_times(stage)[-1]
        yield "labels/stage", Texts([text for time, text in texts if time <= moment][-1:]), {SLOW: begin}


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
