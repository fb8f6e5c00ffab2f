"""Scenes that can be computed and that nobody can mean: they are refused, or said to be doubtful.

The stress of a bending wave is sqrt(3) rho c v at the surface, with the plate's density, its speed of sound c =
sqrt(E / rho) and the largest velocity v of its antinodes (Hunt, J. Acoust. Soc. Am. 32 (1960) 1123).
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from feeder_sim.errors import InputError
from feeder_sim.part.corners import MOST_CORNERS
from feeder_sim.part.mesh_part import solid
from feeder_sim.part.rigid_part import RigidPart
from feeder_sim.scenario import GivenState, MeshPart, Placed, Rectangle, Strip, resolve_material
from feeder_sim.scene.overlap import LEAST_IN_PLATE, overlaps, reaching_hulls
from feeder_sim.scene.scene import Scene
from feeder_sim.scene.start import start_poses
from feeder_sim.scene.timetable import largest_together

FASTEST = 100.0  # [m/s] of the surface; plates of feeders reach 1 m/s
MOST_PLACED = 100  # parts, whose overlap at the start is looked at
MOST_DRAWN = 12  # seeds, whose starts are looked at
HIDDEN = 1.1  # volume of a hull over that of its part, from which on what it hides may matter
BREAKS = 1e8  # [Pa] of alternating stress, at which plates of aluminium and steel do not live long


def check_plausible(scene: Scene) -> None:
    """Refuse what no plate or part can be.

    Raises:
        InputError: the drives together bend the plate by more than its thickness or move it absurdly fast, a drive
            never acts, or a part is longer than its plate.
    """
    scenario, surface = scene.scenario, scene.surface
    keys = [key for key, _ in scenario.excitations]
    together = largest_together(scene.times, scene.all_drives)
    if together > surface.thickness:
        raise InputError(
            f"adds up to {1e6 * together:.4g} um of drives that act at once, allowed is up to the plate's thickness, "
            f"{1e6 * surface.thickness:g} um",
            key=f"{keys[0]}, ...",
        )
    speed = largest_together(scene.times, scene.all_drives, speeds=True)
    if speed > FASTEST:
        raise InputError(
            f"moves the surface at {speed:.3g} m/s, allowed is up to {FASTEST:g} m/s with all drives", key=keys[0]
        )
    for i, drive in enumerate(scenario.drive):
        if drive.start_s >= scene.times.duration:
            raise InputError(
                f"is {drive.start_s:g}, allowed is before the end of the run at {scene.times.duration:g} s",
                key=f"drive[{i}].start_s",
            )
    longer = max(surface.length, surface.width)
    for i, (spec, kind) in enumerate(zip(scenario.part, scene.kinds, strict=True)):
        if spec.guide is None and kind.longest > longer:  # a guided part stands on the plate
            raise InputError(
                f"is {1e3 * kind.longest:.4g} mm long, allowed is up to the plate's longer side, {1e3 * longer:.4g} mm",
                key=f"part[{i}]",
            )


def doubts(scene: Scene) -> Iterator[str]:
    """Lines about what one may mean, but hardly does."""
    plate = scene.scenario.plate
    for (key, _), mode in zip(scene.scenario.excitations, scene.driven, strict=True):
        if mode.doubt:
            yield f"{key}: {mode.doubt}"
    if isinstance(plate, Strip) or (isinstance(plate, Rectangle) and plate.mode_file is None):
        material = resolve_material(plate.material or "aluminium")
        speed = largest_together(scene.times, scene.all_drives, speeds=True)
        stress = math.sqrt(3.0 * material.density * material.youngs_modulus) * speed
        if stress > BREAKS:
            yield (
                f"drive: moves the surface at {speed:.2g} m/s, which bends the plate with {1e-6 * stress:.0f} MPa: it "
                "would break before long"
            )
    if len(scene.parts) <= MOST_PLACED:
        yield from _doubts_of_starts(scene)
    shorter = min(scene.surface.length, scene.surface.width)
    for i, (spec, kind) in enumerate(zip(scene.scenario.part, scene.kinds, strict=True)):
        if spec.guide is None and kind.longest > shorter:
            yield f"part[{i}]: is {1e3 * kind.longest:.3g} mm long, more than the plate's side, {1e3 * shorter:.3g} mm"
        if isinstance(spec, MeshPart):
            yield from _doubts_of_contact(spec, kind, i, crowd=len(scene.parts) > 1)


def _doubts_of_starts(scene: Scene) -> Iterator[str]:
    """Lines about parts that lie in each other, in a wall or in the plate where they start, in the first seeds."""
    run, kinds = scene.scenario.run, [type(spec.start) for spec in scene.scenario.part]
    given = Placed in kinds or GivenState in kinds
    off_rest = np.abs(scene.surface.terms.phasor(0.0, scene.surface.n_shapes).real).max(initial=0.0) > LEAST_IN_PLATE
    if not (given or scene.rim or off_rest):
        return
    deepest: dict[str, tuple[float, str]] = {}
    for sequence in np.random.SeedSequence(run.seed).spawn(min(run.seeds, MOST_DRAWN)):
        poses = start_poses(scene, np.random.default_rng(sequence))
        for what, found in overlaps(scene, [pose.place if pose.present else None for pose in poses]).items():
            deepest[what] = max(found, deepest.get(what, found))
    for what, (depth, name) in deepest.items():
        yield f"part.start: {name} starts {1e3 * depth:.2g} mm in {what}: contact will push it out"
    if given and all(pose.present for pose in poses):
        reaching = reaching_hulls(scene, [pose.place for pose in poses])
        if reaching:
            a, b, depth = max(reaching, key=lambda pair: pair[2])
            more = f", and {len(reaching) - 1} more pairs" if len(reaching) > 1 else ""
            yield (
                f"part.start: the hulls of {a} and {b} overlap by {1e3 * depth:.2g} mm{more}: contact will push them "
                "apart"
            )


def _doubts_of_contact(spec: MeshPart, kind: RigidPart, i: int, *, crowd: bool) -> Iterator[str]:
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
