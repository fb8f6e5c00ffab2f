"""Points of a part on the edge of the plate: where they are is geometry (edge_points.py), how they move is here.

With n the normal from the edge to the nearest point of the part, or to the centre of a ball of radius r there,

    g'' = n . a + 2 n' . v - (g + r) n' . n'

where a and v are the acceleration and the relative velocity of that point or centre. How n' follows from the motion:
EDGE_POINT. The path of such a point (path.py) is that of its gap, along the normal.
"""

from __future__ import annotations

import math

from feeder_sim.constants import GRAVITY
from feeder_sim.engines.impulse.free_part.edge_piece import BALL, BESIDE, LINES, NONE, ROUND
from feeder_sim.engines.impulse.free_part.edge_points import edge_points
from feeder_sim.engines.impulse.free_part.on_plate import CLOSE
from feeder_sim.engines.impulse.free_part.path import write_path
from feeder_sim.engines.impulse.scratch import AT_EDGE
from feeder_sim.engines.impulse.surface import (
    ACCELERATION,
    ALONG,
    CHANGE,
    HEIGHT,
    NOW,
    SLOPE_X,
    SLOPE_Y,
    SPEED,
    TURN_X,
    TURN_Y,
    along_at,
    flow_at,
    height_at,
    most_push,
    shapes_at,
    shapes_under,
    slope_at,
)
from feeder_sim.engines.impulse.vectors import add_to, cross, difference, dot, plus, vector, write_to
from feeder_sim.machine_code import inlined

REACH = 1e-3  # [m]; how far from the edge of the plate a part is looked at there
SWUNG = 4.0  # |n'| |v|, by which a gap at the edge is accelerated at most, over the other bounds: twice as much as now


@inlined
def evaluate_edge(part, kinds, plate, first, turning, work):
    """Fill points on the edge of the plate, from `first` on; returns their end, and whether one is close.

    work.now: modal coordinates.
    """
    kind, surface = kinds.record[part.kind], plate.surface
    height = _height_of_plate(part, surface, work.under[first], work.now)
    part.position[2] -= height
    n_points = edge_points(part, kind, kinds, surface, REACH, work.edge)
    part.position[2] += height
    n, close = first, False
    for k in range(n_points):
        edge, point, under = work.edge[k], work.point[n], work.under[n]
        shapes_under(edge.foot[0], edge.foot[1], part, surface, under)
        _along_normal(under, edge.normal, surface)
        point.gap = edge.gap + height * edge.normal[2] - along_at(under, work.now, NOW)
        if point.gap < -BESIDE:
            continue
        point.sort, point.edge, point.friction, point.carried = AT_EDGE, k, kind.friction[0], 0
        point.snap_bound = point.rolls = 0.0
        point.push = along_at(under, work.now, ACCELERATION)
        point.most_push = most_push(under, plate.bounds)
        write_to(point.surface_velocity, flow_at(under, work.now, surface))
        _lean(point, edge, slope_at(under, work.now))
        for s in range(under.shape[0]):
            under[s, SLOPE_X] = under[s, SLOPE_Y] = 0.0  # its path is along the normal
        move_edge_point(n, part, kind, turning, work)
        close = close or point.gap < CLOSE
        n += 1
    return n, close


@inlined
def _height_of_plate(part, surface, under, modal):
    """How high the plate is under a part, or at its edge next to it [m]."""
    x = min(max(part.position[0], surface.grid_x[0]), surface.grid_x[-1])
    y = min(max(part.position[1], surface.grid_y[0]), surface.grid_y[-1])
    shapes_at(x, y, surface, under)
    return height_at(under, modal)


@inlined
def _along_normal(under, n, surface):
    """Write how far every mode shape moves a place of the plate along a normal [1]."""
    moves = surface.half_thickness * surface.in_plane
    for s in range(under.shape[0]):
        under[s, ALONG] = n[2] * under[s, HEIGHT] - moves * (n[0] * under[s, TURN_X] + n[1] * under[s, TURN_Y])


