"""The command `part`: what a mesh file holds, and how the part comes to lie."""

from __future__ import annotations

import contextlib
import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from feeder_sim.cli.files import new_picture, writable
from feeder_sim.cli.report import as_lines, print_rows
from feeder_sim.cli.terminal import at_terminal
from feeder_sim.errors import InputError, printable

if TYPE_CHECKING:
    from feeder_sim.part.rigid_part import RigidPart
    from feeder_sim.scenario import Contact, MeshPart
    from feeder_sim.studies.drops import DropStudy

CORNER_ERROR_UM = 50.0  # as for the parts of a scenario
MOST_POSES = 26  # printed; JSON has all
MOST_DROPS = 1_000_000
OPTIONS = {  # by the key that a scenario has for it; None: the file, which is named anyway
    "file": None,
    "part": None,
    "part.file": None,
    "part.pieces": "--pieces",
    "file_unit_mm": "--unit",
    "corner_error_um": "--corner-error",
    "material": "--material",
    "restitution": "--restitution",
    "friction": "--friction",
}


def part(
    file: Annotated[Path, typer.Argument(help="Mesh file of one closed body.", show_default=False)],
    material: Annotated[str, typer.Option("--material", help="Name of its material.")] = "steel",
    unit: Annotated[float, typer.Option("--unit", help="Length of one unit of the file [mm].")] = 1.0,
    drops: Annotated[int, typer.Option("--drops", min=0, max=MOST_DROPS, help="Drops on a plate at rest.")] = 2000,
    engine: Annotated[str, typer.Option("--engine", help="Engine of the drops.")] = "impulse",
    restitution: Annotated[float | None, typer.Option("--restitution", help="Of part and plate [0.2].")] = None,
    friction: Annotated[float | None, typer.Option("--friction", help="Of part and plate [0.3].")] = None,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Root of the random attitudes.")] = 0,
    corner_error: Annotated[
        float, typer.Option("--corner-error", min=0.0, help="Of the contact corners [um].")
    ] = CORNER_ERROR_UM,
    pieces: Annotated[
        bool, typer.Option("--pieces", help="Cut it into convex pieces and write them to STEM_pieces.obj beside it.")
    ] = False,
    piece_error: Annotated[
        float | None, typer.Option("--piece-error-mm", help="Error of the pieces [mm]; else 1 % of the longest side.")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace existing pieces.")] = False,
    picture: Annotated[Path | None, typer.Option("--picture", help="Draw the stable poses to this file.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout.")] = False,
) -> None:
    """Describe a part of your own: mass, inertia, contact corners, stable poses and how often it falls into each."""
    from feeder_sim.scene.part import build_part

    if picture is not None:
        new_picture(picture)
    if piece_error is not None and not pieces:
        raise InputError("belongs to --pieces, which is missing", file=file, key="--piece-error-mm")
    with _naming_options(file):
        spec, contact = _spec(file, material, unit, corner_error), _contact(file, engine, restitution, friction)
        if pieces:
            spec = _cut(spec, piece_error, force=force)
        body = build_part(spec, name=printable(file.stem))
    study = _dropped(body, drops, contact, engine, seed) if drops else None
    if picture is not None:
        _draw(body, study, picture)
    facts = describe(body, spec, study)
    if as_json:
        print(json.dumps(facts))
        return
    poses, drop_facts = facts.pop("stable_poses"), facts.pop("drops")
    print(as_lines(facts))
    _print_poses(poses, drop_facts)


@contextlib.contextmanager
def _naming_options(file: Path) -> Iterator[None]:
    """Let each InputError that is raised in the block name an option where it names a key of a scenario."""
    try:
        yield
    except InputError as error:
        key = None if error.key is None else OPTIONS.get(error.key, error.key)
        named = file if error.key == "part" else error.file
        raise InputError(error.problem.replace("file_unit_mm", "--unit"), file=named, key=key) from error


def _spec(file: Path, material: str, unit: float, corner_error: float) -> MeshPart:
    from feeder_sim.scenario import MeshPart
    from feeder_sim.scenario.tables import validated

    values = {
        "shape": "mesh",
        "file": file,
        "file_unit_mm": unit,
        "material": material,
        "corner_error_um": corner_error,
    }
    return validated(values, MeshPart, file)


def _cut(spec: MeshPart, error_mm: float | None, *, force: bool) -> MeshPart:
    """Write the convex pieces of a part beside its mesh; returns the part with them."""
    from feeder_sim.part.mesh_file import closed_mesh
    from feeder_sim.part.pieces import make_pieces, pieces_beside, write_pieces

    path = pieces_beside(spec.file)
    if path.is_file() and not force:
        raise InputError("exists already, --force replaces it", file=path, key="--pieces")
    writable(path, force=force)
    mesh = closed_mesh(spec.file, spec.file_unit_mm)
    pieces, how = make_pieces(mesh, spec.file_unit_mm, error_mm)
    write_pieces(path, pieces, spec.file, how)
    return spec.model_copy(update={"contact": "parts", "pieces": path})


def _contact(file: Path, engine: str, restitution: float | None, friction: float | None) -> Contact:
    """The contact that the options ask for.

    Raises:
        InputError: a value that is not allowed, or an engine that is not known.
    """
    from feeder_sim.scenario import Contact
    from feeder_sim.scenario.tables import validated
    from feeder_sim.studies.drops import ENGINES

    if engine not in ENGINES:
        raise InputError(f"is {engine!r}, must be {', '.join(ENGINES)}", key="--engine")
    options = {"restitution": restitution, "friction": friction}
    return validated({name: value for name, value in options.items() if value is not None}, Contact, file)


def _dropped(body: RigidPart, drops: int, contact: Contact, engine: Any, seed: int) -> DropStudy | None:
    from feeder_sim.part.stable_poses import stable_poses
    from feeder_sim.pool.work import Work
    from feeder_sim.studies.drops import drop

    if not stable_poses(body).poses:
        return None
    with at_terminal(Work(), f"{drops} drops of {body.name}") as work:
        return drop(body, drops, contact=contact, engine=engine, seed=seed, work=work)


def _draw(body: RigidPart, study: DropStudy | None, picture: Path) -> None:
    from feeder_sim.part.stable_poses import stable_poses
    from feeder_sim.plots.poses import draw_poses

    poses = stable_poses(body).poses
    if not poses:
        print("feeder-sim: no picture: the part lies on any side and has no stable poses", file=sys.stderr)
        return
    draw_poses(body, poses, picture, study)


def describe(body: RigidPart, spec: MeshPart, study: DropStudy | None) -> dict[str, Any]:
    """Everything about a part from a mesh file as JSON takes it; units in the names."""
    import numpy as np

    from feeder_sim.part.mesh_part import solid
    from feeder_sim.part.stable_poses import stable_poses

    shape = solid(body)
    poses = []
    for i, pose in enumerate(stable_poses(body).poses):
        share = study.shares[i] if study else None
        poses.append(
            {
                "name": pose.name,
                "height_mm": 1e3 * pose.height,
                "yaws": pose.yaws,
                "quasi_static_chance": pose.chance,
                "share": share.value if share else None,
                "se": share.standard_error if share else None,
            }
        )
    return {
        "file": str(spec.file),
        "file_unit_mm": spec.file_unit_mm,
        "size_mm": (1e3 * np.ptp(body.vertices, axis=0)).tolist(),
        "volume_mm3": 1e9 * shape.volume,
        "mass_g": 1e3 * body.mass,
        "centre_mm": (1e3 * body.centre).tolist(),
        "inertia_g_mm2": (1e9 * body.inertia).tolist(),
        "principal_axes": body.principal_axes.tolist(),
        "watertight": True,  # no other file is read
        "facets": len(body.faces),
        "dropped_facets": body.dropped_facets,  # without area
        "corners": len(body.corners),
        "corner_error_um": 1e6 * body.corner_error,
        "hull_over_volume": shape.hull_over_volume,
        "pieces": len(body.pieces),
        "stable_poses": poses,
        "drops": {
            "drops": len(study.pose),
            "engine": study.engine,
            "restitution": study.contact.restitution,
            "friction": study.contact.friction,
            "other_share": study.other / len(study.pose),
            "still_moving": study.moving,
        }
        if study
        else None,
    }


def _print_poses(poses: list[dict[str, Any]], drops: dict[str, Any] | None) -> None:
    """A table of the poses, and what belongs to its shares."""
    if not poses:
        print("stable poses: none, the part lies on any side")
        return
    rows = [
        {"pose": pose["name"], "height_mm": pose["height_mm"], "yaws": pose["yaws"]}
        | {"put_down_slowly_percent": 100.0 * pose["quasi_static_chance"]}
        | ({"dropped_percent": 100.0 * pose["share"], "se_percent": 100.0 * pose["se"]} if drops else {})
        for pose in poses[:MOST_POSES]
    ]
    print_rows(rows)
    if len(poses) > MOST_POSES:
        print(f"and {len(poses) - MOST_POSES} more, with --json")
    if drops:
        print(
            f"other: {100.0 * drops['other_share']:.2g} % of {drops['drops']} drops by {drops['engine']}, restitution "
            f"{drops['restitution']:g}, friction {drops['friction']:g}"
            + (f"; {drops['still_moving']} were still moving" if drops["still_moving"] else "")
        )
