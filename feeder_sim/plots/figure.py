"""What all pictures share: an empty figure, and the units of their axes."""

from __future__ import annotations

from typing import Any

MM, UM, MS = 1e3, 1e6, 1e3  # per m, per m, per s


def empty_figure(width: float, height: float) -> Any:
    """An empty figure of a size in inches; matplotlib is imported only where something is drawn."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")
