"""Questions of many runs, as a user of Python asks them."""

from __future__ import annotations

import threading
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import Any, cast

from feeder_sim.api.progress import Progress, displayed
from feeder_sim.errors import check_type, path_of_user
from feeder_sim.measures.effort import MOST_SEEDS
from feeder_sim.measures.function import Function, as_measures
from feeder_sim.measures.protocol import Measure
from feeder_sim.pool.work import Work
from feeder_sim.scenario import Scenario, check_scenario
from feeder_sim.studies.ask import ask, folder_of
from feeder_sim.studies.budget import Budget, BudgetQuestion
from feeder_sim.studies.calibration.calibrate import Calibration, calibration_of
from feeder_sim.studies.chart.chart import Chart, ChartQuestion
from feeder_sim.studies.question import Question
from feeder_sim.studies.search.optimise import OptimiseQuestion, Search
from feeder_sim.studies.search.proposals import Sampler
from feeder_sim.studies.speed_map import MapQuestion, SpeedMap
from feeder_sim.studies.study import Study
from feeder_sim.studies.sweep.sweep import Sweep, SweepQuestion, axis_texts
from feeder_sim.studies.uncertainty.uncertainty import Uncertainty, UncertaintyQuestion


def sweep(
    scenario: Scenario,
    vary: Mapping[str, Any],
    *,
    zip: bool = False,
    sobol: int = 0,
    seeds: int | None = None,
    measure: str | None = None,
    until_se: float | None = None,
    most_seeds: int = MOST_SEEDS,
    inputs: int = 16,
    workers: int | None = None,
    executor: Executor | None = None,
    out: str | Path | None = None,
    progress: Progress = None,
    stop: threading.Event | None = None,
    measures: Iterable[Function | Measure[Any, Any]] = (),
) -> Sweep:
    """Run a scenario at every point of a grid, in many processes.

    In a script, call it below `if __name__ == "__main__":`, as everything that starts processes.

    Args:
        scenario: what is varied; the values it has stand for all keys that are not.
        vary: values by dotted key, or a text as the command line takes it: `{"drive[0].amplitude_um": "0.5:8:log12"}`.
            Units are in the names of the keys.
        zip: take the values of the keys side by side, not crossed.
        sobol: so many points of a scrambled Sobol sequence, in place of a grid; keys may then have ranges, "0.5:8".
        seeds: of every point; default: those of the scenario.
        measure: that `until_se` looks at.
        until_se: more seeds, 8 or more, are run until the standard error is below this share of the mean [1].
        most_seeds: of a point with `until_se`; `Sweep.short` counts the points that do not get there.
        inputs: draws of the uncertain inputs, where the scenario has any.
        workers: processes; default: one per core.
        executor: runs the tasks in place of processes of this machine, as that of a Dask client.
        out: folder for the table and a journal, as of the command; with it the same call goes on after a break.
        progress: True shows a bar on stderr; a function is called with the share that is done.
        stop: set it to end; what is done is returned.
        measures: of one's own, as for `simulate`; functions that processes can import.

    Raises:
        InputError: a key or a value that is not allowed, or a folder that holds something else.
        RecordingFailed: the folder cannot be written.
    """
    check_type(vary, Mapping, "a dictionary of values by key", "vary")
    effort: dict[str, Any] = {"seeds": seeds, "until_se": until_se, "most_seeds": most_seeds, "inputs": inputs}
    check_scenario(scenario)
    work = Work(workers, executor, stop=stop or threading.Event())
    question = SweepQuestion.of(vary=axis_texts(vary), zip=zip, sobol=sobol, measure=measure, **effort)
    return cast("Sweep", _study_of(question, scenario, work, out, progress, measures))


def uncertainty(
    scenario: Scenario,
    *,
    inputs: int = 32,
    seeds: int = 2,
    indices: bool = False,
    measure: str | None = None,
    workers: int | None = None,
    executor: Executor | None = None,
    out: str | Path | None = None,
    progress: Progress = None,
    stop: threading.Event | None = None,
    measures: Iterable[Function | Measure[Any, Any]] = (),
) -> Uncertainty:
    """Run a scenario at many draws of its `[uncertain]` inputs, in many processes.

    In a script, call it below `if __name__ == "__main__":`, as everything that starts processes.

    Args:
        scenario: has an `[uncertain]` table.
        inputs: draws of the inputs, from 2 on; with `indices` so many times (inputs + 2), and a power of two.
        seeds: of every draw; two tell inputs and seeds apart.
        indices: draw them so that Sobol indices can be told; the extra `uncertainty` brings SALib.
        measure: that every seed has to have; default: any.
        workers: processes; default: one per core.
        executor: runs the tasks in place of processes of this machine, as that of a Dask client.
        out: folder for the tables and a journal, as of the command; with it the same call goes on after a break.
        progress: True shows a bar on stderr; a function is called with the share that is done.
        stop: set it to end; what is done is returned.
        measures: of one's own, as for `simulate`; functions that processes can import.

    Raises:
        InputError: no input is uncertain, an argument is not allowed, SALib is missing, there is no such measure, or
            the folder holds something else.
        RecordingFailed: the folder cannot be written.
    """
    check_scenario(scenario)
    work = Work(workers, executor, stop=stop or threading.Event())
    question = UncertaintyQuestion.of(inputs=inputs, seeds=seeds, indices=indices, measure=measure)
    return cast("Uncertainty", _study_of(question, scenario, work, out, progress, measures))


