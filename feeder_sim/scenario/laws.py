"""Which scenarios can have which of the laws of impact by choice."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from feeder_sim.scenario.run import Contact

if TYPE_CHECKING:
    from feeder_sim.scenario.scenario import Scenario


def uncovered_laws(scenario: Scenario, *, in_mujoco: bool) -> Iterator[str]:
    """What a scenario asks of its law of impact that cannot be computed, as for `engine_choice.uncovered`."""
    contact = scenario.contact
    exponent, beta, zener = contact.restitution_exponent, contact.tangential_restitution, contact.restitution == "zener"
    if in_mujoco:
        why = "in MuJoCo, whose contacts are set before it is known how fast they are"
        if exponent:
            yield f"contact.restitution_exponent is {exponent:g}, allowed is 0 {why}"
        if zener:
            yield f'contact.restitution is "zener", allowed is a number {why}'
        if beta is not None:
            yield f"contact.tangential_restitution is {beta:g}, allowed is none in MuJoCo, which has no such law"
        yield from _of_impulses_only(scenario)
    else:
        yield from _of_exact_contact(scenario)
    if exponent and scenario.guide is not None and scenario.guide.kind == "slide":
        yield (
            f'contact.restitution_exponent is {exponent:g}, allowed is 0 with part[0].guide.kind = "slide": its '
            "chatter is summed with one restitution"
        )
    if beta is not None:
        for problem in _not_balls_on_a_plate(scenario):
            yield f"contact.tangential_restitution is {beta:g}, allowed is none {problem}"
        for i, part in enumerate(scenario.part):
            if part.inertia_g_mm2 is not None and len(set(part.inertia_g_mm2)) > 1:
                yield (
                    f"contact.tangential_restitution is {beta:g}, allowed is none with different numbers in "
                    f"part[{i}].inertia_g_mm2"
                )
        if scenario.run.reaction:
            yield f"contact.tangential_restitution is {beta:g}, allowed is none with run.reaction = true"
    if zener:
        if scenario.plate.kind in ("piston", "still"):
            kind = scenario.plate.kind
            yield f'contact.restitution is "zener", allowed is a number with plate.kind = "{kind}", which does not bend'
        for problem in (*_not_balls_on_a_plate(scenario), *_weighed(scenario)):
            yield f'contact.restitution is "zener", allowed is a number {problem}'
        if getattr(scenario.plate, "rim", False):
            yield 'contact.restitution is "zener", allowed is a number with plate.rim = true, whose walls do not bend'
        if scenario.run.reaction:
            why = "which would take the energy of the waves twice"
            yield f'contact.restitution is "zener", allowed is a number with run.reaction = true, {why}'


def _of_impulses_only(scenario: Scenario) -> Iterator[str]:
    """Numbers of the impulse engine, which MuJoCo would leave out without a word."""
    noise, tolerance = scenario.contact.noise_m_s, scenario.run.tolerance_nm
    if noise not in (0.0, Contact().noise_m_s):
        yield (
            f"contact.noise_m_s is {noise:g}, allowed is 0 or the default {Contact().noise_m_s:g} in MuJoCo, whose "
            "impacts do not scatter"
        )
    if tolerance is not None:
        yield (
            f"run.tolerance_nm is {tolerance:g}, allowed is none in MuJoCo, which has a step: "
            "run.steps_per_period says how exact it is"
        )


def _of_exact_contact(scenario: Scenario) -> Iterator[str]:
    """What cannot be computed without a step, and a noise where impacts do not scatter; as for `uncovered_laws`."""
    noise, tolerance, guide = scenario.contact.noise_m_s, scenario.run.tolerance_nm, scenario.guide
    if guide is not None and guide.kind == "slide":
        return
    steps, reasons = scenario.run.steps_per_period, list(needs_steps(scenario))
    if (reasons or steps is not None) and noise not in (0.0, Contact().noise_m_s):
        why = reasons[0] if reasons else f"with run.steps_per_period = {steps}"
        yield (
            f"contact.noise_m_s is {noise:g}, allowed is 0 or the default {Contact().noise_m_s:g} {why}: only impacts "
            "without a step scatter"
        )
    if tolerance is None:
        return
    for reason in reasons:
        yield f"run.tolerance_nm is {tolerance:g}, allowed is none {reason}"
    if steps is not None:
        yield f"run.steps_per_period is {steps}, allowed is none with run.tolerance_nm, which does without steps"


def needs_steps(scenario: Scenario) -> Iterator[str]:
    """Why the impulse engine computes a scenario in steps; nothing where it does without."""
    if scenario.n_parts > 1:
        yield f"with {scenario.n_parts} parts: one free part is computed without a step"
    if scenario.guide is not None:
        yield f'with part[0].guide.kind = "{scenario.guide.kind}"'
    shape = scenario.part[0].shape
    if shape in ("cylinder", "dimer"):
        yield f'with part[0].shape = "{shape}"'
    if getattr(scenario.plate, "rim", False):
        yield "with plate.rim = true"
    if scenario.refill is not None:
        yield "with refill"
    for key in ("planar", "reaction"):
        if getattr(scenario.run, key):
            yield f"with run.{key} = true"


def _weighed(scenario: Scenario) -> Iterator[str]:
    """Balls that are not solid, whose elastic constants nobody knows."""
    for i, part in enumerate(scenario.part):
        if part.mass_g is not None:
            yield f"with part[{i}].mass_g: its law is for solid balls"


def _not_balls_on_a_plate(scenario: Scenario) -> Iterator[str]:
    """Why laws for free balls do not hold; nothing where they do."""
    for i, part in enumerate(scenario.part):
        if part.shape != "ball":
            yield f'with part[{i}].shape = "{part.shape}": its law is for balls'
        if part.guide is not None:
            yield f"with part[{i}].guide"
    if scenario.run.planar:
        yield "with run.planar = true"
