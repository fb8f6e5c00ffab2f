"""Build the libraries of machine code, of the variants of entry points that were needed before.

What is there and of the present sources is not built again.

    FEEDER_SIM_COMPILE=1 pytest                        # or anything else: what it compiles is noted in the cache
    python -m feeder_sim.machine_code.build            # build them, and those of the libraries that there are
    python -m feeder_sim.machine_code.build --noted    # build them alone: those of changed records are left out
    python -m feeder_sim.machine_code.build --check 7  # build the seventh again, and compare it with what is there

Needs `cc` as linker. Two builds from the same sources, with the same Python, numba and llvmlite, are the same bytes.
Each is made in a process of its own, in which hashes of texts do not differ from run to run: what was compiled before,
and the order of a set, would show in the bytes.
"""

from __future__ import annotations

import argparse
import importlib
import itertools
import json
import multiprocessing
import os
import pickle
import platform
import subprocess
import tempfile
from pathlib import Path
from typing import Any

import llvmlite
import llvmlite.binding
import numba
from numba.core.bytecode import FunctionIdentity
from numba.core.callconv import CPUCallConv

from feeder_sim.machine_code import jit
from feeder_sim.machine_code.flat import Kind
from feeder_sim.machine_code.functions import FOREIGN
from feeder_sim.machine_code.key import base_folder, key_of
from feeder_sim.machine_code.library import FOLDER, RELEASE, file_hash, kind_from, kind_to

# What compiled code needs of numba's runtime: arrays with a count of references, and giving one back.
RUNTIME = """
declare ptr @malloc(i64)
declare void @free(ptr)

define ptr @NRT_MemInfo_alloc_aligned(i64 %size, i32 %align) {
  %wide = zext i32 %align to i64
  %more = add i64 %size, 48
  %all = add i64 %more, %wide
  %record = call ptr @malloc(i64 %all)
  %at = ptrtoint ptr %record to i64
  %first = add i64 %at, 48
  %least = sub i64 %wide, 1
  %above = add i64 %first, %least
  %mask = sub i64 0, %wide
  %aligned = and i64 %above, %mask
  %data = inttoptr i64 %aligned to ptr
  store i64 1, ptr %record
  %destructor = getelementptr i8, ptr %record, i64 8
  store ptr null, ptr %destructor
  %argument = getelementptr i8, ptr %record, i64 16
  store ptr null, ptr %argument
  %place = getelementptr i8, ptr %record, i64 24
  store ptr %data, ptr %place
  %length = getelementptr i8, ptr %record, i64 32
  store i64 %size, ptr %length
  %allocator = getelementptr i8, ptr %record, i64 40
  store ptr null, ptr %allocator
  ret ptr %record
}

define ptr @NRT_MemInfo_alloc(i64 %size) {
  %record = call ptr @NRT_MemInfo_alloc_aligned(i64 %size, i32 32)
  ret ptr %record
}

define ptr @NRT_Allocate(i64 %size) {
  %data = call ptr @malloc(i64 %size)
  ret ptr %data
}

define void @NRT_Free(ptr %data) {
  call void @free(ptr %data)
  ret void
}

define void @NRT_MemInfo_call_dtor(ptr %record) {
  call void @free(ptr %record)
  ret void
}
"""
GIVE_BACK = f"""
define void @{RELEASE}(ptr %record) {{
  %before = atomicrmw sub ptr %record, i64 1 monotonic
  %last = icmp eq i64 %before, 1
  br i1 %last, label %free, label %end
free:
  call void @NRT_MemInfo_call_dtor(ptr %record)
  br label %end
end:
  ret void
}}
"""
# As numba calls a function of two arrays: each is owner, parent, length, size of elements, address, shape, stride.
ENTRANCE = """
declare i32 @"{function}"(ptr, ptr, ptr, ptr, i64, i64, ptr, i64, i64, ptr, ptr, i64, i64, ptr, i64, i64)

define i32 @{name}(ptr %integers, ptr %floats) {{
  %result = alloca ptr
  %error = alloca ptr
  %status = call i32 @"{function}"(ptr %result, ptr %error,
    ptr null, ptr null, i64 {many}, i64 8, ptr %integers, i64 {many}, i64 8,
    ptr null, ptr null, i64 {many}, i64 8, ptr %floats, i64 {many}, i64 8)
  ret i32 %status
}}
"""
PROCESSOR = "x86-64-v3"
INDEX = FOLDER / "index.json"
LIST = FOLDER / "variants.json"  # what the libraries were made of, for who builds them again
LINK = ["cc", "-shared", "-s", "-nostartfiles", "-Wl,--gc-sections", "-Wl,--build-id=none"]
PYTHON = ".".join(platform.python_version_tuple()[:2])
TOOLS = f"Python {PYTHON}, numba {numba.__version__}, llvmlite {llvmlite.__version__}"  # the bytes depend on them
MANY = 1 << 40  # elements, which nothing counts


