"""What does not fit a scene: starts and goals off the plate, refills without room, picks of poses that do not exist."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from feeder_sim.errors import InputError
from feeder_sim.part.rigid_part import RigidPart
from feeder_sim.part.stable_poses import AXES
from feeder_sim.plate.surface import Surface
from feeder_sim.scenario import GivenState, Heap, Outlet, PartSpec, Pick, Placed, Scattered, Scenario, Start, Tube
from feeder_sim.scene.gripper import read_gripper

if TYPE_CHECKING:
    from feeder_sim.scenario import Schedule
    from feeder_sim.scene.scene import Scene
    from feeder_sim.scene.timetable import TimedStage

WIDEST_HEAP = 500  # parts side by side
DIAMETER_ROUND_OFF = 1e-9  # relative, of a tube that is just as wide as its part
FREE_TILT, UPRIGHT = (0.0, 3.0), (0.0, 0.0)  # [deg]; tilt at the start of a free and of a guided part by default


def check_on_plate(start: Start | Scattered | Heap | Placed | GivenState, surface: Surface, key: str) -> None:
    """Refuse a start that is not on the plate.

    Raises:
        InputError: its position, or the rectangle or circle around it, reaches beyond the plate's edge.
    """
    half = (0.5e3 * surface.length, 0.5e3 * surface.width)
    if isinstance(start, Placed):
        for n, (x, y, _) in enumerate(start.places_mm_deg):
            is_off = surface.outline is not None and not surface.outline.holds(1e-3 * np.array([x, y]))
            if abs(x) > half[0] or abs(y) > half[1] or is_off:
                message = f"is [{x:g}, {y:g}], must be +-{half[0]:.1f}, +-{half[1]:.1f} (on the plate)"
                raise InputError(message, key=f"{key}.places_mm_deg[{n}]")
        return
    at_point = isinstance(start, Start | GivenState)
    x, y = start.position_mm[:2] if isinstance(start, Start | GivenState) else start.centre_mm
    name = "position_mm" if at_point else "centre_mm"
    if abs(x) > half[0] or abs(y) > half[1]:
        message = f"is [{x:g}, {y:g}], must be +-{half[0]:.1f}, +-{half[1]:.1f} (on the plate)"
        raise InputError(message, key=f"{key}.{name}")
    margin = math.inf if surface.outline is None else float(surface.outline.distance(1e-3 * np.array([x, y])))
    if margin < 0.0 and not isinstance(start, Scattered):
        raise InputError(
            f"is [{x:g}, {y:g}], {-1e3 * margin:.3g} mm off the plate or over a hole, must be a place on the plate",
            key=f"{key}.{name}",
        )
    size = (0.0, 0.0)
    if isinstance(start, Heap):
        size, name = (start.diameter_mm, start.diameter_mm), "diameter_mm"
    elif isinstance(start, Scattered) and start.size_mm is not None:
        size, name = start.size_mm, "size_mm"
    is_over_edge = isinstance(start, Heap) and 0.5e-3 * start.diameter_mm > margin
    if abs(x) + 0.5 * size[0] > half[0] or abs(y) + 0.5 * size[1] > half[1] or is_over_edge:
        raise InputError(
            f"is {_size_text(size)}, must be what lies on the plate around its centre", key=f"{key}.{name}"
        )


def check_refill(scenario: Scenario, surface: Surface, kinds: Sequence[RigidPart]) -> None:
    """Refuse a refill that is not on the plate, or absurdly wide.

    Raises:
        InputError: as said.
    """
    start = scenario.refill_start
    if scenario.refill is None or start is None:
        return
    key = "refill.start" if scenario.refill.start else "part[0].start"
    check_on_plate(start, surface, key)
    if isinstance(start, Heap):
        check_width(start, min(kind.size for kind in kinds), key=key)


def check_pick(scene: Scene, pick: Pick | Outlet, key: str) -> None:
    """Refuse one pick, or what is right at an outlet; `key` names it.

    Raises:
        InputError: it names a kind that there is not, a pose that its part does not have, or a gripper that cannot be
            used.
    """
    names = scene.scenario.kind_names
    if isinstance(pick, Pick) and pick.shape is not None:
        read_gripper(pick.shape, key=f"{key}.shape")
    if pick.part is not None and pick.part not in names:
        raise InputError(f'is "{pick.part}", must be {", ".join(names)}', key=f"{key}.part")
    if pick.up and pick.part is None and len(names) > 1:
        raise InputError(f"needs the kind whose poses are meant, part: {', '.join(names)}", key=f"{key}.up")
    kind = names.index(pick.part) if pick.part is not None else 0
    poses = scene.poses[kind].names
    if unknown := [name for name in pick.up if name not in (*poses, *AXES)]:
        of_kind = f"{', '.join(poses)} (poses of {names[kind]}, see feeder-sim part), " if poses else ""
        axes = f"{', '.join(AXES)} (axes as drawn)"
        raise InputError(f'has "{unknown[0]}", must be {of_kind}{axes}', key=f"{key}.up")


def check_picks(scene: Scene) -> None:
    """Refuse a pause in which no frame is left for the pick, or the refill, after its parts have settled.

    Raises:
        InputError: a stage with `until`, and a pick or a refill at its end, has a pause shorter than two frames, or a
            pick or an outlet names a pose that its part does not have, or a gripper that cannot be used.
    """
    schedule = scene.scenario.schedule
    for key, pick in schedule.picks if schedule else ():
        check_pick(scene, pick, key)
    for i, outlet in enumerate(scene.scenario.outlets):
        check_pick(scene, outlet, f"outlet[{i}]")
    least = 2.0 * scene.frame_interval
    last = len(schedule.order) - 1 if schedule and scene.scenario.refill else None  # of a cycle, before a refill
    for stage in scene.times.stages:
        is_refilled = 0 < stage.cycle < scene.times.stages[-1].cycle and stage.number == last
        if stage.until and (stage.picks or is_refilled) and stage.end - stage.stop < least:
            event = "pick" if stage.picks else "a refill after it"
            raise InputError(
                f"is {stage.end - stage.stop:g}, must be at least two frames, {least:.2g} s, with until and {event}",
                key=f"schedule.{_stage_key(schedule, stage)}.pause_s",
            )


def _stage_key(schedule: Schedule | None, stage: TimedStage) -> str:
    """The key of a stage in its schedule."""
    if stage.cycle and schedule is not None:
        return f"stage[{schedule.order[stage.number]}]"
    return f"{'stage' if stage.cycle else 'prepare'}[{stage.number}]"


def check_goal(scenario: Scenario, surface: Surface) -> None:
    """Refuse a goal that is not on the plate.

    Raises:
        InputError: a coordinate of the goal lies beyond the plate's edge.
    """
    goal = scenario.goal
    if goal is None:
        return
    for name, coordinate, size in (("x_mm", goal.x_mm, surface.length), ("y_mm", goal.y_mm, surface.width)):
        if abs(coordinate or 0.0) > 0.5e3 * size:
            raise InputError(f"is {coordinate:g}, must be within +-{0.5e3 * size:g} (on the plate)", key=f"goal.{name}")


def _size_text(size: tuple[float, float]) -> str:
    """A size as it stands in a scenario: one diameter, or [length, width]."""
    return f"{size[0]:g}" if size[0] == size[1] else f"[{size[0]:g}, {size[1]:g}]"


def check_in_tube(spec: PartSpec, part: RigidPart, i: int) -> None:
    """Refuse a part that would overlap the wall of its tube at some tilt within its range.

    Raises:
        InputError: the tube is narrower than the part.
    """
    if not isinstance(spec.guide, Tube) or not isinstance(spec.start, Start):
        return
    tilt = math.radians(max(abs(angle) for angle in spec.start.tilt_deg or UPRIGHT))
    reach = np.hypot(*part.corners[:, :2].T) * math.cos(tilt) + np.abs(part.corners[:, 2]) * math.sin(tilt)
    least = 2e3 * float(reach.max() + part.corner_radius)
    if least > spec.guide.inner_diameter_mm * (1.0 + DIAMETER_ROUND_OFF):
        raise InputError(
            f"is {spec.guide.inner_diameter_mm:g}, must be at least {least:.4g}, which the part takes at its start",
            key=f"part[{i}].guide.inner_diameter_mm",
        )


def check_width(start: Heap, size: float, *, key: str) -> None:
    """Refuse a heap that is absurdly wide for parts of a size [m]; `key` names its start in the message.

    Raises:
        InputError: it is.
    """
    widest = 2e3 * WIDEST_HEAP * size
    if start.diameter_mm > widest:
        raise InputError(
            f"is {start.diameter_mm:g}, must be up to {WIDEST_HEAP} times the size of a part, {widest:.4g}",
            key=f"{key}.diameter_mm",
        )
