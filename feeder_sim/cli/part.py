"""The command `part`: what a mesh file holds, and how the part comes to lie."""

from __future__ import annotations

import contextlib
import json
import math
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
    from feeder_sim.studies.drops import DropStudy, Throw

CORNER_ERROR_UM = 50.0  # as for the parts of a scenario
MOST_POSES = 26  # printed; JSON has all
MOST_DROPS = 1_000_000
SURE = 3.0  # standard errors beyond which two shares differ
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
    "throw.height": "--throw-height-mm",
    "throw.speed": "--throw-speed-m-s",
    "throw.spin": "--throw-spin-rad-s",
}


def part(
    file: Annotated[Path, typer.Argument(help="Mesh file of one closed body.", show_default=False)],
    material: Annotated[str, typer.Option("--material", help="Name of its material.")] = "steel",
    unit: Annotated[float, typer.Option("--unit", help="Length of one unit of the file [mm].")] = 1.0,
    drops: Annotated[int, typer.Option("--drops", min=0, max=MOST_DROPS, help="Drops on a plate at rest.")] = 2000,
    throws: Annotated[int, typer.Option("--throws", min=0, max=MOST_DROPS, help="Throws on a plate at rest.")] = 0,
    throw_height: Annotated[
        str | None, typer.Option("--throw-height-mm", help="H or LOW:HIGH [four times its longest extent].")
    ] = None,
    throw_speed: Annotated[
        str | None, typer.Option("--throw-speed-m-s", help="Along the plate, V or LOW:HIGH [as it falls on it].")
    ] = None,
    throw_spin: Annotated[
        str | None, typer.Option("--throw-spin-rad-s", help="S or LOW:HIGH [1 rad over its longest extent].")
    ] = None,
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
    study = _dropped(body, drops, None, contact, engine, seed) if drops else None
    with _naming_options(file):
        throw = _throw(body, throw_height, throw_speed, throw_spin)
        thrown = _dropped(body, throws, throw, contact, engine, seed) if throws else None
    if picture is not None:
        _draw(body, study, picture)
    facts = describe(body, spec, study, thrown)
    if as_json:
        print(json.dumps(facts))
        return
    poses, drop_facts, throw_facts = (facts.pop(key) for key in ("stable_poses", "drops", "throws"))
    print(as_lines(facts))
    _print_poses(poses, drop_facts, throw_facts)


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


def _throw(body: RigidPart, height: str | None, speed: str | None, spin: str | None) -> Throw:
    """The throw that the options ask for.

    Raises:
        InputError: an option that is neither a number nor two with a colon between them.
    """
    from feeder_sim.studies.drops import Throw

    def bounds(option: str, text: str | None, unit: float = 1.0) -> tuple[float, float] | None:
        if text is None:
            return None
        try:
            low, _, high = text.partition(":")
            return unit * float(low), unit * float(high or low)
        except ValueError:
            raise InputError(f"is {text!r}, must be a number or LOW:HIGH", key=option) from None

    return Throw.of(
        body,
        bounds("--throw-height-mm", height, 1e-3),
        bounds("--throw-speed-m-s", speed),
        bounds("--throw-spin-rad-s", spin),
    )


def _dropped(
    body: RigidPart, drops: int, throw: Throw | None, contact: Contact, engine: Any, seed: int
) -> DropStudy | None:
    from feeder_sim.part.stable_poses import stable_poses
    from feeder_sim.pool.work import Work
    from feeder_sim.studies.drops import drop

    if not stable_poses(body).poses:
        return None
    with at_terminal(Work(), f"{drops} {'throws' if throw else 'drops'} of {body.name}") as work:
        return drop(body, drops, throw=throw, contact=contact, engine=engine, seed=seed, work=work)


def _draw(body: RigidPart, study: DropStudy | None, picture: Path) -> None:
    from feeder_sim.part.stable_poses import stable_poses
    from feeder_sim.plots.poses import draw_poses

    poses = stable_poses(body).poses
    if not poses:
        print("feeder-sim: no picture: the part lies on any side and has no stable poses", file=sys.stderr)
        return
    draw_poses(body, poses, picture, study)


def describe(
    body: RigidPart, spec: MeshPart, study: DropStudy | None, thrown: DropStudy | None = None
) -> dict[str, Any]:
    """Everything about a part from a mesh file as JSON takes it; units in the names."""
    import numpy as np

    from feeder_sim.measures.protocol import as_json
    from feeder_sim.part.mesh_part import solid
    from feeder_sim.part.stable_poses import stable_poses

    shape = solid(body)
    poses = []
    for i, pose in enumerate(stable_poses(body).poses):
        share, thrown_share = (each.shares[i] if each else None for each in (study, thrown))
        poses.append(
            {
                "name": pose.name,
                "height_mm": 1e3 * pose.height,
                "yaws": pose.yaws,
                "quasi_static_chance": pose.chance,
                "share": share.value if share else None,
                "se": share.standard_error if share else None,
                "thrown_share": thrown_share.value if thrown_share else None,
                "thrown_se": thrown_share.standard_error if thrown_share else None,
                "thrown_tries": as_json(thrown_share.tries) if thrown_share else None,
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
        "drops": {"drops": len(study.pose), **_facts_of(study)} if study else None,
        "throws": {"throws": len(thrown.pose), **_facts_of(thrown)} if thrown else None,
    }


def _facts_of(study: DropStudy) -> dict[str, Any]:
    return {
        "engine": study.engine,
        "restitution": study.contact.restitution,
        "friction": study.contact.friction,
        "height_mm": [1e3 * height for height in study.throw.height],
        "speed_m_s": list(study.throw.speed),
        "spin_rad_s": list(study.throw.spin),
        "other_share": study.other / len(study.pose),
        "still_moving": study.moving,
    }


def _print_poses(poses: list[dict[str, Any]], drops: dict[str, Any] | None, throws: dict[str, Any] | None) -> None:
    """A table of the poses, and what belongs to its shares."""
    if not poses:
        print("stable poses: none, the part lies on any side")
        return
    rows = [
        {"pose": pose["name"], "height_mm": pose["height_mm"], "yaws": pose["yaws"]}
        | {"put_down_slowly_percent": 100.0 * pose["quasi_static_chance"]}
        | ({"dropped_percent": 100.0 * pose["share"], "se_percent": 100.0 * pose["se"]} if drops else {})
        | (
            {"thrown_percent": 100.0 * pose["thrown_share"], "thrown_se_percent": 100.0 * pose["thrown_se"]}
            if throws
            else {}
        )
        for pose in poses[:MOST_POSES]
    ]
    print_rows(rows)
    if len(poses) > MOST_POSES:
        print(f"and {len(poses) - MOST_POSES} more, with --json")
    for name, facts in (("drops", drops), ("throws", throws)):
        if facts:
            other = f"other: {100.0 * facts['other_share']:.2g} % of {facts[name]} {name} by {facts['engine']}"
            print(
                f"{other}, restitution {facts['restitution']:g}, friction {facts['friction']:g}"
                + (f"; {facts['still_moving']} were still moving" if facts["still_moving"] else "")
            )
    if drops and throws:
        moved = [pose["name"] for pose in poses if _differ(pose)]
        print(f"shares that depend on how it falls: {', '.join(moved) or 'none'}")
    elif drops and len(poses) > 1:
        print("shares may depend on how the part falls: --throws 1000 says by how much")


def _differ(pose: dict[str, Any]) -> bool:
    """Whether a pose has other shares of drops and of throws, by more than chance."""
    return bool(abs(pose["share"] - pose["thrown_share"]) > SURE * math.hypot(pose["se"], pose["thrown_se"]))