Row = tuple[str, str, list[Any]]  # module and name of an entry point, text and kinds of its arguments


def noted_variants() -> dict[str, Row]:
    """Variants that were compiled on this machine from the present sources alone, by name."""
    rows = {}
    for file in (base_folder() / "machine_code").glob("*/*.variant"):
        stem, module, key = file.name.removesuffix(".variant").rsplit("-", 2)
        if not module.startswith("feeder_sim."):
            continue
        try:
            text, arguments, _ = pickle.loads(file.read_bytes())
            row = f"{module}.{stem.partition('.')[2].rpartition('_')[0]}", text, list(map(kind_to, arguments))
            variant = variant_of(row)
        except jit.DAMAGED:
            continue
        if key_of(variant.entry) == key and FOREIGN not in json.dumps(row):
            rows[variant.name] = row
    return rows


def variant_of(row: Row) -> jit.Variant:
    name, text, arguments = row
    module, _, function = name.rpartition(".")
    entry = getattr(importlib.import_module(module), function).py_func
    return jit.Variant(entry, text, tuple(map(kind_from, arguments)))


def built(row: Row) -> tuple[str, dict[str, Any], bytes]:
    """Name, line of the index, and shared library of a variant."""
    with tempfile.TemporaryDirectory() as folder:
        os.environ["NUMBA_CACHE_DIR"] = folder  # what is made for this processor is of no use later
        jit.code_folder.cache_clear()
        if jit.DISTINCT_NAMES:  # numbers in names of functions, by which their order goes
            FunctionIdentity._unique_ids = itertools.count(1)
        calls: Any = CPUCallConv
        calls.build_excinfo_struct = _without_place
        config: Any = numba.config
        config.CPU_NAME, config.CPU_FEATURES = PROCESSOR, ""
        llvmlite.binding.initialize_native_target()
        llvmlite.binding.initialize_native_asmprinter()
        variant = variant_of(row)
        machine_code, kind = object_of(variant)
        (Path(folder) / "code.o").write_bytes(machine_code)
        library = Path(folder) / "code.so"
        subprocess.run([*LINK, "-o", str(library), str(Path(folder) / "code.o"), "-lm"], check=True)
        line = {"key": key_of(variant.entry), "returns": kind_to(kind), "tools": TOOLS}
        return variant.name, line, library.read_bytes()


def _without_place(_: Any, error: Any, arguments: Any, place: Any, function: Any) -> tuple[Any, Any, None]:
    """What machine code knows of an error: not the file and the line, which differ from checkout to checkout.

    Numba has them in texts of its own, too, on a line behind the message.
    """
    texts = [text.partition('\nFile "')[0] if isinstance(text, str) else text for text in arguments or ()]
    return error, tuple(texts) if texts else arguments, None


