"""The JSON Schema of scenarios and plate files: up to date, named by the examples, and known to a TOML linter."""

from __future__ import annotations

import importlib
import json
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from command_line import check_refused, feeder_sim
from conftest import REPOSITORY

from feeder_sim.scenario.schema import TABLES, json_schema

EXAMPLES = [*sorted(REPOSITORY.glob("scenarios/*.toml")), *sorted(REPOSITORY.glob("models/*/plate.toml"))]
TOMBI = Path(sys.executable).with_name("tombi")


def parts_of(value: Any) -> Iterator[Any]:
    yield value
    for entry in value.values() if isinstance(value, dict) else value if isinstance(value, list) else ():
        yield from parts_of(entry)


@pytest.mark.parametrize("kind", TABLES)
def test_schema_in_the_repository_is_up_to_date(kind: str) -> None:
    """If not: feeder-sim schema KIND --force --out schema/KIND.schema.json."""
    text = (REPOSITORY / f"schema/{kind}.schema.json").read_text(encoding="utf-8")
    assert text == feeder_sim("schema", kind).stdout


@pytest.mark.parametrize("kind", TABLES)
def test_schema_knows_no_null_and_says_what_every_key_is_for(kind: str) -> None:
    schema = json_schema(kind)
    assert not any(part is None or part == "null" for part in parts_of(schema))
    for name, table in {"": schema, **schema["$defs"]}.items():
        assert (table["additionalProperties"] is False or name == "UncertainKeys") and table["description"], name
        for key, entry in table.get("properties", {}).items():
            assert key in ("kind", "shape") or entry["description"], f"{name}.{key}"
            assert "](" not in entry.get("description", "") and "{" not in entry.get("description", "")
    assert json.loads(json.dumps(schema)) == schema


def test_numbers_and_ranges_and_choices_are_those_of_the_program() -> None:
    tables = json_schema("scenario")["$defs"]
    assert tables["Drive"]["properties"]["frequency_hz"]["maximum"] == 1e7
    assert [choice["type"] for choice in tables["Start"]["properties"]["yaw_deg"]["anyOf"]] == ["number", "array"]
    assert tables["Strip"]["required"] == ["kind", "thickness_mm"]
    assert "1.5 wavelengths" in tables["Strip"]["properties"]["length_mm"]["description"]


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: f"{path.parent.name}/{path.name}")
def test_examples_name_their_schema_in_their_first_line(path: Path) -> None:
    found = re.match(r"#:schema (\S+)\n", path.read_text(encoding="utf-8"))
    kind = "plate" if path.name == "plate.toml" else "scenario"
    assert found and (path.parent / found[1]).resolve() == REPOSITORY / f"schema/{kind}.schema.json"


def test_a_schema_is_written_to_a_new_file_only(tmp_path: Path) -> None:
    out = tmp_path / "plate.json"
    for file, arguments in ((None, []), (str(out), ["--out", out])):
        told = json.loads(feeder_sim("schema", "plate", "--json", *arguments).stdout)
        assert told == {"kind": "plate", "file": file, "schema": json_schema("plate")}
    assert out.read_text(encoding="utf-8") == feeder_sim("schema", "plate").stdout
    check_refused(feeder_sim("schema", "--out", out), "exists already, --force replaces it")
    assert feeder_sim("schema", "--out", out, "--force").returncode == 0
    assert json.loads(out.read_text()) == json_schema("scenario")
    check_refused(feeder_sim("schema", "plat"), "is 'plat' (did you mean 'plate'?), must be scenario, plate")


def lint(*paths: Path) -> tuple[int, str]:
    command = list(map(str, [TOMBI, "lint", "--offline", *paths]))
    done = subprocess.run(command, capture_output=True, text=True, cwd=REPOSITORY, timeout=60, check=False)
    return done.returncode, re.sub(r"\x1b\[[0-9;]*m", "", done.stdout + done.stderr)


def test_a_linter_passes_the_examples() -> None:
    code, said = lint(*EXAMPLES)
    assert code == 0, said


DRIFT = "scenarios/drift_4750hz.toml"


@pytest.mark.parametrize(
    ("example", "right", "wrong", "named"),
    [
        ("scenarios/separation_100.toml", "cycles = 10", "cylces = 10", '"cylces" is not allowed'),
        ("scenarios/separation_100.toml", "clearance_mm", "clearence_mm", '"clearence_mm" is not allowed'),
        ("scenarios/separation_100.toml", "count = 100", "cuont = 100", '"cuont" is not allowed'),
        ("scenarios/separation_100.toml", "count = 100", "count = 0", "must be ≥ 1"),
        (DRIFT, "thickness_mm", "thicknes_mm", '"thicknes_mm" is not allowed'),
        (
            DRIFT,
            "\n[run]",
            "\n[uncertain]\ncontact.friction = { uniform = [0.2, 0.5], also = ['a'] }\n[run]",
            "",
        ),
        (DRIFT, "\n[run]", "\n[uncertain]\n'contact.friction' = { choice = [0.1, 0.3] }\n[run]", ""),
        (DRIFT, "\n[run]", "\n[uncertain]\ncontact.friction = { unifrom = [0.2, 0.5] }\n[run]", "unifrom"),
        (DRIFT, "\n[run]", "\n[uncertain]\ncontact.friction = { normal = [0.2, 0.5], als = ['a'] }\n[run]", "als"),
        ("models/plate_180/plate.toml", "length_mm", "lenght_mm", '"lenght_mm" is not allowed'),
        ("models/plate_180_piezos/plate.toml", "thickness_mm = 2.0", "thick_mm = 2.0", '"thick_mm" is not allowed'),
    ],
)
def test_a_linter_names_a_misspelt_key(example: str, right: str, wrong: str, named: str, tmp_path: Path) -> None:
    shutil.copytree(REPOSITORY / "schema", tmp_path / "schema")
    text = (REPOSITORY / example).read_text(encoding="utf-8")
    assert right in text
    copy = tmp_path / example
    copy.parent.mkdir(parents=True)
    copy.write_text(text.replace(right, wrong, 1), encoding="utf-8")
    code, said = lint(copy)
    assert (code != 0) == bool(named) and named in said, said


def test_documented_tables_show_no_names_of_python(repository: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(repository / "docs/_ext")
    told = importlib.import_module("reference_tables").table_reference("feeder_sim.scenario:Scenario")
    assert "| `shape` | file |" in told  # of a gripper; no choice between tables
    assert not re.search(r"<class|pathlib|table \[table\]", told)
