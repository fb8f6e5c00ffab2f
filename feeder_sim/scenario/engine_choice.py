"""Which engine a scenario gets, and by which method; `rules` says which scenarios each can compute.

Two engine names stand for several methods. `mujoco` has one; `impulse` has the general one and `slide`, which finds
every event of a part with one degree of freedom exactly, and `exact`, which computes one free part without a step.
Over a plate that takes the impulses of the parts both have a method of their own, `reaction`. docs/engines.md describes
them.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from feeder_sim.scenario.scenario import Scenario


class Choice(NamedTuple):
    """An engine by name, the method by which it computes the scenario, and the reason for the choice."""

    name: str
    method: str
    reason: str


def choose_engine(scenario: Scenario) -> Choice:
    """The engine of a checked scenario: the one it asks for, else the fastest that can compute it."""
    guide = scenario.guide
    method = "reaction" if scenario.run.reaction else "impulse"
    asks_for_steps = scenario.run.steps_per_period is not None or any(needs_steps(scenario))
    if scenario.run.tolerance_nm is not None or not asks_for_steps:
        method = "exact"
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
    if scenario.n_parts > 1:
        yield f"with {scenario.n_parts} parts: one free part is computed without a step"
    if scenario.guide is not None and scenario.guide.kind == "slide":
        yield 'with part[0].guide.kind = "slide"'
    if scenario.part[0].in_steps and scenario.guide is None:
        yield f'with part[0].shape = "{scenario.part[0].shape}"'
    if scenario.refill is not None:
        yield "with refill"
    for key in ("planar", "reaction"):
        if getattr(scenario.run, key):
            yield f"with run.{key} = true"
