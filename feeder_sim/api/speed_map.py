"""Transport speed over frequency and amplitude, as a user of Python asks for it."""

from __future__ import annotations

import threading
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from feeder_sim.api.answer import Answer, check_some
from feeder_sim.api.plots import axes_for
from feeder_sim.api.progress import Progress, shown
from feeder_sim.errors import InputError, check_whole, path_of_user
from feeder_sim.notebook import counted
from feeder_sim.run.advice import not_drawn
from feeder_sim.scenario import Scenario, check_scenario
from feeder_sim.studies import speed_map as mapping
from feeder_sim.studies.map_folder import map_folder, rows_of, text_of, values_of, write_points
from feeder_sim.studies.speed_map import MapPoint

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def speed_map(
    scenario: Scenario,
    frequencies_hz: str | Iterable[float],
    amplitudes_um: str | Iterable[float],
    *,
    seeds: int = 12,
    workers: int | None = None,
    out: str | Path | None = None,
    progress: Progress = None,
    stop: threading.Event | None = None,
) -> SpeedMap:
    """Measure the transport speed of a part at every pair of a drive frequency and an amplitude.

    Args:
        scenario: one part that starts at a point of a strip, with `run.stop = "passage"` and one drive by an amplitude.
            Start and duration of a point go with its wavelength and speed. Inputs that are `[uncertain]` have the
            values of the scenario.
        frequencies_hz: numbers above 0 [Hz], or a text as the command line takes it, such as "2500:10000:40".
        amplitudes_um: numbers above 0 [um], or such a text.
        seeds: of every point.
        workers: threads of this process; default: all cores. It takes no executor.
        out: folder for the table and a journal, as of the command; with it the same call goes on after a break.
        progress: True shows a bar on stderr; a function is called with the share that is done.
        stop: set it to end; the points done so far are returned.

    Raises:
        InputError: a scenario that cannot be mapped, values that are not allowed, or a folder that holds something
            else.
        RecordingFailed: the folder cannot be written.
    """
    check_scenario(scenario)
    check_whole(seeds, "seeds")
    check_some(workers=workers)
    frequency, amplitude = text_of(frequencies_hz, "frequencies_hz"), text_of(amplitudes_um, "amplitudes_um")
    axes = values_of(frequency, "frequencies_hz"), values_of(amplitude, "amplitudes_um")
    how: dict[str, Any] = {"seeds": seeds, "workers": workers, "stop": stop}
    with shown(progress, scenario.title or "speed map") as (show, notify):
        how |= {"progress": show, "notify": notify}
        if out is None:
            points = mapping.speed_map(scenario, *axes, **how)
        else:
            mapping.check_mapped(scenario)
            with map_folder(path_of_user(out, "out"), "", scenario, frequency, amplitude, seeds) as folder:
                points = mapping.speed_map(scenario, *axes, **how, journal=folder.journal)
                write_points(folder, points)
    complete = len(points) == len(axes[0]) * len(axes[1])
    return SpeedMap(tuple(points), complete, scenario.title, tuple(not_drawn(scenario)))


@dataclass(frozen=True, repr=False)
class SpeedMap(Answer):
    """Transport speeds over frequency and amplitude.

    Attributes:
        points: of the map, a `MapPoint` each.
        complete: whether all of them are done.
        title: that of the scenario.
        cautions: what misleads, a line each: uncertain inputs, whose values are those of the scenario.
    """

    points: tuple[MapPoint, ...]
    complete: bool
    title: str = ""
    cautions: tuple[str, ...] = ()

    @property
    def fastest(self) -> MapPoint | None:
        """The largest mean where at least half of the seeds arrive; None where they do at no point.

        The largest of many means is too large on average: check it with fresh seeds.
        """
        return mapping.fastest_of(self.points)

    def plot(self, *, marks: Sequence[tuple[float, float, float]] = (), ax: Axes | None = None) -> Axes:
        """Draw the map, with lines of equal throw number; returns matplotlib axes.

        Args:
            marks: measured points: frequency [Hz], amplitude [um], speed [mm/s].
            ax: matplotlib axes to draw into; default: new ones.

        Raises:
            InputError: no point is done.
        """
        from feeder_sim.plots.speed_map import draw_points

        if not self.points:
            raise InputError("no point is done, there is nothing to draw", key="plot")
        axes = axes_for(ax)
        draw_points(axes, self.points, title=self.title, marks=marks)
        return axes

    def _line(self) -> str:
        rest = "" if self.complete else ", not complete"
        rest += f", {counted(len(self.cautions), 'caution')}" if self.cautions else ""
        arrived = sum(point.n > 0 for point in self.points)
        return f"SpeedMap: {counted(len(self.points), 'point')}, {arrived} with arrivals{rest}"

    def _table(self) -> Sequence[Mapping[str, Any]]:
        return rows_of(self.points)
