"""Tables of a scenario that say how it is computed: contact law, duration and time step, settings of MuJoCo."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from feeder_sim.scenario.tables import Flag, NonNegative, Positive, Table


class Contact(Table):
    """Contact between part and plate, and of parts with each other (`part_restitution`, `part_friction`).

    `model = "restitution"` reverses the normal velocity within one step (Newton); "compliant" is MuJoCo's
    spring-damper contact with a time constant, and has no coefficient of restitution.
    """

    model: Literal["restitution", "compliant"] = "restitution"
    restitution: Annotated[float, Field(ge=0, le=1, strict=True)] = 0.2
    friction: NonNegative = 0.3
    part_restitution: Annotated[float, Field(ge=0, le=1, strict=True)] = 0.2
    part_friction: NonNegative = 0.3
    time_constant_us: Positive | None = None
    damping_ratio: Positive = 1.0

    @model_validator(mode="after")
    def _time_constant(self) -> Self:
        if (self.model == "compliant") != (self.time_constant_us is not None):
            raise ValueError('time_constant_us belongs to model = "compliant", which needs it')
        return self


class MujocoSettings(Table):
    """How the MuJoCo engine is set up; the defaults are the best known, other values are for comparison.

    `plate`: a patch with joints, or a mocap body (which has no velocity in contact). `contact_set`: a small sphere at
    every corner, or MuJoCo's own contact of hull and box. `impedance` of contacts: as hard as MuJoCo allows, or its
    default. `tolerance` of the solver: MuJoCo's default, scaled to the part or not. `refsafe = false` keeps time
    constants below two steps, which MuJoCo otherwise lengthens. `units` are those in which the model is written. The
    other keys are MuJoCo's options of that name.
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
    units: Literal["SI", "mm-g-ms"] = "SI"


class Run(Table):
    """How long, with how many seeds, with which step and with which simplifications a scenario is computed.

    `in_plane_velocity = false` leaves out the horizontal motion of the surface; `tangent_surface = true` makes the
    impulse engine replace the surface under a part by its tangent plane, as the MuJoCo engine always does;
    `planar = true` keeps a part in the plane y = 0 of a strip or piston, with the outline it has there.
    `reaction = true` lets every impulse that the plate gives a part act on the driven modes of a rectangle too.
    `allow_unstable` runs settings that are known to fail. With a schedule the duration is that of its stages. A part
    that falls off the plate is computed down to `floor_mm`, and is lost there.
    """

    engine: Literal["auto", "impulse", "mujoco"] = "auto"
    duration_s: Annotated[float, Field(gt=0, le=1e5, strict=True)] | None = None
    stop: Literal["time", "passage"] = "time"
    seeds: Annotated[int, Field(ge=1, le=10_000, strict=True)] = 12
    seed: Annotated[int, Field(ge=0, lt=2**63, strict=True)] = 0
    steps_per_period: Annotated[int, Field(ge=1, le=10_000, strict=True)] = 40
    frames_per_second: Annotated[float, Field(ge=1, le=1e6, strict=True)] = 500.0
    floor_mm: Annotated[float, Field(ge=-1e4, le=-1, strict=True)] = -50.0
    in_plane_velocity: Flag = True
    tangent_surface: Flag = False
    planar: Flag = False
    reaction: Flag = False
    allow_unstable: Flag = False
