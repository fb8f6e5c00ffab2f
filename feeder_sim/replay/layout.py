"""Layout of the viewer: the scene, and beside it, or below it where the plate is long, plots and other views.

Pictures and films have a style of their own: content only, without the titles and panels by which people work the
viewer, and in slow motion without the plots, which know no such time.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

from numpy.typing import ArrayLike

from feeder_sim.replay.eye import OBLIQUE, Eye, framing
from feeder_sim.replay.labels import Box, legend_lines
from feeder_sim.replay.plate import TIMELINE
from feeder_sim.replay.wave import HEIGHT, PERIOD_S, SLOW

Style = Literal["viewer", "picture", "slow_motion"]
BACKGROUND = (24, 27, 31)
LONG = 2.2  # length over depth of a box, from which on the scene has the whole width
SHARES = {"viewer": (3, 2), "picture": (3, 2), "slow_motion": (2, 3)}  # of the scene, and of what is beside or below it
WINDOW = 16.0 / 9.0  # width over height of a picture, and about that of the viewer's window
WAVE_DIRECTION = (0.0, -1.0, 0.6)
CONTENTS = ("plate", "guide", "parts", "shadows", "drop_lines", "paths", "picked", "labels")


def scene_eye(box: Box, entries: int, style: Style, direction: ArrayLike = OBLIQUE) -> Eye:
    """The eye of the scene, for a box with so many entries in its legend."""
    return framing(box.framed(legend_lines(entries)), scene_aspect(box, style), direction=direction)


def scene_aspect(box: Box, style: Style) -> float:
    """Width over height of the pane of the scene."""
    share = SHARES[style][0] / sum(SHARES[style])
    return WINDOW / share if is_long(box) else WINDOW * share


def wave_aspect(box: Box, style: Style) -> float:
    """Width over height of the pane of the surface, which is one of two panes except in slow motion."""
    share, alone = SHARES[style][1] / sum(SHARES[style]), style == "slow_motion"
    if is_long(box):
        return WINDOW / share * (1.0 if alone else 0.5)
    return WINDOW * share * (1.0 if alone else 2.0)


def is_long(box: Box) -> bool:
    """Whether a box is so long that its pane should be so, too."""
    length, depth = (box.high - box.low)[:2]
    return bool(length > LONG * depth)


def layout(box: Box, eye: Eye, beside: Sequence[Any], shares: Sequence[float], *, title: str, style: Style) -> Any:
    """The blueprint.

    Args:
        box: what the scene shows.
        eye: of the scene.
        beside: the other views.
        shares: of each of them.
        title: of the scene.
        style: what it is for.
    """
    import rerun.blueprint as rrb

    bare = style != "viewer"
    scene = spatial_view("/", [f"+ /{name}/**" for name in CONTENTS], title, eye, style=style)
    if is_long(box):
        views: Any = rrb.Vertical(scene, rrb.Horizontal(*beside, column_shares=shares), row_shares=SHARES[style])
    else:
        views = rrb.Horizontal(scene, rrb.Vertical(*beside, row_shares=shares), column_shares=SHARES[style])
    hidden = [rrb.TopPanel(state="hidden")] if bare else []
    return rrb.Blueprint(
        views,
        rrb.TimePanel(
            state="hidden" if bare else "collapsed",
            timeline=TIMELINE,
            play_state="paused" if bare else "playing",
            loop_mode="all",
        ),
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        *hidden,
        auto_layout=False,
        auto_views=False,
    )


def wave_view(box: Box, *, style: Style) -> Any:
    """The view of the surface, magnified."""
    height = HEIGHT * float(box.high[0] - box.low[0])
    raised = Box(box.low * [1.0, 1.0, 0.0] - [0.0, 0.0, height], box.high * [1.0, 1.0, 0.0] + [0.0, 0.0, height])
    below = [0.0, 1.25 * float(box.low[1]), -height]  # the caption
    eye = framing([*raised.corners, below], wave_aspect(box, style), direction=WAVE_DIRECTION)
    title = f"Surface, magnified; timeline {SLOW}: one period in {PERIOD_S:g} s"
    return spatial_view("/wave", ["+ /wave/**"], title, eye, style=style)


def spatial_view(origin: str, contents: Sequence[str], title: str, eye: Eye, *, style: Style) -> Any:
    """A view in 3D."""
    import rerun.blueprint as rrb

    return rrb.Spatial3DView(
        origin=origin,
        contents=contents,
        name=title,
        titlebar=style == "viewer",
        eye_controls=rrb.EyeControls3D(position=eye.position, look_target=eye.target, eye_up=[0.0, 0.0, 1.0]),
        line_grid=False,
        background=BACKGROUND,
    )
