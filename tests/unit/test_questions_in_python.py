"""Questions as functions: a scenario in, a result out that shows itself shortly; folders as those of the commands."""

from __future__ import annotations

import math
import tempfile
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import tomli_w
from conftest import strip_scenario
from pretended import Pretended
from speeds import AMPLITUDE, FRICTION, of_map, values_of

import feeder_sim
from feeder_sim.notebook import MOST_ROWS, table
from feeder_sim.studies.search.optimise import OptimiseQuestion
from feeder_sim.studies.study import Answer

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
    with pytest.raises(feeder_sim.InputError, match="is sped"):
        swept.plot("sped")
    vary: dict[str, Any] = {AMPLITUDE: [1.0, 2.0], FRICTION: [0.1, 0.2]}
    zipped = feeder_sim.sweep(strip_scenario(), vary, zip=True, executor=Pretended(values_of))
    assert [row.point[FRICTION] for row in zipped.rows] == [0.1, 0.2]
    crossed = feeder_sim.sweep(strip_scenario(), vary, executor=Pretended(values_of))
    assert len(crossed.rows) == 4 and len(crossed.plot()[0].containers) == 2  # a curve for each friction
    drawn = feeder_sim.sweep(strip_scenario(), {AMPLITUDE: "0.5:2"}, sobol=8, executor=Pretended(values_of))
    assert len(drawn.rows) == 8


