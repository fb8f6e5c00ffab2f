"""Seeds as tasks of workers and in executors: what is sent, what comes back, and what is said when it does not."""

from __future__ import annotations

import json
import pickle
import threading
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import strip_scenario
from swept import AMPLITUDE, Pretended, over, plan_of

import feeder_sim
from feeder_sim import sweep
from feeder_sim.errors import FeederSimError
from feeder_sim.jobs.runner import Runner
from feeder_sim.jobs.task import SeedValues, Task, run_task, warnings_over
from feeder_sim.pool.workers import Workers
from feeder_sim.records.seed import Seed
from feeder_sim.run.provenance import identity_of
from feeder_sim.scenario import Contact
from feeder_sim.studies.sweep.cases import SweepTasks


def test_real_seeds_are_those_of_simulate() -> None:
    """A sweep in threads, with uncertain inputs, against `simulate` of the same scenarios."""
    from feeder_sim import simulate

    scenario = strip_scenario(seeds=2, duration_s=0.05)
    with ThreadPoolExecutor(1) as pool:
        swept = sweep(scenario, {AMPLITUDE: [0.5, 1.0]}, executor=pool, workers=1)
    for row in swept.valued("drift_velocity_x_mm_s"):
        found = simulate(scenario.changed(row.point)).measures()["drift_velocity_x_mm_s"]
        assert (row.statistic.mean, row.statistic.se, row.statistic.n) == (found["mean"], found["se"], 2)


def test_a_broken_executor_loses_nothing() -> None:
    question = over(f"{AMPLITUDE}=1:2:3", seeds=5)
    whole, broken, second = plan_of(question, Pretended()), plan_of(question), Pretended()
    assert broken.run(Runner(Workers(Pretended(break_at=(3,)), 2, lambda: second)))
    assert second.seeds and broken.cases.rows == whole.cases.rows


def test_workers_that_end_again_and_again_end_the_sweep(monkeypatch: pytest.MonkeyPatch) -> None:
    cases = plan_of(over(f"{AMPLITUDE}=1:2:3", seeds=5)).cases
    workers = Workers(Pretended(break_at=(0,)), 2, lambda: Pretended(break_at=(0,)))
    with pytest.raises(FeederSimError, match="again and again"):
        Runner(workers).run(SweepTasks(cases, lambda case, point, seed: None))


def test_a_task_says_why_it_cannot_be_run_and_what_misleads() -> None:
    refused = strip_scenario().changed({"part[0].start.position_mm": [1e4, 0.0]})
    misleading = strip_scenario(duration_s=0.02).changed({"run.in_plane_velocity": False})
    (failed,), (told,) = (run_task(Task(one, identity_of(one), (0,))) for one in (refused, misleading))
    assert "start.position_mm" in failed.failure and not failed.values
    assert [line.partition(" ")[0] for line in told.warnings] == ["run.in_plane_velocity"]
    for seed in (failed, told):
        entry = json.loads(json.dumps(seed.as_entry()))
        assert SeedValues.of_entry(entry) == seed
        entry.pop("warnings", None)  # as journals had it once
        assert SeedValues.of_entry(entry) == replace(seed, warnings=())
    with pytest.raises(FeederSimError, match="another version of the package"):
        run_task(Task(misleading, "of another version", (0,)))


def test_a_warning_is_given_once_for_all_points() -> None:
    """Also where its numbers are those of each point."""
    lines = [("run.planar is true: no",), ("run.planar is true: no", "drive[0]: by 3.2 um"), ("drive[0]: by 2e+03 um",)]
    places = [[SeedValues(seed, {}, 0.1, "", told) for seed in range(2)] for told in lines]
    assert [warning.in_words() for warning in warnings_over([*places, []])] == [
        "run.planar is true: no (at 2 of 3 points)",
        "drive[0]: by 3.2 um (at 2 of 3 points, the numbers are those of the first)",
    ]
    assert [warning.in_words() for warning in warnings_over(places[:1])] == ["run.planar is true: no"]
    other = [SeedValues(0, {}, 0.1, "", ("drive[1]: by 3.2 um",))]
    assert len(warnings_over([places[1], other])) == 3  # of another drive


