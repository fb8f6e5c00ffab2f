"""The parts in a replay: their poses and colours, the path and the guide of one, rings before a pick."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feeder_sim.records.seed import Cause
from feeder_sim.records.trajectory import Frames
from feeder_sim.replay.colours import NUT
from feeder_sim.replay.plate import NODE_HEIGHT_MM
from feeder_sim.replay.scenery import MM, TIMELINE, Entry, Lines, Mesh, Parts, Times
from feeder_sim.replay.seed_view import SeedView, radius_of

BLINK_S, BLINK_PERIOD_S = 0.4, 0.1  # [s]; how long, and with which period, rings blink before parts are picked
RING = (0, 140, 60)
RING_SIZE, RING_WIDTH = 1.35, 0.12  # over the radius of the part
RING_POINTS = 33
PATH, GLASS = (30, 110, 60), (110, 160, 190)
GUIDE_HEIGHT = 18.0  # [mm], as drawn


def part_entries(view: SeedView, moments: Sequence[tuple[Frames, Times]]) -> Iterator[Entry]:
    """All kinds of parts, in frames at their times."""
    palette = [entry.colour for entry in view.colours.entries]
    kind_of_part = np.repeat(np.arange(len(view.scenario.part)), [part.count for part in view.scenario.part])
    for kind in range(len(view.scenario.part)):
        members = np.flatnonzero(kind_of_part == kind).tolist()
        part = view.recording.parts[members[0]]
        mesh = Mesh(part.vertices * MM, part.faces, None if view.crowd else NUT)
        used = np.unique(view.colours.index(view.record.frames, members)).tolist()
        for frames, times in moments:
            position, on_plate = frames.position[:, members] * MM, frames.on_plate(view.plate, -view.plate.trough)
            poses = position, frames.quaternion[:, members], frames.present[:, members], on_plate[:, members]
            parts = Parts(mesh, *poses, view.colours.index(frames, members), palette, used)
            yield f"parts/{kind if view.crowd else part.name}", parts, times


def path_entries(view: SeedView) -> Iterator[Entry]:
    """The line that the centre of a part followed."""
    for i, part in enumerate(view.recording.parts):
        yield f"paths/{part.name}", Lines([view.record.frames.position[:, i] * MM], PATH, 0.06), {}


def blinking_rings(view: SeedView) -> Iterator[Entry]:
    """A ring around each part about to be picked, as large as the part needs."""
    frames = view.record.frames
    for time, members in _picks(view):
        for row in np.flatnonzero((frames.time > time - BLINK_S) & (frames.time <= time + 1e-9)):
            lit = int((time - frames.time[row]) / (0.5 * BLINK_PERIOD_S)) % 2 == 0
            yield "picked", _rings(view, frames, row, members if lit else members[:0]), {TIMELINE: frames.time[row]}
        yield "picked", None, {TIMELINE: time + 0.5 * BLINK_PERIOD_S}


def steady_rings(view: SeedView, frames: Frames) -> Iterator[Entry]:
    """As `blinking_rings`, with one ring for each part, where it is picked."""
    for number, (time, members) in enumerate(_picks(view)):
        row = frames.row_at(time - 1e-6)
        seen = members[np.isfinite(frames.position[row, members]).all(axis=-1)]
        yield f"picked/{number}", _rings(view, frames, row, seen), {TIMELINE: max(0.0, time - BLINK_S)}
        yield f"picked/{number}", None, {TIMELINE: time}


def _picks(view: SeedView) -> Iterator[tuple[float, NDArray[np.int64]]]:
    """Times of picks [s], and the parts that are picked then (n,)."""
    removals = view.record.removals
    picked = removals.cause == Cause.PICKED
    for time in np.unique(removals.time[picked]):
        yield float(time), removals.part[picked & (removals.time == time)]


def _rings(view: SeedView, frames: Frames, row: Any, members: NDArray[np.int64]) -> Lines:
    """Circles around parts, just above the plate."""
    radius = np.array([radius_of(view.recording.parts[m]) for m in members])
    angle = np.linspace(0.0, 2.0 * np.pi, RING_POINTS)
    circle = np.column_stack([np.cos(angle), np.sin(angle)])
    centres = frames.position[row, members, :2] * MM
    height = np.full((RING_POINTS, 1), 3.0 * NODE_HEIGHT_MM)
    rings = [np.hstack([c + RING_SIZE * r * circle, height]) for c, r in zip(centres, radius, strict=True)]
    return Lines(rings, RING, RING_WIDTH * radius)


def guide_entries(view: SeedView) -> Iterator[Entry]:
    """The axis of a slide, or the rings of a tube and its outline."""
    if view.guide is None:
        return
    foot, up, radius = np.array([*view.guide.foot, 0.0]) * MM, view.guide.axis, view.guide.radius
    lines = [np.array([foot, foot + GUIDE_HEIGHT * up])]
    if radius is not None:
        angle = np.linspace(0.0, 2.0 * np.pi, 49)
        across = np.cross([0.0, 1.0, 0.0], up)
        ring = radius * MM * (np.cos(angle)[:, None] * across + np.sin(angle)[:, None] * [0.0, 1.0, 0.0])
        lines = [foot + ring + height * up for height in np.linspace(0.0, GUIDE_HEIGHT, 9)]
        lines += [np.array([foot + side, foot + side + GUIDE_HEIGHT * up]) for side in ring[::12]]
    yield "guide", Lines(lines, GLASS, 0.03), {}
