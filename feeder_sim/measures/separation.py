"""Separation by a schedule: counts of the parts at the end of every stage, and picks, over an ensemble.

A part is *isolated* if no other part is within the clearance of the schedule's pick. A *dead position* is a place near
nodal lines of all modes that the cycle drives up to its first pick, so that no mode moves a part away from it. A part
is *flipped* if another of its sides is up than at the end of the stage before.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from feeder_sim.measures.picking import has_picks, nearest_neighbours
from feeder_sim.measures.protocol import FindingsBase, Measure, labelled
from feeder_sim.measures.stage_lines import StageLines, stage_lines
from feeder_sim.measures.statistic import Statistic
from feeder_sim.notebook import counted
from feeder_sim.records.seed import Cause, Seed, Status, parts_arrived, parts_removed
from feeder_sim.records.trajectory import Frames
from feeder_sim.scene.prepared import Prepared
from feeder_sim.scene.scene import Scene
from feeder_sim.scene.timetable import TimedStage

ON_LINE = 5e-3  # [m]; largest distance from a nodal line of a part that counts as on it
DEAD_POSITION = 5e-3  # [m]; largest distance of a dead position from nodal lines of all modes up to the pick
TOUCHING = 1e-4  # [m]; largest gap between the bounding spheres of two parts that count as touching


@dataclass(frozen=True)
class StageReport:
    """Counts at the end of one stage, before the pick.

    Attributes:
        end_s: end of the stage.
        on_plate: parts over the plate; the counts below are of these parts, except picked and lost.
        isolated: parts farther than the clearance from all others; 0 where no pick asks for one.
        touching_pairs: pairs whose bounding spheres overlap; an upper bound of pairs that touch.
        on_nodal_line: parts within 5 mm of nodal lines of all of the stage's modes.
        dead: parts in dead positions.
        flipped: parts with another side up than at the end of the stage before, those excepted that came after it.
        picked, lost: parts taken out after the end of the stage before, up to the end of this one.
        nearest_mm: median distance to the nearest neighbour; NaN for fewer than two parts.
    """

    end_s: float
    on_plate: float
    isolated: float
    touching_pairs: float
    on_nodal_line: float
    dead: float
    flipped: float
    picked: float
    lost: float
    nearest_mm: float


def stage_reports(scene: Scene, lines: StageLines, record: Seed) -> list[StageReport]:
    """Counts at the end of every stage that the run has reached, for one seed."""
    frames, reports = record.frames, []
    stages = scene.stages(record.stops.tolist())
    cycle = _stages_to_first_pick(stages)
    reached = float(frames.time[-1])
    before: int | None = 0
    for number, stage in enumerate(stages):
        if stage.end > reached + scene.frame_interval:
            break
        row = frames.row_at(stage.end)
        reports.append(_report(scene, lines, record, number, stage, row, before, cycle))
        before = row
    return reports


def _stages_to_first_pick(stages: Sequence[TimedStage]) -> set[int]:
    """Numbers of the driven stages of the last cycle up to its first pick, or of all of them without a pick."""
    numbers = set()
    for number, stage in enumerate(stages):
        if stage.cycle == stages[-1].cycle:
            if stage.excitations:
                numbers.add(number)
            if stage.picks:
                break
    return numbers


def _report(
    scene: Scene,
    lines: StageLines,
    record: Seed,
    number: int,
    stage: TimedStage,
    row: int,
    before: int | None,
    cycle: set[int],
) -> StageReport:
    """Counts of one stage.

    Args:
        scene: has the parts and the stages.
        lines: nodal lines of the stages.
        record: of the seed.
        number: of the stage, over the whole timetable.
        stage: its times.
        row: frame at its end.
        before: frame at the end of the stage before; 0 or None for the start.
        cycle: numbers of the stages that define dead positions.
    """
    frames, removals = record.frames, record.removals
    start, end = (frames.time[before] if before else -np.inf), frames.time[row]
    position = frames.position[row]
    on_plate = scene.on_plate(frames[slice(row, row + 1)])[0]
    points = position[on_plate, :2]
    nearest = nearest_neighbours(points)
    clearances = [s.clearance for s in scene.times.stages if s.clearance is not None]
    dead = np.full(len(points), bool(cycle))
    for driven in cycle:
        dead &= lines.near(driven, points, DEAD_POSITION)
    came = np.zeros(len(position), bool)
    came[parts_arrived(record.arrivals, start=start, end=end)] = True
    return StageReport(
        end_s=stage.end,
        on_plate=int(on_plate.sum()),
        isolated=int((nearest > clearances[0]).sum()) if clearances else 0,
        touching_pairs=_touching_pairs(scene, position, on_plate),
        on_nodal_line=int(lines.near(number, points, ON_LINE).sum()),
        dead=int(dead.sum()),
        flipped=int((_side_up(frames, row) != _side_up(frames, before or 0))[on_plate & ~came].sum()),
        picked=len(parts_removed(removals, Cause.PICKED, start=start, end=end)),
        lost=len(parts_removed(removals, Cause.LOST, start=start, end=end)),
        nearest_mm=1e3 * float(np.median(nearest)) if len(points) > 1 else float("nan"),
    )


def _touching_pairs(scene: Scene, position: NDArray[np.float64], on_plate: NDArray[np.bool_]) -> int:
    """Pairs of parts on the plate whose bounding spheres overlap, from positions (parts, 3) [m] and a mask (parts,)."""
    from scipy.spatial import cKDTree

    index = np.flatnonzero(on_plate)
    size = np.array([kind.size for kind in scene.kinds])[scene.kind_of[index]]
    if len(index) < 2:
        return 0
    pairs = cKDTree(position[index]).query_pairs(2.0 * size.max() + TOUCHING, output_type="ndarray")
    distance = np.linalg.norm(position[index[pairs[:, 0]]] - position[index[pairs[:, 1]]], axis=1)
    return int((distance < size[pairs[:, 0]] + size[pairs[:, 1]] + TOUCHING).sum())


def _side_up(frames: Frames, row: int) -> NDArray[np.int64]:
    """Axis of each part (1, 2, 3) nearest to the vertical, negative where it points down, shape (parts,)."""
    w, x, y, z = frames.quaternion[row].T
    up = np.stack([2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)], axis=1)
    axis = np.abs(up).argmax(axis=1)
    return np.asarray((axis + 1) * np.sign(np.take_along_axis(up, axis[:, None], axis=1)[:, 0]), np.int64)


@dataclass(frozen=True, repr=False)
class StageCounts(FindingsBase):
    """Means over the seeds of the counts of `StageReport`, for one stage of one cycle."""

    cycle: int
    stage: str
    end_s: Statistic
    on_plate: Statistic
    isolated: Statistic
    touching_pairs: Statistic
    on_nodal_line: Statistic
    dead: Statistic
    flipped: Statistic
    picked: Statistic
    lost: Statistic
    nearest_mm: Statistic


@dataclass(frozen=True, repr=False)
class SeparationFindings(FindingsBase):
    """Number of parts in the scene, parts picked and lost in the whole run, and the counts of every stage.

    Where nothing is to be picked, `picked` has no value.
    """

    parts: int
    picked: Statistic
    lost: Statistic
    stages: tuple[StageCounts, ...]


@dataclass(frozen=True)
class SeedSeparation:
    """What is read of a seed: a report of every stage it has reached, and how many parts were picked and lost."""

    reports: list[StageReport]
    picked: float
    lost: float


class Separation(Measure[SeparationFindings, SeedSeparation]):
    """Counts of many parts at the end of every stage, parts picked and parts lost."""

    headline = ("picked", "lost")

    counts = (Status.DONE, Status.LEFT_PLATE)

    def applies(self, prepared: Prepared) -> bool:
        return prepared.scenario.schedule is not None or len(prepared.scene.parts) > 1

    def reader(self, prepared: Prepared) -> Callable[[Seed], SeedSeparation]:
        scene = prepared.scene
        lines = stage_lines(scene)

        def read(seed: Seed) -> SeedSeparation:
            picked, lost = (float((seed.removals.cause == cause).sum()) for cause in (Cause.PICKED, Cause.LOST))
            return SeedSeparation(stage_reports(scene, lines, seed), picked, lost)

        return read

    def findings(self, prepared: Prepared, readings: Sequence[SeedSeparation]) -> SeparationFindings:
        scene, stages = prepared.scene, []
        for number, stage in enumerate(scene.times.stages):
            over_seeds = [seed.reports[number] for seed in readings if len(seed.reports) > number]
            counts = {
                field.name: Statistic.of(getattr(report, field.name) for report in over_seeds)
                for field in fields(StageReport)
            }
            stages.append(StageCounts(stage.cycle, stage.name, **counts))
        return SeparationFindings(
            parts=len(scene.parts),
            picked=Statistic.of(seed.picked for seed in readings if has_picks(scene)),
            lost=Statistic.of(seed.lost for seed in readings),
            stages=tuple(stages),
        )

    def lines(self, prepared: Prepared, findings: SeparationFindings) -> list[str]:
        if prepared.scenario.goal is not None:
            return []  # transport: nothing is to be picked
        lines = []
        for label, statistic in (
            ("picked", findings.picked),
            ("lost", findings.lost),
            ("before last pick" if has_picks(prepared.scene) else "on the plate", findings.stages[-1].on_plate),
        ):
            if statistic.n:
                spread = f", SD {statistic.sd:.1f}" if statistic.n > 1 else ""
                of_all = "" if prepared.scenario.refill else f" of {findings.parts}"
                text = f"{statistic.mean:.1f}{of_all}{spread}, n = {counted(statistic.n, 'seed')}"
                lines.append(labelled(label, text))
        return lines
