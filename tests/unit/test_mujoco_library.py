"""Which versions of MuJoCo are taken."""

from __future__ import annotations

import tomllib
from pathlib import Path

import mujoco
import pytest
from conftest import REPOSITORY

from feeder_sim.engines.mujoco_library import LEAST_VERSION, WRONG_VERSION, load_mujoco_symbols
from feeder_sim.errors import FeederSimError


@pytest.mark.parametrize("version", ["3.12.0", "4.0.0"])
def test_a_version_that_does_not_do_is_refused(monkeypatch: pytest.MonkeyPatch, version: str) -> None:
    monkeypatch.setattr(mujoco, "__version__", version)
    with pytest.raises(FeederSimError, match=rf"MuJoCo is {version}, must be 3\.13 or newer except 4\.0\.0"):
        load_mujoco_symbols()


@pytest.mark.parametrize("version", ["3.13.0", "3.17.0", "4.0.1"])
def test_any_other_is_taken(monkeypatch: pytest.MonkeyPatch, version: str) -> None:
    monkeypatch.setattr(mujoco, "__version__", version)
    load_mujoco_symbols()


@pytest.mark.parametrize(("content", "expected"), [(None, "is missing in"), (b"no library", r"is damaged \(")])
def test_a_library_that_is_not_there_or_damaged_is_said_to_be(
    content: bytes | None, expected: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if content is not None:
        (tmp_path / "libmujoco.so").write_bytes(content)
    monkeypatch.setattr(mujoco, "__file__", str(tmp_path / "__init__.py"))
    with pytest.raises(FeederSimError, match=rf"MuJoCo's library {expected}.*, install the package mujoco again$"):
        load_mujoco_symbols()


def test_pip_is_told_the_same() -> None:
    project = tomllib.loads((REPOSITORY / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    (needed,) = (line for line in project["dependencies"] if line.startswith("mujoco"))
    least, wrong = (".".join(map(str, version)) for version in (LEAST_VERSION[:2], WRONG_VERSION))
    assert needed == f"mujoco>={least},!={wrong}"
