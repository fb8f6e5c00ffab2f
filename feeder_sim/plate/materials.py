"""Elastic constants and densities of the materials that a scenario may name."""

from __future__ import annotations

from dataclasses import dataclass, replace


@dataclass(frozen=True)
class Material:
    """An elastic solid, in SI units: isotropic, or orthotropic with its axes along x and y of the plate.

    Attributes:
        density: [kg/m^3].
        youngs_modulus: [Pa]; along x if orthotropic.
        poisson_ratio: dimensionless, between 0 and 0.5; if orthotropic, contraction along y over stretch along x.
        youngs_modulus_y, shear_modulus: [Pa] of an orthotropic solid, both or none; the shear modulus is taken for
            shear in the plane and through the thickness.
    """

    density: float
    youngs_modulus: float
    poisson_ratio: float
    youngs_modulus_y: float | None = None
    shear_modulus: float | None = None

    @property
    def isotropic(self) -> bool:
        """Whether it has one modulus and one Poisson's ratio."""
        return self.youngs_modulus_y is None or self.shear_modulus is None

    @property
    def turned(self) -> Material:
        """The same solid with x and y exchanged."""
        e_x, e_y = self.youngs_modulus, self.youngs_modulus_y
        if e_y is None:
            return self
        return replace(self, youngs_modulus=e_y, youngs_modulus_y=e_x, poisson_ratio=self.poisson_ratio * e_y / e_x)

    @property
    def in_plane_shear_modulus(self) -> float:
        """G = E / 2 (1 + nu), or the given one [Pa]."""
        if self.shear_modulus is not None:
            return self.shear_modulus
        return self.youngs_modulus / (2.0 * (1.0 + self.poisson_ratio))

    @property
    def plane_stress(self) -> tuple[float, float, float, float]:
        """Q11, Q12, Q22, Q66 [Pa], stress per strain in a plane of free surface (Jones, Mechanics of Composite
        Materials, 2nd ed., 1999, eq. 2.66); Q66 is the shear modulus.
        """
        e_x, nu = self.youngs_modulus, self.poisson_ratio
        e_y = e_x if self.youngs_modulus_y is None else self.youngs_modulus_y
        compliance = 1.0 - nu**2 * e_y / e_x
        return e_x / compliance, nu * e_y / compliance, e_y / compliance, self.in_plane_shear_modulus


@dataclass(frozen=True)
class Ceramic:
    """A piezoelectric ceramic, in SI units, poled through its thickness.

    Attributes:
        solid: density, 1 / s11 at constant field, and Poisson's ratio in its plane.
        d31: size of the piezoelectric constant [m/V].
        relative_permittivity: along the field, of the free ceramic [1].
        loss_tangent: at a small field [1]; at 0.4 kV/mm that of hard ceramics is three to six times as much (Noliac).
    """

    solid: Material
    d31: float
    relative_permittivity: float
    loss_tangent: float


def _ceramic(d31: float, s11: float, permittivity: float, loss: float, density: float, poisson: float) -> Ceramic:
    """From the units of data sheets: pm/V, um^2/N, 1, 1, kg/m^3, 1."""
    return Ceramic(Material(density, 1e12 / s11, poisson), 1e-12 * d31, permittivity, loss)


# Noliac, Piezo ceramics Ver1203 (2012), which give no Poisson's ratio (0.31 of usual ones); PI Ceramic, Piezo material
# data (2012); PZT: Jaffe, Cook and Jaffe, Piezoelectric Ceramics (1971), table 7.3 and Morgan TP-226, with -s12 / s11.
CERAMICS = {
    "NCE46": _ceramic(130.0, 13.0, 1300.0, 0.003, 7700.0, 0.31),
    "NCE51": _ceramic(195.0, 16.0, 1850.0, 0.019, 7800.0, 0.31),
    "PIC151": _ceramic(210.0, 15.0, 2400.0, 0.02, 7800.0, 0.34),
    "PIC181": _ceramic(120.0, 11.8, 1200.0, 0.003, 7800.0, 0.34),
    "PIC255": _ceramic(180.0, 16.1, 1750.0, 0.02, 7800.0, 0.34),
    "PZT-4": _ceramic(123.0, 12.3, 1300.0, 0.004, 7500.0, 0.33),
    "PZT-5A": _ceramic(171.0, 16.4, 1700.0, 0.02, 7750.0, 0.35),
    "PZT-5H": _ceramic(274.0, 16.5, 3400.0, 0.02, 7500.0, 0.29),
    "PZT-8": _ceramic(97.0, 11.5, 1000.0, 0.004, 7600.0, 0.32),
}

MATERIALS = {
    # Aluminium: the rolled sheet of the plate in docs/evidence.md. The other values come from handbooks.
    "aluminium": Material(density=2770.0, youngs_modulus=71.0e9, poisson_ratio=0.33),
    "steel": Material(density=7850.0, youngs_modulus=210.0e9, poisson_ratio=0.30),
    "brass": Material(density=8500.0, youngs_modulus=105.0e9, poisson_ratio=0.35),
    "acrylic": Material(density=1190.0, youngs_modulus=3.2e9, poisson_ratio=0.37),
    "nylon": Material(density=1140.0, youngs_modulus=2.8e9, poisson_ratio=0.39),
    # At room temperature, PA6 dry: moist it has about a third of the modulus. Typical of data sheets, and within the
    # ranges of Ashby, Materials Selection in Mechanical Design, appendix A.
    "abs": Material(density=1050.0, youngs_modulus=2.3e9, poisson_ratio=0.39),
    "pom": Material(density=1410.0, youngs_modulus=2.9e9, poisson_ratio=0.37),
    "pa6": Material(density=1130.0, youngs_modulus=3.0e9, poisson_ratio=0.39),
    # A wafer with its flat along <110>, x and y along <110> (Hopcroft, Nix and Kenny, J. MEMS 19 (2010) 229).
    "silicon": Material(2329.0, 169.0e9, 0.064, youngs_modulus_y=169.0e9, shear_modulus=50.9e9),
}
