"""The replay as a person sees it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from conftest import strip_scenario

from feeder_sim.replay.replay import REPLAY
from feeder_sim.replay.viewer import take_screenshot
from feeder_sim.run.run_folder import record_run

DRIVERS = Path("/usr/share/vulkan/icd.d")


@pytest.mark.skipif(not any(DRIVERS.glob("*.json")), reason="no graphics driver, not even a software one")
def test_replay_opens_with_a_coloured_plate_and_its_plots(tmp_path: Path) -> None:
    from matplotlib.image import imread

    record_run(strip_scenario(seeds=2, duration_s=0.5), tmp_path / "run")
    take_screenshot(tmp_path / "run" / REPLAY, tmp_path / "shot.png", at=0.4)
    rgb = imread(tmp_path / "shot.png")[..., :3]
    scene, plots = rgb[:, : rgb.shape[1] * 3 // 5], rgb[:, rgb.shape[1] * 3 // 5 :]
    red, green, blue = np.moveaxis(scene, -1, 0)
    assert ((red > 0.5) & (blue < 0.5 * red) & (green < 0.5 * red)).mean() > 0.03  # the antinode under the part
    assert ((blue > 0.5) & (red < 0.6 * blue)).mean() > 0.03  # its neighbour in opposite phase
    orange = np.abs(plots - np.array([214, 140, 30]) / 255).max(axis=-1) < 0.15
    assert orange.sum() > 100
