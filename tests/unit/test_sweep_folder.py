"""The folder of a sweep: what its journals keep, tasks that share it, and what it is not to be."""

from __future__ import annotations

import zlib
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import pytest
from conftest import strip_scenario
from swept import AMPLITUDE, Pretended, cases_at

from feeder_sim.errors import InputError
from feeder_sim.jobs.identity import identity_of
from feeder_sim.jobs.journal import Journal, read_journal
from feeder_sim.jobs.workers import Workers
from feeder_sim.scenario import load_scenario
from feeder_sim.studies.sweep.cases import Cases, run_cases, take_done
from feeder_sim.studies.sweep.folder import merged, sweep_folder
from feeder_sim.studies.sweep.question import Question


def test_a_journal_outlives_what_a_kill_leaves(tmp_path: Path) -> None:
    path = tmp_path / "journal.jsonl"
    with Journal(path) as journal:
        journal.add({"seed": 1})
        journal.add({"seed": 2})
    whole = path.read_bytes()
    for cut in range(len(whole)):
        path.write_bytes(whole[:cut])
        with Journal(path) as journal:
            journal.add({"seed": 3})
        kept = [entry["seed"] for entry in read_journal(path)]
        assert kept[-1] == 3 and kept[:-1] == [1, 2][: len(kept) - 1]
        assert len(kept) - 1 >= whole[:cut].count(b"\n")
    path.write_bytes(whole.replace(b'"seed": 2', b'"seed": 7'))
    assert [entry["seed"] for entry in read_journal(path)] == [1]
    path.write_bytes(b"%08x 5\n%08x {}\n" % (zlib.crc32(b"5"), zlib.crc32(b"{}")))
    cases = cases_at(Question((f"{AMPLITUDE}=1,2",)))
    assert take_done(cases, [path]) == 0 and not any(case.done for case in cases)


def test_done_points_are_kept_and_others_added(tmp_path: Path) -> None:
    scenario, journal = strip_scenario(seeds=4), tmp_path / "journal.jsonl"
    run_cases(cases_at(Question((f"{AMPLITUDE}=1,2",))), Workers(Pretended(), 1), journal)
    again = Pretended()
    swept = run_cases(cases_at(Question((f"{AMPLITUDE}=2,3",), seeds=6)), Workers(again, 1), journal)
    assert sorted(again.seeds) == [(2.0, 4), (2.0, 5), *((3.0, seed) for seed in range(6))]
    assert [row.found.n for row in swept.of("speed")] == [6, 6]
    assert identity_of(scenario) == identity_of(scenario.changed({"title": "other", "run.seeds": 7}))
    assert identity_of(scenario) != identity_of(scenario.changed({"run.seed": 7}))


def test_fewer_seeds_keep_those_that_are_there(tmp_path: Path) -> None:
    journal = tmp_path / "journal.jsonl"
    run_cases(cases_at(Question((f"{AMPLITUDE}=1,2",), seeds=6)), Workers(Pretended(), 1), journal)
    again = Pretended()
    swept = run_cases(cases_at(Question((f"{AMPLITUDE}=1,2,3",), seeds=2)), Workers(again, 1), journal)
    assert sorted(again.seeds) == [(3.0, 0), (3.0, 1)]
    assert [row.seeds for row in swept.of("speed")] == [6, 6, 2] and swept.kept == 2 and swept.complete


def test_tasks_of_a_job_array_merge_to_the_whole(tmp_path: Path) -> None:
    scenario, question = strip_scenario(seeds=3), Question((f"{AMPLITUDE}=1:2:5",))
    for number in (1, 2, 3):
        with sweep_folder(tmp_path / "s", "", scenario, question, (number, 3)) as folder:
            cases = Cases.of(scenario, question, file=Path("scenario")).part(number, 3)
            run_cases(cases, Workers(Pretended(), 1), folder.journal)
    assert len(list((tmp_path / "s").glob("journal-*-of-3.jsonl"))) == 3
    found, _ = merged(tmp_path / "s")
    assert found.complete
    assert found.rows == run_cases(cases_at(question.__class__(question.vary, seeds=3)), Workers(Pretended(), 1)).rows


def test_tasks_that_begin_at_once_share_a_folder(tmp_path: Path) -> None:
    scenario, question = strip_scenario(seeds=3), Question((f"{AMPLITUDE}=1:2:5",))

    def begin(number: int) -> str:
        with sweep_folder(tmp_path / "s", "", scenario, question, (number, 16)) as folder:
            return folder.journal.name

    with ThreadPoolExecutor(16) as pool:
        assert len(set(pool.map(begin, range(1, 17)))) == 16
    assert Question.of_toml(tmp_path / "s/sweep.toml") == question


