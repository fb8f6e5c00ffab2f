"""Measured tosses of a cube (ContactNets), with the authors' own friction and restitution: nothing is fitted."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from cube_tosses import EDGE_MM, compute_tosses, read_tosses, upper_face
from scipy.spatial.transform import Rotation

from feeder_sim.errors import InputError

DATA = Path(__file__).parents[2] / "benchmarks" / "validation" / "cube_tosses.csv"
SOME = 70  # tosses; the standard error of a share of 0.8 is then 0.05


def test_every_fourth_toss_ends_where_it_was_measured() -> None:
    study = compute_tosses(read_tosses(DATA)[::4])
    found = study.summary()
    assert len(study.error) > SOME
    assert found["same_face"] > 0.82 - 2 * 0.05
    assert found["median_error_mm"] < 28.0  # a slip of 0.03 in the friction doubles it
    assert found["median_way_mm"] > 3.0 * EDGE_MM
    assert found["lifted_mm"] < 1.0


@pytest.mark.slow
@pytest.mark.parametrize(("engine", "error_mm", "share"), [("impulse", 25.0, 0.82), ("mujoco", 28.0, 0.80)])
def test_all_tosses(engine: str, error_mm: float, share: float) -> None:
    found = compute_tosses(read_tosses(DATA), engine).summary()  # type: ignore[arg-type]
    assert found["median_error_mm"] <= error_mm and found["same_face"] >= share


def test_the_face_that_points_up() -> None:
    turns = Rotation.from_euler("xyz", [[0, 0, 50], [180, 0, 10], [0, -90, 0], [90, 0, 0]], degrees=True)
    assert upper_face(turns).tolist() == [3, -3, 1, 2]


def test_a_damaged_table_is_one_line(tmp_path: Path) -> None:
    lines = DATA.read_text().splitlines()
    damaged = tmp_path / "tosses.csv"
    damaged.write_text("\n".join([lines[0], lines[1].replace("0.743243", "long")]))
    with pytest.raises(InputError, match=r"line 2, duration_s: is 'long', must be a number"):
        read_tosses(damaged)
    for old, new, said in (
        ("0.743243", "nan", "duration_s: is nan, must be up to"),
        ("0.743243", "0", "duration_s: is 0, must be at least"),
        ("0.431995", "0.9", "qw: to qz have length"),
    ):
        damaged.write_text("\n".join([lines[0], lines[1].replace(old, new)]))
        with pytest.raises(InputError, match=said):
            read_tosses(damaged)
    damaged.write_text("\n".join([lines[0].replace("qw", "qq"), lines[1]]))
    with pytest.raises(InputError, match=r"qw: is missing"):
        read_tosses(damaged)
    with pytest.raises(InputError, match="cannot be read"):
        read_tosses(tmp_path / "none.csv")
    assert np.isfinite(read_tosses(DATA)[0].duration)
