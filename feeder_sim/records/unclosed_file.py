"""HDF5 files whose writer was killed: opened for reading without ever waiting.

A writer in HDF5's single-writer mode leaves a file that is consistent at any moment, but marked as being written. The
library opens such a file only as a reader beside a living writer; then it takes damage for something not yet written
and tries again, waiting ever longer. Here it sees the file's bytes with a head that says "closed", and damage is an
error at once.

The head is HDF5's superblock of version 3. Its checksum is Jenkins' lookup3 (http://burtleburtle.net/bob/c/lookup3.c).
"""

from __future__ import annotations

import io
import struct
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, TypeVar

if TYPE_CHECKING:
    import h5py

# Signature; version, size of offsets, size of lengths, flags; base, extension, end of file, root group; checksum.
_HEAD = struct.Struct("<8s4B4QI")
_BEGIN = b"\x89HDF\r\n\x1a\n" + bytes([3, 8, 8])
_WORD = 0xFFFFFFFF
GROWTH = 2**30  # [bytes] that a living writer may add while the file is read
TRIES = 3

T = TypeVar("T")


def read_hdf5(path: Path, read: Callable[[Any], T]) -> T:
    """What `read` makes of an HDF5 file, also of one that was not closed.

    A living writer may get in between: while the file changes, a failure is not the last word, but it never waits.

    Raises:
        OSError: it cannot be opened: not HDF5, cut, or with a damaged head.
        Exception: whatever h5py raises for damage in it.
    """
    for remaining in reversed(range(TRIES)):
        before = _stamp(path)
        try:
            with _opened(path) as file:
                return read(file)
        except Exception:
            if remaining == 0 or _stamp(path) == before:
                raise
    raise AssertionError("unreachable")


def _stamp(path: Path) -> tuple[int, int]:
    status = path.stat()
    return status.st_size, status.st_mtime_ns


@contextmanager
def _opened(path: Path) -> Iterator[h5py.File]:
    import h5py

    with path.open("rb") as raw:
        head = raw.read(_HEAD.size)
        if not head.startswith(_BEGIN) or head[len(_BEGIN)] == 0:  # of another kind, or closed: it never waits
            with h5py.File(path, "r") as file:
                yield file
        else:
            size = path.stat().st_size
            with h5py.File(_Mended(raw, closed_head(head, size), size + GROWTH), "r") as file:
                yield file


def closed_head(head: bytes, size: int) -> bytes:
    """The head that a file of so many bytes would have if it had been closed, and were going to grow.

    Raises:
        OSError: the head is damaged, or the file is shorter than it was when the head was written.
    """
    if len(head) < _HEAD.size:
        raise OSError("the file is cut")
    *begin, _, base, extension, end, root, checksum = _HEAD.unpack(head)
    if checksum != lookup3(head[:-4]):
        raise OSError("the head of the file is damaged")
    if size < end:
        raise OSError("the file is cut")
    mended = _HEAD.pack(*begin, 0, base, extension, size + GROWTH, root, 0)[:-4]
    return mended + struct.pack("<I", lookup3(mended))


class _Mended(io.RawIOBase):
    """A file with another head, and with zeros between its end and a given size."""

    def __init__(self, raw: BinaryIO, head: bytes, size: int) -> None:
        self._raw, self._head, self._size, self._at = raw, head, size, 0

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        self._at = offset + {io.SEEK_SET: 0, io.SEEK_CUR: self._at, io.SEEK_END: self._size}[whence]
        return self._at

    def tell(self) -> int:
        return self._at

    def readinto(self, buffer: memoryview) -> int:  # type: ignore[override]
        self._raw.seek(self._at)
        content = self._raw.read(len(buffer))
        if not content:
            raise OSError("the file is cut")
        if self._at < len(self._head):
            content = self._head[self._at : self._at + len(content)] + content[len(self._head) - self._at :]
        buffer[:] = content.ljust(len(buffer), b"\0")  # the library looks ahead beyond the end
        self._at += len(buffer)
        return len(buffer)


def lookup3(data: bytes) -> int:
    """Jenkins' hash of some bytes, `hashlittle` of lookup3 with the initial value 0."""
    a = b = c = (0xDEADBEEF + len(data)) & _WORD
    aligned = max(0, (len(data) - 1) // 12 * 12)
    for x, y, z in struct.iter_unpack("<3I", data[:aligned]):
        a, b, c = (a + x) & _WORD, (b + y) & _WORD, (c + z) & _WORD
        for turns in ((4, 6, 8), (16, 19, 4)):
            a = ((a - c) & _WORD) ^ _turned(c, turns[0])
            c = (c + b) & _WORD
            b = ((b - a) & _WORD) ^ _turned(a, turns[1])
            a = (a + c) & _WORD
            c = ((c - b) & _WORD) ^ _turned(b, turns[2])
            b = (b + a) & _WORD
    if len(data) == aligned:
        return c
    x, y, z = struct.unpack("<3I", data[aligned:].ljust(12, b"\0"))
    a, b, c = (a + x) & _WORD, (b + y) & _WORD, (c + z) & _WORD
    c = ((c ^ b) - _turned(b, 14)) & _WORD
    a = ((a ^ c) - _turned(c, 11)) & _WORD
    b = ((b ^ a) - _turned(a, 25)) & _WORD
    c = ((c ^ b) - _turned(b, 16)) & _WORD
    a = ((a ^ c) - _turned(c, 4)) & _WORD
    b = ((b ^ a) - _turned(a, 14)) & _WORD
    return ((c ^ b) - _turned(b, 24)) & _WORD


def _turned(x: int, n: int) -> int:
    """32 bits turned left by n."""
    return (x << n | x >> 32 - n) & _WORD
