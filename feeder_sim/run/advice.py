"""Cautions about settings that are known to mislead, and recommendations of cheaper models for a scene.

docs/choosing.md discusses the numbers in these texts.
"""

from __future__ import annotations

import math

import numpy as np

from feeder_sim.constants import GRAVITY
from feeder_sim.scenario import Scenario
from feeder_sim.scenario.engine_choice import Choice
from feeder_sim.scenario.rules import complaints
from feeder_sim.scene.scene import Scene
from feeder_sim.scene.under_parts import motion_under_parts

COMPLIANT_DEPTH = 0.37  # 1/e: largest depth of a critically damped contact, over speed times time constant
THROUGH = 0.5  # of the thickness; a part that gets deeper into the plate may leave it on the lower side
SHORT_RING_UP = 0.1  # of the time for which a drive acts; a shorter ring-up can be left out
UNEVEN_WIDTH = 0.1  # of the antinode; a mode that varies more across the plate is not that of a strip
FINE_STEPS = 40  # per period; more steps change the drift by a percent
USUAL_SPEED = 0.06  # [m/s], velocity amplitude of plates under parts: 1 um at 8775 Hz, 3.4 um at 2797 Hz
MUCH_FASTER = 5.0  # than usual: parts hop by a centimetre and more
MOST_ACCELERATION = 2000.0  # [g]; what drives move plates with


def cautions(scene: Scene, engine: Choice) -> list[str]:
    """Settings of a scene that are known to give wrong numbers: key, value and effect, a line each."""
    scenario = scene.scenario
    lines = [*complaints(scenario, "unstable"), *_cautions_of_motion(scene)]
    lines += [*not_drawn(scenario), *complaints(scenario, "misleading")]
    return lines + (_cautions_of_fall(scene) if engine.name == "mujoco" else [])


def not_drawn(scenario: Scenario) -> list[str]:
    """The caution about uncertain inputs, wherever a scenario is run as it is and no values of them are drawn."""
    keys = ", ".join(scenario.uncertain or ())
    return [f"{keys}: uncertain inputs, which have the values of the scenario here, not those of draws"] if keys else []


def _cautions_of_motion(scene: Scene) -> list[str]:
    """A line for each drive that moves the parts of a table far more than feeders do."""
    lines = []
    keys = [key for key, _ in scene.scenario.excitations]
    for motion in motion_under_parts(scene):
        if motion.acceleration > MOST_ACCELERATION or motion.velocity > MUCH_FASTER * USUAL_SPEED:
            lines.append(
                f"{keys[motion.excitation]}: moves the plate under part[{motion.part}] by "
                f"{1e6 * motion.median:.3g} um, {motion.acceleration:.0f} g and {motion.velocity:.2g} m/s; usual is "
                f"{USUAL_SPEED:g} m/s, below {MOST_ACCELERATION:g} g"
            )
    return lines


def _cautions_of_fall(scene: Scene) -> list[str]:
    """A line for each part table whose parts hit the plate so fast that the contact may not stop them in it."""
    lines = []
    for i, spec in enumerate(scene.scenario.part):
        drop = 1e-3 * spec.start.drop_height_mm[1]
        thrown = abs(spec.start.velocity_mm_s[2]) * 1e-3 if spec.start.kind in ("point", "state") else 0.0
        speed = math.hypot(math.sqrt(2.0 * GRAVITY * drop), thrown)
        constant = scene.scenario.contact.time_constant_us
        depth = speed * (scene.timestep if constant is None else COMPLIANT_DEPTH * 1e-6 * constant)
        if depth > THROUGH * scene.surface.thickness:
            lines.append(
                f"part[{i}].start: falls onto the plate at {speed:.2g} m/s and {1e3 * depth:.2g} mm into it, more than "
                f"half its thickness of {1e3 * scene.surface.thickness:g} mm, and out of it below"
            )
    return lines


def recommendations(scene: Scene) -> list[str]:
    """Cheaper models for a scene, and simplifications in it that save too little, a line each."""
    scenario = scene.scenario
    run = scenario.run
    lines: list[str] = []
    if run.engine == "mujoco" and scenario.contact.model == "restitution":
        lines.append('run.engine = "impulse": the same drift within 3 %, for a small part of the time')
    if run.tangent_surface or run.planar:
        lines.append("leave tangent_surface and planar out: the curved surface and six degrees of freedom cost no more")
    if scenario.plate.kind == "piston" and scenario.guide is None and scenario.n_parts == 1:
        lines.append(
            'part.guide = { kind = "slide" } if only the vertical motion matters: exact, and ten times cheaper'
        )
    if run.steps > 2 * FINE_STEPS:
        lines.append(f"run.steps_per_period = {FINE_STEPS}: finer steps change the drift by a percent")
    ringing = [drive for drive in scene.drives if drive.damping_ratio is not None]
    shortest = min((stage.stop - stage.start for stage in scene.times.stages if stage.excitations), default=math.inf)
    if ringing and shortest < math.inf and not run.reaction:  # which needs the ring-up
        slowest = max(drive.ring_up_time for drive in ringing)
        if slowest < SHORT_RING_UP * shortest and len(ringing) == len(scene.drives):
            lines.append(f"ring_up = false is enough: {slowest:.2g} s against {shortest:.3g} s of driving")
        elif slowest > shortest:
            lines.append(f"keep ring_up: it takes {slowest:.2g} s, the shortest stage {shortest:.2g} s")
    if float(np.ptp(scene.surface.table[:, 0], axis=2).max()) > UNEVEN_WIDTH:
        lines.append("keep the plate's own modes: a strip of the same frequency is off by more than a half")
    return lines or ["nothing: this is the simplest model that carries the effects"]
