"""The report of a run: what was asked, pictures, curves, all measures, and how to repeat it."""

from __future__ import annotations

import datetime
import hashlib
import shlex
from collections.abc import Callable
from pathlib import Path

from feeder_sim.document.document import Block, Document, Section, Table, Text
from feeder_sim.document.words import number, sentence
from feeder_sim.measures.catalogue import HEADLINES
from feeder_sim.records.seed import Counts, Status
from feeder_sim.records.trajectory_file import last_change
from feeder_sim.report.measure_tables import measure_blocks, tiles
from feeder_sim.report.provenance import foot
from feeder_sim.report.run_curves import curves
from feeder_sim.report.run_pictures import parts_picture, plate_picture, player, screenshot
from feeder_sim.report.scenario_tables import scenario_blocks
from feeder_sim.run.recorded_run import RESOLVED, RecordedRun

HOW_ENDED = {
    Status.UNFINISHED: "not finished",
    Status.DONE: "ran to their end",
    Status.DIVERGED: "stopped, since their state was not valid",
    Status.LEFT_PLATE: "ended when all parts had left the plate",
}
Progress = Callable[[float], None]


def run_document(
    folder: Path,
    *,
    with_screenshot: bool = False,
    with_replay: bool = False,
    progress: Progress | None = None,
    notify: Callable[[str], None] | None = None,
) -> Document:
    """The page of a run.

    Args:
        folder: of the run, or a file that `export` made of it.
        with_screenshot: also take a picture of the replay, which takes seconds.
        with_replay: the page also plays the replay of the first seed, which adds one or two megabytes.
        progress: called with the fraction done.
        notify: takes a line for the user, such as that there is no graphics driver.

    Raises:
        InputError: there is no run, or it cannot be read.
    """
    report_progress = progress or (lambda _: None)
    run = RecordedRun.open(folder)
    report_progress(0.2)
    summary = run.result.summary()
    measures = run.result.measures()
    added = [name for measure, _ in run.result.findings for name in measure.headline if name not in HEADLINES]
    report_progress(0.4)
    pictures: list[Block] = [picture for picture in (plate_picture(run), parts_picture(run)) if picture is not None]
    report_progress(0.6)
    if with_screenshot:
        pictures.append(screenshot(run, notify))
    playing = player(run) if with_replay else None
    report_progress(0.8)
    curve_figures: list[Block] = list(curves(run))
    report_progress(1.0)
    scenario = run.result.prepared.scenario
    intro = Text(
        "Means over the seeds, with their standard error (SE), the 95 % interval of the mean (Student's t) and the "
        "number n of values. Every seed is one run from a random start of its own.",
        "plain",
    )
    sections = [
        Section("What was asked", scenario_blocks(scenario, run.recording.scenario_text)),
        Section("The plate and the parts", tuple(pictures)),
        Section("The replay", (playing,) if playing else ()),
        Section("Curves", tuple(curve_figures)),
        Section("All measures", (intro, *measure_blocks(measures))),
        Section("Warnings", _warnings(run)),
        Section("How it was computed, and how to repeat it", _provenance(run, summary)),
    ]
    return Document(
        title=scenario.title or run.folder.resolve().name,
        subtitle=_subtitle(run),
        tiles=tiles(measures, added),
        notices=tuple(_notices(run)),
        sections=tuple(section for section in sections if section.blocks),
        foot=foot(),
    )


def _subtitle(run: RecordedRun) -> str:
    seeds = len(run.recording.status)
    started = sum(len(frames) > 0 for frames in run.recording.seeds)
    simulated = sum(float(frames.time[-1]) for frames in run.recording.seeds if len(frames))
    started_text = f"{started} of {seeds} seeds" if started < seeds else f"{seeds} seeds" if seeds > 1 else "1 seed"
    return f"Simulation of a vibrating plate: {started_text}, {number(simulated)} s simulated in all."


def _notices(run: RecordedRun) -> list[Text]:
    """What a reader has to know first: that a run is not whole."""
    seeds, lines = len(run.recording.status), []
    if run.result.interrupted:
        how = "The run is still going on" if run.is_running else "The run was interrupted"
        lines.append(
            Text(f"{how}: {run.ended} of {seeds} seeds have ended. Only these count in the measures.", "warning")
        )
    if run.failed:
        n = len(run.failed)
        lines.append(Text(f"{n} of {seeds} seeds failed: their state was not valid. They do not count in the measures; "
                          "the causes are listed under Warnings.", "failure"))  # fmt: skip
    elif run.ended == 0 and not run.result.interrupted:
        lines.append(Text("No seed has ended, so that there are no measures.", "warning"))
    for key in run.changed_inputs:
        changed = f"The file of {key} has changed since the run; measures that depend on it may be wrong."
        lines.append(Text(changed, "warning"))
    return lines