def test_a_sweep_goes_on_elsewhere_without_the_files_it_began_with(repository: Path, tmp_path: Path) -> None:
    mode_file = tmp_path / "here/modes.h5"
    mode_file.parent.mkdir()
    mode_file.write_bytes((repository / "models/plate_180/modes.h5").read_bytes())
    changes = {"plate.mode_file": mode_file, AMPLITUDE: 1.0, "drive[0].voltage_vpp": None}
    scenario = load_scenario(repository / "scenarios/drift_2797hz_plate.toml").changed(changes)
    question = Question((f"{AMPLITUDE}=1,2",), seeds=2)
    with sweep_folder(tmp_path / "here/s", "", scenario, question) as folder:
        run_cases(Cases.of(scenario, question, file=Path("s")), Workers(Pretended(), 1), folder.journal)
    (tmp_path / "here").rename(tmp_path / "there")
    (tmp_path / "there/modes.h5").unlink()
    found, folder = merged(tmp_path / "there/s")
    assert found.complete and found.others == 0 and len(found.of("speed")) == 2
    with folder:
        assert "inputs/modes.h5" in (tmp_path / "there/s/scenario.toml").read_text()


def test_a_refused_question_leaves_nothing_that_was_not_there(tmp_path: Path) -> None:
    question = Question((f"{AMPLITUDE}=1:2:5",), measure="sped")
    scenario = strip_scenario(seeds=3)

    def refused(path: Path, share: tuple[int, int] | None = None) -> None:
        cases = Cases.of(scenario, question, file=Path("scenario"))
        with pytest.raises(InputError, match="is sped"), sweep_folder(path, "", scenario, question, share) as folder:
            run_cases(cases, Workers(Pretended(), 1), folder.journal)

    refused(tmp_path / "new/s")
    assert not any(tmp_path.iterdir())
    (tmp_path / "own").mkdir()
    refused(tmp_path / "own")
    assert not any((tmp_path / "own").iterdir())
    with pytest.raises(InputError), sweep_folder(tmp_path / "own", "", scenario, question):
        (tmp_path / "own/meanwhile.txt").write_text("mine")
        raise InputError("is sped")
    assert [path.name for path in (tmp_path / "own").iterdir()] == ["meanwhile.txt"]
    (tmp_path / "beside").mkdir()
    (tmp_path / "beside/mine.txt").write_text("mine")
    refused(tmp_path / "beside/s")
    assert [path.name for path in (tmp_path / "beside").iterdir()] == ["mine.txt"]
    refused(tmp_path / "tasks", (1, 2))  # task 2 may work there
    assert (tmp_path / "tasks/sweep.toml").is_file()
    with sweep_folder(tmp_path / "s", "", scenario, replace(question, measure="")) as folder:
        run_cases(cases_at(Question((f"{AMPLITUDE}=1,2",), seeds=1)), Workers(Pretended(), 1), folder.journal)
    kept = (tmp_path / "s/journal.jsonl").read_bytes()
    refused(tmp_path / "s")
    assert kept and (tmp_path / "s/journal.jsonl").read_bytes() == kept
    with pytest.raises(InputError, match="late"), sweep_folder(tmp_path / "late", "", scenario, question) as folder:
        run_cases(cases_at(Question((f"{AMPLITUDE}=1,2",), seeds=1)), Workers(Pretended(), 1), folder.journal)
        raise InputError("late")
    assert (tmp_path / "late/journal.jsonl").stat().st_size > 0


def test_a_folder_of_something_else_is_left_alone(tmp_path: Path) -> None:
    scenario, question = strip_scenario(seeds=3), Question((f"{AMPLITUDE}=1:2:5",))
    (tmp_path / "own").mkdir()
    (tmp_path / "own/scenario.toml").write_text("# mine")
    with pytest.raises(InputError, match=r"holds scenario\.toml and no sweep\.toml"):
        sweep_folder(tmp_path / "own", "", scenario, question)
    with sweep_folder(tmp_path / "s", "", scenario, question):
        pass
    with sweep_folder(tmp_path / "s", "", scenario, replace(question, seeds=7, measure="speed")):
        pass  # more seeds are the same question
    for other in (replace(question, vary=(f"{AMPLITUDE}=1:3:5",)), replace(question, zipped=True)):
        with pytest.raises(InputError, match="holds another question"):
            sweep_folder(tmp_path / "s", "", scenario, other)
    with pytest.raises(InputError, match="holds another question"):
        sweep_folder(tmp_path / "s", "", scenario.changed({"contact.friction": 0.1}), question)
    (tmp_path / "s/sweep.png").symlink_to(tmp_path / "own/scenario.toml")
    with pytest.raises(InputError, match="is a link"), sweep_folder(tmp_path / "s", "", scenario, question):
        pass
    assert (tmp_path / "own/scenario.toml").read_text() == "# mine"
