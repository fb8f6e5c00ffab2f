from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
import typer
from command_line import check_refused, feeder_sim, in_new_process, said
from conftest import NUT_ON_STRIP, REPOSITORY, toml_of
from typer.testing import CliRunner

import feeder_sim as package
from feeder_sim.cli.main import app
from feeder_sim.cli.report import print_result
from feeder_sim.errors import Interrupted
from feeder_sim.run import plan
from feeder_sim.run.prepare import prepare
from feeder_sim.run.run_folder import scenario_toml
from feeder_sim.run.simulation import Result
from feeder_sim.scenario import load_scenario

MODE_FILE = REPOSITORY / "models/plate_180/modes.h5"
BOUNCING = REPOSITORY / "scenarios/ball_50hz.toml"
LATE = ("numba", "mujoco", "rerun", "trimesh", "scipy", "h5py", "matplotlib", "networkx", "optuna", "viser")
SHORT = NUT_ON_STRIP | {"title": "short", "run": {"duration_s": 0.1, "seeds": 2}}


@pytest.fixture
def scenario(tmp_path: Path) -> Path:
    path = tmp_path / "short.toml"
    path.write_text(toml_of(SHORT))
    return path


def test_run_prints_one_json_object_and_fills_the_folder(scenario: Path, tmp_path: Path) -> None:
    done = in_new_process("run", scenario, "--json", "--out", tmp_path / "run")
    assert done.returncode == 0, done.stderr
    assert said(done) == []
    summary = json.loads(done.stdout)
    assert set(summary["transport_speed_mm_s"]) == {"mean", "sd", "se", "n"}
    assert summary["engine"] == "impulse"
    assert summary["simulated_s"] == pytest.approx(0.2, rel=0.03)
    assert summary["real_time_factor"] == pytest.approx(summary["simulated_s"] / summary["wall_s"])
    files = {".lock", "run.json", "scene.h5", "seeds", "summary.json", "scenario.toml", "scene.xml"}
    assert {p.name for p in (tmp_path / "run").iterdir()} == files


def test_resolved_scenario_runs_again_to_the_same_bits(scenario: Path, tmp_path: Path) -> None:
    assert feeder_sim("run", scenario, "--seed", 5, "--out", tmp_path / "a").returncode == 0
    assert feeder_sim("run", tmp_path / "a/scenario.toml", "--out", tmp_path / "b").returncode == 0
    first, second = (package.read_recording(tmp_path / name).seeds[1] for name in "ab")
    assert first.position.tobytes() == second.position.tobytes()


def test_run_without_a_folder_takes_the_next_free_one(scenario: Path, tmp_path: Path) -> None:
    for _ in range(2):
        assert feeder_sim("run", scenario, "--seeds", 1, cwd=tmp_path).returncode == 0
    assert sorted(p.name for p in (tmp_path / "runs").iterdir()) == ["short-001", "short-002"]


