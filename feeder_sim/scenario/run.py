"""Tables of a scenario that say how it is computed: contact law, duration and time step, settings of MuJoCo."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, Field, PlainValidator, WithJsonSchema, model_validator

from feeder_sim import extensions
from feeder_sim.scenario.tables import DurationS, Flag, NonNegative, Positive, Table

ENGINES = {
    "auto": "the fastest that covers the scene",
    "impulse": "rigid contact by impulses, flight in closed form; exact on a slide",
    "mujoco": "rigid-body contact by MuJoCo's own solver",
}
LAWS = {
    "newton": "of restitution: the normal velocity after an impact is -e times that before",
    "poisson": "of restitution: e times the impulse of compression once more",
}
STEPS_PER_PERIOD = 40  # of a method that has steps, where the scenario does not say

Share = Annotated[float, Field(ge=0, le=1, strict=True)]


def _named(name: str, own: Iterable[str], group: str) -> str:
    """A name of ours, or one that another package adds to a group."""
    allowed = (*own, *extensions.names_of(group))
    if name not in allowed:
        raise ValueError(f"must be {', '.join(map(repr, allowed[:-1]))} or {allowed[-1]!r}")
    return name


def _law(name: str) -> str:
    return _named(name, LAWS, "laws")


def _engine(name: str) -> str:
    return _named(name, ENGINES, "engines")


def _share_or_zener(value: Any) -> Any:
    """A coefficient of restitution, or the name of the theory that makes it."""
    if value == "zener":
        return value
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError('must be a number from 0 to 1, or "zener"')
    if not value >= 0.0:
        raise ValueError("must be greater than or equal to 0")
    if value > 1.0:
        raise ValueError("must be less than or equal to 1")
    return float(value)


class Contact(Table):
    """Contact between part and plate, and of parts with each other (`part_restitution`, `part_friction`).

    `model = "restitution"` reverses the normal velocity within one step (Newton); "compliant" is MuJoCo's
    spring-damper contact with a time constant, and has no coefficient of restitution. The impulse engine has laws
    beyond one number ([Physics](physics.md#laws-of-impact)): Poisson's in place of Newton's, or a law of another
    package (`law`), a restitution that falls with the speed of the impact (`restitution_exponent`), that of balls by
    Zener's theory, and a tangential one of balls. Impacts on a slide, and those without a step (`run.tolerance_nm`),
    scatter by `noise_m_s`, so that no part follows a periodic motion that a real one would leave; 0 is for closed
    forms.
    """

    model: Literal["restitution", "compliant"] = "restitution"
    law: Annotated[str, AfterValidator(_law), WithJsonSchema({"enum": list(LAWS), "type": "string"})] = "newton"
    restitution: Annotated[
        Share | Literal["zener"], PlainValidator(_share_or_zener, json_schema_input_type=Share | Literal["zener"])
    ] = 0.2
    friction: NonNegative = 0.3
    rolling_friction_um: NonNegative = 0.0
    part_restitution: Share = 0.2
    part_friction: NonNegative = 0.3
    restitution_exponent: Share = 0.0
    restitution_speed_m_s: Annotated[float, Field(ge=1e-3, le=100, strict=True)] = 1.0
    tangential_restitution: Share | None = None
    noise_m_s: Annotated[float, Field(ge=0, le=1e-3, strict=True)] = 1e-8
    time_constant_us: Positive | None = None
    damping_ratio: Positive = 1.0

    @property
    def coefficient(self) -> float:
        """Coefficient of restitution on the plate [1].

        Raises:
            ValueError: it is no number but a theory.
        """
        if isinstance(self.restitution, str):
            raise ValueError(f'restitution is "{self.restitution}", which is no number')
        return self.restitution

    @model_validator(mode="after")
    def _time_constant(self) -> Self:
        if (self.model == "compliant") != (self.time_constant_us is not None):
            raise ValueError('time_constant_us belongs to model = "compliant", which needs it')
        return self

    @model_validator(mode="after")
    def _falls_from_a_number(self) -> Self:
        if self.restitution_exponent and self.restitution == "zener":
            raise ValueError(
                f'restitution_exponent is {self.restitution_exponent:g}, must be 0 with restitution = "zener", '
                "which falls with the speed by itself"
            )
        if self.restitution_speed_m_s != 1.0 and not self.restitution_exponent:
            raise ValueError("restitution_speed_m_s belongs to restitution_exponent above 0")
        return self


class MujocoSettings(Table):
    """How the MuJoCo engine is set up; the defaults are the best known, other values are for comparison.

    `plate`: a patch with joints, or a mocap body (which has no velocity in contact). `contact_set`: a small sphere at
    every corner, or MuJoCo's own contact of hull and box. `impedance` of contacts: as hard as MuJoCo allows, or its
    default. `tolerance` of the solver: MuJoCo's default, scaled to the part or not. `refsafe = false` keeps time
    constants below two steps, which MuJoCo otherwise lengthens. The other keys are MuJoCo's options of that name.
    """

    plate: Literal["patch", "mocap"] = "patch"
    contact_set: Literal["corners", "hull"] = "corners"
    cone: Literal["elliptic", "pyramidal"] = "elliptic"
    integrator: Literal["euler", "implicitfast", "discrete"] = "euler"
    iterations: Annotated[int, Field(ge=1, le=10_000, strict=True)] = 100
    impratio: Annotated[float, Field(gt=0, le=1e6, strict=True)] = 1.0
    impedance: Literal["hard", "default"] = "hard"
    tolerance: Literal["scaled", "default"] = "scaled"
    refsafe: Flag = True


class Run(Table):
    """How long, with how many seeds, with which step and with which simplifications a scenario is computed.

    `in_plane_velocity = false` leaves out the horizontal motion of the surface; `tangent_surface = true` makes the
    impulse engine replace the surface under a part by its tangent plane, as the MuJoCo engine always does;
    `planar = true` keeps a part in the plane y = 0 of a strip or piston, with the outline it has there.
    `reaction = true` lets every impulse that the plate gives a part act on the driven modes of a rectangle too.
    The impulse engine computes one free part without a step ([Contact](contact.md)); `tolerance_nm` says how exactly,
    and how exact the chatter of a part on a slide is. With `steps_per_period` it takes steps there too. Several parts
    are computed in steps on a plate that is driven, and without one there too where `tolerance_nm` is given.
    `allow_unstable` runs settings that are known to fail. With a schedule the duration is that of its stages. A part
    that falls off the plate is computed down to `floor_mm`, and is lost there.
    """

    engine: Annotated[str, AfterValidator(_engine), WithJsonSchema({"enum": list(ENGINES), "type": "string"})] = "auto"
    duration_s: DurationS | None = None
    stop: Literal["time", "passage"] = "time"
    seeds: Annotated[int, Field(ge=1, le=10_000, strict=True)] = 12
    seed: Annotated[int, Field(ge=0, lt=2**63, strict=True)] = 0
    tolerance_nm: Annotated[float, Field(ge=1e-4, le=100, strict=True)] | None = None
    steps_per_period: Annotated[int, Field(ge=1, le=10_000, strict=True)] | None = None
    points_per_wavelength: Annotated[int, Field(ge=8, le=1000, strict=True)] | None = None
    frames_per_second: Annotated[float, Field(ge=1, le=1e6, strict=True)] = 500.0
    floor_mm: Annotated[float, Field(ge=-1e4, le=-1, strict=True)] = -50.0
    in_plane_velocity: Flag = True
    tangent_surface: Flag = False
    planar: Flag = False
    reaction: Flag = False
    allow_unstable: Flag = False

    @property
    def steps(self) -> int:
        """Steps per period of a method that has some."""
        return STEPS_PER_PERIOD if self.steps_per_period is None else self.steps_per_period
