"""Whatever stands in a file, it is read unchanged, or refused in one short line that a terminal only shows."""

from __future__ import annotations

import copy
import shutil
import sys
import tempfile
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import tomli_w
import trimesh
from conftest import NUT_ON_STRIP, REPOSITORY
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from feeder_sim.engines.mujoco.mjcf import build_mjcf
from feeder_sim.errors import LONGEST_MESSAGE, FeederSimError, InputError, quoted
from feeder_sim.part.mesh_file import MESH_SUFFIXES
from feeder_sim.part.rigid_part import RigidPart
from feeder_sim.plate.materials import Material
from feeder_sim.plate.mode_file import ModeFile, Resonance, read_mode_file, write_mode_file
from feeder_sim.plate.modes import PlateModes, plate_modes
from feeder_sim.plate.rectangle import RectangularPlate
from feeder_sim.run.run_folder import scenario_toml
from feeder_sim.scenario import MeshPart, parse_scenario
from feeder_sim.scene.part import build_part
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


SCENARIO = """
[plate]
kind = "piston"
[[drive]]
frequency_hz = 50.0
amplitude_um = 100.0
[[part]]
shape = "ball"
diameter_mm = 3.0
[run]
duration_s = 1.0
"""
HUGE = "0x" + "f" * 5000  # more digits than Python writes


def refused(text: str) -> str:
    with pytest.raises(InputError) as error:
        parse_scenario(text, file=FILE)
    message = str(error.value)
    assert message.startswith("scenario.toml: ") and message.isprintable() and len(message) <= LONGEST_MESSAGE
    return message


@pytest.mark.parametrize(
    ("old", "new", "key"),
    [
        ("duration_s = 1.0", f"duration_s = {HUGE}", "run.duration_s: is a whole number of more than 300 digits"),
        ("duration_s = 1.0", f"duration_s = 1.0\nseed = [{HUGE}]", "run.seed[0]: is a whole number"),
        ('kind = "piston"', f"kind = {HUGE}", "plate.kind: is a whole number"),
        ("duration_s = 1.0", f"duration_s = {'9' * 5000}", "holds a whole number of thousands of digits"),
    ],
)
def test_whole_numbers_of_thousands_of_digits(old: str, new: str, key: str, capfd: pytest.CaptureFixture[str]) -> None:
    assert key in refused(SCENARIO.replace(old, new))
    assert capfd.readouterr().err == ""  # pydantic told there what it could not show


@pytest.mark.parametrize("depth", [30, 300, 3000])
def test_keys_and_lists_nested_deep(depth: int) -> None:
    deep = ".".join(["a"] * depth)
    for text in (
        f"{deep} = 1\n{SCENARIO}",
        f"{SCENARIO}[{deep}]\nx = 1\n",
        SCENARIO.replace("duration_s = 1.0", f"duration_s.{deep} = 1"),
        SCENARIO.replace('kind = "piston"', f"kind.{deep} = 1"),
        SCENARIO.replace("1.0", "[" * depth + "]" * depth),
    ):
        assert "nested too deep, must be 20 levels" in refused(text)


def test_control_characters_do_not_reach_the_terminal() -> None:
    red, turned = "\\u001b[31mred\\u009b1m", "\\u202ecba\\u2066"  # an escape sequence; letters from right to left
    assert r"is '\x1b[31mred\x9b1m'" in refused(f'{SCENARIO}engine = "{red}"')
    assert r"run.\x1b[31mred\x9b1m: unknown key" in refused(f'{SCENARIO}"{red}" = 1')
    assert r"run.\u202ecba\u2066: unknown key" in refused(f'{SCENARIO}"{turned}" = 1')
    named = InputError("no such file", file="\x1b[2J\udc80.toml")
    assert str(named) == r"\x1b[2J\udc80.toml: no such file"


def test_long_values_are_shortened() -> None:
    long = "x" * 5000
    assert "...xx" in refused(f'{SCENARIO}engine = "{long}"')
    assert len(refused(f'{SCENARIO}engine = "{long}"')) < 200
    assert refused(SCENARIO.replace("piston", long)).endswith("'still', 'tray', 'plate'")
    assert "unknown key; must be" in refused(f"{SCENARIO}{long} = 1")
    many = "\n".join(f"key_{i} = 1" for i in range(20_000))
    assert "and 19999 more" in refused(f"{SCENARIO}{many}")  # in no time
    assert len(quoted(list(range(10_000)))) == 80
    assert quoted(int(HUGE, 16)) == "a value that is too long to show (int)"


