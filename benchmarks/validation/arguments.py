"""Kinds of options that the scripts of this folder share, for argparse."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path


def between(low: float, high: float) -> Callable[[str], float]:
    """A number in a range."""

    def number(text: str) -> float:
        value = float(text)
        if not low <= value <= high:
            raise argparse.ArgumentTypeError(f"is {text}, must be {low:g} to {high:g}")
        return value

    return number


def whole(low: int, high: int) -> Callable[[str], int]:
    """A whole number in a range."""

    def number(text: str) -> int:
        value = int(text)
        if not low <= value <= high:
            raise argparse.ArgumentTypeError(f"is {text}, must be {low} to {high}")
        return value

    return number


def new_file(text: str) -> Path:
    """A file whose folder exists: it may be written minutes later."""
    path = Path(text)
    if not path.parent.is_dir():
        raise argparse.ArgumentTypeError(f"is {text}, whose folder does not exist")
    return path
