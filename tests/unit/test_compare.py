"""Two runs against each other: intervals of differences, settings, files and versions."""

from __future__ import annotations

import json
import math
import shutil
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from command_line import check_refused, feeder_sim

from feeder_sim.measures.statistic import Statistic
from feeder_sim.run.run_folder import record_run
from feeder_sim.scenario import Ball, Drive, MeshPart, RigidPlate, Run, Scenario, Slide, Start
from feeder_sim.studies.compare import difference


def ball(**changes: Any) -> Scenario:
    return Scenario(
        title="a ball",
        plate=RigidPlate(kind="piston"),
        drive=(Drive(frequency_hz=50.0, amplitude_um=230.0, ring_up=False),),
        part=(Ball(shape="ball", diameter_mm=3.0, guide=Slide(kind="slide"), start=Start(drop_height_mm=(1.4, 2.0))),),
        run=Run(seeds=3, duration_s=1.0),
    ).changed(changes)


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same twice; other settings with the same seeds; other seeds."""
    folder = tmp_path_factory.mktemp("runs")
    for name, changes in {
        "a": dict[str, Any](),
        "same": {},
        "louder": {"drive[0].amplitude_um": 240.0, "title": "a louder ball"},
        "reseeded": {"run.seed": 7, "run.seeds": 4},
    }.items():
        record_run(ball(**changes), folder / name, replay=False)
    return folder


def compared(*arguments: object) -> dict[str, Any]:
    done = feeder_sim("compare", *arguments, "--json")
    assert done.returncode == 0, done.stderr
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def test_welch_interval_is_that_of_scipy() -> None:
    from scipy.stats import ttest_ind

    first, second = [1.0, 2.5, 2.0, 1.5, math.nan], [3.0, 9.0, 5.0]
    found = difference("speed", first, second, paired=False)
    wanted = ttest_ind(second, first[:4], equal_var=False).confidence_interval(0.95)
    assert (found.low, found.high) == pytest.approx((wanted.low, wanted.high), rel=1e-12)
    assert found.difference == pytest.approx(np.mean(second) - np.mean(first[:4])) and found.pairs is None
    assert (found.first, found.second) == (Statistic.of(first), Statistic.of(second))


def test_paired_interval_is_that_of_scipy_over_seeds_with_both_values() -> None:
    from scipy.stats import ttest_rel

    first, second = [1.0, 2.5, 2.0, 1.5, math.nan], [2.0, 3.0, math.nan, 3.0, 1.0]
    found = difference("speed", first, second, paired=True)
    both = [0, 1, 3]
    wanted = ttest_rel([second[i] for i in both], [first[i] for i in both]).confidence_interval(0.95)
    assert (found.low, found.high) == pytest.approx((wanted.low, wanted.high), rel=1e-12)
    assert found.pairs == 3 and found.difference == pytest.approx((1.0 + 0.5 + 1.5) / 3)
    assert (found.first.n, found.second.n) == (4, 4)


@pytest.mark.parametrize("paired", [True, False])
def test_too_few_seeds_have_a_difference_without_an_interval(paired: bool) -> None:
    one = difference("speed", [1.0], [2.0], paired=paired)
    assert one.difference == 1.0 and math.isnan(one.low) and math.isnan(one.high)
    none = difference("speed", [math.nan, math.nan], [2.0, 3.0], paired=paired)
    assert math.isnan(none.difference) and math.isnan(none.low)


@pytest.mark.parametrize("paired", [True, False])
def test_values_that_do_not_vary_have_an_interval_of_no_width(paired: bool) -> None:
    found = difference("picked", [4.0, 4.0], [5.0, 5.0], paired=paired)
    assert (found.low, found.difference, found.high) == (1.0, 1.0, 1.0)


def test_a_run_does_not_differ_from_its_repetition(runs: Path) -> None:
    found = compared(runs / "a", runs / "same/scene.h5")
    assert found["method"] == "paired by seed" and found["measures"]
    assert all((m["difference"], m["low"], m["high"], m["pairs"]) == (0.0, 0.0, 0.0, 3) for m in found["measures"])
    assert found["settings"] == {} == found["versions"] and found["only_first"] == [] == found["only_second"]
    said = feeder_sim("compare", runs / "a", runs / "same").stdout
    assert "no settings differ" in said and "no versions differ" in said and "paired by seed" in said


def test_runs_of_the_same_seeds_are_paired_and_their_settings_named(runs: Path) -> None:
    found = compared(runs / "a", runs / "louder")
    assert found["method"] == "paired by seed"
    assert found["settings"] == {"title": ["a ball", "a louder ball"], "drive[0].amplitude_um": [230.0, 240.0]}
    summaries = [json.loads((runs / name / "summary.json").read_text()) for name in ("a", "louder")]
    by_name = {measure["name"]: measure for measure in found["measures"]}
    for number, side in enumerate(("first", "second")):
        assert by_name["highest_rise_mm"][side] == pytest.approx(summaries[number]["highest_rise_mm"])
    rise = by_name["highest_rise_mm"]
    assert rise["low"] < rise["difference"] < rise["high"]
    said = feeder_sim("compare", runs / "a", runs / "louder").stdout
    assert "drive[0].amplitude_um: 230.0 | 240.0" in said


def test_runs_of_other_seeds_are_compared_by_welch(runs: Path) -> None:
    found = compared(runs / "a", runs / "reseeded")
    assert found["method"] == "Welch" and all(measure["pairs"] is None for measure in found["measures"])
    assert found["settings"] == {"run.seed": [0, 7], "run.seeds": [3, 4]}
    assert "Welch" in feeder_sim("compare", runs / "a", runs / "reseeded").stdout


def test_measures_that_one_run_has_are_named(runs: Path, tmp_path: Path) -> None:
    record_run(ball(**{"run.duration_s": 0.02}), tmp_path / "falls", replay=False)  # and does not bounce
    found = compared(runs / "a", tmp_path / "falls")
    assert "impact_speed_mm_s" in found["only_first"] and found["only_second"] == []
    assert "only the first run has: " in feeder_sim("compare", runs / "a", tmp_path / "falls").stdout


def test_files_are_compared_by_content_and_versions_by_name(tmp_path: Path) -> None:
    import trimesh

    for name, height in (("low.stl", 3.0), ("copy.stl", 3.0), ("high.stl", 4.0)):
        trimesh.creation.box((2.0, 2.0, height)).export(tmp_path / name)
        part = MeshPart(shape="mesh", file=tmp_path / name, guide=Slide(kind="slide"))
        scenario = ball().model_copy(update={"part": (part,)}).changed({"run.duration_s": 0.1, "run.seeds": 1})
        record_run(scenario, tmp_path / Path(name).stem, replay=False)
    assert compared(tmp_path / "low", tmp_path / "copy")["settings"] == {}
    ((key, values),) = compared(tmp_path / "low", tmp_path / "high")["settings"].items()
    assert key == "part[0].file" and values[0].startswith("low.stl (") and values[1].startswith("high.stl (")
    with h5py.File(tmp_path / "copy/scene.h5", "r+") as file:
        held = json.loads(file.attrs["libraries"])
        file.attrs["libraries"] = np.bytes_(json.dumps(held | {"numpy": "1.0"}))
    found = compared(tmp_path / "low", tmp_path / "copy")
    assert found["versions"] == {"numpy": [held["numpy"], "1.0"]}
    (tmp_path / "copy/inputs/copy.stl").write_bytes((tmp_path / "high.stl").read_bytes())
    check_refused(feeder_sim("compare", tmp_path / "low", tmp_path / "copy"), "another content of part[0].file")


def test_what_is_no_run_is_refused_in_one_line(runs: Path, tmp_path: Path) -> None:
    check_refused(feeder_sim("compare", runs / "a", tmp_path), "no run here, must be a folder that holds")
    shutil.copytree(runs / "a", tmp_path / "cut")
    content = (runs / "a/seeds/000.h5").read_bytes()
    (tmp_path / "cut/seeds/000.h5").write_bytes(content[: len(content) // 4])
    check_refused(feeder_sim("compare", tmp_path / "cut", runs / "a"), "not a readable recording")
