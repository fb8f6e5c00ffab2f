"""What is asked of an HDF5 file before anything in it is read: that it holds its data itself, and no more than fits.

A file may come from anybody. HDF5 follows links to other files, takes the bytes of a dataset from any file or pipe, and
makes room for whatever size a file claims.
"""

from __future__ import annotations

import io
import os
import sys
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from feeder_sim.errors import InputError
from feeder_sim.whole_files import write_whole

T = TypeVar("T")

# What all HDF5 files of the package share: text of fixed length in attributes, arrays with units and checksums.
#
# Text of variable length lies in a heap of the file that has no checksum; on a damaged one the library can loop for
# ever. With fixed lengths and the latest file format every part of a file's structure is under a checksum, and so is
# the data.


def put_text(attributes: Any, texts: Mapping[str, str]) -> None:
    """Write texts as attributes of an HDF5 object."""
    import h5py

    for name, text in texts.items():
        encoded = text.encode()
        attributes.create(name, np.bytes_(encoded), dtype=h5py.string_dtype("utf-8", max(1, len(encoded))))


def get_text(attributes: Any, name: str) -> str | None:
    """Read a text of fixed length; None where there is none of that name."""
    if name not in attributes or attributes.get_id(name).dtype.kind != "S":
        return None
    return bytes(attributes[name]).decode()


class FileKind(NamedTuple):
    """What tells HDF5 files of a kind: schema and version; what one is called, what to do about another version."""

    schema: str
    version: int
    name: str
    remedy: str

    def mark(self, file: Any) -> None:
        """Say in a file that is written of which kind it is."""
        put_text(file.attrs, {"schema": self.schema})
        file.attrs["schema_version"] = self.version


def write_hdf5(path: Path, kind: FileKind, write: Callable[[Any], None]) -> None:
    """Write an HDF5 file by a function that fills it, in place of the one before.

    Raises:
        RecordingFailed: it cannot be written, as when the disk is full.
        InputError: no file of this name can be written.
    """
    import h5py

    buffer = io.BytesIO()  # the library never sees the disk: it crashes as it closes what it could not write
    with h5py.File(buffer, "w", libver="latest") as file:
        kind.mark(file)
        write(file)
    write_whole(path, buffer.getbuffer())


def read_hdf5(path: Path, kind: FileKind, read: Callable[[Any], T]) -> T:
    """What a function makes of an HDF5 file of a kind.

    Raises:
        InputError: it is damaged, of another kind or version, or asks for more than it holds.
    """
    import h5py

    try:
        with h5py.File(path, "r") as file:
            check_trusted(file, path)
            if (schema := get_text(file.attrs, "schema")) != kind.schema:
                problem = f"is {schema!r}, must be a {kind.name} ({kind.schema!r})"
                raise InputError(problem, file=path, key="schema")
            version = file.attrs.get("schema_version")
            if not np.isscalar(version) or version != kind.version:
                problem = f"is {version}, must be {kind.version}: {kind.remedy}"
                raise InputError(problem, file=path, key="schema_version")
            return read(file)
    except InputError:
        raise
    except Exception as error:  # of a file that is damaged, h5py raises what it likes
        raise InputError(f"not a readable {kind.name} (truncated or of another format)", file=path) from error


def put_array(file: Any, name: str, values: NDArray[Any], unit: str) -> None:
    """Write an array as a dataset with a unit; an empty one, which HDF5 does not store, has no checksum."""
    compression = {"compression": "gzip", "shuffle": True} if values.size > 1000 else {}
    checksum = {"fletcher32": True} if values.size else {}
    put_text(file.create_dataset(name, data=values, **compression, **checksum).attrs, {"unit": unit})


FILTERS = (1, 2, 3)  # deflate, shuffle, Fletcher's checksum: what the package writes with, and needs no plugin
MOST_PACKED = 1100  # times; deflate reaches 1032
DEEPEST, MOST_ENTRIES = 3, 1_000_000  # levels of groups, and all entries; an exported run of 10,000 seeds has 80,000


def check_trusted(file: Any, path: Path) -> None:
    """Refuse an opened HDF5 file that points outside itself or claims more data than it can hold.

    Raises:
        InputError: what it holds that no file of this package does; `path` names it in the message.
    """
    import h5py

    claimed, missing = 0, False
    for name, entry in _entries(file, path):
        if not isinstance(entry, h5py.Dataset):
            continue
        if entry.external or entry.is_virtual:
            raise InputError("takes its data from another file, must be data in the file itself", file=path, key=name)
        filters = entry.id.get_create_plist()
        if any(filters.get_filter(k)[0] not in FILTERS for k in range(filters.get_nfilters())):
            raise InputError("is packed in an unknown way, must be gzip", file=path, key=name)
        claimed += entry.nbytes
        missing |= entry.nbytes > MOST_PACKED * entry.id.get_storage_size()
    if missing or claimed > _memory():
        raise InputError(f"claims to hold {claimed / 1e9:.2g} GB, must be what it can and this machine has", file=path)


def _entries(file: Any, path: Path) -> Iterator[tuple[str, Any]]:
    """Every group and dataset by every name it has: what has several is read as often."""
    import h5py

    count = 0
    stack = [("", file)]
    while stack:
        parent, group = stack.pop()
        for member in group:
            name, count = f"{parent}/{member}", count + 1
            if not isinstance(group.get(member, getlink=True), h5py.HardLink):
                raise InputError("is a link to somewhere else, must be data in the file itself", file=path, key=name)
            entry = group[member]
            yield name, entry
            if isinstance(entry, h5py.Group):
                if name.count("/") > DEEPEST or count > MOST_ENTRIES:  # it may contain itself
                    raise InputError(f"has too many groups, or deeper than {DEEPEST} levels as allowed", file=path)
                stack.append((name, entry))


def _memory() -> float:
    """Memory of the machine [bytes]; unlimited where the system does not say."""
    if sys.platform == "win32":
        return float("inf")
    try:
        return float(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    except (ValueError, OSError):  # not known by this name
        return float("inf")
