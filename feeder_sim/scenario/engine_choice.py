"""Which scenarios each engine can compute, which engine a scenario gets, and settings that are known to fail.

Two engine names stand for several methods. `mujoco` has one; `impulse` has the general one and `slide`, which finds
every event of a part with one degree of freedom exactly, and `exact`, which computes one free part without a step.
Over a plate that takes the impulses of the parts both have a method of their own, `reaction`. docs/engines.md describes
them.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import TYPE_CHECKING, Literal, NamedTuple

from feeder_sim.scenario.laws import needs_steps, uncovered_laws
from feeder_sim.scenario.part import Start
from feeder_sim.scenario.run import MujocoSettings

if TYPE_CHECKING:
    from feeder_sim.scenario.scenario import Scenario

# With fewer steps drifts are biased, and a compliant contact is unstable (stability maps in docs/choosing.md).
MIN_STEPS_PER_PERIOD = 20
# A compliant contact (MuJoCo's solref = "T zeta") with a time constant T of fewer steps is unstable.
MIN_STEPS_PER_TIME_CONSTANT = 5.0

EngineName = Literal["impulse", "mujoco"]
Method = Literal["impulse", "exact", "reaction", "slide", "mujoco"]


class Choice(NamedTuple):
    """An engine by name, the method by which it computes the scenario, and the reason for the choice."""

    name: EngineName
    method: Method
    reason: str


def choose_engine(scenario: Scenario) -> Choice:
    """The engine of a checked scenario: the one it asks for, else the fastest that can compute it."""
    guide = scenario.guide
    method: Method = "reaction" if scenario.run.reaction else "impulse"
    asks_for_steps = scenario.run.steps_per_period is not None or any(needs_steps(scenario))
    if scenario.run.tolerance_nm is not None or not asks_for_steps:
        method = "exact"
    if guide is not None and guide.kind == "slide":
        method = "slide"
    if scenario.run.engine == "mujoco":
        return Choice("mujoco", "mujoco", "asked for")
    if scenario.run.engine == "impulse":
        return Choice("impulse", method, "asked for")
    if scenario.contact.model == "compliant":
        return Choice("mujoco", "mujoco", "a compliant contact needs its spring-dampers")
    if method == "slide":
        return Choice("impulse", "slide", "one degree of freedom, whose impacts it finds exactly")
    return Choice("impulse", method, "rigid contact, which it covers and is the fastest at")


def uncovered(scenario: Scenario) -> Iterator[str]:
    """What the engine of a scenario cannot compute: key, value and what is allowed, one line each."""
    run, contact = scenario.run, scenario.contact
    if run.engine == "impulse" and contact.model == "compliant":
        yield (
            'run.engine is "impulse", allowed is "mujoco" with contact.model = "compliant": impulses have no stiffness'
        )
    in_mujoco = choose_engine(scenario).name == "mujoco"
    default = MujocoSettings()
    changed = [name for name, value in scenario.mujoco if value != getattr(default, name)]
    if changed and scenario.guide is not None:
        name = changed[0]
        value, allowed = getattr(scenario.mujoco, name), getattr(default, name)
        yield f"mujoco.{name} is {json.dumps(value)}, allowed is {json.dumps(allowed)} with part[0].guide"
    if changed and not in_mujoco:
        yield f'run.engine is "{run.engine}", allowed is "mujoco" with mujoco.{changed[0]}'
    guide = scenario.guide
    if guide is not None and guide.kind == "tube" and guide.friction > 0.0 and in_mujoco:
        yield (
            f"part[0].guide.friction is {guide.friction:g}, allowed is 0 in MuJoCo: a part that slides along the wall "
            "gains speed away from it in MuJoCo's convex friction cone"
        )
    if getattr(scenario.plate, "rim", False) and (guide is not None or run.planar):
        why = "with run.planar = true" if guide is None else "with part[0].guide, which holds the part"
        yield f"plate.rim is true, allowed is false {why}"
    if run.planar:
        yield from _uncovered_in_plane(scenario, in_mujoco=in_mujoco)
    if run.reaction:
        yield from _uncovered_with_reaction(scenario, in_mujoco=in_mujoco)
    yield from uncovered_laws(scenario, in_mujoco=in_mujoco)
    if any(part.shape == "dimer" for part in scenario.part):
        yield from _uncovered_of_dimers(scenario, in_mujoco=in_mujoco)


def _uncovered_of_dimers(scenario: Scenario, *, in_mujoco: bool) -> Iterator[str]:
    """What cannot be computed with dimers, which have no hull that other bodies could meet; as for `uncovered`."""
    if scenario.n_parts > 1:
        yield f"part.count adds up to {scenario.n_parts}, allowed is 1 with a dimer: it meets no other parts"
    if getattr(scenario.plate, "rim", False):
        yield "plate.rim is true, allowed is false with a dimer: it meets no walls"
    if scenario.refill is not None:
        yield "refill is given, allowed is none with a dimer"
    if scenario.run.reaction:
        yield "run.reaction is true, allowed is false with a dimer"
    if in_mujoco:
        yield 'run.engine is "mujoco", allowed is "impulse" with a dimer'


def _uncovered_with_reaction(scenario: Scenario, *, in_mujoco: bool) -> Iterator[str]:
    """What cannot be computed with run.reaction = true, as for `uncovered`."""
    if scenario.guide is not None:
        yield "part[0].guide is given, allowed is none with run.reaction = true"
    if scenario.plate.kind not in ("rectangle", "modes"):
        yield (
            f'plate.kind is "{scenario.plate.kind}", allowed is "rectangle" or "modes" with run.reaction = true: '
            "only its modes have a mass"
        )
    for key, drive in scenario.excitations:
        if not drive.ring_up:
            yield f"{key}.ring_up is false, allowed is true with run.reaction = true: it prescribes the motion"
    if in_mujoco:
        yield 'run.engine is "mujoco", allowed is "impulse" with run.reaction = true: its plate does not give way'


def uncovered_outline(scenario: Scenario) -> Iterator[str]:
    """What cannot be computed on a plate that is no whole rectangle, which only its mode file says; as `uncovered`."""
    if choose_engine(scenario).name == "mujoco":
        why = "a plate with holes or an outline of its own: its parts meet whole rectangles"
        yield f'run.engine is "mujoco", allowed is "impulse" on {why}'
    if getattr(scenario.plate, "rim", False):
        yield "plate.rim is true, allowed is false on a plate with holes or an outline of its own"


def _uncovered_in_plane(scenario: Scenario, *, in_mujoco: bool) -> Iterator[str]:
    """What cannot be computed with run.planar = true, as for `uncovered`."""
    part = scenario.part[0]
    if in_mujoco:
        yield "run.planar is true, allowed is false in MuJoCo"
    if scenario.plate.kind in ("rectangle", "modes"):
        allowed = '"strip", "piston" or "still"'
        yield f'plate.kind is "{scenario.plate.kind}", allowed is {allowed} with run.planar = true'
    if scenario.n_parts > 1 or part.guide is not None or not isinstance(part.start, Start):
        yield "run.planar is true, allowed is false for many parts and for a part in a guide"
        return
    low, high = part.start.yaw_deg
    if low != high:
        yield f"part[0].start.yaw_deg is [{low:g}, {high:g}], allowed is one angle with run.planar = true"
    if part.start.position_mm[1] or part.start.velocity_mm_s[1]:
        yield "part[0].start has a position or velocity along y, allowed is 0 with run.planar = true"


def known_failures(scenario: Scenario) -> tuple[str, ...]:
    """Settings that do not simulate what was asked for: key, value, what is allowed and why, one line each."""
    run, contact, mujoco = scenario.run, scenario.contact, scenario.mujoco
    failures = []
    if run.steps < MIN_STEPS_PER_PERIOD:
        failures.append(
            f"run.steps_per_period is {run.steps}, allowed is at least {MIN_STEPS_PER_PERIOD}: the "
            "plate would move by a third of its amplitude within a step, and speeds come out wrong"
        )
    if contact.time_constant_us is not None:
        shortest = 1e6 / scenario.highest_frequency_hz
        if contact.time_constant_us < MIN_STEPS_PER_TIME_CONSTANT * shortest / run.steps:
            needed = int(-(-MIN_STEPS_PER_TIME_CONSTANT * shortest // contact.time_constant_us))
            failures.append(
                f"run.steps_per_period is {run.steps}, allowed is at least {needed} for "
                f"contact.time_constant_us = {contact.time_constant_us:g}: a shorter contact throws parts"
            )
    elif mujoco.integrator == "discrete":
        failures.append(
            'mujoco.integrator is "discrete", allowed is "euler" or "implicitfast" with contact.model = '
            '"restitution": it takes the rebound out'
        )
    if mujoco.plate == "mocap":
        failures.append('mujoco.plate is "mocap", allowed is "patch": a mocap body has no velocity in contact')
    return tuple(failures)
