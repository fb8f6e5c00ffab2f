"""Tables of a plate file for what is fixed to the plate: piezo actuators, bars, masses."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from feeder_sim.scenario.material import MaterialChoice
from feeder_sim.scenario.tables import AngleDeg, CoordinateMm, Flag, LengthMm, NonNegative, PointMm, Positive, Table

MOST_LAYERS = 10_000  # of ceramic in one patch
MOST_ACTUATORS = 100
Side = Literal["below", "above"]
SizeMm = tuple[LengthMm, LengthMm]
Name = Annotated[str, Field(min_length=1, max_length=60, pattern=r"^[^\x00-\x1f]+$")]


class BondedLayer(Table):
    """A rectangle bonded to the plate; `size_mm` is along its own axes, the first of them turned by `angle_deg`."""

    at_mm: PointMm
    size_mm: SizeMm
    angle_deg: AngleDeg = 0.0
    thickness_mm: LengthMm
    side: Side = "below"


class Actuator(BondedLayer):
    """A piezo patch. Its bending moment is the calibrated one, or else that of its material."""

    name: Name
    moment_per_volt_n: Positive | None = None
    density_kg_m3: Annotated[float, Field(ge=1, le=1e5, strict=True)] = 7700.0
    s11_um2_per_n: Annotated[float, Field(ge=1e-3, le=1e6, strict=True)] = 13.0
    poisson_ratio: Annotated[float, Field(ge=0, lt=0.5, strict=True)] = 0.31
    d31_pm_per_v: Annotated[float, Field(gt=0, le=1e5, strict=True)] | None = None
    layers: Annotated[int, Field(ge=1, le=MOST_LAYERS, strict=True)] = 1
    relative_permittivity: Annotated[float, Field(ge=1, le=1e6, strict=True)] = 1800.0
    loss_tangent: Annotated[float, Field(ge=0, le=1, strict=True)] = 0.02
    shear_lag_mm: NonNegative | None = None
    loads: Flag = True

    @model_validator(mode="after")
    def _acts(self) -> Self:
        if self.moment_per_volt_n is None and self.d31_pm_per_v is None:
            raise ValueError("moment_per_volt_n is missing, allowed is a number above 0, or d31_pm_per_v instead")
        if self.shear_lag_mm is not None and 2.0 * self.shear_lag_mm >= min(self.size_mm):
            raise ValueError(
                f"shear_lag_mm is {self.shear_lag_mm:g}, allowed is less than half of the shorter side, "
                f"{0.5 * min(self.size_mm):g}"
            )
        return self


class ActuatorFile(Table):
    """Actuators of a plate whose modes are imported, in the coordinates of its modes."""

    actuator: Annotated[tuple[Actuator, ...], Field(min_length=1, max_length=MOST_ACTUATORS)]

    @model_validator(mode="after")
    def _own_names(self) -> Self:
        check_names(self.actuator)
        return self


def check_names(actuators: Sequence[Actuator]) -> None:
    """Refuse two actuators of one name.

    Raises:
        ValueError: there are.
    """
    names = [actuator.name for actuator in actuators]
    for i, name in enumerate(names):
        if name in names[:i]:
            raise ValueError(f"actuator[{i}].name is {name!r}, allowed is a name of its own")


class Bar(BondedLayer):
    """A bar bonded to the plate."""

    material: MaterialChoice = "aluminium"


class Mass(Table):
    """A mass fixed to the plate at a point, such as a bolt or a magnet."""

    at_mm: PointMm
    mass_g: Positive
    offset_mm: CoordinateMm = 0.0
