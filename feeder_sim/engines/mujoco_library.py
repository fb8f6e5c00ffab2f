"""The C library inside the installed MuJoCo: its version, its manners, its functions in compiled code."""

from __future__ import annotations

from pathlib import Path

import llvmlite.binding
import mujoco

from feeder_sim.errors import FeederSimError

LEAST_VERSION = (4, 0, 1)


def load_mujoco_symbols() -> None:
    """Check the version and make the C functions of the installed MuJoCo visible to compiled code by name.

    Raises:
        FeederSimError: MuJoCo is too old.
    """
    if tuple(int(n) for n in mujoco.__version__.split(".")[:3]) < LEAST_VERSION:
        raise FeederSimError(f"MuJoCo {mujoco.__version__} solves sparse contacts wrongly; mujoco-core 4.0.1 is needed")
    folder = Path(mujoco.__file__).parent
    library = next(p for p in sorted(folder.iterdir()) if p.name.startswith(("libmujoco", "mujoco.dll")))
    llvmlite.binding.load_library_permanently(str(library))


def silence_mujoco() -> None:
    """The simulation's guard reports diverged states, not a MUJOCO_LOG.TXT wherever the user happens to be."""
    config = mujoco.MjLogConfig.get()
    config.logto_file = config.logto_console = False
    config.set()
