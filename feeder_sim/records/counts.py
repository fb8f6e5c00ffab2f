"""What an engine counts where it had to give way: nothing of it in a run means that all went as its methods say."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple


class Counts(NamedTuple):
    """Counts of a seed.

    unresolved_impacts: impacts and forces of many contacts whose iteration was given up; late_contacts: contacts that
    a leap in time had passed, and that were found by going back; budgets_spent: times in which a part was looked at so
    often that nothing was allowed to bounce any more.
    """

    unresolved_impacts: int = 0
    late_contacts: int = 0
    budgets_spent: int = 0

    @staticmethod
    def total(counts: Iterable[Counts]) -> Counts:
        """Of several seeds together."""
        return Counts(*(sum(column) for column in zip(*counts, strict=True)))


NOTHING_COUNTED = Counts()
