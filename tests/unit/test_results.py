"""Results as users of Python hold them: typed findings, tables, plots, reprs, and runs opened again."""

from __future__ import annotations

import builtins
import inspect
import json
import pydoc
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, get_type_hints

import matplotlib
import numpy as np
import pytest
from conftest import StopsAfter, refusal, strip_scenario
from test_keep import bouncing, picking

import feeder_sim
from feeder_sim.api.opened import OpenedRun
from feeder_sim.api.progress import displayed
from feeder_sim.errors import InputError
from feeder_sim.measures import catalogue
from feeder_sim.measures.protocol import FindingsBase
from feeder_sim.pool.work import Work
from feeder_sim.run.recorded_run import RecordedRun
from feeder_sim.run.run_folder import SUMMARY, scenario_toml
from feeder_sim.scenario import HexNut, ModePlate, Scenario, Start


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("runs") / "drift"
    feeder_sim.record_run(strip_scenario(seeds=2, duration_s=0.3), folder, replay=False)
    return folder


@pytest.fixture(autouse=True)
def no_window() -> Iterator[None]:
    from matplotlib import pyplot

    pyplot.switch_backend("Agg")
    yield
    pyplot.close("all")


def test_opened_run_is_the_result_it_was(run: Path) -> None:
    computed = feeder_sim.simulate(strip_scenario(seeds=2, duration_s=0.3))
    exported = run.parent / "trajectory.h5"
    feeder_sim.open(run).to_hdf5(exported)
    for given in (run, str(run), run / "scene.h5", str(exported)):
        opened = feeder_sim.open(given)
        assert isinstance(opened, feeder_sim.Result) and "prepared" not in vars(opened)  # which may take long
        assert opened.measures() == computed.measures() and opened.lines() == computed.lines()
        assert opened.drift == computed.drift and opened.scenario == computed.scenario
        assert not opened.interrupted and opened.part_names == computed.part_names == ("part_0",)
    stored = json.loads((run / SUMMARY).read_text())
    opened = feeder_sim.open(run)
    assert opened.summary().keys() == stored.keys() - {"version", "libraries"}
    assert opened.stored_summary == stored
    line = refusal(feeder_sim.open, run.parent)
    assert line.endswith("no run here, must be a folder that holds scene.h5")


@pytest.mark.parametrize(
    ("file", "kind"), [("sweep", "sweep"), ("search", "optimise"), ("uncertainty", "uncertainty"), ("map", "map")]
)
def test_the_folder_of_a_question_says_what_reads_it(file: str, kind: str, tmp_path: Path) -> None:
    (tmp_path / f"{file}.toml").touch()
    line = refusal(feeder_sim.open, tmp_path)
    assert f": is the folder of {kind}, which keeps no run: " in line
    assert line.endswith("feeder_sim.open_study reads it, `feeder-sim report` shows it")


def test_interrupted_run_opens(tmp_path: Path) -> None:
    begun = feeder_sim.record_run(strip_scenario(seeds=6, duration_s=20.0), tmp_path, stop=StopsAfter(2), replay=False)
    opened = feeder_sim.open(tmp_path)
    assert begun.interrupted and opened.interrupted
    assert len(opened.seeds) == len(begun.seeds) < 6
    assert [seed.status for seed in opened.seeds] == [seed.status for seed in begun.seeds]
    assert opened.measures() == begun.measures()


