"""Tosses of a cube in plain MuJoCo: eight small spheres at its corners over a plane, `mj_step` from Python."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np
from cube_tosses import FRICTION, RESTITUTION, Toss
from numpy.typing import NDArray
from tosses import INERTIA, MASS, STEPS_PER_MS, corners, start

from feeder_sim.constants import GRAVITY

FOOT = 1e-5  # radius of the spheres [m]
SETTINGS = (
    f"MuJoCo {mujoco.__version__}, eight corner spheres in explicit pairs, solref 0 -(1+e)/dt, solreffriction 0 -1/dt, "
    "solimp 0.9999 0.9999, elliptic cone, tolerance 1e-15"
)


def final_poses(tosses: Sequence[Toss], *, steps_per_ms: int = STEPS_PER_MS) -> NDArray[np.float64]:
    """Position [m] and quaternion, w first, at the end of each toss, shape (n, 7)."""
    dt = 1e-3 / steps_per_ms
    model = mujoco.MjModel.from_xml_string(_xml(dt))
    data = mujoco.MjData(model)
    poses = np.empty((len(tosses), 7))
    for i, toss in enumerate(tosses):
        mujoco.mj_resetData(model, data)
        data.qpos[:3], data.qpos[3:] = start(toss), toss.attitude.as_quat(scalar_first=True)
        data.qvel[:3], data.qvel[3:] = toss.velocity, toss.angular_velocity  # the spin in body axes, as the data's
        mujoco.mj_step(model, data, nstep=round(toss.duration / dt))
        poses[i] = data.qpos
    return poses


def _xml(dt: float) -> str:
    feet, pairs = "", ""
    for i, corner in enumerate(corners()):
        place = " ".join(repr(float(x)) for x in corner)
        feet += f'<geom name="foot{i}" type="sphere" size="{FOOT}" pos="{place}" contype="0" conaffinity="0"/>'
        pairs += (
            f'<pair geom1="plane" geom2="foot{i}" solref="0 {-(1.0 + RESTITUTION) / dt!r}" '
            f'solreffriction="0 {-1.0 / dt!r}" solimp="0.9999 0.9999 0.001 0.5 2" '
            f'friction="{FRICTION} {FRICTION} 0 0 0" condim="3"/>'
        )
    return f"""<mujoco><option timestep="{dt!r}" gravity="0 0 {-GRAVITY}" cone="elliptic" tolerance="1e-15"/>
    <worldbody><geom name="plane" type="plane" size="5 5 1" pos="0 0 {-FOOT}" contype="0" conaffinity="0"/>
    <body><inertial pos="0 0 0" mass="{MASS}" diaginertia="{INERTIA} {INERTIA} {INERTIA}"/><freejoint/>{feet}</body>
    </worldbody><contact>{pairs}</contact></mujoco>"""
