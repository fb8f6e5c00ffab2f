"""Machine code that is kept between runs is that of the present sources, and a cache that fails costs time only.

Everything here runs a copy of the package in processes of its own, with a cache of its own.
"""

from __future__ import annotations

import json
import os
import pickle
import platform
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numba
import numpy as np
import pytest
from conftest import REPOSITORY

from feeder_sim.engines.impulse import state
from feeder_sim.machine_code import compiled, inlined, jit, overload
from feeder_sim.machine_code.jit import LIBRARIES, MOST_FOLDERS, PARTS, callable_from_python, code_key
from feeder_sim.machine_code.key import LENGTH, key_of

# Two more files for the copy: what Python calls is in one of them, what that calls in the other.
INNER = """
from feeder_sim.machine_code import compiled

@compiled
def law(x):
    return 2 * x

@compiled
def sum_of_ends(records, first, last):
    if last - first == 1:
        return records[first].end
    middle = (first + last) // 2
    return sum_of_ends(records, first, middle) + sum_of_ends(records, middle, last)
"""
ENTRIES = """
from feeder_sim.inner import law, sum_of_ends
from feeder_sim.machine_code import entry_point

@entry_point
def first(x):
    return law(x) + 1

@entry_point
def difference(x):
    return law(x) + 1 - law(law(x))

@entry_point
def ends(records):
    return law(sum_of_ends(records, 0, records.shape[0]))
"""

# Prints what the entries make of numbers, and of three records with fields of these names that hold 0, 1, 2; and how
# many functions had to be compiled for it.
CALL = """
import json, sys
import numpy as np
from feeder_sim.entries import difference, ends, first

values = []
for given in json.loads(sys.argv[1]):
    if isinstance(given, list):
        records = np.zeros(3, [(name, "f8") for name in given])
        for number, name in enumerate(given):
            records[name] = number
        values.append(ends(records))
    else:
        values += [first(given), difference(given)]
calls = [call for entry in (difference, ends, first) for call, _ in entry.variants.values()]
compiled = [call.args[0].stats.cache_misses for call in calls]
print(json.dumps([values, sum(sum(misses.values()) for misses in compiled)]))
"""

# Before it, a wait for a sign from outside, on a disk so slow that others get between reading an index and writing it.
AT_ONCE = """
import sys, time
from numba.core.caching import IndexDataCacheFile
import feeder_sim.entries

save = IndexDataCacheFile._save_index
IndexDataCacheFile._save_index = lambda *arguments: (time.sleep(0.3), save(*arguments))
print("ready", file=sys.stderr, flush=True)
sys.stdin.readline()
"""

# Before it, an end as sudden as that of a killed process, when all but the entry itself is compiled.
KILLED = """
import os
from feeder_sim.machine_code import jit

jit._EntryCache.save_overload = lambda *_: os._exit(9)
"""

# After it, how often inner functions were compiled.
MISSES = """
from feeder_sim.inner import law, sum_of_ends
from feeder_sim.machine_code.jit import dispatcher_of

print([sum(dispatcher_of(function).stats.cache_misses.values()) for function in (law, sum_of_ends)])
"""

# The free fall of a ball far above a plate at rest.
FALL = """
import json, sys
import numpy as np
from feeder_sim.engines.protocol import engine_class
from feeder_sim.scenario import load_scenario
from feeder_sim.scenario.engine_choice import choose_engine
from feeder_sim.scene.scene import build_scene

changes = {"drive[0].amplitude_um": 0.0, "part[0].start.drop_height_mm": 100.0}
scenario = load_scenario(json.loads(sys.argv[1])).changed(changes)
engine = engine_class(choose_engine(scenario))(build_scene(scenario), np.random.default_rng(0))
begin, end = engine.current(), engine.advance(50)
print(json.dumps([begin.position[0, 0, 2] - end.position[-1, 0, 2], end.velocity[-1, 0, 2], type(engine).__name__]))
"""


@dataclass(frozen=True)
class Copy:
    """A copy of the package, and the cache that its processes use."""

    package: Path
    cache: Path

    def start(self, script: str, argument: Any, prefix: Sequence[str] = ()) -> subprocess.Popen[str]:
        # Files of byte code are told apart by whole seconds, and tests change a source within one.
        more, pipe = {"PYTHONPATH": str(self.package.parent), "NUMBA_CACHE_DIR": str(self.cache)}, subprocess.PIPE
        command, env = [*prefix, sys.executable, "-B", "-c", script, json.dumps(argument)], os.environ | more
        return subprocess.Popen(
            command, env=env, cwd=self.package.parent, stdin=pipe, stdout=pipe, stderr=pipe, text=True
        )

    def call(self, *arguments: Any) -> list[Any]:
        return printed(self.start(CALL, arguments))

    def edit(self, name: str, old: str, new: str) -> None:
        text = (self.package / name).read_text()
        assert text.count(old) == 1
        (self.package / name).write_text(text.replace(old, new))

    def files(self) -> dict[Path, bytes]:
        """All machine code, but for what says what entry points return."""
        found = [file for file in self.cache.rglob("*") if file.suffix in (".nbi", ".nbc")]
        return {file: file.read_bytes() for file in found}