def optimise(
    scenario: Scenario,
    over: Mapping[str, Any],
    *,
    maximise: str | None = None,
    minimise: str | None = None,
    trials: int = 200,
    budget_s: float | None = None,
    seeds: int | None = None,
    check_seeds: int = 16,
    screen: str | Path | None = None,
    recipes: int = 256,
    sampler: Sampler = "tpe",
    workers: int | None = None,
    executor: Executor | None = None,
    out: str | Path | None = None,
    progress: Progress = None,
    stop: threading.Event | None = None,
    measures: Iterable[Function | Measure[Any, Any]] = (),
) -> Search:
    """Search for the recipe that makes a measure largest or smallest, in many processes; the extra `search`.

    In a script, call it below `if __name__ == "__main__":`, as everything that starts processes.

    Args:
        scenario: where the search begins; the values it has stand for all keys that are not searched.
        over: by dotted key a range, "0.5:2" or "0.5:2:log", or a list of choices. Units are in the names of the keys.
            A key that ends in `.mode` takes its frequency along.
        maximise: measure that is to be large; this or the next.
        minimise: measure that is to be small.
        trials: recipes to try, at most.
        budget_s: time for the trials [s]; default: no limit.
        seeds: of a recipe, from 2 on; default: those of the scenario, up to 8.
        check_seeds: fresh seeds of the best recipe and of the scenario as it is, from 2 on.
        screen: file of a drift map, which proposes recipes to begin with, for the least `arrival_time_s`.
        recipes: that the drift map walks, from 2 on.
        sampler: of Optuna: "tpe", or "cmaes" for numbers only.
        workers: processes; default: one per core.
        executor: runs the tasks in place of processes of this machine, as that of a Dask client.
        out: folder for the tables and journals, as of the command; with it the same call goes on after a break.
            Default: one that is removed at the end.
        progress: True shows a bar on stderr; a function is called with the share of the budget that is spent.
        stop: set it to end; what is done is returned.
        measures: of one's own, as for `simulate`; functions that processes can import.

    Raises:
        InputError: a key, a value or an argument that is not allowed, no such measure, Optuna is missing, or the
            folder holds something else.
        RecordingFailed: the folder cannot be written.
    """
    check_scenario(scenario)
    check_type(over, Mapping, "a dictionary of ranges and choices by key", "over")
    aims: dict[str, Any] = {"maximise": maximise, "minimise": minimise, "seeds": seeds, "check_seeds": check_seeds}
    screened = path_of_user(screen, "screen") if screen is not None else None
    effort: dict[str, Any] = {"trials": trials, "budget_s": budget_s, "screen": screened, "recipes": recipes}
    work = Work(workers, executor, stop=stop or threading.Event())
    question = OptimiseQuestion.of(over=axis_texts(over), sampler=sampler, **aims, **effort)
    return cast("Search", _study_of(question, scenario, work, out, progress, measures))


def speed_map(
    scenario: Scenario,
    frequencies_hz: str | Iterable[float],
    amplitudes_um: str | Iterable[float],
    *,
    seeds: int = 12,
    workers: int | None = None,
    executor: Executor | None = None,
    out: str | Path | None = None,
    progress: Progress = None,
    stop: threading.Event | None = None,
) -> SpeedMap:
    """Measure the transport speed of a part at every pair of a drive frequency and an amplitude.

    Args:
        scenario: one part that starts at a point of a strip, with `run.stop = "passage"` and one drive by an amplitude.
            Start and duration of a point go with its wavelength and speed. Inputs that are `[uncertain]` have the
            values of the scenario.
        frequencies_hz: numbers above 0 [Hz], or a text as the command line takes it, such as "2500:10000:40".
        amplitudes_um: numbers above 0 [um], or such a text.
        seeds: of every point.
        workers: processes; default: one per core.
        executor: runs the tasks in place of processes of this machine, as that of a Dask client.
        out: folder for the table and a journal, as of the command; with it the same call goes on after a break.
        progress: True shows a bar on stderr; a function is called with the share that is done.
        stop: set it to end; the points done so far are returned.

    Raises:
        InputError: a scenario that cannot be mapped, values that are not allowed, or a folder that holds something
            else.
        RecordingFailed: the folder cannot be written.
    """
    check_scenario(scenario)
    texts = axis_texts({"frequencies_hz": frequencies_hz, "amplitudes_um": amplitudes_um})
    work = Work(workers, executor, stop=stop or threading.Event())
    question = MapQuestion.of(**dict(text.split("=", 1) for text in texts), seeds=seeds)
    return cast("SpeedMap", _study_of(question, scenario, work, out, progress))


