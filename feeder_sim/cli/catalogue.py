"""What a user can choose from: scenarios and mode files in a folder, engines, shapes of parts, materials."""

from __future__ import annotations

from pathlib import Path

from feeder_sim.errors import FeederSimError
from feeder_sim.part.solids import ISO_4032
from feeder_sim.plate.materials import MATERIALS
from feeder_sim.plate.mode_file import read_mode_file
from feeder_sim.scenario import load_scenario

ENGINES = {
    "impulse": "rigid contact by impulses, flight in closed form; exact on a slide",
    "mujoco": "rigid-body contact by MuJoCo's own solver",
}


def catalogue(folder: Path) -> dict[str, dict[str, str]]:
    """Names and one-line descriptions by kind; for a file that cannot be read the reason is its description."""
    return {
        "scenarios": {str(p.relative_to(folder)): _title(p) for p in sorted(folder.glob("scenarios/*.toml"))},
        "mode files": {str(p.relative_to(folder)): _modes(p) for p in sorted(folder.glob("models/*/*.h5"))},
        "engines": ENGINES,
        "parts": {
            "hex_nut": "sizes " + ", ".join(ISO_4032) + ", or by dimensions",
            "ball": "diameter_mm",
            "cylinder": "diameter_mm, height_mm",
            "box": "size_mm",
            "dimer": "ball_diameter_mm, length_mm",
            "mesh": "any closed mesh file",
        },
        "materials": {name: f"{m.density:g} kg/m3, {m.youngs_modulus / 1e9:g} GPa" for name, m in MATERIALS.items()},
    }


def _title(path: Path) -> str:
    """Title of a scenario file."""
    try:
        return load_scenario(path).title
    except FeederSimError as error:
        return f"unusable: {error}"


def _modes(path: Path) -> str:
    """Size of the plate of a mode file, and its numbers of modes and measured resonances."""
    try:
        mode_file = read_mode_file(path)
    except FeederSimError as error:
        return f"unusable: {error}"
    plate, highest = mode_file.modes.plate, mode_file.modes.natural_frequency[-1]
    size = " x ".join(f"{1e3 * d:g}" for d in (plate.length, plate.width, plate.thickness))
    return f"{size} mm, {len(mode_file.modes)} modes up to {highest:.0f} Hz, {len(mode_file.resonances)} measured"
