"""Text in HDF5 attributes, at a fixed length.

Text of variable length lies in a heap of the file that has no checksum; on a damaged one the library can loop for ever.
With fixed lengths and the latest file format every part of a file's structure is under a checksum.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np


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
