"""The commands about a run: `check` before it, `run`, and `resume` after a break, of a study too."""

from __future__ import annotations

import contextlib
import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from feeder_sim.cli.files import (
    AsJson,
    Dask,
    EngineName,
    ScenarioFile,
    Seed,
    Seeds,
    Set,
    StallAfter,
    ThreadCount,
    file_in_errors,
    options_in_errors,
    scenario_of,
    writable,
)
from feeder_sim.cli.report import as_lines, print_result
from feeder_sim.cli.study import finish, print_study, share_of
from feeder_sim.cli.terminal import at_terminal
from feeder_sim.errors import InputError, Interrupted, printable

if TYPE_CHECKING:
    from feeder_sim.pool.work import Work
    from feeder_sim.run.simulation import Result
    from feeder_sim.scenario import Scenario

WithReplay = Annotated[
    bool, typer.Option("--replay", help="Build the replay at once; else when it is first looked at.")
]


def run(
    scenario_file: ScenarioFile,
    engine: EngineName = None,
    seeds: Seeds = None,
    seed: Seed = None,
    settings: Set = None,
    out: Annotated[Path | None, typer.Option("--out", help="Folder for the run [runs/NAME-001, -002, ...].")] = None,
    as_json: AsJson = False,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Say what would be done, as `check` does.")] = False,
    stall_after: StallAfter = None,
    workers: ThreadCount = None,
    dask: Dask = None,
    measure: Annotated[str | None, typer.Option("--measure", help="Measure that --until-se looks at.")] = None,
    until_se: Annotated[
        str | None, typer.Option("--until-se", help="More seeds until the standard error is below, such as 3%.")
    ] = None,
    most_seeds: Annotated[
        int, typer.Option("--most-seeds", min=8, max=10_000, help="Whatever --until-se asks for.")
    ] = 1000,
    replay_too: WithReplay = False,
) -> None:
    """Simulate a scenario and record it."""
    given = _work(workers, stall_after)
    scenario = scenario_of(scenario_file, engine, seeds, seed, settings)
    if (until_se is None) != (measure is None):
        raise InputError("is given alone, must be with the other one of the two", key="--until-se, --measure")
    share = None if until_se is None else share_of(until_se)
    with file_in_errors(scenario_file):
        from feeder_sim.run.keep import StatisticsOnly
        from feeder_sim.run.run_folder import check_free, fresh_folder, record_run

        if out is not None:
            check_free(out)
        if dry_run:
            _print_plan(scenario, as_json)
            return
        folder = out or fresh_folder(scenario_file.stem)
        try:
            with options_in_errors(), at_terminal(given, scenario.title or scenario_file.stem, dask) as work:
                if measure is None:
                    result = record_run(scenario, folder, replay=replay_too, record=StatisticsOnly(), work=work)
                else:
                    from feeder_sim.measures.effort import Effort
                    from feeder_sim.run.until import record_until

                    effort = Effort(scenario.run.seeds, share, max(most_seeds, scenario.run.seeds), measure)
                    result = record_until(scenario, folder, effort, replay=replay_too, work=work)
        except BaseException:
            if out is None:
                with contextlib.suppress(OSError):  # it holds something
                    folder.rmdir()
            raise
    _finish_run(result, folder, as_json)


def resume(
    folder: Annotated[Path, typer.Argument(help="Folder of a run or a study.", show_default=False)],
    seeds: Annotated[int | None, typer.Option("--seeds", min=1, help="Of a run: go on to more seeds.")] = None,
    as_json: AsJson = False,
    stall_after: StallAfter = None,
    workers: ThreadCount = None,
    dask: Dask = None,
    replay_too: WithReplay = False,
) -> None:
    """Go on with a run or a study that was interrupted or killed, or with more seeds of a run."""
    from feeder_sim.studies.ask import kind_of, resume_study

    given = _work(workers, stall_after)
    if kind_of(folder) is None:
        from feeder_sim.run.keep import StatisticsOnly
        from feeder_sim.run.run_folder import resume_run

        with options_in_errors(), at_terminal(given, str(folder), dask) as work:
            result = resume_run(folder, seeds=seeds, replay=replay_too, record=StatisticsOnly(), work=work)
        _finish_run(result, folder, as_json)
        return
    if replay_too:
        raise InputError("is the folder of a study, which has no replay", file=folder, key="--replay")
    if seeds is not None:
        raise InputError("is the folder of a study, whose command with more seeds goes on", file=folder, key="--seeds")
    with options_in_errors(), at_terminal(given, str(folder), dask) as work:
        study = resume_study(folder, work)
    print_study(study, folder, as_json)
    finish(study, goes_on="the same command goes on")


def check(
    scenario_file: ScenarioFile,
    engine: EngineName = None,
    seeds: Seeds = None,
    settings: Set = None,
    as_json: AsJson = False,
    full: Annotated[bool, typer.Option("--full", help="Print all values, by the keys that --json has.")] = False,
    mjcf: Annotated[Path | None, typer.Option("--mjcf", help="Also write the scene as MJCF.")] = None,
) -> None:
    """Validate a scenario; say what moves and how strongly, which engine runs it, and what it costs."""
    scenario = scenario_of(scenario_file, engine, seeds, None, settings)
    with file_in_errors(scenario_file):
        if mjcf is not None:
            from feeder_sim.run.run_folder import mjcf_text
            from feeder_sim.scene.scene import build_scene

            text = mjcf_text(build_scene(scenario))
            writable(mjcf).write_text(text, encoding="utf-8")
        _print_plan(scenario, as_json, full=full)


def _work(workers: int | None, stall_after: float | None) -> Work:
    from feeder_sim.pool.work import STALL_AFTER_S, Work

    with options_in_errors():
        return Work(workers, stall_after=STALL_AFTER_S if stall_after is None else stall_after)


def _finish_run(result: Result, folder: Path, as_json: bool) -> None:
    """Print the result; the exit code says how it ended."""
    print_result(result, folder, as_json)
    for failure in result.failures:
        print(f"feeder-sim: {failure}", file=sys.stderr)
    if result.interrupted:
        name = printable(str(folder))
        line = f"interrupted; what was computed is in {name}, feeder-sim resume {name} goes on"
        print(f"feeder-sim: {line}", file=sys.stderr)
        raise typer.Exit(Interrupted.exit_code)
    if result.failures:
        raise typer.Exit(1)


def _print_plan(scenario: Scenario, as_json: bool, *, full: bool = False) -> None:
    from feeder_sim.cli.plan import plan_lines
    from feeder_sim.run.plan import plan_run
    from feeder_sim.run.prepare import prepare

    plan = plan_run(prepare(scenario))
    print(json.dumps(plan) if as_json else as_lines(plan) if full else plan_lines(plan))
