"""Elastic constants and densities of the materials that a scenario may name."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Material:
    """An isotropic elastic solid, in SI units.

    Attributes:
        density: [kg/m^3].
        youngs_modulus: [Pa].
        poisson_ratio: dimensionless, between 0 and 0.5.
    """

    density: float
    youngs_modulus: float
    poisson_ratio: float


MATERIALS = {
    # Aluminium: the rolled sheet of the plate in docs/validation.md. The other values come from handbooks.
    "aluminium": Material(density=2770.0, youngs_modulus=71.0e9, poisson_ratio=0.33),
    "steel": Material(density=7850.0, youngs_modulus=210.0e9, poisson_ratio=0.30),
    "brass": Material(density=8500.0, youngs_modulus=105.0e9, poisson_ratio=0.35),
    "acrylic": Material(density=1190.0, youngs_modulus=3.2e9, poisson_ratio=0.37),
    "nylon": Material(density=1140.0, youngs_modulus=2.8e9, poisson_ratio=0.39),
}