def chart(
    scenario: Scenario,
    *,
    measure: str | None = None,
    method: Sequence[str] | None = None,
    seeds: int | None = None,
    within: float = 0.05,
    known: float | None = None,
    workers: int | None = None,
    executor: Executor | None = None,
    out: str | Path | None = None,
    progress: Progress = None,
    stop: threading.Event | None = None,
) -> Chart:
    """Compute a measure of a scenario with many settings: what each costs, and how far it is off.

    In a script, call it below `if __name__ == "__main__":`, as everything that starts processes.

    Args:
        scenario: what is computed, at the values of its inputs that are `[uncertain]`.
        measure: that is to be right; default: the usual one.
        method: "no-step", "steps", "mujoco" and "simplified", or some of them; default: all but "mujoco".
        seeds: of every setting; default: those of the scenario.
        within: error that is good enough [1].
        known: the exact value, in the unit of the measure; default: that of the finest setting.
        workers: processes; default: one per core.
        executor: runs the tasks in place of processes of this machine, as that of a Dask client.
        out: folder for the table and a journal, as of the command; with it the same call goes on after a break.
        progress: True shows a bar on stderr; a function is called with the share that is done.
        stop: set it to end; what is done is returned.

    Raises:
        InputError: an argument is not allowed, there is no such measure, or the folder holds something else.
        RecordingFailed: the folder cannot be written.
    """
    check_scenario(scenario)
    methods = None if method is None else [method] if isinstance(method, str) else list(method)
    work = Work(workers, executor, stop=stop or threading.Event())
    question = ChartQuestion.of(measure=measure, method=methods, seeds=seeds, within=within, known=known)
    return cast("Chart", _study_of(question, scenario, work, out, progress))


def budget(
    scenario: Scenario,
    *,
    measure: str | None = None,
    seeds: int = 32,
    inputs: int = 32,
    mujoco: bool = False,
    workers: int | None = None,
    executor: Executor | None = None,
    out: str | Path | None = None,
    progress: Progress = None,
    stop: threading.Event | None = None,
) -> Budget:
    """How far to trust a measure: numerics, seeds, inputs, and what the model leaves out.

    In a script, call it below `if __name__ == "__main__":`, as everything that starts processes.

    Args:
        scenario: what is computed; its inputs that are `[uncertain]` are an entry.
        measure: to look at; default: the usual one.
        seeds: of every entry.
        inputs: draws of the uncertain inputs.
        mujoco: whether MuJoCo in place of impulses is an entry, too.
        workers: processes; default: one per core.
        executor: runs the tasks in place of processes of this machine, as that of a Dask client.
        out: folder for the table and a journal, as of the command; with it the same call goes on after a break.
        progress: True shows a bar on stderr; a function is called with the share that is done.
        stop: set it to end; what is done is returned.

    Raises:
        InputError: an argument is not allowed, there is no such measure, or the folder holds something else.
        RecordingFailed: the folder cannot be written.
    """
    check_scenario(scenario)
    work = Work(workers, executor, stop=stop or threading.Event())
    question = BudgetQuestion.of(measure=measure, seeds=seeds, inputs=inputs, mujoco=mujoco)
    return cast("Budget", _study_of(question, scenario, work, out, progress))


def calibrate(
    file: str | Path,
    *,
    points: int | None = None,
    seeds: int | None = None,
    workers: int | None = None,
    executor: Executor | None = None,
    out: str | Path | None = None,
    progress: Progress = None,
    stop: threading.Event | None = None,
) -> Calibration:
    """What measurements say about constants that are not known exactly, and what they cannot decide.

    In a script, call it below `if __name__ == "__main__":`, as everything that starts processes.

    Args:
        file: TOML with experiments and priors.
        points: of each of two rounds; default: 32.
        seeds: of every point; default: 8.
        workers: processes; default: one per core.
        executor: runs the tasks in place of processes of this machine, as that of a Dask client.
        out: folder for the tables and a journal, as of the command; with it the same call goes on after a break.
        progress: True shows a bar on stderr; a function is called with the share that is done.
        stop: set it to end; what is done is returned.

    Raises:
        InputError: the file or an argument is not allowed, there is no such measure, too few points have a value of it,
            or the folder holds something else.
        MissingExtra: scikit-learn is not installed.
        RecordingFailed: the folder cannot be written.
    """
    question = calibration_of(path_of_user(file, "calibrate"), points, seeds)
    work = Work(workers, executor, stop=stop or threading.Event())
    return cast("Calibration", _study_of(question, question.experiment[0].scenario, work, out, progress))


def _study_of(
    question: Question,
    scenario: Scenario,
    work: Work,
    out: str | Path | None,
    progress: Progress,
    measures: Iterable[Function | Measure[Any, Any]] = (),
) -> Study:
    folder = folder_of(question, scenario, path_of_user(out, "out")) if out is not None else None
    with displayed(work, progress, scenario.title or question.kind) as work:
        return ask(question, scenario, folder, measures=as_measures(measures), work=work)
