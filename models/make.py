"""Makes every generated file under models/: `python models/make.py`."""

from __future__ import annotations

from pathlib import Path

from parts import write_parts

from feeder_sim.engines.mujoco.mjcf import build_part_mjcf
from feeder_sim.plate.mode_file import write_mode_file
from feeder_sim.run.run_folder import mjcf_text
from feeder_sim.scenario import HexNut, load_plate_file, load_scenario
from feeder_sim.scene.part import build_part
from feeder_sim.scene.plate_modes import compute_modes
from feeder_sim.scene.scene import build_scene

MODELS = Path(__file__).parent
SCENARIOS = MODELS.parent / "scenarios"

PLATES = ("plate_180", "plate_180_piezos", "plate_silicon", "strip_160")
# Scene folder: the scenario it shows.
SCENES = {"plate_180": "drift_2797hz_plate", "strip_3mm": "drift_4750hz"}


def main() -> None:
    for folder in PLATES:
        write_mode_file(MODELS / folder / "modes.h5", compute_modes(load_plate_file(MODELS / folder / "plate.toml")))
    for folder, scenario in SCENES.items():
        text = mjcf_text(build_scene(load_scenario(SCENARIOS / f"{scenario}.toml")))
        _write(MODELS / folder / "scene.xml", text)
    nut = build_part_mjcf(build_part(HexNut(size="M2.5"), name="hex_nut_m2_5"))
    nut.compile()
    _write(MODELS / "hex_nut_m2_5/hex_nut_m2_5.xml", nut.to_xml())
    write_parts()


def _write(path: Path, text: str) -> None:
    path.parent.mkdir(exist_ok=True)
    path.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