def _warnings(run: RecordedRun) -> tuple[Block, ...]:
    """Settings that mislead, failures, and what else limits the results."""
    lines: list[Block] = [Text(sentence(str(failure)), "failure") for failure in run.result.failures]
    lines += [Text(sentence(warning), "warning") for warning in run.result.prepared.warnings]
    unresolved = Counts.total(run.recording.records).unresolved_impacts
    if unresolved:
        lines.append(
            Text(f"{unresolved} impacts were given up by the iteration that resolves many contacts at once.", "note")
        )
    speed = run.result.measures().get("transport_speed_mm_s")
    if speed and 0 < speed["n"] < run.ended:
        late = f"{run.ended - speed['n']} of {run.ended} seeds have no transport speed: the part did not come so far."
        lines.append(Text(f"{late} The mean is of the others, and may be too large.", "warning"))
    n_left_plate = sum(status == Status.LEFT_PLATE for status in run.recording.status)
    if n_left_plate:
        lines.append(Text(f"In {n_left_plate} seeds all parts left the plate before the end.", "note"))
    if 0 < run.ended < 3:
        plural = "s have" if run.ended > 1 else " has"
        lines.append(
            Text(
                f"Only {run.ended} seed{plural} ended: intervals are wide, or there are none. --seeds asks for more.",
                "note",
            )
        )
    if other := run.changed_versions:
        named = ", ".join(f"{name} {then} (now {now})" for name, (then, now) in other.items())
        text = f"The run was made with other versions than those that measured it for this page: {named}."
        lines.append(Text(text, "note"))
    return tuple(lines) or (Text("None known."),)


def _provenance(run: RecordedRun, summary: dict[str, object]) -> tuple[Block, ...]:
    """Engine, cost, versions, hashes, the command, and where the data are."""
    recording, prepared = run.recording, run.result.prepared
    status = [f"{n} {how}" for kind, how in HOW_ENDED.items() if (n := recording.status.count(kind))]
    written = datetime.datetime.fromtimestamp(1e-9 * last_change(recording.path)).astimezone()
    scenario_hash = hashlib.sha256(recording.scenario_text.encode()).hexdigest()
    factor = summary["real_time_factor"]
    cost = f"{number(run.result.wall_s, 3)} s of wall time"
    rows = [
        ("seeds", ", ".join(status)),
        ("engine", f"{recording.engine}: {prepared.engine.reason}"),
        *(() if run.is_tracked else (("time step", f"{number(1e6 * prepared.scene.timestep)} us"),)),
        ("cost", f"{cost}, {number(float(factor), 3)} x real time" if isinstance(factor, float) else cost),
        ("last written", written.isoformat(" ", "seconds")),
        ("folder", str(run.folder)),
    ]
    versions = [(name, version) for name, version in recording.libraries.items()]
    hashes = [("scenario", scenario_hash), *recording.inputs.items()]
    if run.is_tracked:
        how: tuple[Block, ...] = (
            Text("The parts were seen by a camera from above: of heights and poses nothing is known."),
        )
    else:
        how = (
            Text("This runs the same scenario again, to the same bits with the same versions on the same machine:"),
            Text(_command(run), "code"),
            *((Text("This goes on with it:"), Text(_resume(run), "code")) if run.result.interrupted else ()),
            Text("Without the folder, save the text of the scenario above as scenario.toml, beside its files."),
        )
    return (
        *how,
        Table("The run", ("what", "value"), tuple(rows)),
        Table("Versions", ("library", "version"), tuple(versions)),
        Table("Inputs (SHA-256)", ("input", "hash"), tuple(hashes)),
    )


def _command(run: RecordedRun) -> str:
    """What repeats a run, of its scenario as it was resolved."""
    resolved = run.folder / RESOLVED
    return f"feeder-sim run {shlex.quote(str(resolved if resolved.is_file() else Path(RESOLVED)))} --out repeated"


def _resume(run: RecordedRun) -> str:
    return f"feeder-sim resume {shlex.quote(str(run.folder))}"
