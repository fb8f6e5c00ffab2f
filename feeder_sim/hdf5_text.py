"""What all HDF5 files of the package share: text of fixed length in attributes, arrays with units and checksums.

Text of variable length lies in a heap of the file that has no checksum; on a damaged one the library can loop for ever.
With fixed lengths and the latest file format every part of a file's structure is under a checksum, and so is the data.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray


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


def put_array(file: Any, name: str, values: NDArray[Any], unit: str) -> None:
    """Write an array as a dataset with a unit; an empty one, which HDF5 does not store, has no checksum."""
    compression = {"compression": "gzip", "shuffle": True} if values.size > 1000 else {}
    checksum = {"fletcher32": True} if values.size else {}
    put_text(file.create_dataset(name, data=values, **compression, **checksum).attrs, {"unit": unit})