@given(text=st.text())
def test_any_message_is_one_short_line(text: str) -> None:
    for error in (FeederSimError(text * 100), InputError(text, file=text, key=text)):
        assert str(error).isprintable() and len(str(error)) <= LONGEST_MESSAGE


def mesh_file(folder: Path, suffix: str) -> Path:
    trimesh.creation.annulus(1.0, 2.0, 3.0).export(folder / f"ring{suffix}")
    return folder / f"ring{suffix}"


def mesh(path: Path) -> RigidPart:
    return build_part(MeshPart(shape="mesh", file=path))


@given(data=st.data())
@settings(max_examples=200, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_damaged_mesh_is_a_part_or_refused(data: st.DataObject, tmp_path: Path) -> None:
    path = mesh_file(tmp_path, data.draw(st.sampled_from(MESH_SUFFIXES)))
    content = bytearray(path.read_bytes())
    if data.draw(st.booleans()):
        content = content[: data.draw(st.integers(0, len(content) - 1))]
    else:
        start = data.draw(st.one_of(st.integers(0, 200), st.integers(0, len(content) - 1)))
        content[start : start + 8] = data.draw(st.binary(min_size=8, max_size=8))
    path.write_bytes(bytes(content))
    try:
        part = mesh(path)
    except InputError as error:
        assert "\n" not in str(error)
    else:
        assert np.isfinite([part.mass, *part.inertia, part.size]).all()


def test_mesh_without_a_third_coordinate_is_refused(tmp_path: Path) -> None:
    path = mesh_file(tmp_path, ".obj")
    path.write_text("v 0 0\nv 1 0\nv 0 1\nf 1 2 3\n")
    with pytest.raises(InputError, match=r"has vertices of 2 coordinates, must be 3$"):
        mesh(path)


def test_mesh_that_another_module_would_be_needed_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """trimesh guesses the alphabet of text that is not in UTF-8 with a module that need not be there."""
    monkeypatch.setitem(sys.modules, "charset_normalizer", None)
    path = mesh_file(tmp_path, ".obj")
    path.write_bytes(b"# M\xfcnchen\n" + path.read_bytes())
    assert mesh(path).mass > 0.0  # names and comments may be in any alphabet


@pytest.mark.parametrize(
    ("suffix", "named"),
    [(".obj", b"mtllib ../other.mtl\nusemtl red\n"), (".ply", b"comment TextureFile ../other.png\n")],
)
def test_mesh_reads_no_file_that_it_names(
    suffix: str, named: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    path = mesh_file(tmp_path, suffix)
    plain, content = mesh(path), path.read_bytes()
    at = 0 if suffix == ".obj" else content.index(b"element")
    path.write_bytes(content[:at] + named + content[at:])
    asked: list[str] = []
    monkeypatch.setattr(trimesh.resolvers.FilePathResolver, "get", lambda self, name: asked.append(name))
    part = mesh(path)
    assert asked == [] and caplog.text == ""
    assert np.array_equal(part.vertices, plain.vertices) and np.array_equal(part.inertia, plain.inertia)


@pytest.mark.parametrize("suffix", MESH_SUFFIXES)
def test_mesh_of_several_bodies_is_refused(suffix: str, tmp_path: Path) -> None:
    """Their hull was one body that closed the gap, with the mass of all."""
    box, beside, inside = trimesh.creation.box(), trimesh.creation.box(), trimesh.creation.icosphere(1)
    beside.apply_translation((3, 0, 0))
    inside.apply_scale(0.3)
    inside.invert()  # a cavity, which was counted as mass twice
    for bodies, number in (([box, beside], 2), ([box, inside], 2), ([box, beside, inside], 3)):
        trimesh.util.concatenate(bodies).export(tmp_path / f"bodies{suffix}")
        with pytest.raises(InputError, match=f"holds {number} bodies or cavities, must be one body"):
            mesh(tmp_path / f"bodies{suffix}")
    box.export(tmp_path / f"one{suffix}")
    assert mesh(tmp_path / f"one{suffix}").mass > 0.0


def test_mesh_without_bounds_is_refused(tmp_path: Path) -> None:
    for number in ("1e300", "nan", "inf", "1e6"):
        path = mesh_file(tmp_path, ".off")
        lines = path.read_text().splitlines()
        path.write_text("\n".join([*lines[:2], f"{number} 0.0 0.0", *lines[3:]]))
        with pytest.raises(InputError, match=r"ring\.off: part\.file: "):
            mesh(path)
