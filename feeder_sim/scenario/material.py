"""Materials in scenarios and plate files: a name, or a table of constants."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import AfterValidator, Discriminator, Field, Tag, model_validator

from feeder_sim.plate.materials import CERAMICS, MATERIALS, Material
from feeder_sim.scenario.tables import Table

ModulusGpa = Annotated[float, Field(ge=1e-4, le=1e4, strict=True)]


class CustomMaterial(Table):
    """A material that is not in the list; an orthotropic one has a second modulus and a shear modulus."""

    density_kg_m3: Annotated[float, Field(ge=1, le=1e5, strict=True)]
    youngs_modulus_gpa: ModulusGpa
    poisson_ratio: Annotated[float, Field(ge=0, lt=0.5, strict=True)]
    youngs_modulus_y_gpa: ModulusGpa | None = None
    shear_modulus_gpa: ModulusGpa | None = None

    @model_validator(mode="after")
    def _stable(self) -> Self:
        e_y = self.youngs_modulus_y_gpa
        if (e_y is None) != (self.shear_modulus_gpa is None):
            raise ValueError("youngs_modulus_y_gpa and shear_modulus_gpa are allowed together only")
        if e_y is not None and self.poisson_ratio**2 * e_y >= self.youngs_modulus_gpa:
            raise ValueError(
                f"poisson_ratio is {self.poisson_ratio:g}, must be below "
                f"{(self.youngs_modulus_gpa / e_y) ** 0.5:.3g}, the root of youngs_modulus_gpa / youngs_modulus_y_gpa"
            )
        return self


def _check_material(value: str) -> str:
    if value not in MATERIALS:
        names = ", ".join(sorted(MATERIALS))
        raise ValueError(f"must be one of {names}, or a table of density_kg_m3, youngs_modulus_gpa, poisson_ratio")
    return value


def _check_ceramic(value: str) -> str:
    if value not in CERAMICS:
        raise ValueError(f"must be one of {', '.join(sorted(CERAMICS))}, and constants in place of its own")
    return value


CeramicName = Annotated[str, AfterValidator(_check_ceramic), Field(json_schema_extra={"enum": sorted(CERAMICS)})]
MaterialChoice = Annotated[
    Annotated[str, AfterValidator(_check_material), Field(json_schema_extra={"enum": sorted(MATERIALS)}), Tag("name")]
    | Annotated[CustomMaterial, Tag("table")],
    Discriminator(lambda value: "name" if isinstance(value, str) else "table"),
]


def resolve_material(choice: MaterialChoice) -> Material:
    """Look a material up by name, or convert a custom one to SI."""
    if isinstance(choice, str):
        return MATERIALS[choice]
    e_y, g = choice.youngs_modulus_y_gpa, choice.shear_modulus_gpa
    return Material(
        choice.density_kg_m3,
        choice.youngs_modulus_gpa * 1e9,
        choice.poisson_ratio,
        None if e_y is None else e_y * 1e9,
        None if g is None else g * 1e9,
    )