def test_folder_that_holds_a_run_is_left_alone(scenario: Path, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    feeder_sim("run", scenario, "--out", folder)
    before = {p: p.stat().st_mtime_ns for p in folder.iterdir()}
    check_refused(feeder_sim("run", scenario, "--out", folder), f"{folder}: --out: already holds a run")
    assert {p: p.stat().st_mtime_ns for p in folder.iterdir()} == before


def test_dry_run_and_check_describe_and_write_nothing(scenario: Path, tmp_path: Path) -> None:
    dry = feeder_sim("run", scenario, "--dry-run", "--json", cwd=tmp_path)
    checked = feeder_sim("check", scenario, "--json", cwd=tmp_path)
    plan = json.loads(checked.stdout)
    assert json.loads(dry.stdout).keys() == plan.keys()
    assert plan["steps_per_seed"] == pytest.approx(0.1 * 4750 * 40, rel=0.03)
    assert plan["parts"][0]["mass_g"] == pytest.approx(0.263, rel=2e-3)
    assert plan["parts"][0]["name"] == plan["drives"][0]["under_parts"][0]["part"] == "hex_nut"
    assert plan["estimated_wall_s"] > 0 and plan["estimated_file_size_mb"] > 0
    assert "transport_speed_mm_s" in plan["measures"]
    assert [p.name for p in tmp_path.iterdir()] == ["short.toml"]
    assert "antinode_to_node_mm: 19.49" in feeder_sim("check", scenario, "--full").stdout


def test_check_says_in_sentences_what_moves_and_what_it_costs(scenario: Path) -> None:
    said = feeder_sim("check", scenario).stdout
    for text in (
        " moves at 4750 Hz by 1 um and 90.8 g at most; under hex_nut by 1 um and 90.8 g.\n",
        "From antinode to node it is 19.49 mm.\n",
        "The engine is impulse: rigid contact",
        " of 0.1 s in steps of ",
        "Warnings: none.\n",
    ):
        assert text in said
    assert "transport_speed_mm_s" in said and "_um" not in said and len(said.splitlines()) < 12
    many = feeder_sim("check", "separation_100", "--seeds", 1).stdout
    assert "Mode 13 (2639.2 Hz computed) moves at 2646 Hz" in many and "(0 to 36.4)" in many


@pytest.mark.parametrize("duration_s", [0.1, 6.0])
def test_estimated_file_size_is_about_right(duration_s: float, scenario: Path, tmp_path: Path) -> None:
    scenario.write_text(toml_of(SHORT, {"run.duration_s": duration_s}))
    plan = json.loads(feeder_sim("check", scenario, "--json").stdout)
    feeder_sim("run", scenario, "--out", tmp_path / "run")
    size = sum(p.stat().st_size for p in (tmp_path / "run").rglob("*") if p.is_file()) * 1e-6
    assert 0.5 < plan["estimated_file_size_mb"] / size < 2.0


def test_check_writes_the_scene_as_mjcf(scenario: Path, tmp_path: Path) -> None:
    import mujoco

    assert feeder_sim("check", scenario, "--mjcf", tmp_path / "scene.xml").returncode == 0
    assert mujoco.MjModel.from_xml_path(str(tmp_path / "scene.xml")).nv == 9


def test_modes_are_computed_listed_stored_and_drawn(tmp_path: Path) -> None:
    plate = REPOSITORY / "models/plate_180/plate.toml"
    made = feeder_sim("modes", plate, "--out", tmp_path / "m.h5", "--picture", tmp_path / "m.png", "--mode", 13)
    assert made.returncode == 0, made.stderr
    listed = feeder_sim("modes", tmp_path / "m.h5")
    assert listed.stdout == made.stdout
    assert "2639.23" in listed.stdout and "2646" in listed.stdout
    assert (tmp_path / "m.png").read_bytes().startswith(b"\x89PNG")
    check_refused(feeder_sim("modes", plate, "--out", tmp_path / "m.h5"), "exists already")
    too_high = feeder_sim("modes", tmp_path / "m.h5", "--picture", tmp_path / "n.png", "--mode", 99)
    check_refused(too_high, "must be 1 to 59")


@pytest.mark.parametrize(
    ("typed", "expected"),
    [
        ("sweep drift_4750hz --vary a=1,2 --inputs 1", "'--inputs' ... 2 ... feeder-sim sweep --help"),
        ("run drift_4750hz --seeds abc", "'--seeds' ... integer ... feeder-sim run --help"),
        ("sweep drift_4750hz", "'--vary' ... feeder-sim sweep --help"),
        ("modes import", "Missing argument ... feeder-sim modes import --help"),
        ("run --out", "'--out' ... feeder-sim run --help"),
        ("run --sedes 3", "--sedes ... --seeds ... feeder-sim run --help"),
        ("swep", "'swep' ... 'sweep' ... feeder-sim --help"),
        ("--nonsense", "--nonsense ... feeder-sim --help"),
    ],
)
def test_a_command_that_is_typed_wrongly_is_refused_in_one_line(typed: str, expected: str) -> None:
    """Click prints its usage, four lines, without a word on which program it is."""
    refused = feeder_sim(*typed.split())
    check_refused(refused, expected)
    assert refused.stderr.startswith("feeder-sim: ")


def test_without_a_command_there_is_help() -> None:
    shown = feeder_sim()
    assert shown.returncode == 2 and "optimise" in shown.stdout + shown.stderr


def test_every_command_has_json() -> None:
    commands = typer.main.get_command(app).commands  # type: ignore[attr-defined]
    assert "modes import" in commands and "replay" in commands
    options = {name: [option for of in command.params for option in of.opts] for name, command in commands.items()}
    assert [name for name, known in options.items() if "--json" not in known] == []


def test_ctrl_c_is_told_also_where_nothing_can_be_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(plan, "plan_run", interrupted)
    done = CliRunner().invoke(app, ["check", str(BOUNCING)])
    assert isinstance(done.exception, Interrupted) and str(done.exception) == "interrupted"


def test_list_names_what_there_is() -> None:
    listed = feeder_sim("list", cwd=REPOSITORY)
    for expected in ("scenarios/drift_4750hz.toml", "models/plate_180/modes.h5", "mujoco", "M2.5", "aluminium"):
        assert expected in listed.stdout


def test_replay_of_nothing_is_refused(tmp_path: Path) -> None:
    check_refused(feeder_sim("replay", tmp_path / "nothing"), "no run here")


def test_python_does_what_the_command_does(scenario: Path, tmp_path: Path) -> None:
    loaded = package.load_scenario(scenario)
    result = package.simulate(loaded)
    summary = json.loads(in_new_process("run", scenario, "--json", "--out", tmp_path / "run").stdout)
    assert result.measures()["drift_velocity_x_mm_s"] == summary["drift_velocity_x_mm_s"]
    assert result.trajectories[0].position.shape == (result.scene.n_frames, 1, 3)


def test_help_does_not_load_the_heavy_libraries() -> None:
    code = (
        "import sys, typer.testing; from feeder_sim.cli.main import app;"
        "typer.testing.CliRunner().invoke(app, ['--help']);"
        f"print([name for name in {(*LATE, 'pydantic')} if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize("room", ["run.prepare", "report.document_of", "studies.sweep.sweep"])
def test_what_is_rarely_needed_is_imported_late(room: str) -> None:
    code = f"import sys, feeder_sim.{room}; print([name for name in {LATE} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_existing_files_are_left_alone(scenario: Path, tmp_path: Path) -> None:
    kept = scenario.read_text()
    for command in (["check", scenario, "--mjcf", scenario], ["modes", MODE_FILE, "--picture", scenario]):
        check_refused(feeder_sim(*command), "exists already")
    assert scenario.read_text() == kept


@pytest.mark.parametrize("target", ["short.toml/sub", "x" * 300])
def test_folder_that_cannot_be_made_is_one_line(target: str, scenario: Path, tmp_path: Path) -> None:
    check_refused(feeder_sim("run", scenario, "--out", tmp_path / target))


@pytest.fixture
def ball(tmp_path: Path) -> Path:
    """A ball on a slide at 240 um, 8 s of four seeds."""
    changed = load_scenario(BOUNCING).changed({"drive[0].amplitude_um": 240.0, "run.duration_s": 8.0, "run.seeds": 4})
    path = tmp_path / "ball.toml"
    path.write_text(scenario_toml(changed))
    return path


def test_run_of_a_guided_part_reports_its_bounces(ball: Path, tmp_path: Path) -> None:
    done = feeder_sim("run", ball, "--out", tmp_path / "run")
    assert "bounce interval  20" in done.stdout
    assert "motion           1 (4 seeds)" in done.stdout
    assert "drift" not in done.stdout


@pytest.mark.parametrize("name", ["drift_4750hz", "separation_heap", "transport_strip", "wave_circulation"])
def test_every_kind_of_summary_is_printed(
    name: str, repository: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of an ensemble with nothing in it yet, which has every key and no numbers."""
    scenario = load_scenario(repository / f"scenarios/{name}.toml")
    print_result(Result(prepare(scenario), (), 1.0), tmp_path, False)
    printed = capsys.readouterr().out
    assert printed.startswith(scenario.title) and "recorded in" in printed
    assert ("arrived" in printed) == (name == "transport_strip")


def test_version_is_that_of_the_package() -> None:
    assert feeder_sim("--version").stdout == f"feeder-sim {package.__version__}\n"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "offered"), [("com", "compare"), ("run drift_4", "drift_4750hz"), ("check --se", "--seeds")]
)
def test_a_shell_completes_commands_examples_and_options(words: str, offered: str) -> None:
    """As the script asks that `feeder-sim --install-completion` puts into the settings of bash."""
    asked = {"_FEEDER_SIM_COMPLETE": "complete_bash", "COMP_WORDS": f"feeder-sim {words}"}
    asked["COMP_CWORD"] = str(len(words.split()))
    code = "import sys; sys.argv = ['feeder-sim']; from feeder_sim.cli.main import main; main()"
    done = subprocess.run(
        [sys.executable, "-c", code], env=os.environ | asked, capture_output=True, text=True, timeout=60, check=False
    )
    assert offered in done.stdout.split() and done.stderr == ""
