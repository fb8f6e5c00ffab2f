"""What uncertain inputs come to, as lines and as JSON."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import zip_longest
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from feeder_sim.studies.uncertainty.indices import Index
    from feeder_sim.studies.uncertainty.linear_shares import LinearShares
    from feeder_sim.studies.uncertainty.propagate import Propagation


def as_json_object(done: Propagation) -> dict[str, Any]:
    """Everything that was found, as JSON takes it."""
    measures = {row.pop("measure"): row for row in done.rows()}
    return {"complete": done.swept.complete, "measures": measures, "shares": done.shares}


def lines_of(done: Propagation, measure: str, measured: float | None = None) -> list[str]:
    """What was found of one measure, in words; and where a value of it lies that was measured."""
    from feeder_sim.measures.protocol import labelled

    if not measure:
        return ["no measure has a value"]
    spread = done.spread(measure)
    runs = f"{spread.of_runs} {spread.low:.4g} to {spread.high:.4g}"
    lines = [labelled(measure, f"median {spread.median:.4g}, {runs}")]
    if math.isfinite(spread.sd_inputs):
        interval = f"{spread.of_means} {spread.inputs_low:.4g} to {spread.inputs_high:.4g}, SD {spread.sd_inputs:.3g}"
        lines.append(labelled("over inputs", spread.not_told or interval))
        lines.append(labelled("over seeds", f"SD {spread.sd_seeds:.3g} at the same inputs"))
    if measured is not None:
        values = [value for row in done.values(measure) for value in row]
        below = sum(value < measured for value in values)
        where = "within" if spread.low <= measured <= spread.high else "outside of"
        told = f"{measured:.4g} is {where} the {spread.of_runs}; {below} of {len(values)} runs are below it"
        lines.append(labelled("measured", told))
    return [*lines, *_share_lines(done.linear_shares(measure), done.indices(measure))]


def _share_lines(linear: LinearShares | None, indices: Sequence[Index]) -> list[str]:
    """A table: of the variance over the inputs, what hangs on each of them."""
    told: list[tuple[str, list[tuple[str, float, float]]]] = []
    if linear:
        lines = [(i.key, i.share, i.interval) for i in linear.inputs]
        told.append(("straight line", [*lines, ("all of them", linear.explained, linear.explained_interval)]))
    if indices:
        told.append(("first order", [(i.key, i.first, i.first_interval) for i in indices]))
        told.append(("total", [(i.key, i.total, i.total_interval) for i in indices]))
    if not told:
        return []
    keys = [key for key, _, _ in told[0][1]]
    width = max(len(key) for key in (*keys, "share of variance"))
    texts = [[head, *(f"{share:.2f} +- {half:.2f}" for _, share, half in shares)] for head, shares in told]
    table = zip_longest(("share of variance", *keys), *texts, fillvalue="")
    return [f"{key:<{width}}{''.join(f'{text:>16}' for text in row)}".rstrip() for key, *row in table]
