"""All questions of many runs, by the command that asks them, and which of them a folder holds."""

from __future__ import annotations

from pathlib import Path

from feeder_sim.studies.chart.chart import ChartQuestion
from feeder_sim.studies.question import Question
from feeder_sim.studies.search.optimise import OptimiseQuestion
from feeder_sim.studies.speed_map import MapQuestion
from feeder_sim.studies.sweep.sweep import SweepQuestion
from feeder_sim.studies.uncertainty.uncertainty import UncertaintyQuestion

_ALL: tuple[type[Question], ...] = (SweepQuestion, UncertaintyQuestion, OptimiseQuestion, MapQuestion, ChartQuestion)
KINDS = {kind.kind: kind for kind in _ALL}


def kind_of(folder: Path) -> type[Question] | None:
    """What a folder holds; None where it holds no question."""
    return next((kind for kind in _ALL if (folder / kind.file).is_file()), None)
