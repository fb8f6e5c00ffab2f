"""`feeder-sim modes import`: measured or computed mode shapes of any plate, from files of other programs."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from feeder_sim.cli.files import file_in_errors, new_picture, writable
from feeder_sim.errors import InputError, Unknown, printable

if TYPE_CHECKING:
    from feeder_sim.plate.imported.measured_shapes import MeasuredShapes
    from feeder_sim.plate.imported.modes import Imported
    from feeder_sim.plate.materials import Material

UNIVERSAL, TABLE = (".unv", ".uff"), ".csv"
LONGEST_TABLE = 500_000_000  # bytes


def import_modes_command(
    source: Annotated[
        Path, typer.Argument(metavar="FILE", help="Universal file (.unv, .uff), or table (.csv).", show_default=False)
    ],
    *,
    thickness: Annotated[float | None, typer.Option("--thickness", help="Thickness of the plate [mm]; needed.")] = None,
    out: Annotated[Path | None, typer.Option("--out", help="Write the modes to this HDF5 file.")] = None,
    material: Annotated[str, typer.Option("--material", help="Material of the plate, a name of `list`.")] = "aluminium",
    outline: Annotated[
        Path | None, typer.Option("--outline", help="Outline file (.toml) [the outline of the points].")
    ] = None,
    actuators: Annotated[
        Path | None, typer.Option("--actuators", help="File (.toml) of [[actuator]] tables, places as in FILE.")
    ] = None,
    unit: Annotated[
        str | None, typer.Option("--unit", help="Length of a universal file without units: m, mm, cm, in.")
    ] = None,
    picture: Annotated[
        Path | None, typer.Option("--picture", help="Draw points beside smooth shapes to this file.")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace an existing --out file.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout.")] = False,
) -> None:
    """Bring in mode shapes from a measurement or another program; check, store and draw them."""
    if thickness is None:
        raise InputError("is missing, must be the thickness of the plate in mm", file=source, key="--thickness")
    if not 1e-3 <= thickness <= 1e5:
        raise InputError(f"is {thickness:g}, must be 0.001 to 100000 mm", key="--thickness")
    of = _material(material)
    if out is not None:
        writable(out, force=force)
    if picture is not None:
        new_picture(picture)
    from feeder_sim.plate.imported.modes import import_modes

    edge = None
    if outline is not None:
        from feeder_sim.scene.outlines import read_outline_file

        edge = read_outline_file(outline)
    shapes = _read(source, unit, 1e-3 * thickness)
    with file_in_errors(source):
        imported = import_modes(shapes, thickness=1e-3 * thickness, material=of, outline=edge, source=source.name)
    mode_file = imported.mode_file
    if actuators is not None:
        from feeder_sim.scenario import load_actuator_file
        from feeder_sim.scene.attachments import with_actuators

        with file_in_errors(actuators):
            mode_file = with_actuators(mode_file, load_actuator_file(actuators).actuator)
    if out is not None:
        from feeder_sim.plate.mode_file import write_mode_file

        write_mode_file(out, mode_file)
    if picture is not None:
        from feeder_sim.plots.pictures import draw_imported

        draw_imported(imported, picture)
    _print(imported, as_json)
    for warning in imported.warnings:
        print(f"feeder-sim: warning: {printable(warning)}", file=sys.stderr)


def _material(name: str) -> Material:
    from feeder_sim.plate.materials import MATERIALS

    if name not in MATERIALS:
        raise Unknown(name, MATERIALS, key="--material")
    return MATERIALS[name]


def _read(source: Path, unit: str | None, thickness: float) -> MeasuredShapes:
    """The shapes in a file, by the suffix of its name."""
    from feeder_sim.plate.imported.universal_file import LENGTHS, read_universal_file

    suffix = source.suffix.lower()
    if suffix not in (*UNIVERSAL, TABLE):
        allowed = ", ".join((*UNIVERSAL, TABLE))
        raise InputError(f"is {source.suffix!r}, must be {allowed}", file=source, key="suffix")
    if unit is not None and (unit not in LENGTHS or suffix == TABLE):
        allowed = "none with a table, whose columns say mm" if suffix == TABLE else f"one of {', '.join(LENGTHS)}"
        raise InputError(f"is {unit!r}, must be {allowed}", file=source, key="--unit")
    if suffix in UNIVERSAL:
        if not source.is_file():
            raise InputError("no such file", file=source)
        return read_universal_file(source, unit, thickness)
    from feeder_sim.plate.imported.shapes_csv import read_shapes_csv
    from feeder_sim.scenario.tables import read_text

    return read_shapes_csv(read_text(source, LONGEST_TABLE), source)


def _print(imported: Imported, as_json: bool) -> None:
    """Print what has become of the modes, in words or as one JSON object."""
    rows, mode_file = _rows(imported), imported.mode_file
    modes, shift = mode_file.modes, mode_file.origin.shift if mode_file.origin else (0.0, 0.0)
    size = [round(1e3 * d, 4) for d in (modes.plate.length, modes.plate.width, modes.plate.thickness)]
    outline = imported.outline
    if as_json:
        plate = {
            "plate_mm": size,
            "shift_mm": [1e3 * s for s in shift],
            "outline_corners": len(outline.exterior),
            "holes": len(outline.holes),
            "area_mm2": 1e6 * outline.polygon.area,
            "points": len(imported.points),
        }
        print(json.dumps(plate | {"modes": rows, "warnings": list(imported.warnings)}))
        return
    holes = f", {len(outline.holes)} hole{'s' if len(outline.holes) > 1 else ''}" if outline.holes else ""
    kind = "rectangle" if modes.outline is None else f"outline with {len(outline.exterior)} corners{holes}"
    print(f"plate {size[0]:g} x {size[1]:g} x {size[2]:g} mm, {kind}, {len(imported.points)} points")
    print(
        f"moved by ({1e3 * shift[0]:.4g}, {1e3 * shift[1]:.4g}) mm, so that its bounding box is centred on the origin"
    )
    print("mode  frequency (Hz)  damping   modal mass (g)  residual  condition  points  collinear   MAC  rectangle's")
    for row in rows:
        damping = "-" if row["damping_ratio"] is None else f"{row['damping_ratio']:.5f}"
        alike = "-" if row["mac"] is None else f"{row['mac']:.2f}"
        which = "-" if row["mac"] is None else f"{'+'.join(map(str, row['resembles']))}, {row['resembles_hz']:.0f} Hz"
        print(
            f"{row['mode']:>4}  {row['frequency_hz']:>14.1f}  {damping:>7}  {row['modal_mass_g']:>15.4g}"
            f"{'*' if row['modal_mass_of_file'] else ' '} {row['residual']:>8.1e}  {row['condition']:>9.1e}"
            f"  {row['points_per_half_wavelength']:>6.1f}  {row['collinearity']:>9.3f}  {alike:>4}  {which}"
        )
    if any(row["modal_mass_of_file"] for row in rows):
        print("* modal mass as given in the file")


def _rows(imported: Imported) -> list[dict[str, Any]]:
    mode_file = imported.mode_file
    damping = {r.mode: r.damping_ratio for r in mode_file.resonances}
    rows = []
    for i, quality in enumerate(imported.quality):
        alike = quality.resembles
        rows.append(
            {
                "mode": i + 1,
                "frequency_hz": float(mode_file.modes.natural_frequency[i]),
                "damping_ratio": damping.get(i),
                "modal_mass_g": 1e3 * float(mode_file.modes.modal_mass[i]),
                "modal_mass_of_file": quality.mass_of_file,
                "rotations_of_file": quality.with_rotations,
                "residual": quality.residual,
                "condition": quality.condition,
                "points_per_half_wavelength": quality.points_per_half_wavelength,
                "collinearity": quality.collinearity,
                "mac": alike.mac if alike else None,
                "resembles": [mode + 1 for mode in alike.modes] if alike else [],
                "resembles_hz": alike.frequency if alike else None,
            }
        )
    return rows