def test_optimise(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without a folder nothing is left of it; with one the same call goes on."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    over = {AMPLITUDE: "0.5:5", FRICTION: [0.1, 0.2, 0.3]}
    how: dict[str, Any] = {"maximise": "speed", "trials": 16, "seeds": 2, "check_seeds": 4}
    found = feeder_sim.optimise(strip_scenario(), over, **how, executor=Pretended(values_of))
    assert found.complete and len(found.trials) == 16 and not list(tmp_path.iterdir())
    check_shown(found)
    assert "as it is" in found._repr_html_() and found.plot().get_ylabel() == "speed"
    assert found.best is not None and found.best.point is not None
    assert found.best_scenario.contact.friction == found.best.point[FRICTION]
    feeder_sim.optimise(strip_scenario(), over, **how, executor=Pretended(values_of), out=tmp_path / "s")
    assert (tmp_path / "s/best.toml").is_file()
    read: Any = feeder_sim.open_study(tmp_path / "s")
    assert read.aim == found.aim and read.question.over == (f"{AMPLITUDE}=0.5:5", f"{FRICTION}=[0.1, 0.2, 0.3]")
    assert read.best == found.best and read.complete


def test_a_search_that_was_screened_is_another_question(tmp_path: Path) -> None:
    """By the content of the drift map, and by how many recipes it walks; folders of before can be read."""
    words: dict[str, Any] = {"over": (f"{AMPLITUDE}=0.5:5",), "minimise": "arrival_time_s", "seeds": 4}
    (tmp_path / "map.npz").write_bytes(b"a map")
    alone, screened = (OptimiseQuestion.of(**words, screen=screen) for screen in (None, tmp_path / "map.npz"))
    assert "screen='', recipes=0" in alone.same and "recipes=256" in screened.same
    (tmp_path / "map.npz").write_bytes(b"another")
    assert screened.same != OptimiseQuestion.of(**words, screen=tmp_path / "map.npz", recipes=16).same
    before = {"over": list(words["over"]), "measure": "arrival_time_s", "maximise": False, "seeds": 4, "sampler": "tpe"}
    (tmp_path / "search.toml").write_text(tomli_w.dumps(before | {"screen": 64 * "a", "recipes": 256}))
    assert OptimiseQuestion.read(tmp_path).minimise == "arrival_time_s"


def test_uncertainty(tmp_path: Path) -> None:
    scenario = strip_scenario().changed({"uncertain": {AMPLITUDE: {"uniform": [1.0, 4.0]}}})
    executor = Pretended(values_of)
    for out in (None, tmp_path / "u", str(tmp_path / "u")):
        found = feeder_sim.uncertainty(scenario, inputs=8, executor=executor, out=out)
        assert found.complete and found.measures == ("speed",)
    assert executor.count == 2 * 16  # the third call found all of it in the folder
    check_shown(found)
    assert found.plot(measured=9.0).get_xlabel() == "speed"
    assert [tick.get_text() for tick in found.plot_shares().get_yticklabels()] == ["drive[0].amplitude (um)"]
    few = feeder_sim.uncertainty(scenario, inputs=3, executor=executor)
    with pytest.raises(feeder_sim.InputError, match="speed has no shares that can be told"):
        few.plot_shares()


def test_compare(tmp_path: Path) -> None:
    for name, amplitude in (("a", 1.0), ("b", 2.0)):
        feeder_sim.record_run(strip_scenario(seeds=2, amplitude_um=amplitude), tmp_path / name, replay=False)
    shares: list[float] = []
    found = feeder_sim.compare(tmp_path / "a", str(tmp_path / "b"), progress=shares.append)
    assert found.paired and AMPLITUDE in found.settings and shares[-1] == 1.0
    check_shown(found)
    assert list(found.to_frame().columns[:4]) == ["measure", "first", "second", "difference"]


def test_speed_map(tmp_path: Path) -> None:
    scenario, executor = feeder_sim.load_scenario("drift_4750hz"), Pretended(of_map)
    how: dict[str, Any] = {"seeds": 2, "executor": executor}
    for out in (None, tmp_path / "m", tmp_path / "m"):
        found = feeder_sim.speed_map(scenario, [4000.0, 5000.0], "1:2:2", out=out, **how)
        assert found.complete and [point.frequency_hz for point in found.points] == [4000.0, 4000.0, 5000.0, 5000.0]
    assert executor.count == 2 * 4 * 2
    check_shown(found)
    assert found.plot().get_xlabel() == "drive frequency (Hz)"
    assert (tmp_path / "m/map.csv").read_text().count("\n") == 5
    read = feeder_sim.open_study(tmp_path / "m")
    assert repr(read) == repr(found) and read.table() == found.table() and read.complete
    assert list(found.cautions) == []
    uncertain = scenario.changed({"uncertain": {"contact.friction": {"uniform": [0.2, 0.4]}}})
    found = feeder_sim.speed_map(uncertain, [4000.0, 5000.0], "1:2:2", **how)
    assert "contact.friction: uncertain inputs, which have the values of the scenario here" in found.cautions[0].text
    assert repr(found).endswith(", 1 caution>")


def test_stopped_is_not_complete() -> None:
    stop = threading.Event()
    stop.set()
    swept = feeder_sim.sweep(strip_scenario(), {AMPLITUDE: [1.0]}, executor=Pretended(values_of), stop=stop)
    assert not swept.complete and repr(swept).endswith("not complete>")
    with pytest.raises(feeder_sim.InputError, match="nothing to draw"):
        swept.plot()


DRIFT = strip_scenario()
UNCERTAIN = DRIFT.changed({"uncertain": {FRICTION: {"uniform": [0.2, 0.4]}}})
REFUSED: list[tuple[Callable[[], Any], str]] = [
    (lambda: feeder_sim.sweep(DRIFT, ["a"]), r"vary: is \['a'\], allowed is a dictionary"),  # type: ignore[arg-type]
    (lambda: feeder_sim.sweep("x", {}), "scenario: is 'x', allowed"),  # type: ignore[arg-type]
    (lambda: feeder_sim.sweep(DRIFT, {AMPLITUDE: [object()]}), "allowed are numbers, texts and tables"),
    (lambda: feeder_sim.sweep(DRIFT, {AMPLITUDE: [1]}, measure=3), "measure: is 3, allowed"),  # type: ignore[arg-type]
    (lambda: feeder_sim.sweep(DRIFT, {AMPLITUDE: [1]}, until_se="3%"), "until_se: is '3%', allowed"),  # type: ignore[arg-type]
    (lambda: feeder_sim.sweep(DRIFT, {AMPLITUDE: [1]}, until_se=2), "until_se: is 2, allowed is less than 1"),
    (lambda: feeder_sim.sweep(DRIFT, {AMPLITUDE: [1]}, until_se=0.1), "measure: is missing"),
    (lambda: feeder_sim.sweep(DRIFT, {AMPLITUDE: [1]}, zip=True, sobol=4), "zip, sobol: are both given"),
    (lambda: feeder_sim.sweep(DRIFT, {AMPLITUDE: [1, 1]}), r"vary drive\[0\]\.amplitude_um: "),
    (lambda: feeder_sim.sweep(DRIFT, {}), "vary: is missing"),
    (lambda: feeder_sim.sweep(DRIFT, {AMPLITUDE: [1]}, out=__file__), "out: is not a folder"),
    (lambda: feeder_sim.optimise(DRIFT, {AMPLITUDE: "1:2"}), "maximise, minimise: exactly one of them is needed"),
    (lambda: feeder_sim.optimise(DRIFT, {AMPLITUDE: "1:2:5"}, maximise="a"), r"over drive\[0\]\.amplitude_um: has a"),
    (lambda: feeder_sim.optimise(DRIFT, {AMPLITUDE: "1:2"}, maximise="a", sampler="x"), "sampler: is 'x', allowed"),  # type: ignore[arg-type]
    (lambda: feeder_sim.optimise(DRIFT, {AMPLITUDE: "1:2"}, maximise="a", budget_s=0), "budget_s: is 0, allowed"),
    (lambda: feeder_sim.uncertainty(DRIFT), r"\[uncertain\]: is missing"),
    (lambda: feeder_sim.uncertainty(UNCERTAIN, indices=True, inputs=6), "inputs: is 6, allowed is a power of two"),
    (lambda: feeder_sim.uncertainty(UNCERTAIN, indices=True, seeds=1), "seeds: is 1, allowed is 2 or more"),
    (lambda: feeder_sim.compare(3, 4), "first: is 3, allowed is a path"),  # type: ignore[arg-type]
    (lambda: feeder_sim.speed_map(DRIFT, [1.0], 3), "amplitudes_um: is 3, allowed"),  # type: ignore[arg-type]
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
