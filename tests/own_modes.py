"""Files that a user might bring modes in with, made of the package's own modes, and plates with holes; for tests."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from conftest import REPOSITORY
from numpy.typing import NDArray

from feeder_sim.plate.materials import MATERIALS
from feeder_sim.plate.mode_file import ModeFile, Origin, read_mode_file, write_mode_file
from feeder_sim.plate.modes import PlateModes
from feeder_sim.plate.outline import checked_outline
from feeder_sim.plate.rectangle import RectangularPlate
from feeder_sim.scenario import Drive, HexNut, ModePlate, Run, Scenario, Start

CORNER_MM = np.array([90.0, 90.0])  # the files' origin is a corner of the plate


def plate_180() -> ModeFile:
    return read_mode_file(REPOSITORY / "models/plate_180/modes.h5")


def places(n: int = 41, size: float = 0.18, seed: int = 0) -> NDArray[np.float64]:
    """A grid with its inner points shaken, so that it reaches to the edge and has no order (n^2, 2) [m]."""
    grid = np.stack(np.meshgrid(*2 * (np.linspace(-0.5, 0.5, n),), indexing="ij"), axis=-1).reshape(-1, 2)
    inner = (np.abs(grid) < 0.499).all(axis=1)
    grid[inner] += np.random.default_rng(seed).uniform(-0.3, 0.3, (int(inner.sum()), 2)) / n
    return size * grid


def values_at(modes: PlateModes, which: Sequence[int], points: NDArray[np.float64]) -> NDArray[np.float64]:
    """(w, beta_x, beta_y) at points, (modes, 3, n)."""
    return np.stack([modes.evaluate(i, *points.T) for i in which])


def write_table(
    path: Path, frequency: Sequence[float], points: NDArray[np.float64], w: NDArray[np.float64], *more: str
) -> Path:
    """A table with points (n, 2) [m] and deflections (modes, n), and further lines at its head."""
    names = ["x_mm", "y_mm", *(f"mode_{i + 1}" for i in range(len(w)))]
    rows = np.column_stack([1e3 * points + CORNER_MM, w.T])
    lines = ["# frequency_hz, " + ", ".join(map(str, frequency)), *more, ", ".join(names)]
    path.write_text("\n".join([*lines, *(", ".join(map(repr, row.tolist())) for row in rows)]), encoding="utf-8")
    return path


def shape_55(frequency: float, values: Any, *, nodes: Sequence[int] | None = None, **more: Any) -> dict[str, Any]:
    """A dataset 55 of a mode with values (3 or 6, n)."""
    n = values.shape[1]
    return {
        "type": 55, "id1": "mode", "model_type": 1, "analysis_type": 2, "data_ch": 2 if len(values) == 3 else 3,
        "spec_data_type": 8, "data_type": 5 if np.iscomplexobj(values) else 2, "n_data_per_node": len(values),
        "load_case": 1, "mode_n": 1, "freq": frequency, "modal_m": 0.0, "modal_damp_vis": 0.0, "modal_damp_his": 0.0,
        "node_nums": list(nodes or range(1, n + 1)), **{f"r{i + 1}": row for i, row in enumerate(values)},
    } | more  # fmt: skip


def nodes_2411(points: NDArray[np.float64], scale: float = 1e3) -> dict[str, Any]:
    """A dataset 2411 with nodes 1, 2, ... at points (n, 2) [m], in units of 1/scale metres."""
    n = len(points)
    x, y = (scale * (points + 1e-3 * CORNER_MM)).T
    zeros = [0] * n
    return {
        "type": 2411, "node_nums": list(range(1, n + 1)), "def_cs": zeros, "disp_cs": zeros, "color": zeros,
        "x": x.tolist(), "y": y.tolist(), "z": [0.0] * n,
    }  # fmt: skip


def units_164(length: float = 1e3, force: float = 1.0) -> dict[str, Any]:
    """A dataset 164: lengths in a metre, forces in a newton."""
    return {
        "type": 164, "units_code": 9, "units_description": "own", "temp_mode": 1, "length": length, "force": force,
        "temp": 1.0, "temp_offset": 273.15,
    }  # fmt: skip


def write_universal(path: Path, *datasets: dict[str, Any]) -> Path:
    import pyuff

    file = pyuff.UFF(str(path))
    file.write_sets(list(datasets), mode="overwrite")
    return path


def flat_plate(path: Path, *holes: NDArray[np.float64], exterior: NDArray[np.float64] | None = None) -> Path:
    """A mode file of a plate of 100 x 100 mm with holes [m], whose only mode is a seesaw along x."""
    square = 0.05 * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    coefficients = np.zeros((1, 3, 4, 4))
    coefficients[0, 0, 1, 0] = 1.0 / (np.sqrt(1.5) * np.sqrt(0.5))  # w = x / 50 mm
    modes = PlateModes(
        plate=RectangularPlate(0.1, 0.1, 0.003, MATERIALS["aluminium"]),
        natural_frequency=np.array([1000.0]),
        coefficients=coefficients,
        parity=np.full((1, 2), -1),
        modal_mass=np.array([0.03]),
        outline=checked_outline([square if exterior is None else exterior, *holes]),
    )
    write_mode_file(path, ModeFile(modes, origin=Origin("test", (0.0, 0.0))))
    return path


def circle(x: float, y: float, radius: float, n: int = 96) -> NDArray[np.float64]:
    angle = 2.0 * np.pi * np.arange(n) / n
    return np.array([x, y]) + radius * np.column_stack([np.cos(angle), np.sin(angle)])


def on_plate(
    mode_file: Path, *, amplitude_um: float = 0.0, start: Start | None = None, part: Any = None, **run: Any
) -> Scenario:
    """A nut on such a plate, which is at rest by default."""
    return Scenario(
        plate=ModePlate(kind="modes", mode_file=mode_file),
        drive=(Drive(frequency_hz=1000.0, amplitude_um=amplitude_um),),
        part=(part or HexNut(size="M2.5", start=start or Start()),),
        run=Run(**({"duration_s": 1.0, "seeds": 1, "frames_per_second": 100.0} | run)),
    )