def test_run_whose_input_is_gone_gives_frames_and_the_stored_summary(run: Path) -> None:
    recording = feeder_sim.open(run).recording
    plate = ModePlate(kind="modes", mode_file=run / "gone.h5")
    text = scenario_toml(strip_scenario(seeds=2).model_copy(update={"plate": plate}))
    gone = OpenedRun(RecordedRun(replace(recording, scenario_text=text, inputs={"plate.mode_file": 64 * "0"})))
    changed = OpenedRun(RecordedRun(replace(recording, inputs={"plate.mode_file": 64 * "0"})))
    text = recording.scenario_text.replace("thickness_mm = 3.0", "thickness_mm = -3.0")
    refused = OpenedRun(RecordedRun(replace(recording, scenario_text=text)))
    for ask in (refused.measures, refused.lines, lambda: refused.scenario):
        assert "scenario.toml: plate.thickness_mm: is -3.0" in refusal(ask)
    assert refused.summary() == refused.stored_summary and "2 done" in repr(refused)
    assert refused.to_xarray().kind.values.tolist() == ["hex_nut"] and "plate.thickness_mm" in refused._repr_html_()
    for opened, said in ((gone, r"gone\.h5: cannot be read"), (changed, "plate.mode_file: has another content than")):
        line = rf"{said}.*so that only frames, impacts and the stored summary can be had$"
        for ask in (opened.measures, lambda opened=opened: opened.drift, opened.lines, lambda o=opened: o.scene):
            with pytest.raises(InputError, match=line):
                ask()
        assert opened.summary()["drift_velocity_x_mm_s"]["n"] == 2
        assert len(opened.trajectories[1]) > 100 and opened.plot.path() is not None
        assert opened.to_xarray().sizes["seed"] == 2 and len(opened.to_frame("frames")) > 200
        assert repr(opened).startswith("<Result") and "stored summary can be had" in opened._repr_html_()


def test_findings_have_types_and_those_that_do_not_apply_say_so() -> None:
    result = feeder_sim.simulate(picking())
    assert result.separation.picked.mean == 1.0 and result.rate.picks_per_minute.n == 2
    assert result.measures()["picked"] == result.separation.picked.as_dict()
    assert result.poses.pose_kinds[0].kind == "hex_nut"
    for name in ("drift", "bounces", "refills", "arrivals", "circulation"):
        line = f"{name}: is not measured of this scenario, measured are separation, poses, rate"
        assert refusal(getattr, result, name) == line
        assert not hasattr(result, name)
    assert {"rate", "poses"} <= {name for name, _ in inspect.getmembers(result)}
    assert feeder_sim.simulate(bouncing()).bounces.bounce_interval_ms.n > 2


def test_reprs_are_short(run: Path) -> None:
    opened = feeder_sim.open(run)
    scenario = opened.scenario
    prepared = feeder_sim.prepare(scenario)
    (ensemble,) = feeder_sim.measure_drift([strip_scenario()])
    seed = opened.seeds[0]
    values = (opened, opened.recording, scenario, prepared, prepared.scene, ensemble, seed, seed.frames, opened.plate)
    for value in (*values, *opened.recording.parts, opened.recording.records[0], opened.plot):
        assert 10 < len(repr(value)) < 200 and "\n" not in repr(value)
    for value in (opened, opened.recording, scenario, prepared, ensemble, seed.frames):
        html: str = value._repr_html_()
        assert html.startswith("<b>") and html.endswith("</pre>") and 50 < len(html) < 3000
    assert "mean drift" in opened._repr_html_()
    assert "[[part]]\nshape = &quot;hex_nut&quot;\nsize = &quot;M2.5&quot;" in scenario._repr_html_()
    assert repr(scenario) == "<Scenario: strip plate, 4750 Hz, 1 hex_nut, 0.3 s, 2 seeds>"
    uncertain = scenario.changed({"uncertain": {"contact.friction": {"uniform": [0.2, 0.4]}}})
    assert "[uncertain.&quot;contact.friction&quot;]\nuniform = [0.2, 0.4]" in uncertain._repr_html_()
    (of_uncertain,) = feeder_sim.measure_drift([uncertain])
    for value in (of_uncertain, feeder_sim.simulate(uncertain)):
        (warning,) = (line for line in value.warnings if "contact.friction: uncertain inputs" in line)
        assert f"warning: {warning}" in value._repr_html_()
    assert "&lt;i&gt;" in scenario.changed({"title": "<i>"})._repr_html_()


