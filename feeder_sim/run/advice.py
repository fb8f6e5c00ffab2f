"""What a user should know about a scene before believing it: settings known to mislead, and simpler models that do.

Every figure here comes from `feeder-sim chart` (README, "Choosing"): the methods, the model ladder, the stability maps.
"""

from __future__ import annotations

import math

import numpy as np

from feeder_sim.scenario.engine_choice import Choice, known_failures
from feeder_sim.scene.scene import GRAVITY, Scene

SOFT_DEPTH = 0.37  # of speed times time constant: how deep a critically damped contact gives way, 1/e
LONG_RING_UP = 0.1  # of the time a drive acts: below this it could be left out
UNEVEN = 0.1  # of the antinode: a mode that varies by so much across the plate is no strip
FINE = 40  # steps per period: finer ones change the drift by a percent


def cautions(scene: Scene, engine: Choice) -> list[str]:
    """Settings of a scene that are known to give wrong numbers: key, value, and what they do, a line each."""
    scenario = scene.scenario
    run, contact, settings = scenario.run, scenario.contact, scenario.mujoco
    found = [*known_failures(scenario)]
    if not run.in_plane_velocity and scenario.plate.kind != "piston":
        found.append("run.in_plane_velocity is false: drifts come out at a third of their speed or less")
    if scenario.plate.kind == "strip" and run.planar:
        found.append("run.planar is true: over short waves drifts change by some percent")
    if engine.name != "mujoco":
        return found
    found += _cautions_of_fall(scene)
    if contact.friction > 0.0 and scenario.guide is None:
        found.append(
            f"contact.friction is {contact.friction:g} in MuJoCo: in its convex cone a sliding impact leaves the plate "
            "too fast, by half of the approach at a slope of 1 : 3"
        )
    if contact.model == "compliant":
        found.append('contact.model is "compliant": rebounds depend on the step, and resemble no coefficient')
    if settings.cone == "pyramidal" and contact.model == "restitution":
        found.append('mujoco.cone is "pyramidal": friction rebounds like the normal velocity, drifts are 20 % too fast')
    if settings.tolerance == "default" and settings.units != "SI":
        found.append('mujoco.tolerance is "default": the solver stops before contacts are resolved, 20 % too fast')
    if settings.iterations < 5:
        found.append(f"mujoco.iterations is {settings.iterations}: contacts of several corners are not resolved")
    if settings.impedance == "default":
        found.append('mujoco.impedance is "default": friction is soft, and what rests on a slope creeps')
    return found


def _cautions_of_fall(scene: Scene) -> list[str]:
    """Parts that fall so fast that they get through the plate before the contact stops them."""
    found = []
    for i, spec in enumerate(scene.scenario.part):
        drop = 1e-3 * spec.start.drop_height_mm[1]
        thrown = abs(spec.start.velocity_mm_s[2]) * 1e-3 if spec.start.kind == "point" else 0.0
        speed = math.hypot(math.sqrt(2.0 * GRAVITY * drop), thrown)
        constant = scene.scenario.contact.time_constant_us
        deep = speed * (scene.timestep if constant is None else SOFT_DEPTH * 1e-6 * constant)
        if deep > 0.5 * scene.surface.thickness:
            found.append(
                f"part[{i}].start: falls onto the plate at {speed:.2g} m/s and {1e3 * deep:.2g} mm into it, more than "
                f"half its thickness of {1e3 * scene.surface.thickness:g} mm, and out of it below"
            )
    return found


def recommendations(scene: Scene) -> list[str]:
    """Models that are cheaper, or simplifications that are not worth what they cost, for this scene."""
    scenario = scene.scenario
    run, found = scenario.run, []
    if run.engine == "mujoco" and scenario.contact.model == "restitution":
        found.append('run.engine = "impulse": the same drift within 3 %, for a small part of the time')
    if run.tangent_surface or run.planar:
        found.append("leave tangent_surface and planar out: the curved surface and six degrees of freedom cost no more")
    if scenario.plate.kind == "piston" and scenario.guide is None and scenario.n_parts == 1:
        found.append(
            'part.guide = { kind = "slide" } if only the vertical motion matters: exact, and ten times cheaper'
        )
    if run.steps_per_period > 2 * FINE:
        found.append(f"run.steps_per_period = {FINE}: finer steps change the drift by a percent")
    ringing = [d for d in scene.drives if d.damping_ratio is not None]
    shortest = min((stage.stop - stage.start for stage in scene.times.stages if stage.excitations), default=math.inf)
    if ringing and shortest < math.inf:
        slowest = max(1.0 / (d.damping_ratio * 2.0 * math.pi * d.natural_frequency) for d in ringing if d.damping_ratio)
        if slowest < LONG_RING_UP * shortest and len(ringing) == len(scene.drives):
            found.append(f"ring_up = false is enough: {slowest:.2g} s against {shortest:.3g} s of driving")
        elif slowest > shortest:
            found.append(f"keep ring_up: it takes {slowest:.2g} s, the shortest stage {shortest:.2g} s")
    if float(np.ptp(scene.surface.table[..., 0], axis=2).max()) > UNEVEN:
        found.append("keep the plate's own modes: a strip of the same frequency is off by more than a half")
    return found or ["nothing: this is the simplest model that carries the effects"]