def printed(process: subprocess.Popen[str]) -> list[Any]:
    """What a process has printed, which has to end well and without a word about anything else."""
    out, err = process.communicate(timeout=120)
    assert process.returncode == 0 and err == "", err
    return list(json.loads(out))


@pytest.fixture
def copy(tmp_path: Path) -> Copy:
    made = Copy(tmp_path / "sources/feeder_sim", tmp_path / "cache")
    shutil.copytree(REPOSITORY / "feeder_sim", made.package, ignore=shutil.ignore_patterns("__pycache__"))
    (made.package / "inner.py").write_text(INNER)
    (made.package / "entries.py").write_text(ENTRIES)
    return made


def expected(*arguments: float, factor: int = 2) -> list[float]:
    """What the entries make of numbers."""
    return [value for x in arguments for value in (factor * x + 1, factor * x + 1 - factor**2 * x)]


@pytest.mark.slow
def test_a_second_process_compiles_nothing(copy: Copy) -> None:
    assert copy.call(3, 0.5) == [expected(3, 0.5), 4]  # two functions, for whole numbers and others
    before = copy.files()
    assert len(before) == 2 * 4  # an index for each of them, and its code
    assert copy.call(3, 0.5) == [expected(3, 0.5), 0]
    assert copy.files() == before


@pytest.mark.slow  # compiles in three processes
@pytest.mark.parametrize(("argument", "values", "misses"), [(3, [7, -5], [1, 0]), (["begin", "end"], [6.0], [0, 0])])
def test_what_a_killed_process_has_compiled_is_not_compiled_again(
    argument: Any, values: list[float], misses: list[int], copy: Copy
) -> None:
    """Of two entry points the first is made of what was there, and that is removed then."""
    killed = copy.start(KILLED + CALL, [argument])
    killed.communicate(timeout=120)
    assert killed.returncode == 9
    parts = [file for file in copy.files() if file.parent.name == PARTS]
    assert (
        len(parts) == len(copy.files()) == 2 * (2 if argument == 3 else 3)
    )  # an index for each function, and its code
    out, err = copy.start(CALL + MISSES, [argument]).communicate(timeout=120)
    assert [json.loads(line) for line in out.splitlines()] == [[values, len(values)], misses] and err == ""
    assert not [file for file in copy.files() if file.parent.name == PARTS]  # they are in the entries now
    assert copy.call(argument) == [values, 0]


@pytest.mark.slow  # compiles in three processes
def test_versions_that_two_processes_compiled_are_told_apart_by_a_third(copy: Copy) -> None:
    """Both compile the same function first, for records of which each is the first that it meets."""
    short, long = ["begin", "end"], ["begin", "middle", "end"]
    assert [copy.call(kind) for kind in (short, long)] == [[[6.0], 1], [[12.0], 1]]
    assert copy.call(short, long, short) == [[6.0, 12.0, 6.0], 0]


@pytest.mark.slow  # compiles in three processes
def test_a_function_of_another_file_is_the_present_one(copy: Copy) -> None:
    assert copy.call(3)[0] == expected(3)
    copy.edit("inner.py", "2 * x", "5 * x")
    assert copy.call(3)[0] == expected(3, factor=5)
    copy.edit("inner.py", "5 * x", "2 * x")
    assert copy.call(3) == [expected(3), 0]  # the way back costs nothing


@pytest.mark.slow
def test_a_constant_of_another_file_is_the_present_one(copy: Copy) -> None:
    """Gravity, in a file without any compiled function, for a whole engine, the one that compiles fastest."""
    for present, gravity in (("9.81", 9.81), ("1.62", 1.62)):
        copy.edit("constants.py", "GRAVITY = 9.81", f"GRAVITY = {present}")
        fallen, speed, engine = printed(copy.start(FALL, str(REPOSITORY / "scenarios/ball_50hz.toml")))
        assert engine == "SlideEngine" and speed**2 == pytest.approx(2.0 * gravity * fallen, rel=1e-9)


