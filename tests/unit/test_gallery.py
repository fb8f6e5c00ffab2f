"""The gallery of the docs shows every example, with a picture of it."""

from __future__ import annotations

import re

import pytest
from conftest import REPOSITORY
from PIL import Image

from feeder_sim.example_files import examples

SHOWN = re.findall(r"^<!-- generated: gallery (\S+) -->$", (REPOSITORY / "docs/gallery.md").read_text("utf-8"), re.M)


def test_every_example_has_one_card() -> None:
    assert sorted(",".join(SHOWN).split(",")) == sorted(examples())


@pytest.mark.parametrize("name", sorted(examples()))
def test_every_example_has_a_small_picture(name: str) -> None:
    file = REPOSITORY / "docs/figures/gallery" / f"{name}.jpg"
    assert file.stat().st_size < 30_000
    with Image.open(file) as picture:
        assert picture.size == (320, 240)