def test_findings_of_many_stages_are_a_line_and_tables() -> None:
    many = {"part[0].count": 8, "part[0].start": {"kind": "scattered"}}
    cycles = picking().changed(many | {"schedule.cycles": 12, "stage[0].duration_s": 0.02})
    result = feeder_sim.simulate(cycles, record=feeder_sim.StatisticsOnly())
    found = (result.separation, result.poses, result.rate)
    for findings in (*found, result.separation.stages[0], result.poses.pose_kinds[0].stages[-1]):
        assert 20 < len(repr(findings)) < 200 and "\n" not in repr(findings) and "Statistic(" not in repr(findings)
        assert 100 < len(findings._repr_html_()) < 10_000
    assert repr(result.separation) == "<SeparationFindings: parts 8, picked 8 +- 0, lost 0 +- 0, 12 stages>"
    assert len(repr(result.findings)) < 1000 and repr(result.findings).startswith("((Separation(), <Sep")
    shown = result.separation._repr_html_()
    assert "<th>mean</th><th>sd</th><th>se</th><th>n</th>" in shown and "<b>stages</b><table>" in shown
    assert shown.count("<tr>") == (1 + 2) + (1 + 12) and "<th>touching_pairs</th>" in shown
    assert "<b>pose_kinds[0].stages</b>" in result.poses._repr_html_()
    assert "<td>time_shares.driving</td>" in result.rate._repr_html_()


def test_every_measure_has_findings_with_a_short_repr() -> None:
    for name in ("drift", "bounces", "separation", "poses", "refills", "rate", "arrivals", "circulation"):
        findings = get_type_hints(getattr(feeder_sim.Result, name).fget, vars(catalogue))["return"]
        assert issubclass(findings, FindingsBase) and findings.__repr__ is FindingsBase.__repr__, name


def test_repr_of_a_table_makes_it_again() -> None:
    nut = HexNut(size="M3", start=Start(position_mm=(1.0, 2.0)), count=1)
    assert repr(nut) == "HexNut(start=Start(position_mm=(1.0, 2.0)), size='M3')"
    assert eval(repr(nut)) == nut


def test_frames_in_xarray(run: Path) -> None:
    opened = feeder_sim.open(run)
    first, second = opened.seeds
    short = feeder_sim.Result(opened.prepared, (replace(first, frames=first.frames[slice(10)]), second), 0.0)
    second.frames.present[-1] = False
    data = short.to_xarray()
    second.frames.present[-1] = True
    n = len(second.frames)
    assert data.sizes == {"seed": 2, "time": n, "part": 1, "axis": 3, "component": 4}
    assert data.position.attrs["units"] == "m" and data.time.attrs["units"] == "s"
    assert data.velocity.attrs["units"] == "m/s" and data.angular_velocity.attrs["units"] == "rad/s"
    assert np.array_equal(data.time, second.frames.time)
    assert np.array_equal(data.position.sel(seed=0)[:10], first.frames.position[:10])
    assert np.isnan(data.position.sel(seed=0)[10:]).all() and not data.present.sel(seed=0)[10:].any()
    assert np.array_equal(data.quaternion.sel(seed=1)[:-1], second.frames.quaternion[:-1])
    assert np.isnan(data.velocity.sel(seed=1)[-1]).all() and not data.present.sel(seed=1)[-1].any()
    assert float(data.position.sel(part="part_0", axis="z").mean()) > 0.0
    assert data.kind.values.tolist() == ["hex_nut"] and data.status.values.tolist() == ["done", "done"]


def test_tables(run: Path) -> None:
    opened = feeder_sim.open(run)
    measures = opened.to_frame()
    assert list(measures.columns) == ["seed", "status", "measure", "value"]
    x = measures[measures.measure == "drift_velocity_x_mm_s"].value
    assert len(x) == 2 and float(x.mean()) == pytest.approx(opened.drift.drift_velocity_x_mm_s.mean, rel=1e-12)
    frames = opened.to_frame("frames")
    row = frames[(frames.seed == 1)].iloc[7]
    assert row.z_m == opened.trajectories[1].position[7, 0, 2] and row.qw == opened.trajectories[1].quaternion[7, 0, 0]
    assert row.time_s == opened.trajectories[1].time[7] and (row.part, row.kind) == ("part_0", "hex_nut")
    allowed = "of: is 'all', must be measures, frames, impacts, picks, removals"
    assert refusal(opened.to_frame, "all") == allowed
    assert refusal(opened.to_frame, "picks").startswith("picks: are of a schedule with a pick")
    picked = feeder_sim.simulate(picking())
    assert picked.to_frame("picks").seed.tolist() == [0, 1]
    assert picked.to_frame("removals").cause.tolist() == ["picked", "picked"]
    bounced = feeder_sim.simulate(bouncing())
    impacts = bounced.to_frame("impacts")
    assert len(impacts) == sum(len(seed.impacts) for seed in bounced.seeds)
    last = impacts[impacts.seed == 1].iloc[-1]
    assert last.approach_speed_m_s == bounced.seeds[1].impacts.approach_speed[-1]


