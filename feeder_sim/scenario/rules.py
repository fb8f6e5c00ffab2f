"""What a scenario may not ask for, and what misleads: all rules, as functions that say which keys break them.

    refused      cannot be computed; the key, and what is allowed
    unstable     is known not to simulate what was asked for; the same, and `run.allow_unstable` runs it all the same
    misleading   is computed; the key, and what it does to the results

Rules of an engine hold where it computes the scenario. An engine of another package brings its own, `Engine.rules`.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, Any, Literal

from pydantic import BaseModel

from feeder_sim import extensions
from feeder_sim.scenario.engine_choice import choose_engine, needs_steps
from feeder_sim.scenario.part import MAX_PARTS, Placed, Start
from feeder_sim.scenario.plate import PLATE_LEVELS, TRAY_LEVELS
from feeder_sim.scenario.run import LAWS, Contact, MujocoSettings
from feeder_sim.scenario.shown import differs

if TYPE_CHECKING:
    from feeder_sim.scenario.scenario import Scenario

# With fewer steps drifts are biased, and a compliant contact is unstable (stability maps in docs/choosing.md).
MIN_STEPS_PER_PERIOD = 20
# A compliant contact (MuJoCo's solref = "T zeta") with a time constant T of fewer steps is unstable.
MIN_STEPS_PER_TIME_CONSTANT = 5.0
FEW_ITERATIONS = 5  # of MuJoCo's solver; fewer do not resolve contacts of several corners
OF_OURS = " or ".join(f'"{name}"' for name in LAWS)
NOISES = f"0 or the default {Contact().noise_m_s:g}"

Broken = Iterator[tuple[str, str] | str]  # keys, each with what is allowed, or what it does; or whole sentences
Rule = Callable[["Scenario"], Broken]
Level = Literal["refused", "unstable", "misleading"]


def findings_of_level(scenario: Scenario, level: Level, *, engine: str = "") -> Iterator[str]:
    """The rules of a level that a scenario breaks, a line each; engine: another one than its own."""
    engine = engine or choose_engine(scenario).name
    engine_rules: Mapping[str, tuple[Rule, ...]] = RULES_OF.get(engine, {})
    if engine in extensions.names_of("engines"):
        engine_rules = getattr(extensions.find("engines", engine), "rules", {})
    for rule in (*RULES[level], *engine_rules.get(level, ())):
        yield from lines_of(scenario, rule, ": " if level == "misleading" else ", must be ")


def lines_of(scenario: Scenario, rule: Rule, between: str = ", must be ") -> Iterator[str]:
    """What a scenario breaks of one rule: key, value and what the rule says, a line each."""
    for broken in rule(scenario):
        if isinstance(broken, str):
            yield broken
        else:
            key, text = broken
            yield f"{key} is {_value_text(_value_at(scenario, key))}{between}{text}"


def _value_at(scenario: Scenario, key: str) -> Any:
    value: Any = scenario
    key = "run.steps" if key == "run.steps_per_period" else key  # where it has the default
    for name in re.findall(r"\w+", key):
        value = value[int(name)] if name.isdigit() else getattr(value, name, None)
    return value


def _value_text(value: Any) -> str:
    if value is None:
        return "missing"
    if isinstance(value, BaseModel) or (isinstance(value, tuple) and any(isinstance(v, BaseModel) for v in value)):
        return "given"
    if isinstance(value, tuple):
        return f"[{', '.join(map(_value_text, value))}]"
    return f"{value:g}" if isinstance(value, float) else json.dumps(value)


def _tables(s: Scenario) -> Broken:
    """Tables that do not go together."""
    still, run = s.plate.kind == "still", s.run
    if still and (s.drive or s.schedule is not None):
        yield "plate.kind", "no [[drive]] and no [schedule] with it"
    if not still and bool(s.drive) == (s.schedule is not None):
        yield 'exactly one of [[drive]] and [schedule] is needed, none of them with plate.kind = "still"'
    if s.n_parts > MAX_PARTS:
        yield f"part.count adds up to {s.n_parts}, must be up to {MAX_PARTS}"
    if s.n_parts > 1 and run.stop != "time":
        yield "run.stop", '"time" with more than one part'
    if s.schedule is None:
        if run.duration_s is None:
            yield "run.duration_s", "a number above 0"
        if s.goal is not None:
            yield "goal belongs to a [schedule]"
        return
    if not s.excitations and not still:
        yield "schedule.stage has no drive, must be at least one in all stages together"
    if run.duration_s is not None:
        yield "run.duration_s is that of the schedule"
    if run.stop != "time":
        yield "run.stop", '"time" with a schedule'
    if s.plate.kind in ("piston", "tray") and any(stage.until for stage in (*s.schedule.prepare, *s.schedule.stage)):
        yield f'plate.kind is "{s.plate.kind}", which has no nodal lines that parts could settle on'


def _around_the_plate(s: Scenario) -> Broken:
    """New parts, and the robot."""
    refill, by_hand = s.refill, s.schedule is not None and s.schedule.by_hand
    if s.robot is not None and not by_hand and not (s.schedule and s.schedule.picks):
        yield "robot belongs to a [schedule] with a pick"
    if refill is None:
        return
    if s.schedule is None and refill.every_s is None:
        yield "refill.every_s", "a number from 0.01 on without a [schedule], at the end of whose cycles new parts come"
    if s.schedule is not None and refill.every_s is not None:
        yield "refill.every_s", "none with a [schedule], at the end of whose cycles new parts come"
    for key in ("to", "below"):
        if (getattr(refill, key) or 0) > s.n_parts:
            yield f"refill.{key}", f"up to {s.n_parts}, the parts of all tables together"
    if s.parts_at_once < s.n_parts and any(isinstance(part.start, Placed) for part in s.part):
        yield "refill.to", f"{s.n_parts}, all parts, where some are placed one by one"
    if s.guide is not None:
        yield "part[0].guide", "none with [refill]"
    if s.run.planar:
        yield "run.planar", "false with [refill]"
    if s.goal is not None:
        yield "goal", "none with [refill]"
    if s.refill_start is None:
        yield "refill.start", 'a table with kind "scattered" or "heap": part[0] starts at one place'


def _beside_fixtures(s: Scenario) -> Broken:
    """What does not go together with [[fixture]]."""
    if not s.fixture and not s.rim_of_fixtures:
        return
    kind = "[[fixture]]" if s.fixture else "a rim around a tray or an outline"
    if s.run.steps_per_period is not None:
        yield "run.steps_per_period", f"none with {kind}, whose contacts have no steps"
    for key in ("planar", "reaction"):
        if getattr(s.run, key):
            yield f"run.{key}", f"false with {kind}"
    if s.run.engine == "mujoco" or s.contact.model == "compliant":
        yield "run.engine", f'"impulse" with {kind}'
    if s.guide is not None:
        yield "part[0].guide", f"none with {kind}"
    if s.contact.restitution == "zener":
        yield "contact.restitution", f"a number with {kind}, which has no theory of its own"
    for i, part in enumerate(s.part):
        if part.in_steps or part.lonely:
            yield f"part[{i}].shape", f"one of corners or a ball with {kind}"
    labels = [fixture.label(i) for i, fixture in enumerate(s.fixtures)]
    for i, label in enumerate(labels):
        if label in labels[:i]:
            yield f"fixture[{i}].name", f"a name of its own, {label!r} is that of another"
    names = set(s.schedule.stage_names) if s.schedule else set()
    for i, fixture in enumerate(s.fixtures):
        for name in fixture.opens.stages if fixture.opens else ():
            if name not in names:
                allowed = ", ".join(sorted(names)) or "there are none"
                yield f"fixture[{i}].opens.stages", f"names of stages ({allowed}), {name!r} is none"


def _beside_outlets(s: Scenario) -> Broken:
    if s.outlet and s.guide is not None:
        yield "part[0].guide", "none with [[outlet]]"


def _guides(s: Scenario) -> Broken:
    for i, part in enumerate(s.part):
        if part.guide is None:
            continue
        if s.n_parts > 1:
            yield f"part[{i}].guide needs to be the only part, there are {s.n_parts}"
        if s.plate.kind != "piston":
            yield "plate.kind", f'"piston" with part[{i}].guide'
        tilt = math.radians(part.guide.tilt_deg)
        if math.cos(tilt) <= part.guide.friction * math.sin(tilt):
            limit = f"{1.0 / math.tan(tilt):.3g} at tilt_deg = {part.guide.tilt_deg:g}"
            yield f"part[{i}].guide.friction", f"below {limit}: the part would never come down"
    if s.guide is not None:
        for name, field in MujocoSettings.model_fields.items():
            if differs(s.mujoco, name):
                yield f"mujoco.{name}", f"{json.dumps(field.default)} with part[0].guide"


def _trays(s: Scenario) -> Broken:
    """How a tray is driven, and no other plate."""
    allowed, refused = (TRAY_LEVELS, PLATE_LEVELS) if s.plate.kind == "tray" else (PLATE_LEVELS, TRAY_LEVELS)
    for key, drive in s.excitations:
        for name in refused:
            if getattr(drive, name, None) is not None:
                yield f'{key}.{name} does not go with plate.kind = "{s.plate.kind}", must be {", ".join(allowed)}'
    if s.plate.kind == "tray" and s.plate.tilt_deg and choose_engine(s).method not in ("exact", "joint"):
        yield "plate.tilt_deg", "0 but with parts that are computed without a step"


def _rims(s: Scenario) -> Broken:
    if _rim(s) and s.guide is not None:
        yield "plate.rim", "false with part[0].guide, which holds the part"
    elif _rim(s) and s.run.planar:
        yield "plate.rim", "false with run.planar = true"


def _rim(s: Scenario) -> bool:
    return bool(getattr(s.plate, "rim", False))


def _plane(s: Scenario) -> Broken:
    """A part that is kept in a plane."""
    if not s.run.planar:
        return
    if choose_engine(s).name == "mujoco":
        yield "run.planar", "false in MuJoCo"
    if s.plate.kind in ("modes", "plate"):
        yield "plate.kind", '"strip", "piston" or "still" with run.planar = true'
    start = s.part[0].start
    if s.n_parts > 1 or s.guide is not None or not isinstance(start, Start):
        yield "run.planar", "false for many parts and for a part in a guide"
    elif start.yaw_deg[0] != start.yaw_deg[1]:
        yield "part[0].start.yaw_deg", "one angle with run.planar = true"
    elif start.position_mm[1] or start.velocity_mm_s[1]:
        yield "part[0].start", "one with 0 along y in position_mm and velocity_mm_s with run.planar = true"


def _reaction(s: Scenario) -> Broken:
    """A plate that takes the impulses of the parts."""
    if not s.run.reaction:
        return
    if s.guide is not None:
        yield "part[0].guide", "none with run.reaction = true"
    if s.plate.kind not in ("modes", "plate"):
        yield "plate.kind", '"modes" or "plate" with run.reaction = true: only its modes have a mass'
    for key, drive in s.excitations:
        if not drive.ring_up:
            yield f"{key}.ring_up", "true with run.reaction = true: it prescribes the motion"


def _laws_of_impact(s: Scenario) -> Broken:
    contact, on_balls = s.contact, next(_not_balls_on_a_plate(s), "")
    if contact.restitution_exponent and s.guide is not None and s.guide.kind == "slide":
        why = "its chatter is summed with one restitution"
        yield "contact.restitution_exponent", f'0 with part[0].guide.kind = "slide": {why}'
    if contact.law != "newton" and s.guide is not None and s.guide.kind == "slide":
        why = "along one line all laws of restitution are the same"
        yield "contact.law", f'"newton" with part[0].guide.kind = "slide": {why}'
    if contact.law not in LAWS:
        if s.run.reaction:
            yield "contact.law", f"{OF_OURS} with run.reaction = true"
        if contact.rolling_friction_um:
            yield "contact.law", f"{OF_OURS} with contact.rolling_friction_um, a moment that it does not know"
    if contact.tangential_restitution is not None:
        if contact.law != "newton":
            yield "contact.tangential_restitution", f'none with contact.law = "{contact.law}"'
        uneven = [i for i, part in enumerate(s.part) if len(set(part.inertia_g_mm2 or ())) > 1]
        if on_balls:
            yield "contact.tangential_restitution", f"none {on_balls}"
        if uneven:
            yield "contact.tangential_restitution", f"none with different numbers in part[{uneven[0]}].inertia_g_mm2"
        if s.run.reaction:
            yield "contact.tangential_restitution", "none with run.reaction = true"
        if contact.rolling_friction_um:
            yield "contact.rolling_friction_um", "0 with contact.tangential_restitution, whose impacts take no moment"
    if contact.rolling_friction_um:
        if s.run.reaction:
            yield "contact.rolling_friction_um", "0 with run.reaction = true"
        if s.guide is not None and s.guide.kind == "slide":
            yield "contact.rolling_friction_um", '0 with part[0].guide.kind = "slide", on which nothing rolls'
    if contact.restitution == "zener":
        weighed = [i for i, part in enumerate(s.part) if part.mass_g is not None]
        if s.plate.kind in ("piston", "still", "tray"):
            yield "contact.restitution", f'a number with plate.kind = "{s.plate.kind}", which does not bend'
        if on_balls:
            yield "contact.restitution", f"a number {on_balls}"
        if weighed:
            yield "contact.restitution", f"a number with part[{weighed[0]}].mass_g: its law is for solid balls"
        if _rim(s):
            yield "contact.restitution", "a number with plate.rim = true, whose walls do not bend"
        if s.run.reaction:
            yield "contact.restitution", "a number with run.reaction = true, which takes the energy of the waves too"


def _not_balls_on_a_plate(s: Scenario) -> Iterator[str]:
    """Why laws for free balls do not hold; nothing where they do."""
    for i, part in enumerate(s.part):
        if part.shape != "ball":
            yield f'with part[{i}].shape = "{part.shape}": its law is for balls'
        if part.guide is not None:
            yield f"with part[{i}].guide"
    if s.run.planar:
        yield "with run.planar = true"


def _parts_that_meet_nothing(s: Scenario) -> Broken:
    """Parts without a hull that other bodies could meet."""
    shape = next((f"with a {part.shape}" for part in s.part if part.lonely), "")
    if shape and s.n_parts > 1:
        yield f"part.count adds up to {s.n_parts}, must be 1 {shape}: it meets no other parts"
    if shape and _rim(s):
        yield "plate.rim", f"false {shape}: it meets no walls"
    if shape and s.refill is not None:
        yield "refill", f"none {shape}"
    if shape and s.run.reaction:
        yield "run.reaction", f"false {shape}"


def _in_impulses(s: Scenario) -> Broken:
    if s.contact.model == "compliant":
        yield "run.engine", '"mujoco" with contact.model = "compliant": impulses have no stiffness'
    for name in MujocoSettings.model_fields:
        if differs(s.mujoco, name):
            yield "run.engine", f'"mujoco" with mujoco.{name}'
    if s.guide is not None and s.guide.kind == "slide":
        return
    if s.guide is not None and s.run.steps_per_period is not None:
        yield "run.steps_per_period", 'none with part[0].guide.kind = "tube", whose wall is met without steps'
    steps, reason = s.run.steps_per_period, next(needs_steps(s), "")
    in_steps = reason or (f"with run.steps_per_period = {steps}" if steps is not None else "")
    if not in_steps and choose_engine(s).method == "impulse":
        in_steps = "with several parts on a plate that is driven and no run.tolerance_nm"
    if in_steps and s.contact.noise_m_s not in (0.0, Contact().noise_m_s):
        yield "contact.noise_m_s", f"{NOISES} {in_steps}: only impacts without a step scatter"
    if s.run.tolerance_nm is not None and reason:
        yield "run.tolerance_nm", f"none {reason}"
    if s.run.tolerance_nm is not None and steps is not None:
        yield "run.steps_per_period", "none with run.tolerance_nm, which does without steps"


def _in_mujoco(s: Scenario) -> Broken:
    contact, run = s.contact, s.run
    if s.plate.kind == "tray":
        yield 'run.engine is "mujoco", must be "impulse" with plate.kind = "tray"'
    before = "in MuJoCo, whose contacts are set before it is known how fast they are"
    if s.guide is not None and s.guide.kind == "tube" and s.guide.friction > 0.0:
        why = "a part that slides along the wall gains speed away from it in MuJoCo's convex friction cone"
        yield "part[0].guide.friction", f"0 in MuJoCo: {why}"
    if contact.restitution_exponent:
        yield "contact.restitution_exponent", f"0 {before}"
    if contact.restitution == "zener":
        yield "contact.restitution", f"a number {before}"
    if contact.law != "newton":
        yield "contact.law", '"newton" in MuJoCo, whose contacts know no impulse of compression'
    if contact.tangential_restitution is not None:
        yield "contact.tangential_restitution", "none in MuJoCo, which has no such law"
    if contact.rolling_friction_um:
        yield "contact.rolling_friction_um", "0 in MuJoCo, whose rolling friction is soft"
    if contact.noise_m_s not in (0.0, Contact().noise_m_s):
        yield "contact.noise_m_s", f"{NOISES} in MuJoCo, whose impacts do not scatter"
    if run.tolerance_nm is not None:
        yield "run.tolerance_nm", "none in MuJoCo, which has a step: run.steps_per_period says how exact it is"
    if run.reaction:
        yield 'run.engine is "mujoco", must be "impulse" with run.reaction = true: its plate does not give way'
    if any(part.lonely for part in s.part):
        yield 'run.engine is "mujoco", must be "impulse" with a dimer'


def _steps(s: Scenario) -> Broken:
    steps, constant = s.run.steps, s.contact.time_constant_us
    if steps < MIN_STEPS_PER_PERIOD:
        why = "the plate would move by a third of its amplitude within a step, and speeds come out wrong"
        yield "run.steps_per_period", f"at least {MIN_STEPS_PER_PERIOD}: {why}"
    if constant is not None:
        shortest = MIN_STEPS_PER_TIME_CONSTANT * 1e6 / s.highest_frequency_hz
        if constant < shortest / steps:
            why = f"for contact.time_constant_us = {constant:g}: a shorter contact throws parts"
            yield "run.steps_per_period", f"at least {int(-(-shortest // constant))} {why}"


def _settings_that_fail(s: Scenario) -> Broken:
    if s.mujoco.integrator == "discrete" and s.contact.time_constant_us is None:
        why = 'with contact.model = "restitution": it takes the rebound out'
        yield "mujoco.integrator", f'"euler" or "implicitfast" {why}'
    if s.mujoco.plate == "mocap":
        yield "mujoco.plate", '"patch": a mocap body has no velocity in contact'


def _simplifications(s: Scenario) -> Broken:
    if s.schedule is not None and s.schedule.by_hand:
        yield "schedule.by_hand", "a run of the scenario does not pick and fill in what a program did"
    if not s.run.in_plane_velocity and s.plate.kind not in ("piston", "still"):
        yield "run.in_plane_velocity", "drifts come out at a third of their speed or less"
    if s.plate.kind == "strip" and s.run.planar:
        yield "run.planar", "over short waves drifts change by some percent"


def _contacts_of_mujoco(s: Scenario) -> Broken:
    if s.contact.friction > 0.0 and s.guide is None:
        slope = "in MuJoCo's convex cone a sliding impact leaves the plate too fast, by half of the approach at a slope"
        yield "contact.friction", f"{slope} of 1 : 3"
    if s.contact.model == "compliant":
        yield "contact.model", "rebounds depend on the step, and resemble no coefficient"
    if s.mujoco.cone == "pyramidal" and s.contact.model == "restitution":
        yield "mujoco.cone", "friction rebounds like the normal velocity, drifts are 20 % too fast"
    if s.mujoco.iterations < FEW_ITERATIONS:
        yield "mujoco.iterations", "contacts of several corners are not resolved"
    if s.mujoco.impedance == "default":
        yield "mujoco.impedance", "friction is soft, and what rests on a slope creeps"


def plate_with_outline(s: Scenario) -> Broken:
    """Of a plate that is no whole rectangle, which only its mode file says."""
    why = "on a plate with holes or an outline of its own"
    if choose_engine(s).name == "mujoco":
        yield f'run.engine is "mujoco", must be "impulse" {why}: its parts meet whole rectangles'
    if _rim(s) and not s.rim_of_fixtures:
        yield "plate.rim", f"false {why}, whose walls may be [[fixture]]"


RULES: dict[Level, tuple[Rule, ...]] = {
    "refused": (
        *(
            _tables,
            _around_the_plate,
            _beside_fixtures,
            _beside_outlets,
            _guides,
            _trays,
            _rims,
            _plane,
            _reaction,
            _laws_of_impact,
            _parts_that_meet_nothing,
        ),
    ),
    "unstable": (_steps, _settings_that_fail),
    "misleading": (_simplifications,),
}
RULES_OF: dict[str, dict[str, tuple[Rule, ...]]] = {
    "impulse": {"refused": (_in_impulses,)},
    "mujoco": {"refused": (_in_mujoco,), "misleading": (_contacts_of_mujoco,)},
}