# The key of the functions that are called in the end.
KEYS = """
import json
from feeder_sim.entries import ends, first
from feeder_sim.machine_code.key import key_of

print(json.dumps([key_of(first.py_func), key_of(ends.py_func)]))
"""
CHANGES = {  # old and new text of inner.py, and whether the keys of `first` and `ends` are others then
    "a function that both call": ("return 2 * x", "return 3 * x", [True, True]),
    "an inner function of one": ("first + last", "last + first", [False, True]),
    "the type of a constant": ("return 2 * x", "return 2.0 * x", [True, True]),
    "a docstring": ("def law(x):", 'def law(x):\n    """Twice."""', [False, False]),
    "a comment, and lines": ("@compiled\ndef law", "# Twice.\n\n\n@compiled\ndef law", [False, False]),
    "another function": ("@compiled\ndef law", "def other():\n    pass\n\n\n@compiled\ndef law", [False, False]),
}


@pytest.mark.parametrize("change", CHANGES)
def test_a_key_is_that_of_all_that_a_function_calls(change: str, copy: Copy) -> None:
    before = printed(copy.start(KEYS, None))
    assert printed(copy.start(KEYS, None)) == before != before[::-1]
    old, new, others = CHANGES[change]
    source = copy.package / "inner.py"
    source.write_text(source.read_text().replace(old, new, 1))
    assert [now != then for now, then in zip(printed(copy.start(KEYS, None)), before, strict=True)] == others


RECORD = np.dtype([("a", "f8")])


def test_a_key_follows_constants_records_tuples_overloads_and_marks() -> None:
    class Place(NamedTuple):
        x: float
        y: float

    def made(
        constant: Any = 1.0, record: Any = RECORD, fields: Any = Place, choice: float = 2.0, mark: Any = compiled
    ) -> str:
        @mark
        def marked(x: float) -> float:
            return x

        def chosen(x: float) -> float:
            raise NotImplementedError

        @overload(chosen)
        def choose(x: Any) -> Any:
            return lambda x: choice * x

        def function(x: float) -> Any:
            return constant * chosen(x), np.empty(1, record), fields(x, marked(x))

        return key_of(function)

    wider, other = np.dtype([("a", "f8"), ("b", "f8")]), NamedTuple("Place", [("y", float), ("x", float)])
    keys = [made(), made(2.0), made(np.arange(3)), made(np.arange(4)), made(record=wider), made(fields=other)]
    assert len({*keys, made(choice=3.0), made(mark=inlined)}) == 8 and made() == keys[0]


def test_keys_are_kept_for_as_long_as_no_file_changes(copy: Copy) -> None:
    before = printed(copy.start(KEYS, None))
    (kept,) = (copy.cache / "keys").iterdir()
    text = kept.read_text()
    kept.write_text(text.replace(before[0], "0" * len(before[0])))
    assert printed(copy.start(KEYS, None)) == ["0" * len(before[0]), before[1]]
    kept.write_text(text[:10])
    assert printed(copy.start(KEYS, None)) == before


@pytest.mark.slow  # compiles seven times
def test_states_used_last_are_kept(copy: Copy) -> None:
    """A change and the way back cost nothing; old machine code is removed."""
    for factor in range(2, 9):
        if factor > 2:
            copy.edit("inner.py", f"return {factor - 1} * x", f"return {factor} * x")
        assert copy.call(3)[0] == expected(3, factor=factor)
    assert len([file for file in copy.files() if file.suffix == ".nbi"]) == 2 * jit.MOST_STATES


def test_the_key_of_machine_code_changes_with_libraries(monkeypatch: pytest.MonkeyPatch) -> None:
    seen = {code_key()}
    for library in LIBRARIES:
        monkeypatch.setattr(jit, "_version", lambda name, other=library: "0" if name == other else "1")
        seen.add(code_key())
    monkeypatch.setattr(platform, "python_version", lambda: "2.7")
    seen.add(code_key())
    assert len(seen) == 2 + len(LIBRARIES)


