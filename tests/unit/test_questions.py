"""Questions of many runs: as functions whose results show themselves shortly, and what their folders keep."""

from __future__ import annotations

import math
import tempfile
import threading
import zlib
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
import speeds
import swept
from conftest import REPOSITORY, strip_scenario
from pretended import Pretended, asked
from speeds import AMPLITUDE, FRICTION, of_map, values_of
from swept import over

import feeder_sim
from feeder_sim.errors import InputError
from feeder_sim.jobs.ledger import Journal, Ledger, read_journal
from feeder_sim.notebook import MOST_ROWS, table
from feeder_sim.run.provenance import identity_of
from feeder_sim.scenario import Scenario, load_scenario
from feeder_sim.studies.ask import folder_of, merged
from feeder_sim.studies.question import Question
from feeder_sim.studies.search.optimise import OptimiseQuestion
from feeder_sim.studies.study import Answer
from feeder_sim.studies.sweep.sweep import SweepQuestion
from feeder_sim.studies.uncertainty.uncertainty import UncertaintyQuestion

LONGEST = 200  # characters of a line


@pytest.fixture(autouse=True)
def no_window() -> Iterator[None]:
    from matplotlib import pyplot

    pyplot.switch_backend("Agg")
    yield
    pyplot.close("all")


def check_shown(answer: Answer) -> None:
    """A short line, a page of HTML, a tidy table."""
    assert repr(answer).startswith("<") and len(repr(answer)) < LONGEST
    assert len(answer._repr_html_()) < 200 * LONGEST
    frame = answer.to_frame()
    assert len(frame) and not (frame.map(lambda value: value is None)).any().any()


def test_sweep() -> None:
    values = [0.5 + 0.01 * i for i in range(200)]
    swept = feeder_sim.sweep(strip_scenario(), {AMPLITUDE: values}, seeds=4, executor=Pretended(values_of))
    assert swept.complete and repr(swept) == f"<Sweep over {AMPLITUDE}: 200 points, 1 measure>"
    check_shown(swept)
    assert list(swept.to_frame().columns[:4]) == [AMPLITUDE, "measure", "mean", "se"] and len(swept.to_frame()) == 200
    assert len(swept.plot()) == 1
    with pytest.raises(feeder_sim.InputError, match="is 'sped'"):
        swept.plot("sped")
    vary: dict[str, Any] = {AMPLITUDE: [1.0, 2.0], FRICTION: [0.1, 0.2]}
    zipped = feeder_sim.sweep(strip_scenario(), vary, zip=True, executor=Pretended(values_of))
    assert [row.point[FRICTION] for row in zipped.rows] == [0.1, 0.2]
    crossed = feeder_sim.sweep(strip_scenario(), vary, executor=Pretended(values_of))
    assert len(crossed.rows) == 4 and len(crossed.plot()[0].containers) == 2  # a curve for each friction
    drawn = feeder_sim.sweep(strip_scenario(), {AMPLITUDE: "0.5:2"}, sobol=8, executor=Pretended(values_of))
    assert len(drawn.rows) == 8


UNCERTAIN = strip_scenario().changed({"uncertain": {AMPLITUDE: {"uniform": [1.0, 4.0]}}})


