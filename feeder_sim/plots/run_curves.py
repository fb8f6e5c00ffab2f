"""Curves of a run, drawn on axes: what a part does over time, what many parts do from stage to stage, and rates."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feeder_sim.document.figure import MM, MS
from feeder_sim.measures.bounces import Flights
from feeder_sim.measures.rate import RateFindings
from feeder_sim.measures.separation import StageCounts
from feeder_sim.measures.statistic import Statistic, half_interval
from feeder_sim.plots.intervals import COLOURS, DODGE, SEED, draw_band, draw_bars, thinned
from feeder_sim.records.trajectory import Frames

SHARES = ("#1f5fa8", "#9bb8d3", "#e0a030", "#5b6875")  # driving, pauses, looks, picks


def draw_over_time(
    axes: Any, seeds: Sequence[Frames], value: Callable[[Frames], NDArray[np.float64]], *, counted: Sequence[bool]
) -> None:
    """Draw a value of every seed over time as a thin curve, and the mean with its interval while all counted seeds run.

    A mean over the seeds that are left would be one of the slow ones.

    Args:
        axes: time in s.
        seeds: with the same times, as far as they go.
        value: of the frames of a seed, (n,).
        counted: whether a seed is part of the mean; the others are dashed.
    """
    common = min((len(frames) for frames, counts in zip(seeds, counted, strict=True) if counts), default=0)
    kept = []
    for frames, counts in zip(seeds, counted, strict=True):
        values, rows = value(frames), thinned(len(frames))
        axes.plot(frames.time[rows], values[rows], color=SEED, linewidth=0.7, linestyle="-" if counts else "--")
        if counts and common:
            kept.append(values[thinned(common)])
    axes.plot([], [], color=SEED, linewidth=0.7, label="single seeds")
    if not kept:
        return
    time = next(frames.time for frames, counts in zip(seeds, counted, strict=True) if counts)[thinned(common)]
    draw_band(axes, time, np.stack(kept), label=f"mean of {len(kept)} seeds", colour=COLOURS[0])


def draw_counts(axes: Any, ends: Sequence[StageCounts], counts: Sequence[str], labels: Sequence[str]) -> None:
    """Draw counts at the ends of stages over the cycle; `counts` are names of fields, each of them a curve."""
    cycles = [end.cycle for end in ends]
    for i, (name, label) in enumerate(zip(counts, labels, strict=True)):
        statistics = [getattr(end, name) for end in ends]
        shift = DODGE * (i - 0.5 * (len(counts) - 1))
        draw_bars(axes, cycles, statistics, label=label, colour=COLOURS[i % len(COLOURS)], shift=shift)
    _whole_numbers(axes, cycles)
    axes.set_ylim(0.0, None)


def draw_by_stage(axes: Any, stages: Sequence[str], curves: Sequence[tuple[str, Sequence[Statistic]]]) -> None:
    """Draw curves of a label and a value per stage over the stages by their names."""
    for i, (label, statistics) in enumerate(curves):
        shift = DODGE * (i - 0.5 * (len(curves) - 1))
        draw_bars(axes, range(len(stages)), statistics, label=label, colour=COLOURS[i % len(COLOURS)], shift=shift)
    turned = {"rotation": 30, "ha": "right"} if max(map(len, stages)) * len(stages) > 60 else {}
    axes.set_xticks(range(len(stages)), stages, **turned)
    axes.set_ylim(0.0, None)


def _whole_numbers(axes: Any, values: Sequence[int]) -> None:
    """Tick an axis at whole numbers only."""
    from matplotlib.ticker import MaxNLocator

    axes.xaxis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))
    axes.set_xlim(min(values) - 0.5, max(values) + 0.5)


def draw_rates(axes: Any, findings: RateFindings) -> None:
    """Draw picks per minute as bars with intervals: in all, and of each kind in each pose in which it is picked."""
    rows = [("all", findings.picks_per_minute, COLOURS[0])]
    for i, kind in enumerate(findings.picks_per_minute_of_kind):
        colour = COLOURS[1 + i % (len(COLOURS) - 1)]
        rows.append((kind.kind, kind.picks_per_minute, colour))
        picked = [pose for pose in kind.poses if pose.picks_per_minute.n and pose.picks_per_minute.mean > 0.0]
        rows += [
            (f"{kind.kind}, pose {pose.pose}", pose.picks_per_minute, colour) for pose in picked if len(picked) > 1
        ]
    for place, (_, rate, colour) in enumerate(rows):
        half = half_interval(rate.se, rate.n) if rate.n > 1 else 0.0
        pale = 1.0 if "," not in rows[place][0] else 0.5
        axes.barh(place, rate.mean, xerr=half, color=colour, alpha=pale, height=0.6, capsize=2.5)
        end = rate.mean + half
        axes.annotate(f"{rate.mean:.3g}", (end, place), (4, 0), textcoords="offset points", va="center", fontsize=8)
    axes.set_yticks(range(len(rows)), [name for name, _, _ in rows])
    axes.set(xlabel="picks per minute", xlim=(0.0, None))
    axes.margins(x=0.12)
    axes.invert_yaxis()


def draw_shares(axes: Any, findings: RateFindings) -> None:
    """Draw where the time goes as one bar of shares."""
    left = 0.0
    for (name, share), colour in zip(vars(findings.time_shares).items(), SHARES, strict=True):
        axes.barh(0, share.mean, left=left, color=colour, height=0.6, label=f"{name} {100.0 * share.mean:.0f} %")
        left += share.mean
    axes.set(xlim=(0.0, 1.0), yticks=[], ylim=(-0.5, 0.5))
    axes.set_xticks([0.0, 0.5, 1.0], ["0", "50 %", "100 % of the time"])
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=4)
    axes.spines["left"].set_visible(False)


def draw_flights(
    axes: Sequence[Any], flights: Sequence[Flights], *, plate_period: float, means: Sequence[Statistic]
) -> None:
    """Draw histograms of bounce interval, flight height and impact speed of all seeds, each with its mean.

    Args:
        axes: three of them.
        flights: of every seed.
        plate_period: [s].
        means: of interval [ms], height [mm] and speed [mm/s].
    """
    columns = (("interval", MS, "bounce interval (ms)"), ("height", MM, "flight height (mm)"))
    for place, (name, factor, label) in zip(axes, (*columns, ("impact_speed", MM, "impact speed (mm/s)")), strict=True):
        values = np.concatenate([getattr(f, name) for f in flights]) * factor
        place.hist(values, bins=40, color=COLOURS[0], alpha=0.75)
        place.set(xlabel=label, xlim=_wide_enough(values))
    for place, mean in zip(axes, means, strict=True):
        place.axvline(mean.mean, color=COLOURS[1], linewidth=1.4, label=f"mean {mean.mean:.4g}")
        place.legend(loc="upper right")
    axes[0].axvline(plate_period * MS, color="black", linestyle=":", linewidth=1.0, label="plate period")
    axes[0].legend(loc="upper right")
    axes[0].set_ylabel("flights, all seeds")


def _wide_enough(values: NDArray[np.float64]) -> tuple[float, float]:
    """Limits of a histogram: values that differ by round-off alone must not fill it."""
    low, high = float(values.min()), float(values.max())
    room = max(0.05 * (high - low), 0.05 * abs(high), 1e-12)
    return low - room, high + room