@pytest.mark.parametrize(("name", "call"), [("pandas", "to_frame"), ("xarray", "to_xarray")])
def test_missing_library_is_one_line(run: Path, monkeypatch: pytest.MonkeyPatch, name: str, call: str) -> None:
    monkeypatch.setitem(__import__("sys").modules, name, None)
    line = refusal(getattr(feeder_sim.open(run), call))
    assert line == f"{name}: needs the extra `data`: pip install 'feeder_sim[data]'"


def points(line: Any) -> np.ndarray:
    """The points (n, 2) of a drawn line."""
    return np.asarray(line.get_xydata())


def test_plots_draw_what_the_result_holds(run: Path) -> None:
    opened = feeder_sim.open(run)
    drawn = opened.plot.path()
    ends = [points(line)[-1] for line in drawn.lines]
    for frames in opened.trajectories:
        assert any(np.allclose(end, 1e3 * frames.position[-1, 0, :2]) for end in ends)
    one = opened.plot.path(1, ax=matplotlib.figure.Figure().add_subplot())
    assert len(one.lines) == len(drawn.lines) - 3  # a path with its two ends
    ways = [points(line) for line in opened.plot.drift().lines if len(points(line)) > 2]
    cell = opened.prepared.cell
    assert cell is not None
    assert [way[-1, 1] for way in ways[:2]] == [cell.distance_to_node(frames)[-1] for frames in opened.trajectories]
    assert [line.get_label() for line in opened.plot.drift().lines][-1] == "mean of 2 seeds"
    assert refusal(opened.plot.path, 2) == "seed: is 2, must be 0 to 1"
    assert refusal(opened.plot.separation).startswith("separation: is not measured")


def test_plots_of_stages_and_bounces() -> None:
    picked, bounced = feeder_sim.simulate(picking()), feeder_sim.simulate(bouncing())
    drawn: list[Any] = picked.plot.separation().containers
    assert [container.get_label() for container in drawn] == ["on the plate", "on nodal lines", "isolated"]
    assert drawn[0].lines[0].get_ydata().tolist() == [1.0]
    bars: list[Any] = [*bounced.plot.bounces().patches]
    assert sum(bar.get_height() for bar in bars) == bounced.bounces.bounce_interval_ms.n
    assert refusal(picked.plot.drift).startswith("drift: has no transport to draw")


def test_progress_shows_a_bar(capsys: pytest.CaptureFixture[str]) -> None:
    feeder_sim.simulate(strip_scenario().changed({"title": "a nut"}), progress=True)
    written = capsys.readouterr()
    last = written.err.rstrip("\n").split("\r")[-1]
    assert written.out == "" and last.startswith(f"a nut {24 * '#'} 100 %, ") and last.rstrip().endswith(" s")
    seen: list[float] = []
    feeder_sim.simulate(strip_scenario(), progress=seen.append)
    assert seen[-1] == 1.0
    with displayed(Work(), False, "") as work:
        work.progress(0.5)
        work.notify("a line")
    assert capsys.readouterr().err == ""


def test_every_public_name_is_listed_and_has_a_docstring() -> None:
    names = [name for name in dir(feeder_sim) if not name.startswith("_")]
    assert {"Scenario", "open", "simulate", "record_run", "measure_drift", "StatisticsOnly", "scenario"} <= {*names}
    for name in names:
        assert pydoc.getdoc(getattr(feeder_sim, name)), name
    held: dict[str, Any] = {}
    exec("from feeder_sim import *", held)
    assert held["simulate"] is feeder_sim.simulate and held.get("open", builtins.open) is builtins.open
    assert issubclass(feeder_sim.Scenario, Scenario)
