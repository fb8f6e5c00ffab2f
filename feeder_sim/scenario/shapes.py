"""The shapes of parts: a table each, and the solid that it makes. Other packages add theirs (`extensions`)."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Self

from pydantic import Field, SerializeAsAny, ValidationError, WrapValidator, model_validator

from feeder_sim import extensions
from feeder_sim.errors import InputError
from feeder_sim.part.pieces import pieces_beside
from feeder_sim.part.rigid_part import RigidPart
from feeder_sim.part.solids import ISO_4032, ball, box, cylinder, dimer, hex_nut
from feeder_sim.scenario.part import PartTable
from feeder_sim.scenario.tables import LengthMm, first_error

CORNER_ERROR_UM = 50.0  # of the corners of a mesh; see docs/parts.md for what it changes
ROD = 0.2  # diameter of a dimer's rod over that of its balls, where none is given


class HexNut(PartTable):
    """Hexagon nut, by metric size (ISO 4032) or by dimensions."""

    sizes: ClassVar[str] = "sizes " + ", ".join(ISO_4032) + ", or by dimensions"
    shape: Literal["hex_nut"] = "hex_nut"
    size: Literal["M2", "M2.5", "M3", "M4", "M5"] | None = None
    across_flats_mm: LengthMm | None = None
    height_mm: LengthMm | None = None
    bore_mm: Annotated[float, Field(ge=0, le=1e5, strict=True)] | None = None

    @model_validator(mode="after")
    def _size_or_dimensions(self) -> Self:
        dimensions = (self.across_flats_mm, self.height_mm, self.bore_mm)
        is_set = [dimension is not None for dimension in dimensions]
        if any(is_set) if self.size is not None else not all(is_set):
            raise ValueError("give either size or all of across_flats_mm, height_mm, bore_mm")
        if self.bore_mm is not None and self.across_flats_mm is not None and self.bore_mm >= self.across_flats_mm:
            raise ValueError(f"bore_mm is {self.bore_mm}, must be less than across_flats_mm")
        return self

    @property
    def dimensions_mm(self) -> tuple[float, float, float]:
        """Across flats, height, bore [mm]."""
        if self.size is not None:
            return ISO_4032[self.size]
        assert self.across_flats_mm is not None and self.height_mm is not None and self.bore_mm is not None
        return self.across_flats_mm, self.height_mm, self.bore_mm

    def solid(self, density: float, name: str) -> RigidPart:
        across, height, bore = (1e-3 * length for length in self.dimensions_mm)
        return hex_nut(across, height, bore, density, name)

    @property
    def label(self) -> str:
        return f"nut {self.size or f'{self.across_flats_mm:g} x {self.height_mm:g} mm'}"


class Ball(PartTable):
    """Solid sphere."""

    sizes: ClassVar[str] = "diameter_mm"
    shape: Literal["ball"]
    diameter_mm: LengthMm

    def solid(self, density: float, name: str) -> RigidPart:
        return ball(1e-3 * self.diameter_mm, density, name)

    @property
    def label(self) -> str:
        return f"ball {self.diameter_mm:g} mm"


class Cylinder(PartTable):
    """Solid circular cylinder, axis upright at the start."""

    sizes: ClassVar[str] = "diameter_mm, height_mm"
    shape: Literal["cylinder"]
    diameter_mm: LengthMm
    height_mm: LengthMm

    def solid(self, density: float, name: str) -> RigidPart:
        return cylinder(1e-3 * self.diameter_mm, 1e-3 * self.height_mm, density, name)

    @property
    def label(self) -> str:
        return f"cylinder {self.diameter_mm:g} x {self.height_mm:g} mm"


class Box(PartTable):
    """Solid block, with its sides along x, y and z as drawn."""

    sizes: ClassVar[str] = "size_mm"
    shape: Literal["box"]
    size_mm: tuple[LengthMm, LengthMm, LengthMm]

    def solid(self, density: float, name: str) -> RigidPart:
        x, y, z = (1e-3 * side for side in self.size_mm)
        return box((x, y, z), density, name)

    @property
    def label(self) -> str:
        return "box " + " x ".join(f"{side:g}" for side in self.size_mm) + " mm"


class Dimer(PartTable):
    """Two solid balls, rigidly joined by a rod, lying at the start; alone on a plate without rim.

    The rod has no mass unless `rod_density_kg_m3` says so, and touches nothing.
    """

    sizes: ClassVar[str] = "ball_diameter_mm, length_mm"
    in_steps: ClassVar[bool] = True
    lonely: ClassVar[bool] = True
    shape: Literal["dimer"]
    ball_diameter_mm: LengthMm
    length_mm: LengthMm
    rod_diameter_mm: LengthMm | None = None
    rod_density_kg_m3: Annotated[float, Field(ge=0, le=1e5, allow_inf_nan=False, strict=True)] = 0.0

    @model_validator(mode="after")
    def _balls_beside_each_other(self) -> Self:
        shortest = 2.0 * self.ball_diameter_mm
        if self.length_mm < shortest:
            raise ValueError(f"length_mm is {self.length_mm:g}, must be at least {shortest:g}, two balls in a row")
        if self.rod_diameter_mm is not None and self.rod_diameter_mm > self.ball_diameter_mm:
            raise ValueError(f"rod_diameter_mm is {self.rod_diameter_mm:g}, must be up to ball_diameter_mm")
        if self.guide is not None:
            raise ValueError("guide is given, must be none for a dimer")
        return self

    def solid(self, density: float, name: str) -> RigidPart:
        diameter, length = 1e-3 * self.ball_diameter_mm, 1e-3 * self.length_mm
        rod = 1e-3 * self.rod_diameter_mm if self.rod_diameter_mm else ROD * diameter
        return dimer(diameter, length, density, name, rod_diameter=rod, rod_density=self.rod_density_kg_m3)

    @property
    def label(self) -> str:
        return f"dimer {self.length_mm:g} mm"


class MeshPart(PartTable):
    """A closed triangle mesh; mass and inertia are those of the solid.

    Its convex hull meets the plate, and other parts too; with `contact = "parts"` other parts meet the convex pieces
    that `feeder-sim part FILE --pieces` has cut it into.
    """

    sizes: ClassVar[str] = "any closed mesh file"
    shape: Literal["mesh"]
    file: Path
    file_unit_mm: Annotated[float, Field(ge=1e-6, le=1e6, allow_inf_nan=False, strict=True)] = 1.0
    corner_error_um: Annotated[float, Field(ge=0, le=1e4, allow_inf_nan=False, strict=True)] = CORNER_ERROR_UM
    contact: Literal["hull", "parts"] = "hull"
    pieces: Path | None = None

    @property
    def pieces_file(self) -> Path | None:
        """Where its convex pieces are; None where its hull meets other parts."""
        if self.contact == "hull":
            return None
        return self.pieces or pieces_beside(self.file)

    @model_validator(mode="after")
    def _pieces_of_parts(self) -> Self:
        if self.pieces is not None and self.contact == "hull":
            raise ValueError('pieces is given, must be none with contact = "hull"')
        return self

    @property
    def files(self) -> dict[str, Path]:
        pieces = self.pieces_file
        return {"file": self.file} | ({"pieces": pieces} if pieces else {})

    def solid(self, density: float, name: str) -> RigidPart:
        from feeder_sim.part.mesh_part import mesh_part

        error = 1e-6 * self.corner_error_um
        return mesh_part(self.file, self.file_unit_mm, density, name, corner_error=error, pieces=self.pieces_file)

    @property
    def label(self) -> str:
        return self.file.stem


SHAPES: dict[str, type[PartTable]] = {
    "hex_nut": HexNut,
    "ball": Ball,
    "cylinder": Cylinder,
    "box": Box,
    "dimer": Dimer,
    "mesh": MeshPart,
}


def _of_another_package(value: Any, check: Callable[[Any], Any]) -> Any:
    """Let the table of another package check its parts."""
    if isinstance(value, PartTable) and type(value) not in SHAPES.values():
        return value
    shape = value.get("shape") if isinstance(value, dict) else None
    if not isinstance(shape, str) or shape in SHAPES or shape not in extensions.names_of("parts"):
        return check(value)
    table = extensions.find("parts", shape)
    try:
        return table.model_validate(value)
    except ValidationError as error:
        raise ValueError(str(first_error(error, table, Path()))) from None
    except InputError as error:
        raise ValueError(error.problem) from None


if TYPE_CHECKING:
    PartSpec = PartTable
else:
    PartSpec = Annotated[
        SerializeAsAny[Annotated[HexNut | Ball | Cylinder | Box | Dimer | MeshPart, Field(discriminator="shape")]],
        WrapValidator(_of_another_package),
    ]