class Elsewhere(ThreadPoolExecutor):
    """Threads that get and give back only what has been pickled, as other machines do."""

    def submit(self, fn: Callable[..., Any], /, *given: Any, **named: Any) -> Future[Any]:
        sent = pickle.dumps((fn, given, named))

        def call() -> Any:
            function, arguments, keywords = pickle.loads(sent)
            return pickle.loads(pickle.dumps(function(*arguments, **keywords)))

        return super().submit(call)


class Broken(ThreadPoolExecutor):
    def submit(self, fn: Callable[..., Any], /, *given: Any, **named: Any) -> Future[Any]:
        raise BrokenExecutor("a worker has ended")


def check_equal(one: tuple[Seed, ...], other: tuple[Seed, ...]) -> None:
    assert len(one) == len(other)
    for a, b in zip(one, other, strict=True):
        assert np.array_equal(a.frames.position, b.frames.position) and a.status == b.status
        assert np.array_equal(a.impacts, b.impacts) and str(a.failure) == str(b.failure)


def test_seeds_elsewhere_are_those_of_threads() -> None:
    scenario = strip_scenario(seeds=3, duration_s=0.05)
    here = feeder_sim.simulate(scenario)
    with Elsewhere(2) as pool:
        there = feeder_sim.simulate(scenario, executor=pool)
    check_equal(here.seeds, there.seeds)
    assert here.measures() == there.measures()


def test_seeds_that_diverge_elsewhere_leave_their_last_states_in_the_folder(tmp_path: Path) -> None:
    step_us = 1e6 / (8775.0 * 40)  # springs so hard that the step is too long for them
    contact = Contact(model="compliant", time_constant_us=step_us, damping_ratio=0.1)
    scenario = strip_scenario(frequency_hz=8775.0, duration_s=1.0, seeds=2).model_copy(update={"contact": contact})
    here = feeder_sim.record_run(scenario, tmp_path / "here", replay=False)
    with Elsewhere(2) as pool:
        there = feeder_sim.record_run(scenario, tmp_path / "there", replay=False, executor=pool)
    assert len(there.failures) == 2
    check_equal(here.seeds, there.seeds)
    opened = feeder_sim.open(tmp_path / "there")
    check_equal(opened.seeds, there.seeds)
    assert sorted(p.name for p in tmp_path.glob("there/*")) == sorted(p.name for p in tmp_path.glob("here/*"))


def test_a_stopped_run_elsewhere_is_interrupted() -> None:
    stop = threading.Event()
    stop.set()
    with Elsewhere(1) as pool:
        assert feeder_sim.simulate(strip_scenario(seeds=3, duration_s=0.05), executor=pool, stop=stop).interrupted


def test_workers_that_end_are_told_in_one_line() -> None:
    with (
        Broken(1) as pool,
        pytest.raises(FeederSimError, match="workers end before their task is done: BrokenExecutor a worker has ended"),
    ):
        feeder_sim.simulate(strip_scenario(duration_s=0.05), executor=pool)


def test_what_cannot_be_had_elsewhere_is_refused_as_here() -> None:
    scenario = strip_scenario(duration_s=0.05).changed({"part[0].start.position_mm": [1e4, 0.0]})
    with Elsewhere(1) as pool, pytest.raises(feeder_sim.InputError, match="position_mm"):
        feeder_sim.simulate(scenario, executor=pool)


@pytest.mark.slow
def test_a_run_in_processes() -> None:
    scenario = strip_scenario(seeds=4, duration_s=0.05)
    with ProcessPoolExecutor(2) as pool:
        check_equal(feeder_sim.simulate(scenario).seeds, feeder_sim.simulate(scenario, executor=pool).seeds)