@inlined
def _lean(point, edge, slope):
    """Write arm and normal on an edge that has the slope of the plate: it stays normal to it, and to the part's.

    The edge point itself has both over a level plate.
    """
    n, axis = vector(edge.normal), vector(edge.axis)
    along, leans = axis, axis
    if edge.turns == LINES:
        along, leans = cross(axis, n), vector(edge.lever)
    leant = plus(n, -n[2] * (slope[0] * along[0] + slope[1] * along[1]), leans)
    leant = plus(NONE, 1.0 / math.sqrt(dot(leant, leant)), leant)
    write_to(point.arm, edge.arm)
    add_to(point.arm, edge.radius, difference(n, leant))
    write_to(point.normal, leant)


@inlined
def move_edge_point(i, part, kind, turning, work):
    """Write how the normal of point i, on the edge, turns, and the path of its gap, as its part moves now."""
    point, edge = work.point[i], work.edge[work.point[i].edge]
    n, far, axis, bends = vector(point.normal), point.gap + edge.radius, vector(edge.axis), 0.0
    write_path(point, part, plus(point.arm, edge.radius, n), turning)
    v = difference(point.path_velocity, point.surface_velocity)
    if edge.turns == BALL:
        around = plus(v, -dot(v, axis), axis)
        swing = plus(NONE, 1.0 / far, plus(around, -dot(around, n), n))
    elif edge.turns == LINES:
        swing = -dot(turning.spin, vector(edge.lever)) - edge.bend * dot(v, axis)
        swing = plus(NONE, swing / (1.0 - far * edge.bend * dot(axis, axis)), axis)
        slides = far * dot(swing, axis) - dot(v, axis)
        bends = edge.bend * slides * slides
    elif edge.turns == ROUND:
        axis = vector(edge.lever)
        across = cross(n, axis)
        swing = plus(NONE, dot(v, across) / far, across)
        swing = plus(swing, -dot(n, cross(turning.spin, axis)), axis)
    else:
        swing = cross(turning.spin, n)
    fast, own = math.sqrt(dot(swing, swing)), GRAVITY + turning.acceleration
    opens = dot(n, point.path_acceleration) + 2.0 * dot(swing, v) - far * dot(swing, swing) + bends
    point.rate, point.closing = dot(n, v), point.push - opens
    point.most_own = own + SWUNG * fast * math.sqrt(dot(v, v))
    point.jerk_bound = 3.0 * fast * point.most_own
    if kind.reach > 0.0:
        point.jerk_bound += 9.0 * turning.acceleration * turning.speed / kind.reach
    write_to(point.swing, swing)
    write_to(point.path_velocity, (0.0, 0.0, point.rate + along_at(work.under[i], work.now, SPEED)))
    write_to(point.path_acceleration, (0.0, 0.0, opens))
    point.path_jerk, point.closing_rate = 0.0, along_at(work.under[i], work.now, CHANGE)


@inlined
def edge_point_after(i, part, turning, time, work):
    """Arm and normal at point i, on the edge, for forces that last a time [s]: those of the middle; and a speed [m/s].

    The gap closes along the normal of the end, the force acts along that of the middle: by that speed the normal
    velocity of the contact has to be less than the rate of the gap.
    """
    point, edge = work.point[i], work.edge[work.point[i].edge]
    n, swing = vector(point.normal), vector(point.swing)
    centre = plus(point.arm, edge.radius, n)
    going = cross(turning.spin, centre)
    v = difference(plus(part.velocity, 1.0, going), point.surface_velocity)
    middle = plus(n, 0.5 * time, swing)
    middle = plus(NONE, 1.0 / math.sqrt(dot(middle, middle)), middle)
    turned = time * dot(swing, v)
    if edge.turns == BALL:
        slides, turned = NONE, 0.5 * turned
    elif edge.turns == LINES:  # they meet farther along that of the part
        slides = plus(NONE, -dot(v, vector(edge.axis)), cross(n, vector(edge.lever)))
        turned += 0.5 * time * edge.bend * dot(slides, slides)
    elif edge.turns == ROUND:  # the vertex slides along the axis
        slides = plus(NONE, -dot(v, vector(edge.lever)), edge.lever)
    else:  # the vertex slides along the face
        slides = plus(plus(NONE, -1.0, v), dot(v, n), n)
    going = plus(going, 1.0, slides)
    return plus(plus(centre, 0.5 * time, going), -edge.radius, middle), middle, turned
