"""The folder of a question of many runs: what its journals keep, tasks that share it, and what it is not to be."""

from __future__ import annotations

import threading
import zlib
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pretended
import pytest
import speeds
import swept
from conftest import REPOSITORY, strip_scenario
from pretended import asked
from swept import AMPLITUDE, Pretended, over

from feeder_sim.errors import InputError
from feeder_sim.jobs.journal import Journal, read_journal
from feeder_sim.jobs.ledger import Ledger
from feeder_sim.run.identity import identity_of
from feeder_sim.scenario import Scenario, load_scenario
from feeder_sim.studies.ask import folder_of, merged
from feeder_sim.studies.question import Question
from feeder_sim.studies.search.optimise import OptimiseQuestion
from feeder_sim.studies.sweep.sweep import SweepQuestion
from feeder_sim.studies.uncertainty.uncertainty import UncertaintyQuestion

STRIP = strip_scenario(seeds=3, amplitude_um=1.0)
KINDS: dict[str, tuple[Question, Scenario, Any]] = {
    "sweep": (over(f"{AMPLITUDE}=1:2:15"), STRIP, swept.values_of),
    "uncertainty": (
        UncertaintyQuestion.of(inputs=16),
        STRIP.changed({"uncertain": {AMPLITUDE: {"uniform": [1.0, 4.0]}}}),
        swept.values_of,
    ),
    "optimise": (OptimiseQuestion.of(**speeds.SEARCH), STRIP, speeds.values_of),
    "map": (speeds.MAP, load_scenario(REPOSITORY / "scenarios/drift_4750hz.toml"), speeds.of_map),
}


def tables(folder: Path) -> dict[str, str]:
    return {file.name: file.read_text() for file in folder.glob("*.csv")}


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_done_is_kept(kind: str, tmp_path: Path) -> None:
    """Stopped again and again, in a search in the first generation, in a later one and at the check; then whole."""
    question, scenario, values_of = KINDS[kind]
    asked(question, scenario, pretended.Pretended(values_of), tmp_path / "whole")
    for after in (3, 15, 40, 150, 10_000):
        stop = threading.Event()
        asked(question, scenario, pretended.Pretended(values_of, stop, after), tmp_path / "broken", stop=stop)
        journal = tmp_path / "broken/journal.jsonl"
        journal.write_bytes(journal.read_bytes()[:-20])  # killed within a line
    last, none = (pretended.Pretended(values_of) for _ in range(2))
    assert asked(question, scenario, last, tmp_path / "broken").complete and last.count == 1
    assert asked(question, scenario, none, tmp_path / "broken").complete and none.count == 0
    assert tables(tmp_path / "broken") == tables(tmp_path / "whole") != {}


@pytest.mark.parametrize("kind", ["sweep", "uncertainty", "map"])
def test_tasks_of_a_job_array_merge_to_the_whole(kind: str, tmp_path: Path) -> None:
    question, scenario, values_of = KINDS[kind]
    for number in (1, 2, 3):
        asked(question, scenario, pretended.Pretended(values_of), tmp_path / "s", (number, 3))
    assert len(list((tmp_path / "s").glob("journal-*-of-3.jsonl"))) == 3 and not tables(tmp_path / "s")
    asked(question, scenario, pretended.Pretended(values_of), tmp_path / "whole")
    assert merged(tmp_path / "s").complete and tables(tmp_path / "s") == tables(tmp_path / "whole") != {}


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
    assert len(Ledger([path])) == 0


def test_done_points_are_kept_and_others_added(tmp_path: Path) -> None:
    scenario, again = strip_scenario(seeds=4), Pretended()
    first, more = over(f"{AMPLITUDE}=1,2"), over(f"{AMPLITUDE}=1,2", seeds=6)
    asked(first, scenario, Pretended(), tmp_path / "s")
    swept = asked(more, scenario, again, tmp_path / "s")
    assert sorted(again.seeds) == [(amplitude, seed) for amplitude in (1.0, 2.0) for seed in (4, 5)]
    assert [row.found.n for row in swept.valued("speed")] == [6, 6]
    none = Pretended()
    fewer = asked(first, scenario, none, tmp_path / "s")
    assert not none.seeds and [row.seeds for row in fewer.valued("speed")] == [6, 6]
    assert fewer.kept == 2 and fewer.complete
    assert identity_of(scenario) == identity_of(scenario.changed({"title": "other", "run.seeds": 7}))
    assert identity_of(scenario) != identity_of(scenario.changed({"run.seed": 7}))


