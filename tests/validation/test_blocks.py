"""Which side is up: one throw for all steel blocks that were rolled, nothing fitted."""

from __future__ import annotations

import pytest
from blocks import Block, blocks, rms

from feeder_sim.studies.drops import Throw


@pytest.mark.slow
def test_one_throw_predicts_which_side_of_eight_blocks_is_up() -> None:
    measured = [block for block in blocks() if block.share is not None]
    assert len(measured) == 8 and len(blocks()) == 15
    thrown = [block.computed(600, Throw.of(block.part())) - (block.share or 0.0) for block in measured]
    assert rms(thrown) < 0.06  # 0.05 of many throws, and chance
    dropped = [block.computed(300) - (block.share or 0.0) for block in measured]
    assert rms(dropped) > 0.1  # the throw decides


def test_a_cubic_block_shows_a_square_face_in_a_third_of_the_throws() -> None:
    """Of six like faces two count; of a true cube all would be one pose."""
    cube = Block(1.02, 0, None)
    assert cube.computed(400, Throw.of(cube.part())) == pytest.approx(1 / 3, abs=0.07)
