"""Layout of the rerun viewer: the scene, and beside it, or below it where the plate is long, plots and other views.

Heavy to import, as `rerun_file`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import rerun as rr
import rerun.blueprint as rrb

from feeder_sim.replay.layout import BACKGROUND, SHARES, Eye, Style, framing, is_long, scene_eye, wave_aspect
from feeder_sim.replay.plate import HEIGHT
from feeder_sim.replay.scenery import SLOW, TIMELINE, Box, Plot, Scenery
from feeder_sim.replay.seed_view import PERIOD_S

WAVE_DIRECTION = (0.0, -1.0, 0.6)
CONTENTS = ("plate", "fixtures", "outlets", "guide", "parts", "shadows", "drop_lines", "paths", "picked", "labels")


def blueprint(scenery: Scenery, style: Style) -> Any:
    """Layout of the viewer: the scene, and beside it plots, the surface and the stages."""
    box, bare = scenery.box, style != "viewer"
    eye = scene_eye(box, scenery.legend, style, scenery.direction)
    scene = _spatial_view("/", [f"+ /{name}/**" for name in CONTENTS], scenery.title, eye, bare=bare)
    beside = [(_plot_view(plot, bare=bare), 1.0) for plot in scenery.plots if style != "slow_motion"]
    beside += [(_wave_view(box, style=style), 1.0)] if scenery.wave else []
    beside += [(rrb.TextLogView(origin="/stage", name="Stages"), 0.5)] if scenery.wave and not bare else []
    views, shares = zip(*beside, strict=True)
    if is_long(box):
        panes: Any = rrb.Vertical(scene, rrb.Horizontal(*views, column_shares=shares), row_shares=SHARES[style])
    else:
        panes = rrb.Horizontal(scene, rrb.Vertical(*views, row_shares=shares), column_shares=SHARES[style])
    clock: dict[str, Any] = {"timeline": TIMELINE, "play_state": "paused" if bare else "playing", "loop_mode": "all"}
    panels = [
        rrb.TimePanel(state="hidden" if bare else "collapsed", **clock),
        *(panel(state="hidden") for panel in (rrb.BlueprintPanel, rrb.SelectionPanel)),
        *([rrb.TopPanel(state="hidden")] if bare else []),
    ]
    return rrb.Blueprint(panes, *panels, auto_layout=False, auto_views=False)


def _plot_view(plot: Plot, *, bare: bool) -> Any:
    """A time series view; bare, it has a legend in place of its title, in which the other seeds are left out."""
    around = axis = None
    if plot.window:
        sides = [rr.TimeRangeBoundary.cursor_relative(seconds=side * plot.window / 2.0) for side in (-1.0, 1.0)]
        around = rrb.TimeAxis(view_range=rr.TimeRange(*sides))
    if plot.largest is not None:
        lowest = -plot.largest if plot.signed else 0.0
        axis = rrb.ScalarAxis(range=(1.05 * lowest, 1.05 * max(plot.largest, 1e-6)))  # a little above the largest
    other_paths = [f"/{plot.path}/{curve.path}" for curve in plot.curves if curve.path.startswith("others/")]
    return rrb.TimeSeriesView(
        origin=f"/{plot.path}",
        name=plot.title,
        titlebar=not bare,
        axis_x=around,
        axis_y=axis,
        plot_legend=rrb.PlotLegend(visible=bare or plot.legend),
        overrides=dict.fromkeys(other_paths, rr.SeriesLines.from_fields(names=["other seeds"])) if bare else None,
    )


def _wave_view(box: Box, *, style: Style) -> Any:
    """The view of the surface, magnified."""
    height = HEIGHT * float(box.high[0] - box.low[0])
    raised = Box(box.low * [1.0, 1.0, 0.0] - [0.0, 0.0, height], box.high * [1.0, 1.0, 0.0] + [0.0, 0.0, height])
    below = [0.0, 1.25 * float(box.low[1]), -height]  # the caption
    eye = framing([*raised.corners, below], wave_aspect(box, style), direction=WAVE_DIRECTION)
    title = f"Surface, magnified; timeline {SLOW}: one period in {PERIOD_S:g} s"
    return _spatial_view("/wave", ["+ /wave/**"], title, eye, bare=style != "viewer")


def _spatial_view(origin: str, contents: Sequence[str], title: str, eye: Eye, *, bare: bool) -> Any:
    """A view in 3D."""
    return rrb.Spatial3DView(
        origin=origin,
        contents=contents,
        name=title,
        titlebar=not bare,
        eye_controls=rrb.EyeControls3D(position=eye.position, look_target=eye.target, eye_up=[0.0, 0.0, 1.0]),
        line_grid=False,
        background=BACKGROUND,
    )
