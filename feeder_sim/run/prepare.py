"""Scenario -> everything that is decided before a run: scene, engine, cell, warnings."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from feeder_sim.constants import GRAVITY
from feeder_sim.errors import InputError
from feeder_sim.notebook import counted
from feeder_sim.part.corners import MOST_CORNERS
from feeder_sim.part.mesh_part import solid
from feeder_sim.part.rigid_part import RigidPart
from feeder_sim.scenario import BendingPlate, GivenState, MeshPart, Placed, Scenario, Strip, resolve_material
from feeder_sim.scenario.engine_choice import Choice, choose_engine
from feeder_sim.scenario.rules import findings_of_level
from feeder_sim.scene.cell import check_stop_rule, transport_cell
from feeder_sim.scene.overlap import LEAST_IN_PLATE, check_fixtures, overlaps, reaching_hulls
from feeder_sim.scene.prepared import Prepared
from feeder_sim.scene.scene import Scene, build_scene
from feeder_sim.scene.start import start_poses
from feeder_sim.scene.timetable import largest_together
from feeder_sim.scene.under_parts import motion_under_parts
from feeder_sim.single_thread import single_threaded

# Scenes that can be computed and that nobody can mean: they are refused, or said to be doubtful.
#
# The stress of a bending wave is sqrt(3) rho c v at the surface, with the plate's density, its speed of sound c =
# sqrt(E / rho) and the largest velocity v of its antinodes (Hunt, J. Acoust. Soc. Am. 32 (1960) 1123).

FASTEST = 100.0  # [m/s] of the surface; plates of feeders reach 1 m/s
MOST_PLACED = 100  # parts, whose overlap at the start is looked at
MOST_DRAWN = 12  # seeds, whose starts are looked at
HIDDEN = 1.1  # volume of a hull over that of its part, from which on what it hides may matter
BREAKS = 1e8  # [Pa] of alternating stress, at which plates of aluminium and steel do not live long


def check_plausible(scene: Scene) -> None:
    """Refuse what no plate or part can be.

    Raises:
        InputError: the drives together bend the plate by more than its thickness or move it absurdly fast, a drive
            never acts, a part is longer than its plate, or fixtures are in each other.
    """
    check_fixtures(scene)
    scenario, surface = scene.scenario, scene.surface
    keys = [key for key, _ in scenario.excitations]
    together = largest_together(scene.times, scene.all_drives)
    if together > surface.thickness and scenario.plate.kind != "tray":
        raise InputError(
            f"adds up to {1e6 * together:.4g} um of drives that act at once, must be up to the plate's thickness, "
            f"{1e6 * surface.thickness:g} um",
            key=f"{keys[0]}, ...",
        )
    speed = largest_together(scene.times, scene.all_drives, speeds=True)
    if speed > FASTEST:
        raise InputError(
            f"moves the surface at {speed:.3g} m/s, must be up to {FASTEST:g} m/s with all drives", key=keys[0]
        )
    for i, drive in enumerate(scenario.drive):
        if drive.start_s >= scene.times.duration:
            raise InputError(
                f"is {drive.start_s:g}, must be before the end of the run at {scene.times.duration:g} s",
                key=f"drive[{i}].start_s",
            )
    longer = max(surface.length, surface.width)
    for i, (spec, kind) in enumerate(zip(scenario.part, scene.kinds, strict=True)):
        if spec.guide is None and kind.longest > longer:  # a guided part stands on the plate
            raise InputError(
                f"is {1e3 * kind.longest:.4g} mm long, must be up to the plate's longer side, {1e3 * longer:.4g} mm",
                key=f"part[{i}]",
            )


def plausibility_warnings(scene: Scene) -> Iterator[str]:
    """Lines about what one may mean, but hardly does."""
    plate = scene.scenario.plate
    for (key, _), mode in zip(scene.scenario.excitations, scene.driven, strict=True):
        if mode.doubt:
            yield f"{key}: {mode.doubt}"
    yield from _jump_warnings(scene)
    yield from _outlet_warnings(scene)
    if isinstance(plate, Strip | BendingPlate):
        material = resolve_material(plate.material)
        speed = largest_together(scene.times, scene.all_drives, speeds=True)
        stress = math.sqrt(3.0 * material.density * material.youngs_modulus) * speed
        if stress > BREAKS:
            yield (
                f"drive: moves the surface at {speed:.2g} m/s, which bends the plate with {1e-6 * stress:.0f} MPa: it "
                "would break before long"
            )
    if len(scene.parts) <= MOST_PLACED:
        yield from _start_warnings(scene)
    shorter = min(scene.surface.length, scene.surface.width)
    for i, (spec, kind) in enumerate(zip(scene.scenario.part, scene.kinds, strict=True)):
        if spec.guide is None and kind.longest > shorter:
            yield f"part[{i}]: is {1e3 * kind.longest:.3g} mm long, more than the plate's side, {1e3 * shorter:.3g} mm"
        if isinstance(spec, MeshPart):
            yield from _contact_warnings(spec, kind, i, crowd=len(scene.parts) > 1)


def _jump_warnings(scene: Scene) -> Iterator[str]:
    """A line where drives without ring-up begin or end off zero, so that the surface jumps into or away from parts."""
    times, jump = scene.surface.terms.jumps(scene.surface.n_shapes)
    within = (times > 0.0) & (times < scene.times.duration - scene.frame_interval)
    times, sizes = times[within], np.abs(jump[within]) @ scene.surface.extremes[0]
    number = int((sizes > LARGEST_JUMP).sum())
    if not number:
        return
    size, time = float(sizes.max()), float(times[sizes.argmax()])
    stage = next((stage for stage in scene.times.stages if stage.start <= time <= stage.stop), None)
    name = f'stage "{stage.name}" of cycle {stage.cycle}, ' if stage is not None and stage.name else ""
    more = f", the largest of {number} jumps" if number > 1 else ""
    yield (
        f"ring_up: is false, and the surface jumps by up to {1e6 * size:.3g} um at {name}{time:.6g} s{more}: parts on "
        "it may be stopped as too deep in the plate; ring_up = true, or a duration of whole half periods, avoids it"
    )


def _outlet_warnings(scene: Scene) -> Iterator[str]:
    """A line for each outlet that no part can reach: beyond a rim, or within a fixture."""
    half = 0.5 * np.array([scene.surface.length, scene.surface.width])
    for i, outlet in enumerate(scene.outlets):
        is_beyond = (outlet.outline.min(axis=0) >= half) | (outlet.outline.max(axis=0) <= -half)
        if scene.rim and is_beyond.any():
            yield f"outlet[{i}]: lies beside the plate, whose rim no part passes: nothing reaches it"
        corners = [[x, y, z] for x, y in outlet.outline for z in (outlet.low, outlet.high)]
        for fixture in scene.fixtures if np.isfinite(outlet.low) else ():
            from scipy.spatial import Delaunay

            if any(Delaunay(body).find_simplex(corners).min() >= 0 for body in fixture.in_space):
                yield f"outlet[{i}]: lies within {fixture.name}: nothing reaches it"


def _start_warnings(scene: Scene) -> Iterator[str]:
    """Lines about parts that lie in each other, in a wall or in the plate where they start, in the first seeds."""
    run, kinds = scene.scenario.run, [type(spec.start) for spec in scene.scenario.part]
    is_prescribed = Placed in kinds or GivenState in kinds
    is_bent = np.abs(scene.surface.terms.phasor(0.0, scene.surface.n_shapes).real).max(initial=0.0) > LEAST_IN_PLATE
    if not (is_prescribed or scene.rim or is_bent):
        return
    deepest: dict[str, tuple[float, str]] = {}
    for sequence in np.random.SeedSequence(run.seed).spawn(min(run.seeds, MOST_DRAWN)):
        poses = start_poses(scene, np.random.default_rng(sequence))
        for what, overlap in overlaps(scene, [pose.place if pose.present else None for pose in poses]).items():
            deepest[what] = max(overlap, deepest.get(what, overlap))
    for what, (depth, name) in deepest.items():
        yield f"part.start: {name} starts {1e3 * depth:.2g} mm in {what}: contact will push it out"
    if is_prescribed and all(pose.present for pose in poses):
        reaching = reaching_hulls(scene, [pose.place for pose in poses])
        if reaching:
            a, b, depth = max(reaching, key=lambda pair: pair[2])
            more = f", and {len(reaching) - 1} more pairs" if len(reaching) > 1 else ""
            yield (
                f"part.start: the hulls of {a} and {b} overlap by {1e3 * depth:.2g} mm{more}: contact will push them "
                "apart"
            )


def _contact_warnings(spec: MeshPart, kind: RigidPart, i: int, *, crowd: bool) -> Iterator[str]:
    """Lines about what the corners of a mesh leave out, and in a crowd its hull."""
    if 1e6 * kind.corner_error > 1.001 * spec.corner_error_um:
        yield (
            f"part[{i}].corner_error_um: is {spec.corner_error_um:g}, {len(kind.corners)} corners leave "
            f"{1e6 * kind.corner_error:.3g} um, and no part gets more than {MOST_CORNERS}"
        )
    hidden = solid(kind).hull_over_volume
    if spec.contact == "hull" and crowd and hidden > HIDDEN:
        yield (
            f"part[{i}]: its hull has {hidden:.2g} times its volume: parts cannot hook or nest; contact = "
            '"parts" keeps its shape'
        )


# Warnings about settings that are known to mislead, and recommendations of cheaper models for a scene.
#
# docs/choosing.md discusses the numbers in these texts.

COMPLIANT_DEPTH = 0.37  # 1/e: largest depth of a critically damped contact, over speed times time constant
THROUGH = 0.5  # of the thickness; a part that gets deeper into the plate may leave it on the lower side
LARGEST_JUMP = 1e-6  # [m] of the surface; parts on a plate lie as deep in it by round-off of a step
SHORT_RING_UP = 0.1  # of the time for which a drive acts; a shorter ring-up can be left out
UNEVEN_WIDTH = 0.1  # of the antinode; a mode that varies more across the plate is not that of a strip
FINE_STEPS = 40  # per period; more steps change the drift by a percent
USUAL_SPEED = 0.06  # [m/s], velocity amplitude of plates under parts: 1 um at 8775 Hz, 3.4 um at 2797 Hz
MUCH_FASTER = 5.0  # than usual: parts hop by a centimetre and more
MOST_ACCELERATION = 2000.0  # [g]; what drives move plates with


def setting_warnings(scene: Scene, engine: Choice) -> list[str]:
    """Settings of a scene that are known to give wrong numbers: key, value and effect, a line each."""
    scenario = scene.scenario
    lines = [*findings_of_level(scenario, "unstable"), *_motion_warnings(scene)]
    lines += [*ignored_uncertainty(scenario), *findings_of_level(scenario, "misleading")]
    lines += [
        f"part[{i}].file: has {counted(kind.dropped_facets, 'facet')} of no area, which the part does without"
        for i, kind in enumerate(scene.kinds)
        if kind.dropped_facets
    ]
    return lines + (_fall_warnings(scene) if engine.name == "mujoco" else [])


def ignored_uncertainty(scenario: Scenario) -> list[str]:
    """The warning about uncertain inputs, wherever a scenario is run as it is and no values of them are drawn."""
    keys = ", ".join(scenario.uncertain or ())
    return (
        [f"{keys}: uncertain inputs, which have the values of the scenario here; `uncertainty` draws them"]
        if keys
        else []
    )


def _motion_warnings(scene: Scene) -> list[str]:
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


def _fall_warnings(scene: Scene) -> list[str]:
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


@single_threaded
def prepare(scenario: Scenario) -> Prepared:
    """Resolve a scenario.

    Raises:
        InputError: the plate, a drive, a part or a start cannot be had, the start does not suit the stop rule, or
            nobody can mean it.
    """
    scene, engine = build_scene(scenario), choose_engine(scenario)
    check_plausible(scene)
    cell = transport_cell(scene)
    check_stop_rule(scene, cell)
    return Prepared(scene, engine, cell, (*setting_warnings(scene, engine), *plausibility_warnings(scene)))