def test_optimise(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without a folder nothing is left of it."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    over = {AMPLITUDE: "0.5:5", FRICTION: [0.1, 0.2, 0.3]}
    how: dict[str, Any] = {"maximise": "speed", "trials": 16, "seeds": 2, "check_seeds": 4}
    found = feeder_sim.optimise(strip_scenario(), over, **how, executor=Pretended(values_of))
    assert found.complete and len(found.trials) == 16 and not list(tmp_path.iterdir())
    check_shown(found)
    assert "as it is" in found._repr_html_() and found.plot().get_ylabel() == "speed"
    assert found.best is not None and found.best.point is not None
    assert found.best_scenario.contact.friction == found.best.point[FRICTION]
    feeder_sim.optimise(strip_scenario(), over, **how, executor=Pretended(values_of), out=str(tmp_path / "s"))
    assert (tmp_path / "s/best.toml").is_file()
    read: Any = feeder_sim.open_study(tmp_path / "s")
    assert read.aim == found.aim and read.question.over == (f"{AMPLITUDE}=0.5:5", f"{FRICTION}=[0.1, 0.2, 0.3]")
    assert read.best == found.best and read.complete


def test_uncertainty() -> None:
    found, few = (feeder_sim.uncertainty(UNCERTAIN, inputs=n, executor=Pretended(values_of)) for n in (8, 3))
    assert found.complete and found.measures == ("speed",)
    check_shown(found)
    assert found.plot(measured=9.0).get_xlabel() == "speed"
    assert [tick.get_text() for tick in found.plot_shares().get_yticklabels()] == ["amplitude of drive 0 (µm)"]
    with pytest.raises(feeder_sim.InputError, match="speed has no shares that can be told"):
        few.plot_shares()


def test_speed_map(tmp_path: Path) -> None:
    scenario, how = feeder_sim.load_scenario("drift_4750hz"), dict[str, Any](seeds=2, executor=Pretended(of_map))
    asked: tuple[Any, ...] = ([4000.0, 5000.0], "1:2:2")
    found = feeder_sim.speed_map(scenario, *asked, out=tmp_path / "m", **how)
    assert found.complete and [point.frequency_hz for point in found.points] == [4000.0, 4000.0, 5000.0, 5000.0]
    check_shown(found)
    assert found.plot().get_xlabel() == "drive frequency (Hz)" and list(found.warnings) == []
    read = feeder_sim.open_study(tmp_path / "m")
    assert repr(read) == repr(found) and read.table() == found.table() and read.complete
    uncertain = scenario.changed({"uncertain": {FRICTION: {"uniform": [0.2, 0.4]}}})
    found = feeder_sim.speed_map(uncertain, *asked, **how)
    assert "contact.friction: uncertain inputs" in found.warnings[0].text and repr(found).endswith(", 1 warning>")


def test_stopped_is_not_complete() -> None:
    stop = threading.Event()
    stop.set()
    swept = feeder_sim.sweep(strip_scenario(), {AMPLITUDE: [1.0]}, executor=Pretended(values_of), stop=stop)
    assert not swept.complete and repr(swept).endswith("not complete>")
    with pytest.raises(feeder_sim.InputError, match="nothing to draw"):
        swept.plot()


def test_a_search_that_was_screened_is_another_question(tmp_path: Path) -> None:
    """By the content of the drift map, and by how many recipes it walks."""
    words: dict[str, Any] = {"over": (f"{AMPLITUDE}=0.5:5",), "minimise": "arrival_time_s", "seeds": 4}
    (tmp_path / "map.npz").write_bytes(b"a map")
    screened = OptimiseQuestion.of(**words, screen=tmp_path / "map.npz")
    before = screened.same
    assert before not in (OptimiseQuestion.of(**words).same, screened.model_copy(update={"recipes": 16}).same)
    (tmp_path / "map.npz").write_bytes(b"another")
    assert screened.same != before


def test_compare(tmp_path: Path) -> None:
    for name, amplitude in (("a", 1.0), ("b", 2.0)):
        feeder_sim.record_run(strip_scenario(seeds=2, amplitude_um=amplitude), tmp_path / name, replay=False)
    shares: list[float] = []
    found = feeder_sim.compare(tmp_path / "a", str(tmp_path / "b"), progress=shares.append)
    assert found.paired and AMPLITUDE in found.settings and shares[-1] == 1.0
    check_shown(found)
    assert list(found.to_frame().columns[:4]) == ["measure", "first", "second", "difference"]


DRIFT = strip_scenario()
REFUSED: list[tuple[Callable[[], Any], str]] = [
    (lambda: feeder_sim.sweep(DRIFT, ["a"]), r"vary: is \['a'\], must be a dictionary"),  # type: ignore[arg-type]
    (lambda: feeder_sim.sweep("x", {}), "scenario: is 'x', must be"),  # type: ignore[arg-type]
    (lambda: feeder_sim.sweep(DRIFT, {AMPLITUDE: [object()]}), "must be numbers, texts and tables"),
    (lambda: feeder_sim.sweep(DRIFT, {AMPLITUDE: [1]}, measure=3), "measure: is 3, must be"),  # type: ignore[arg-type]
    (lambda: feeder_sim.sweep(DRIFT, {AMPLITUDE: [1]}, until_se="3%"), "until_se: is '3%', must be"),  # type: ignore[arg-type]
    (lambda: feeder_sim.sweep(DRIFT, {AMPLITUDE: [1]}, until_se=2), "until_se: is 2, must be less than 1"),
    (lambda: feeder_sim.sweep(DRIFT, {AMPLITUDE: [1]}, until_se=0.1), "measure: is missing"),
    (lambda: feeder_sim.sweep(DRIFT, {AMPLITUDE: [1]}, zip=True, sobol=4), "zip, sobol: are both given"),
    (lambda: feeder_sim.sweep(DRIFT, {AMPLITUDE: [1, 1]}), r"vary drive\[0\]\.amplitude_um: "),
    (lambda: feeder_sim.sweep(DRIFT, {}), "vary: is missing"),
    (lambda: feeder_sim.sweep(DRIFT, {AMPLITUDE: [1]}, out=__file__), "out: is not a folder"),
    (lambda: feeder_sim.optimise(DRIFT, {AMPLITUDE: "1:2"}), "maximise, minimise: exactly one of them is needed"),
    (lambda: feeder_sim.optimise(DRIFT, {AMPLITUDE: "1:2:5"}, maximise="a"), r"over drive\[0\]\.amplitude_um: has a"),
    (lambda: feeder_sim.optimise(DRIFT, {AMPLITUDE: "1:2"}, maximise="a", sampler="x"), "sampler: is 'x', must be"),  # type: ignore[arg-type]
    (lambda: feeder_sim.optimise(DRIFT, {AMPLITUDE: "1:2"}, maximise="a", budget_s=0), "budget_s: is 0, must be"),
    (lambda: feeder_sim.uncertainty(DRIFT), r"\[uncertain\]: is missing"),
    (lambda: feeder_sim.uncertainty(UNCERTAIN, indices=True, inputs=6), "inputs: is 6, must be a power of two"),
    (lambda: feeder_sim.uncertainty(UNCERTAIN, indices=True, seeds=1), "seeds: is 1, must be 2 or more"),
    (lambda: feeder_sim.compare(3, 4), "first: is 3, must be a path"),  # type: ignore[arg-type]
    (lambda: feeder_sim.speed_map(DRIFT, [1.0], 3), "amplitudes_um: is 3, must be"),  # type: ignore[arg-type]
    (lambda: feeder_sim.speed_map(DRIFT, [-1.0], [1.0]), "frequencies_hz: is .* all above 0"),
]


@pytest.mark.parametrize(("call", "said"), REFUSED)
def test_what_is_not_allowed_is_one_line(call: Callable[[], Any], said: str) -> None:
    """Which names arguments, not the options of a command."""
    with pytest.raises(feeder_sim.InputError, match=f"^[^\n]*{said}[^\n]*$") as refused:
        call()
    assert "--" not in str(refused.value)


def test_a_long_table_is_cut() -> None:
    text = table("<a>", [{"n": i, "x": math.nan} for i in range(MOST_ROWS + 5)])
    assert text.count("<tr>") == MOST_ROWS + 1 and "5 more rows" in text and "<td>-</td>" in text
    assert "&lt;a&gt;" in text


STRIP = strip_scenario(seeds=3, amplitude_um=1.0)
KINDS: dict[str, tuple[Question, Scenario, Any]] = {
    "sweep": (over(f"{AMPLITUDE}=1:2:15"), STRIP, swept.values_of),
    "uncertainty": (UncertaintyQuestion.of(inputs=16), UNCERTAIN.changed({"run.seeds": 3}), swept.values_of),
    "optimise": (OptimiseQuestion.of(**speeds.SEARCH), STRIP, speeds.values_of),
    "map": (speeds.MAP, load_scenario(REPOSITORY / "scenarios/drift_4750hz.toml"), speeds.of_map),
}


def tables(folder: Path) -> dict[str, str]:
    return {file.name: file.read_text() for file in folder.glob("*.csv")}


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_done_is_kept(kind: str, tmp_path: Path) -> None:
    """Stopped again and again, in a search in the first generation, in a later one and at the check; then whole."""
    question, scenario, values_of = KINDS[kind]
    asked(question, scenario, Pretended(values_of), tmp_path / "whole")
    for after in (3, 15, 40, 150, 10_000):
        stop = threading.Event()
        asked(question, scenario, Pretended(values_of, stop, after), tmp_path / "broken", stop=stop)
        journal = tmp_path / "broken/journal.jsonl"
        lines = journal.read_bytes().splitlines(keepends=True)
        seeds = [i for i, line in enumerate(lines) if b'"seed"' in line]
        journal.write_bytes(b"".join(lines[: seeds[-1] + 1])[:-20])  # killed within the line of a seed
    last, none = (Pretended(values_of) for _ in range(2))
    assert asked(question, scenario, last, tmp_path / "broken").complete and last.count == 1
    assert asked(question, scenario, none, tmp_path / "broken").complete and none.count == 0
    assert tables(tmp_path / "broken") == tables(tmp_path / "whole") != {}


@pytest.mark.parametrize("kind", ["sweep", "uncertainty", "map"])
def test_tasks_of_a_job_array_merge_to_the_whole(kind: str, tmp_path: Path) -> None:
    question, scenario, values_of = KINDS[kind]
    for number in (1, 2, 3):
        asked(question, scenario, Pretended(values_of), tmp_path / "s", (number, 3))
    assert len(list((tmp_path / "s").glob("journal-*-of-3.jsonl"))) == 3 and not tables(tmp_path / "s")
    asked(question, scenario, Pretended(values_of), tmp_path / "whole")
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
    scenario, again = strip_scenario(seeds=4), swept.Pretended()
    first, more = over(f"{AMPLITUDE}=1,2"), over(f"{AMPLITUDE}=1,2", seeds=6)
    asked(first, scenario, swept.Pretended(), tmp_path / "s")
    found = asked(more, scenario, again, tmp_path / "s")
    assert sorted(again.seeds) == [(amplitude, seed) for amplitude in (1.0, 2.0) for seed in (4, 5)]
    assert [row.statistic.n for row in found.valued("speed")] == [6, 6]
    none = swept.Pretended()
    fewer = asked(first, scenario, none, tmp_path / "s")
    assert not none.seeds and [row.seeds for row in fewer.valued("speed")] == [6, 6]
    assert fewer.retained == 2 and fewer.complete
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
    asked(over(f"{AMPLITUDE}=1,2", seeds=2), scenario, swept.Pretended(), tmp_path / "here/s")
    (tmp_path / "here").rename(tmp_path / "there")
    (tmp_path / "there/modes.h5").unlink()
    found: Any = merged(tmp_path / "there/s")
    assert found.complete and found.foreign_seeds == 0 and len(found.valued("speed")) == 2
    assert "inputs/modes.h5" in (tmp_path / "there/s/scenario.toml").read_text()


def test_a_refused_question_leaves_nothing_that_was_not_there(tmp_path: Path) -> None:
    question, scenario = over(f"{AMPLITUDE}=1:2:5", measure="sped"), strip_scenario(seeds=3)

    def refused(path: Path, share: tuple[int, int] | None = None) -> None:
        with pytest.raises(InputError, match="is 'sped'"):
            asked(question, scenario, swept.Pretended(), path, share)

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
    asked(over(f"{AMPLITUDE}=1:2:5"), scenario, swept.Pretended(), tmp_path / "s")
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
