"""Whatever stands in a file: it is read unchanged, or refused in one short line that a terminal only shows."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from feeder_sim.errors import LONGEST_MESSAGE, FeederSimError, InputError, quoted
from feeder_sim.part.mesh_file import MESH_SUFFIXES
from feeder_sim.part.rigid_part import RigidPart
from feeder_sim.scenario import MeshPart, parse_scenario
from feeder_sim.scene.part import build_part

FILE = Path("scenario.toml")
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
        assert "nested too deep, allowed are 20 levels" in refused(text)


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
    assert refused(SCENARIO.replace("piston", long)).endswith(
        "allowed is 'strip', 'rectangle', 'modes', 'piston', 'still'"
    )
    assert "unknown key; allowed are" in refused(f"{SCENARIO}{long} = 1")
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
    with pytest.raises(InputError, match=r"has vertices of 2 coordinates, allowed are 3$"):
        mesh(path)


def test_mesh_that_another_module_would_be_needed_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """trimesh guesses the alphabet of text that is not in UTF-8 with a module that need not be there."""
    monkeypatch.setitem(sys.modules, "charset_normalizer", None)
    path = mesh_file(tmp_path, ".obj")
    path.write_bytes(b"# M\xfcnchen\n" + path.read_bytes())
    with pytest.raises(InputError, match=r"ring\.obj: part\.file: not a readable mesh: damaged, or .* not in UTF-8$"):
        mesh(path)


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
        with pytest.raises(InputError, match=f"holds {number} bodies or cavities, allowed is one body"):
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
