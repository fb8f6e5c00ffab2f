"""The C library inside the installed MuJoCo: its version, its manners, its functions in compiled code."""

from __future__ import annotations

import ctypes
from pathlib import Path

import mujoco

from feeder_sim.errors import FeederSimError

LEAST_VERSION, WRONG_VERSION = (3, 13, 0), (4, 0, 0)  # older ones lack an integrator; 4.0.0 factors contacts wrongly


def load_mujoco_symbols() -> None:
    """Check the version and make the C functions of the installed MuJoCo visible to compiled code by name.

    Raises:
        FeederSimError: MuJoCo is too old, of a version that is wrong, or damaged.
    """
    version = tuple(int(n) for n in mujoco.__version__.split(".")[:3])
    if version < LEAST_VERSION or version == WRONG_VERSION:
        allowed = "must be 3.13 or newer except 4.0.0, which solves sparse contacts wrongly"
        raise FeederSimError(f"MuJoCo is {mujoco.__version__}, {allowed}")
    folder = Path(mujoco.__file__).parent
    library = next((p for p in sorted(folder.iterdir()) if p.name.startswith(("libmujoco", "mujoco.dll"))), None)
    if library is None:
        raise FeederSimError(f"MuJoCo's library is missing in {folder}, install the package mujoco again")
    try:
        ctypes.CDLL(str(library), ctypes.RTLD_GLOBAL)
    except OSError as error:
        raise FeederSimError(f"MuJoCo's library is damaged ({error}), install the package mujoco again") from error


def silence_mujoco() -> None:
    """The simulation's guard reports diverged states, not a MUJOCO_LOG.TXT wherever the user happens to be."""
    if not hasattr(mujoco, "MjLogConfig"):  # before 3.6
        mujoco.set_mju_user_warning(lambda _: None)
        return
    config = mujoco.MjLogConfig.get()
    config.logto_file = config.logto_console = False
    config.set()