def test_tasks_that_begin_at_once_share_a_folder(tmp_path: Path) -> None:
    scenario, question = strip_scenario(seeds=3), over(f"{AMPLITUDE}=1:2:5")

    def begin(number: int) -> str:
        with folder_of(question, scenario, tmp_path / "s", share=(number, 16)) as folder:
            return folder.journal.name

    with ThreadPoolExecutor(16) as pool:
        assert len(set(pool.map(begin, range(1, 17)))) == 16
    assert SweepQuestion.read(tmp_path / "s") == question


def test_a_sweep_goes_on_elsewhere_without_the_files_it_began_with(repository: Path, tmp_path: Path) -> None:
    mode_file = tmp_path / "here/modes.h5"
    mode_file.parent.mkdir()
    mode_file.write_bytes((repository / "models/plate_180/modes.h5").read_bytes())
    changes = {"plate.mode_file": mode_file, AMPLITUDE: 1.0, "drive[0].voltage_vpp": None}
    scenario = load_scenario(repository / "scenarios/drift_2797hz_plate.toml").changed(changes)
    asked(over(f"{AMPLITUDE}=1,2", seeds=2), scenario, Pretended(), tmp_path / "here/s")
    (tmp_path / "here").rename(tmp_path / "there")
    (tmp_path / "there/modes.h5").unlink()
    found: Any = merged(tmp_path / "there/s")
    assert found.complete and found.others == 0 and len(found.valued("speed")) == 2
    assert "inputs/modes.h5" in (tmp_path / "there/s/scenario.toml").read_text()


def test_a_refused_question_leaves_nothing_that_was_not_there(tmp_path: Path) -> None:
    question, scenario = over(f"{AMPLITUDE}=1:2:5", measure="sped"), strip_scenario(seeds=3)

    def refused(path: Path, share: tuple[int, int] | None = None) -> None:
        with pytest.raises(InputError, match="is sped"):
            asked(question, scenario, Pretended(), path, share)

    refused(tmp_path / "new/s")
    assert not any(tmp_path.iterdir())
    (tmp_path / "own").mkdir()
    refused(tmp_path / "own")
    assert not any((tmp_path / "own").iterdir())
    with pytest.raises(InputError), folder_of(question, scenario, tmp_path / "own"):
        (tmp_path / "own/meanwhile.txt").write_text("mine")
        raise InputError("is sped")
    assert [path.name for path in (tmp_path / "own").iterdir()] == ["meanwhile.txt"]
    (tmp_path / "beside").mkdir()
    (tmp_path / "beside/mine.txt").write_text("mine")
    refused(tmp_path / "beside/s")
    assert [path.name for path in (tmp_path / "beside").iterdir()] == ["mine.txt"]
    refused(tmp_path / "tasks", (1, 2))  # task 2 may work there
    assert (tmp_path / "tasks/sweep.toml").is_file()
    asked(over(f"{AMPLITUDE}=1:2:5"), scenario, Pretended(), tmp_path / "s")
    kept = (tmp_path / "s/journal.jsonl").read_bytes()
    refused(tmp_path / "s")
    assert kept and (tmp_path / "s/journal.jsonl").read_bytes() == kept


def test_a_folder_of_something_else_is_left_alone(tmp_path: Path) -> None:
    scenario, question = strip_scenario(seeds=3), over(f"{AMPLITUDE}=1:2:5")
    (tmp_path / "own").mkdir()
    (tmp_path / "own/scenario.toml").write_text("# mine")
    with pytest.raises(InputError, match=r"holds scenario\.toml and no sweep\.toml"):
        folder_of(question, scenario, tmp_path / "own")
    with folder_of(question, scenario, tmp_path / "s"):
        pass
    with folder_of(over(f"{AMPLITUDE}=1:2:5", seeds=7, measure="speed"), scenario, tmp_path / "s"):
        pass  # more seeds are the same question
    for other in (over(f"{AMPLITUDE}=1:3:5"), over(f"{AMPLITUDE}=1:2:5", zip=True)):
        with pytest.raises(InputError, match="holds another question"):
            folder_of(other, scenario, tmp_path / "s")
    with pytest.raises(InputError, match="holds another question"):
        folder_of(question, scenario.changed({"contact.friction": 0.1}), tmp_path / "s")
    (tmp_path / "s/sweep.png").symlink_to(tmp_path / "own/scenario.toml")
    with pytest.raises(InputError, match="is a link"), folder_of(question, scenario, tmp_path / "s"):
        pass
    assert (tmp_path / "own/scenario.toml").read_text() == "# mine"
