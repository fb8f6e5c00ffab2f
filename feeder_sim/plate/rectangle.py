"""A uniform rectangular plate: dimensions, and the stiffness and inertia per area that follow from them."""

from __future__ import annotations

from dataclasses import dataclass

from feeder_sim.plate.materials import Material

SHEAR_FACTOR = 5.0 / 6.0  # kappa


@dataclass(frozen=True)
class RectangularPlate:
    """A uniform rectangular plate with free edges, centred on the origin; x along `length`.

    Attributes:
        length, width, thickness: [m].
        material: elastic constants and density.
    """

    length: float
    width: float
    thickness: float
    material: Material

    @property
    def bending_stiffness(self) -> float:
        """D11 [N m], for bending along x; D = E h^3 / 12 (1 - nu^2) of an isotropic plate."""
        m = self.material
        if m.isotropic:
            return m.youngs_modulus * self.thickness**3 / (12.0 * (1.0 - m.poisson_ratio**2))
        return m.plane_stress[0] * self.thickness**3 / 12.0

    @property
    def bending_stiffnesses(self) -> tuple[float, float, float, float]:
        """D11, D12, D22, D66 [N m]: D, nu D, D and (1 - nu) D / 2 of an isotropic plate."""
        d, nu = self.bending_stiffness, self.material.poisson_ratio
        if self.material.isotropic:
            return d, nu * d, d, 0.5 * (1.0 - nu) * d
        q11, q12, q22, q66 = (q * self.thickness**3 / 12.0 for q in self.material.plane_stress)
        return q11, q12, q22, q66

    @property
    def turned(self) -> RectangularPlate:
        """The same plate with x and y exchanged."""
        return RectangularPlate(self.width, self.length, self.thickness, self.material.turned)

    @property
    def shear_stiffness(self) -> float:
        """S = kappa G h [N/m]."""
        m = self.material
        if m.isotropic:
            return SHEAR_FACTOR * m.youngs_modulus / (2.0 * (1.0 + m.poisson_ratio)) * self.thickness
        return SHEAR_FACTOR * m.in_plane_shear_modulus * self.thickness

    @property
    def mass_per_area(self) -> float:
        """Rho h [kg/m^2]."""
        return self.material.density * self.thickness

    @property
    def rotary_inertia(self) -> float:
        """Rho h^3 / 12 [kg]."""
        return self.material.density * self.thickness**3 / 12.0
