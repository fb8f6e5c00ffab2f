"""Machine code that was built before is used where it fits, gives the same results, and is compiled anew where not."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from conftest import REPOSITORY

from feeder_sim.engines.impulse.pairs.due import PAIR
from feeder_sim.engines.impulse.state import PART
from feeder_sim.machine_code import library
from feeder_sim.machine_code.flat import Kind, dtype_text, flattened, kind_of, lasting
from feeder_sim.machine_code.library import FOLDER, built_variant, kind_from, kind_to
from feeder_sim.records.seed import Counts

pytestmark = pytest.mark.skipif(not library.fits(), reason="the libraries are for another platform or processor")

# Starts the engines of examples with as little as needs all machine code; prints which of them made numba be imported.
STARTED = """
import sys
from feeder_sim.run.compilation import compile_engine
from feeder_sim.scenario import load_scenario
from feeder_sim.run.prepare import prepare

for name in sys.argv[1:]:
    compile_engine(prepare(load_scenario(name)))
    if "numba" in sys.modules:
        print(name)
        break
"""


@pytest.fixture
def forgotten() -> Iterator[None]:
    """What is known of the libraries is read anew, before and after."""
    library._index.cache_clear()
    yield
    library._index.cache_clear()


def started(names: list[str], tmp_path: Path, **more: str) -> str:
    env = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "cache")} | more
    command = [sys.executable, "-c", STARTED, *names]
    return subprocess.run(command, env=env, capture_output=True, text=True, check=True, timeout=300).stdout.strip()


def test_no_library_knows_where_it_was_built() -> None:
    """It would come out as other bytes elsewhere."""
    libraries = {file.name: file.read_bytes() for file in FOLDER.glob("*.so")}
    assert libraries and [name for name, code in libraries.items() if b'File "' in code or b".py" in code] == []


@pytest.mark.slow
def test_no_example_has_to_compile(tmp_path: Path) -> None:
    """Where this fails, compiled functions have changed: python -m feeder_sim.machine_code.build."""
    assert started([str(file) for file in sorted((REPOSITORY / "scenarios").glob("*.toml"))], tmp_path) == ""


@pytest.mark.slow
def test_an_environment_variable_compiles(tmp_path: Path) -> None:
    name = str(REPOSITORY / "scenarios/ball_50hz.toml")
    assert started([name], tmp_path, FEEDER_SIM_COMPILE="1") == name


@pytest.mark.usefixtures("forgotten")
@pytest.mark.parametrize("left", [None, "", "{", "[]"])
def test_without_an_index_there_is_no_library(
    left: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(library, "FOLDER", tmp_path)
    if left is not None:
        (tmp_path / "index.json").write_text(left)
    assert built_variant(started, "i,") is None


@pytest.mark.usefixtures("forgotten")
def test_of_other_sources_there_is_no_machine_code(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same function with a constant changed has another key."""
    from feeder_sim.run import state_check

    entry, keys = state_check.check_states.py_func, []  # type: ignore[attr-defined]
    name = next(name for name in json.loads((FOLDER / "index.json").read_text()) if name.startswith("check_states"))
    monkeypatch.setattr(library, "variant_name", lambda *_: name)
    assert built_variant(entry, "") is not None
    monkeypatch.setattr(library, "key_of", lambda function: str(keys.append(function)))  # type: ignore[func-returns-value]
    assert built_variant(entry, "") is None and keys == [entry]


@pytest.mark.usefixtures("forgotten")
@pytest.mark.parametrize("left", [0, 1000])
def test_half_a_library_is_none(left: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from feeder_sim.run import state_check

    index = json.loads((FOLDER / "index.json").read_text())
    name = next(name for name in index if name.startswith("check_states"))
    monkeypatch.setattr(library, "variant_name", lambda *_: name)
    monkeypatch.setattr(library, "FOLDER", tmp_path)
    (tmp_path / "index.json").write_text(json.dumps(index))
    (tmp_path / f"{name}.so").write_bytes((FOLDER / f"{name}.so").read_bytes()[:left])
    assert built_variant(state_check.check_states.py_func, "") is None  # type: ignore[attr-defined]


class Place(NamedTuple):
    x: float
    steps: Any


class Turned(NamedTuple):
    steps: float
    x: float


Turned.__name__ = "Place"


def test_kinds_survive_the_index() -> None:
    counts = Kind("tuple", Counts, inner=(Kind("integer"), Kind("bool"), Kind("array", PAIR, 1), Kind("none")))
    for kind in (counts, Kind("array", PART, 1), Kind("array", np.dtype("<c16"), 2)):
        back = kind_from(json.loads(json.dumps(kind_to(kind))))
        assert back == kind
        if kind.of == "array":
            assert dtype_text(back.type) == dtype_text(kind.type)
            assert back.type.isalignedstruct == kind.type.isalignedstruct


def test_arguments_are_laid_down_in_order() -> None:
    numbers = np.arange(6.0).reshape(2, 3)
    flat = flattened((3, 0.5, True, None, Place(1.5, numbers), (np.float64(2.0), np.int64(7))))
    assert list(flat.floats) == [0.5, 1.5, 2.0]
    assert list(flat.integers) == [3, 1, numbers.ctypes.data, 2, 3, 7]
    assert kind_of(Place(1.5, None)).type is Place


def test_texts_tell_types_apart() -> None:
    """Also named tuples whose fields have changed places, and records with a field more."""
    values: list[Any] = [
        1,
        1.0,
        True,
        None,
        np.zeros(1),
        np.zeros((1, 1)),
        np.zeros(1, int),
        np.zeros(1, PART),
        np.zeros(1, PAIR),
    ]
    values += [(1,), (1, 1), Place(1.0, 1.0), Turned(1.0, 1.0)]
    texts = [flattened((value,)).text for value in values]
    assert len(set(texts)) == len(values)


def test_a_lasting_tuple_is_flattened_once() -> None:
    place = Place(2.0, np.zeros(3))
    kept = lasting(place)
    assert kept == place and isinstance(kept, Place)
    first, again = flattened((kept, 1)), flattened((1, kept))
    assert first.text == flattened((place, 1)).text and list(again.integers) == [1, *first.integers[:2]]
    assert kind_of(kept) == kind_of(place)
    changed = kept._replace(x=3.0)
    assert flattened((changed,)).floats == flattened((lasting(changed),)).floats
    assert list(flattened((changed,)).floats) == [3.0]
    assert kind_of(lasting(changed)) == kind_of(place)


def test_other_arguments_are_refused() -> None:
    with pytest.raises(TypeError, match="has gaps"):
        flattened((np.zeros((4, 4))[:, :2],))
    with pytest.raises(TypeError, match="a str is nothing"):
        flattened(("text",))