def test_folders_used_last_are_kept(tmp_path: Path) -> None:
    names = [f"{i:0{LENGTH}x}" for i in range(MOST_FOLDERS + 3)]  # the first is the youngest
    others = ["mine", "a" * (LENGTH + 1)]
    for name in [*names, *others]:
        (tmp_path / name / "below").mkdir(parents=True)
        age = names.index(name) if name in names else 1e9
        os.utime(tmp_path / name, 2 * (time.time() - age,))
    (tmp_path / ("f" * LENGTH)).write_text("a file")
    jit.remove_old_folders(tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {*names[:MOST_FOLDERS], *others, "f" * LENGTH}


@pytest.mark.slow  # compiles in two processes
def test_a_folder_that_is_in_use_is_young(copy: Copy) -> None:
    """What is used again moves to the front, however long ago it was made."""
    copy.call(3)
    (folder,) = (copy.cache / "machine_code").iterdir()
    os.utime(folder, (0, 0))
    for i in range(MOST_FOLDERS + 2):
        (folder.parent / f"{i:0{LENGTH}x}").mkdir()
    assert copy.call(3)[1] == 0
    assert folder.exists() and len(list(folder.parent.iterdir())) == MOST_FOLDERS


@pytest.mark.slow  # compiles in two processes
@pytest.mark.parametrize("place", ["file", "file/below"])
def test_without_a_folder_for_machine_code_everything_is_compiled(place: str, copy: Copy, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    for _ in range(2):
        assert replace(copy, cache=tmp_path / place).call(3) == [expected(3), 2]
    assert (tmp_path / "file").read_text() == "in the way"


def without_privilege() -> list[str]:
    """What a command has to begin with for root to respect a read-only folder."""
    if os.geteuid() != 0:
        return []
    if shutil.which("setpriv") is None:
        pytest.skip("nothing is read-only for root, and there is no setpriv to change that")
    return ["setpriv", "--bounding-set=-dac_override", "--inh-caps=-dac_override"]


@pytest.mark.slow  # compiles in two processes
@pytest.mark.skipif(os.name != "posix", reason="folders are made read-only in another way")
@pytest.mark.parametrize("filled", [False, True])
def test_in_a_read_only_folder_what_is_missing_is_compiled(filled: bool, copy: Copy) -> None:
    copy.cache.mkdir()
    if filled:
        copy.call(3)
    folders, before = [copy.cache, *(path for path in copy.cache.rglob("*") if path.is_dir())], copy.files()
    for folder in folders:
        folder.chmod(0o555)
    try:
        done = printed(copy.start(CALL, [3, 0.5], prefix=without_privilege()))
    finally:
        for folder in folders:
            folder.chmod(0o755)
    assert done == [expected(3, 0.5), 2 if filled else 4]
    assert copy.files() == before


@pytest.mark.slow
def test_processes_that_compile_at_once_add_to_each_other(copy: Copy) -> None:
    """Each for numbers of its own kind, into the same indices; afterwards all is there."""
    both = {number: copy.start(AT_ONCE + CALL, [number]) for number in (3, 0.5)}
    assert all(process.stderr and process.stderr.readline() == "ready\n" for process in both.values())
    for process in both.values():
        print(file=process.stdin, flush=True)
    assert [printed(process) for process in both.values()] == [[expected(number), 2] for number in both]
    before = copy.files()
    assert copy.call(3, 0.5) == [expected(3, 0.5), 0]
    assert copy.files() == before


DAMAGE: dict[str, Callable[[bytes], bytes]] = {
    "nothing": lambda _: b"",
    "half": lambda kept: kept[: len(kept) // 2],
    "something else": lambda _: b"x" * 100,
}
OF_INDICES: dict[str, Callable[[bytes], bytes]] = {
    "a type of a missing script": lambda _: pickle.dumps(numba.__version__) + b"cno_such_script\nPlace\n.",
    "a type that is gone": lambda _: pickle.dumps(numba.__version__) + b"cpathlib\nPlace\n.",
}
CASES = [(suffix, left) for suffix in (".nbc", ".nbi", ".variant") for left in DAMAGE] + [
    (".nbi", left) for left in OF_INDICES
]


@pytest.mark.slow
@pytest.mark.parametrize(("suffix", "left"), CASES)
def test_damaged_machine_code_is_compiled_again(suffix: str, left: str, copy: Copy) -> None:
    copy.call(3)
    for file in [*copy.cache.rglob(f"*{suffix}")]:
        file.write_bytes((DAMAGE | OF_INDICES)[left](file.read_bytes()))
    assert copy.call(3)[0] == expected(3)
    assert copy.call(3) == [expected(3), 0]


@pytest.mark.parametrize("kind", [compiled, inlined])
def test_a_function_for_compiled_ones_cannot_be_called_from_python(kind: Any) -> None:
    """A call would end the process."""
    double = kind(lambda x: 2.0 * x)
    of_engine: Any = state.fly_to
    for inner in (double, of_engine):
        with pytest.raises(TypeError, match=r"is for compiled functions only"):
            inner(1.0)
    assert callable_from_python(double.py_func)(1.5) == 3.0
    assert callable_from_python(lambda x: double(double(x)))(1.5) == 6.0
