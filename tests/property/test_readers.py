"""Whatever stands in a file, the readers give a value or one `InputError`, never anything else."""

from __future__ import annotations

import copy
import shutil
import tempfile
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import tomli_w
from conftest import NUT_ON_STRIP, REPOSITORY
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from feeder_sim.engines.mujoco.mjcf import build_mjcf
from feeder_sim.errors import InputError
from feeder_sim.plate.materials import Material
from feeder_sim.plate.mode_file import ModeFile, Resonance, read_mode_file, write_mode_file
from feeder_sim.plate.modes import PlateModes, plate_modes
from feeder_sim.plate.rectangle import RectangularPlate
from feeder_sim.run.run_folder import scenario_toml
from feeder_sim.scenario import parse_scenario
from feeder_sim.scene.scene import build_scene

FILE = Path("scenario.toml")
MODES = REPOSITORY / "models/plate_180/modes.h5"
GOOD: dict[str, Any] = NUT_ON_STRIP | {
    "part": [{"shape": "hex_nut", "size": "M2.5", "start": {"position_mm": [1.0, 0.0]}}],
    "contact": {"restitution": 0.2},
}
SCALARS = st.one_of(
    st.none().map(lambda _: "text"),
    st.booleans(),
    st.integers(-(10**6), 10**6),
    st.floats(allow_nan=True, allow_infinity=True),
    st.text(st.characters(codec="utf-8"), max_size=8),
    st.sampled_from([1e-300, 1e300, 2**64, 10**40, 1e-9, 1e9]),
)
VALUES = st.one_of(
    SCALARS, st.lists(SCALARS, max_size=3), st.dictionaries(st.text("abc_", min_size=1), SCALARS, max_size=2)
)


def tables(value: Any) -> list[dict[str, Any]]:
    """Every table in a document, outermost first."""
    if isinstance(value, list):
        return [table for entry in value for table in tables(entry)]
    if isinstance(value, dict):
        return [value, *(table for entry in value.values() for table in tables(entry))]
    return []


@given(data=st.data())
@settings(max_examples=300, deadline=None)
def test_scenario_reader_accepts_or_says_what_is_wrong(data: st.DataObject) -> None:
    document = copy.deepcopy(GOOD)
    for _ in range(data.draw(st.integers(1, 3))):
        table = data.draw(st.sampled_from(tables(document)))
        known, new = st.sampled_from(sorted(table) or ["x"]), st.text("abcdefgh_", min_size=1, max_size=12)
        key = data.draw(st.one_of(known, new))
        if data.draw(st.booleans()):
            table[key] = data.draw(VALUES)
        else:
            table.pop(key, None)
    text = tomli_w.dumps(document)
    try:
        scenario = parse_scenario(text, file=FILE)
    except InputError as error:
        assert str(error).startswith("scenario.toml: ")
        assert "\n" not in str(error)
        return
    assert parse_scenario(scenario_toml(scenario), file=FILE) == scenario
    try:
        build_mjcf(build_scene(scenario)).compile()
    except InputError as error:
        assert "\n" not in str(error)


@given(text=st.text(max_size=200))
def test_scenario_reader_survives_any_text(text: str) -> None:
    with pytest.raises(InputError):
        parse_scenario(text, file=FILE)


@pytest.fixture(scope="module")
def small_modes() -> PlateModes:
    plate = RectangularPlate(0.1, 0.08, 0.002, Material(2770.0, 71e9, 0.33))
    return plate_modes(plate, highest_frequency=3000.0, terms_per_axis=16)


def test_mode_file_returns_what_was_written(small_modes: PlateModes, tmp_path: Path) -> None:
    resonance = Resonance(1, 1500.0, 0.002, 2e-7, (0.01, 0.0))
    write_mode_file(tmp_path / "m.h5", ModeFile(small_modes, (resonance,)))
    read = read_mode_file(tmp_path / "m.h5")
    assert read.resonances == (resonance,)
    assert read.modes.plate == small_modes.plate
    assert np.array_equal(read.modes.coefficients, small_modes.coefficients)
    with h5py.File(tmp_path / "m.h5") as file:
        assert file["modes/natural_frequency"].attrs["unit"] == b"Hz"
        assert {"normalisation", "sign_convention", "creator", "method"} <= set(file.attrs)


def test_no_text_in_a_mode_file_lies_outside_its_checksums() -> None:
    """Text of variable length lies in a heap without one, in which HDF5 looped for ever on a damaged file."""
    lengths = {}
    with h5py.File(MODES) as file:

        def note(name: str, item: h5py.HLObject) -> None:
            for key in item.attrs:
                text = h5py.check_string_dtype(item.attrs.get_id(key).dtype)
                lengths[f"{name}/{key}"] = text.length if text else 0

        note("", file)
        file.visititems(note)
    assert lengths["/schema"] == len("feeder_sim/plate_modes") and lengths["modes/parity/unit"] == 1
    assert all(length is not None for length in lengths.values())


@given(data=st.data())
@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_damaged_mode_file_is_refused_or_read_unchanged(data: st.DataObject) -> None:
    """Cut the file anywhere, or overwrite a stretch of it."""
    content = bytearray(MODES.read_bytes())
    if data.draw(st.booleans()):
        content = content[: data.draw(st.integers(0, len(content) - 1))]
    else:
        # Most of the file is compressed coefficients; damage the structure at least as often.
        start = data.draw(st.one_of(st.integers(0, 4000), st.integers(0, len(content) - 64)))
        content[start : start + 16] = data.draw(st.binary(min_size=16, max_size=16))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "damaged.h5"
        path.write_bytes(bytes(content))
        try:
            held = read_mode_file(path)
        except InputError as error:
            assert str(path) in str(error) and "\n" not in str(error)
        else:  # checksums cover the data, so what is read is what was written
            original = read_mode_file(MODES)
            assert np.array_equal(held.modes.coefficients, original.modes.coefficients)
            assert np.array_equal(held.modes.natural_frequency, original.modes.natural_frequency)


@pytest.mark.parametrize("name", ["modes/natural_frequency", "modes/coefficients", "modes/parity", "resonances/mode"])
@pytest.mark.parametrize("value", [None, np.nan, -1.0, np.inf])
def test_inconsistent_mode_file_is_refused(name: str, value: float | None, tmp_path: Path) -> None:
    """Without the last entry, or with another first one."""
    path = tmp_path / "m.h5"
    shutil.copy(MODES, path)
    with h5py.File(path, "r+") as file:
        whole = file[name][()]
        del file[name]
        if value is not None:
            whole.flat[0] = -5 if np.issubdtype(whole.dtype, np.integer) else value
        file[name] = whole[:-1] if value is None else whole
    if (name, value) == ("modes/coefficients", -1.0):
        assert len(read_mode_file(path).modes) == 59  # any finite coefficient is a coefficient
        return
    with pytest.raises(InputError, match=r"m\.h5"):
        read_mode_file(path)
