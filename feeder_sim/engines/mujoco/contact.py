"""Contact as MuJoCo takes it: attributes of a pair of geoms, and the names of the geoms that meet."""

from __future__ import annotations

from feeder_sim.part.rigid_part import RigidPart
from feeder_sim.scenario import Contact, MujocoSettings

HARD = [0.9999, 0.9999, 1e-3, 0.5, 2.0]  # solimp with MuJoCo's largest impedance: as hard as the solver allows
MUJOCO_IMPEDANCE = [0.9, 0.95, 1e-3, 0.5, 2.0]  # its default: what rests on a slope creeps
DEFAULT_SETTINGS = MujocoSettings()


def part_contact(contact: Contact) -> Contact:
    """The contact of parts with each other, as a contact."""
    law = {"restitution": contact.part_restitution, "friction": contact.part_friction}
    return contact.model_copy(update=law)


def contact_parameters(
    contact: Contact, timestep: float, settings: MujocoSettings = DEFAULT_SETTINGS
) -> dict[str, list[float]]:
    """MuJoCo's pair attributes for a contact model at a timestep."""
    friction = [contact.friction, contact.friction, 0.0, 0.0, 0.0]
    if contact.time_constant_us is not None:
        solref, solreffriction = [contact.time_constant_us * 1e-6, contact.damping_ratio], [0.0, 0.0]
    else:
        solref, solreffriction = [0.0, -(1.0 + contact.coefficient) / timestep], [0.0, -1.0 / timestep]
    solimp = HARD if settings.impedance == "hard" else MUJOCO_IMPEDANCE
    return {
        "friction": friction,
        "solref": solref,
        "solreffriction": solreffriction,
        "solimp": list(solimp),
    }


def hull_name(part: RigidPart) -> str:
    """The geom that walls meet: a ball's only corner has its radius."""
    return corner_name(part, 0) if part.corner_radius else f"{part.name}_hull"


def piece_names(part: RigidPart) -> list[str]:
    """The geoms that other parts meet: the convex pieces of a part that has any, else its hull."""
    return [f"{part.name}_piece_{i}" for i in range(len(part.pieces))] or [hull_name(part)]


def corner_name(part: RigidPart, i: int) -> str:
    return f"{part.name}_corner_{i}"
