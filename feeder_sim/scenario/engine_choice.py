"""Which engine a scenario gets, and by which method; `rules` says which scenarios each can compute.

Two engine names stand for several methods. `mujoco` has one; `impulse` has the general one and `slide`, which finds
every event of a part with one degree of freedom exactly, `exact`, which computes one free part without a step, and
`joint`, which computes several without one: on plates at rest and trays, and elsewhere where it is asked for.
Over a plate that takes the impulses of the parts both have a method of their own, `reaction`. docs/engines.md describes
them.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from feeder_sim.scenario.scenario import Scenario


UNSTEPPED = ("still", "tray")  # plates on which several parts are computed without a step by default


class Choice(NamedTuple):
    """An engine by name, the method by which it computes the scenario, and the reason for the choice."""

    name: str
    method: str
    reason: str


TRACKED = Choice("tracks", "tracks", "seen by a camera, not computed")


def choose_engine(scenario: Scenario) -> Choice:
    """The engine of a checked scenario: the one it asks for, else the fastest that can compute it."""
    guide = scenario.guide
    method = "reaction" if scenario.run.reaction else "impulse"
    has_many_parts = scenario.n_parts > 1 or scenario.refill is not None
    is_stepped_by_default = has_many_parts and scenario.plate.kind not in UNSTEPPED
    is_stepped = scenario.run.steps_per_period is not None or is_stepped_by_default or any(needs_steps(scenario))
    if scenario.fixture or scenario.rim_of_fixtures:
        method = "joint"
    elif scenario.run.tolerance_nm is not None or not is_stepped:
        method = "joint" if has_many_parts else "exact"
    if guide is not None and guide.kind == "slide":
        method = "slide"
    if scenario.run.engine == "impulse":
        return Choice("impulse", method, "asked for")
    if scenario.run.engine != "auto":
        return Choice(scenario.run.engine, scenario.run.engine, "asked for")
    if scenario.contact.model == "compliant":
        return Choice("mujoco", "mujoco", "a compliant contact needs its spring-dampers")
    if method == "slide":
        return Choice("impulse", "slide", "one degree of freedom, whose impacts it finds exactly")
    return Choice("impulse", method, "rigid contact, which it covers and is the fastest at")


def needs_steps(scenario: Scenario) -> Iterator[str]:
    """Why the impulse engine computes a scenario in steps; nothing where it does without."""
    if scenario.guide is not None and scenario.guide.kind == "slide":
        yield 'with part[0].guide.kind = "slide"'
    for i, part in enumerate(scenario.part):
        if part.in_steps and scenario.guide is None:
            yield f'with part[{i}].shape = "{part.shape}"'
    for key in ("planar", "reaction"):
        if getattr(scenario.run, key):
            yield f"with run.{key} = true"