def object_of(variant: jit.Variant) -> tuple[bytes, Kind]:
    """Machine code of a variant with its entrance, and the kind of what it returns."""
    dispatcher, kind = jit.made(variant)
    compiled = dispatcher.overloads[jit.TWO_ARRAYS]
    code = compiled.library._codegen
    module = llvmlite.binding.parse_bitcode(compiled.library._final_module.as_bitcode())
    entrance = ENTRANCE.format(function=compiled.fndesc.mangled_name, name=variant.name, many=MANY)
    head = f'target triple = "{module.triple}"\ntarget datalayout = "{module.data_layout}"\n'
    module.link_in(llvmlite.binding.parse_assembly(head + RUNTIME + GIVE_BACK + entrance))
    for value in (*module.functions, *module.global_variables):
        if not value.is_declaration:
            value.linkage = "external" if value.name in (variant.name, RELEASE) else "internal"
    manager, builder = code._module_pass_manager(loop_vectorize=False, slp_vectorize=False, opt=1, cost="cheap")
    manager.run(module, builder)
    calls = [function.name for function in module.functions if function.is_declaration]
    if unknown := [name for name in calls if name.startswith(("NRT", "numba"))]:
        raise SystemExit(f"{variant.name} needs {', '.join(unknown)} of numba's runtime")
    target = llvmlite.binding.Target.from_triple(module.triple)
    machine = target.create_target_machine(cpu=PROCESSOR, features="", opt=3, reloc="pic", codemodel="default")
    return bytes(machine.emit_object(module)), kind


def build_all(rows: dict[str, Row], workers: int) -> None:
    """Build what is not there, or of other sources; other libraries are removed."""
    FOLDER.mkdir(exist_ok=True)
    index = read(INDEX, {})
    lacking = {}
    for name, row in rows.items():
        there = name in index and (FOLDER / f"{name}.so").is_file()
        if not there or index[name]["key"] != key_of(variant_of(row).entry):
            lacking[name] = row
    with _processes(workers) as pool:
        for number, (name, line, library) in enumerate(pool.imap(built, lacking.values())):
            (FOLDER / f"{name}.so").write_bytes(library)
            index[name] = line
            INDEX.write_text(json.dumps(index) + "\n", encoding="ascii")  # what is interrupted keeps what is built
            print(f"{number + 1} of {len(lacking)}: {name}, {len(library) / 1e3:.0f} kB", flush=True)
    for file in FOLDER.glob("*.so"):
        if file.stem not in rows:
            file.unlink()
    for name in rows:
        index[name]["hash"] = file_hash(FOLDER / f"{name}.so")
    INDEX.write_text(json.dumps({name: index[name] for name in sorted(rows)}) + "\n", encoding="ascii")
    LIST.write_text(json.dumps({name: rows[name] for name in sorted(rows)}) + "\n", encoding="ascii")


def _processes(workers: int) -> Any:
    os.environ["PYTHONHASHSEED"] = "0"
    return multiprocessing.get_context("spawn").Pool(workers, maxtasksperchild=1)


def check(row: Row) -> None:
    """Build a variant again, and compare it with what is there, if that was made by the same tools.

    Raises:
        SystemExit: its sources have changed since, or it comes out as other bytes.
    """
    with _processes(1) as pool:
        name, line, library = pool.apply(built, (row,))
    committed = read(INDEX, {})[name]
    if committed["key"] != line["key"]:
        raise SystemExit(f"{name} is of other sources: python -m feeder_sim.machine_code.build")
    if committed["tools"] != TOOLS:
        print(f"{name} is not compared: built by {committed['tools']}, here is {TOOLS}")
        return
    if (there := (FOLDER / f"{name}.so").read_bytes()) != library:
        places = [place for place, pair in enumerate(zip(there, library, strict=False)) if pair[0] != pair[1]]
        linker = subprocess.run([*LINK[:1], "-Wl,--version"], capture_output=True, text=True).stdout.partition("\n")[0]
        raise SystemExit(
            f"{name} comes out as other bytes: {len(library)} of them, {len(there)} are there, {len(places)} differ, "
            f"the first at {places[:1]}; Python {platform.python_version()}, {llvmlite.binding.get_host_cpu_name()}, "
            f"{platform.libc_ver()}, {linker}"
        )
    print(f"{name} comes out as the same bytes")


def read(file: Path, default: Any) -> Any:
    return json.loads(file.read_text(encoding="ascii")) if file.is_file() else default


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--noted", action="store_true", help="only what was compiled on this machine")
    parser.add_argument("--check", type=int, metavar="N", help="build one again, N modulo their number")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    options = parser.parse_args()
    listed = read(LIST, {})
    if options.check is not None:
        check(listed[sorted(listed)[options.check % len(listed)]])
        return
    build_all(noted_variants() | ({} if options.noted else listed), options.workers)


if __name__ == "__main__":
    main()
