"""The curves of a run, with intervals over its seeds; which there are depends on what was measured."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from feeder_sim.document.figure import MM, MS, Figure
from feeder_sim.document.words import number
from feeder_sim.measures.bounces import BounceFindings, Flights, seed_flights
from feeder_sim.measures.rate import ONE_LOAD, RateFindings, one_load
from feeder_sim.measures.separation import SeparationFindings, StageCounts
from feeder_sim.measures.statistic import Statistic
from feeder_sim.notebook import counted
from feeder_sim.plots.intervals import COLOURS, DODGE, FEWEST, draw_bars, draw_over_time, drawn_half
from feeder_sim.records.seed import Status
from feeder_sim.records.trajectory import Frames
from feeder_sim.run.recorded_run import RecordedRun
from feeder_sim.scene.cell import PASSAGE_FROM, PASSAGE_TO

# Curves of a run, drawn on axes: what many parts do from stage to stage, and rates.

SHARES = ("#1f5fa8", "#9bb8d3", "#e0a030", "#5b6875")  # driving, pauses, looks, picks


def draw_counts(axes: Any, ends: Sequence[StageCounts], counts: Sequence[str], labels: Sequence[str]) -> None:
    """Draw counts at the ends of stages over the cycle; `counts` are names of fields, each of them a curve."""
    cycles = [end.cycle for end in ends]
    for i, (name, label) in enumerate(zip(counts, labels, strict=True)):
        statistics = [getattr(end, name) for end in ends]
        shift = DODGE * (i - 0.5 * (len(counts) - 1))
        draw_bars(axes, cycles, statistics, label=label, colour=COLOURS[i % len(COLOURS)], shift=shift)
    _integer_ticks(axes, cycles)
    axes.set_ylim(0.0, None)


def draw_by_stage(axes: Any, stages: Sequence[str], curves: Sequence[tuple[str, Sequence[Statistic]]]) -> None:
    """Draw curves of a label and a value per stage over the stages by their names."""
    for i, (label, statistics) in enumerate(curves):
        shift = DODGE * (i - 0.5 * (len(curves) - 1))
        draw_bars(axes, range(len(stages)), statistics, label=label, colour=COLOURS[i % len(COLOURS)], shift=shift)
    turned = {"rotation": 30, "ha": "right"} if max(map(len, stages)) * len(stages) > 60 else {}
    axes.set_xticks(range(len(stages)), stages, **turned)
    axes.set_ylim(0.0, None)


def _integer_ticks(axes: Any, values: Sequence[int]) -> None:
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
        half = drawn_half(rate)
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


INTERVAL = f"bars are 95 % intervals of the mean over the seeds, where there are {FEWEST} or more"
MOST_STAGES = 12  # of one cycle in a picture by stage
Kind = TypeVar("Kind")


def curves(run: RecordedRun) -> Iterator[Figure]:
    """All curves that a run has the data for."""
    goal = run.result.scene.scenario.goal
    alone, guided = len(run.recording.parts) == 1, run.result.scene.guides[0] is not None
    if any(len(frames) > 1 for frames in run.recording.seeds):
        if goal is not None:
            yield _to_goal(run)
        elif alone and not guided and run.result.scene.scenario.schedule is None:
            yield _drift(run)
    bounces = _findings(run, BounceFindings)
    if bounces is not None and bounces.bounce_interval_ms.n > 1:
        yield _bounces(run, bounces)
    separation = _findings(run, SeparationFindings)
    if separation is not None and goal is None and any(stage.on_plate.n for stage in separation.stages):
        yield from _counts(run, separation)
    rate = _findings(run, RateFindings)
    if rate is not None and rate.picks_per_minute.n:
        yield _rate(rate, f" Counted {ONE_LOAD}." if one_load(run.result.scene) else "")


def _findings(run: RecordedRun, kind: type[Kind]) -> Kind | None:
    return next((findings for _, findings in run.result.findings if isinstance(findings, kind)), None)


def _seeds(run: RecordedRun) -> tuple[list[Frames], list[bool]]:
    """Frames of the seeds that have any, and whether each ran to its end."""
    pairs = [(f, s) for f, s in zip(run.recording.seeds, run.recording.status, strict=True) if len(f) > 1]
    return [frames for frames, _ in pairs], [status == Status.DONE for _, status in pairs]


def _drift(run: RecordedRun) -> Figure:
    """Distance of the part to the nodal line over time, or its way from the start where there is no such line."""
    cell, (seeds, counted) = run.result.prepared.cell, _seeds(run)
    first_end = min((float(f.time[-1]) for f, counts in zip(seeds, counted, strict=True) if counts), default=None)

    def value(frames: Frames) -> NDArray[np.float64]:
        if cell is not None:
            return np.asarray(cell.distance_to_node(frames) * cell.reach * MM)
        displacement = frames.position[:, 0, :2] - frames.position[0, 0, :2]
        return np.asarray(np.linalg.norm(displacement, axis=1) * MM)

    def draw(figure: Any) -> None:
        axes = figure.add_subplot()
        draw_over_time(axes, seeds, value, counted=counted)
        axes.set(xlabel="time (s)", xlim=(0.0, max(float(frames.time[-1]) for frames in seeds)))
        axes.set_ylim(0.0, None)
        if cell is None:
            axes.set_ylabel("distance from the start (mm)")
        else:
            axes.set_ylabel("distance to the nodal line (mm)")
            for level, name in ((PASSAGE_FROM, "start"), (PASSAGE_TO, "end")):
                axes.axhline(level * cell.reach * MM, color="black", linestyle=":", linewidth=0.8)
                text = {"fontsize": 7.5, "va": "top", "xytext": (3, -2), "textcoords": "offset points"}
                axes.annotate(f"{name} of the timed way", (0.0, level * cell.reach * MM), **text)
        axes.legend(loc="upper right" if cell is not None else "upper left")

    label = "its distance to the nearest nodal line" if cell is not None else "its horizontal distance from the start"
    mean = ""
    if first_end is not None:
        until = f" up to {first_end:.3g} s, when the first seed ends" if cell is not None else ""
        band = "; the band is its 95 % interval" if sum(counted) >= FEWEST else ""
        mean = f" The mean is drawn{until}{band}."
    dashed = " Dashed seeds did not run to their end." if not all(counted) else ""
    return Figure(
        draw,
        height=3.3,
        alt=f"The part over time: {label}, in {len(seeds)} seeds.",
        caption=f"The part over time: {label}.{mean}{dashed}",
    )


def _to_goal(run: RecordedRun) -> Figure:
    """Mean x of the parts over time in every seed, with the goal."""
    goal, (seeds, _) = run.result.scene.scenario.goal, _seeds(run)
    assert goal is not None  # the caller's check

    def value(frames: Frames) -> NDArray[np.float64]:
        x = np.where(frames.present, frames.position[..., 0], np.nan)
        counts = np.maximum(frames.present.sum(axis=1), 1)
        return np.where(frames.present.any(axis=1), np.nansum(x, axis=1) / counts, np.nan) * MM

    def draw(figure: Any) -> None:
        axes = figure.add_subplot()
        draw_over_time(axes, seeds, value, counted=[False] * len(seeds))
        for line in axes.lines:
            line.set(linestyle="-", color="#1f5fa8", linewidth=1.1, alpha=0.8)
        band = {"color": "#2a8a5f", "alpha": 0.25, "linewidth": 0.0}
        axes.axhspan(goal.x_mm - goal.within_mm, goal.x_mm + goal.within_mm, label="goal", **band)
        axes.set(xlabel="time (s)", ylabel="mean x of the parts (mm)", xlim=(0.0, None))
        axes.legend(loc="best")

    return Figure(
        draw,
        height=3.2,
        alt=f"Mean x of the parts over time in {len(seeds)} seeds, and the goal at {goal.x_mm:g} mm.",
        caption="The way of the parts: mean x over time, a curve per seed. Stages end when the parts have settled, "
        "each seed at its own time, so that a mean over time would blur them; the table has means per stage.",
    )


def _bounces(run: RecordedRun, findings: BounceFindings) -> Figure:
    """Histograms of the flights of a part in a guide."""
    scene = run.result.scene
    ended = [record for record, s in zip(run.recording.records, run.recording.status, strict=True) if s == Status.DONE]
    flights = seed_flights(scene, [record.impacts for record in ended])
    means = (findings.bounce_interval_ms, findings.flight_height_mm, findings.impact_speed_mm_s)
    period = 1.0 / scene.scenario.excitations[0][1].frequency_hz
    motions = ", ".join(f"{name} in {n}" for name, n in findings.motion.items())
    return Figure(
        lambda figure: draw_flights(figure.subplots(1, 3), flights, plate_period=period, means=means),
        height=2.6,
        alt=f"Histograms of bounce interval, flight height and impact speed of {means[0].n} flights.",
        caption=f"Flights of the part between two contacts with the plate, {means[0].n} of all seeds. The motion "
        f"(after how many impacts it repeats; seeds): {motions}.",
    )


def _counts(run: RecordedRun, findings: SeparationFindings) -> Iterator[Figure]:
    """Counts at the ends of stages: over the cycles, or over the stages where there is one cycle only."""
    scene = run.result.scene
    pairs = [
        (stage, counts) for stage, counts in zip(scene.times.stages, findings.stages, strict=True) if counts.on_plate.n
    ]
    cycles = sorted({stage.cycle for stage, _ in pairs if stage.cycle})
    of_cycles = [(stage, counts) for stage, counts in pairs if stage.cycle]
    if len(cycles) > 1:
        picks = [(stage, counts) for stage, counts in of_cycles if stage.picks]
        at_end = picks or [(s, c) for s, c in of_cycles if s.number == max(s.number for s, _ in of_cycles)]
        isolated = any(stage.clearance is not None for stage, _ in picks)
        names, labels = ["on_plate"], ["on the plate"]
        if isolated:
            names, labels = [*names, "isolated"], [*labels, "isolated"]
        if picks:
            names, labels = [*names, "picked"], [*labels, "picked"]
        driven: dict[str, list[StageCounts]] = {}
        for stage, counts in of_cycles:
            if stage.excitations:
                driven.setdefault(stage.name, []).append(counts)

        def draw(figure: Any) -> None:
            left, right = figure.subplots(1, 2, sharex=True)
            draw_counts(left, [counts for _, counts in at_end], names, labels)
            left.set(xlabel="cycle", ylabel="parts", title="at the pick" if picks else "at the end of the cycle")
            for name, ends in list(driven.items())[:4]:
                draw_counts(right, ends, ["on_nodal_line"], [f"at the end of {name}"])
            for line, colour in zip(right.containers, ("#1f5fa8", "#c2571a", "#2a8a5f", "#8a4fa3"), strict=False):
                for artist in (line[0], *line[1], *line[2]):
                    artist.set_color(colour)
            right.set(xlabel="cycle", title="within 5 mm of the stage's nodal lines")
            for axes in (left, right):
                axes.set_ylim(0.0, None)
                axes.legend(loc="best")

        alone = findings.stages[0].on_plate.n
        yield Figure(
            draw,
            height=3.2,
            alt="Parts on the plate, isolated, picked, and near nodal lines, over the cycles.",
            caption=f"Parts from cycle to cycle, means of {counted(alone, 'seed')}; {INTERVAL}. "
            "Picked are those taken out at the end of that cycle.",
        )
    elif 1 <= len(pairs) <= MOST_STAGES:
        curves_of = [("on the plate", [counts.on_plate for _, counts in pairs])]
        if any(stage.excitations for stage, _ in pairs):
            curves_of.append(("near nodal lines", [counts.on_nodal_line for _, counts in pairs]))
        if any(stage.picks for stage, _ in pairs):
            curves_of.append(("isolated", [counts.isolated for _, counts in pairs]))
            curves_of.append(("picked", [counts.picked for _, counts in pairs]))
        stages = [stage.name or "end" for stage, _ in pairs]

        def draw_stages(figure: Any) -> None:
            axes = figure.add_subplot()
            draw_by_stage(axes, stages, curves_of)
            axes.set(ylabel="parts at the end of the stage")
            axes.legend(loc="best")

        if len(pairs) > 1:
            yield Figure(
                draw_stages,
                height=3.2,
                alt="Parts on the plate, near nodal lines, isolated and picked at the end of every stage.",
                caption=f"Parts from stage to stage, means of {counted(pairs[0][1].on_plate.n, 'seed')}; {INTERVAL}.",
            )


def _rate(findings: RateFindings, remark: str) -> Figure:
    """Picks per minute by kind, and where the time goes."""
    rows = 1 + sum(1 + len(kind.poses) for kind in findings.picks_per_minute_of_kind)
    height = min(1.6 + 0.28 * rows, 5.0)

    def draw(figure: Any) -> None:
        top, bottom = figure.subplots(2, 1, height_ratios=[height - 1.1, 0.45])
        draw_rates(top, findings)
        draw_shares(bottom, findings)

    rate = findings.picks_per_minute
    begin = f" Cycles from {findings.counted_from_cycle} on count." if findings.counted_from_cycle > 1 else ""
    return Figure(
        draw,
        height=height,
        alt=f"Picks per minute: {number(rate.mean, 3)} in all, and of each kind; shares of the time.",
        caption=f"Picks per minute, and where the time goes, means of {counted(rate.n, 'seed')}; "
        f"{INTERVAL}.{begin}{remark}",
    )
