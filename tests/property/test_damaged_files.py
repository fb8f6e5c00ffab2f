"""Whatever stands in a file: it is read unchanged, or refused in one short line that a terminal only shows."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from feeder_sim.errors import LONGEST_MESSAGE, FeederSimError, InputError, quoted
from feeder_sim.scenario import parse_scenario

FILE = Path("scenario.toml")
SCENARIO = """
[plate]
kind = "piston"
[[drive]]
frequency_hz = 50.0
amplitude_um = 100.0
[[part]]
shape = "ball"
diameter_mm = 3.0
[run]
duration_s = 1.0
"""
HUGE = "0x" + "f" * 5000  # more digits than Python writes


def refused(text: str) -> str:
    with pytest.raises(InputError) as error:
        parse_scenario(text, file=FILE)
    message = str(error.value)
    assert message.startswith("scenario.toml: ") and message.isprintable() and len(message) <= LONGEST_MESSAGE
    return message


@pytest.mark.parametrize(
    ("old", "new", "key"),
    [
        ("duration_s = 1.0", f"duration_s = {HUGE}", "run.duration_s: is a whole number of more than 300 digits"),
        ("duration_s = 1.0", f"duration_s = 1.0\nseed = [{HUGE}]", "run.seed[0]: is a whole number"),
        ('kind = "piston"', f"kind = {HUGE}", "plate.kind: is a whole number"),
        ("duration_s = 1.0", f"duration_s = {'9' * 5000}", "holds a whole number of thousands of digits"),
    ],
)
def test_whole_numbers_of_thousands_of_digits(old: str, new: str, key: str, capfd: pytest.CaptureFixture[str]) -> None:
    assert key in refused(SCENARIO.replace(old, new))
    assert capfd.readouterr().err == ""  # pydantic told there what it could not show


@pytest.mark.parametrize("depth", [30, 300, 3000])
def test_keys_and_lists_nested_deep(depth: int) -> None:
    deep = ".".join(["a"] * depth)
    for text in (
        f"{deep} = 1\n{SCENARIO}",
        f"{SCENARIO}[{deep}]\nx = 1\n",
        SCENARIO.replace("duration_s = 1.0", f"duration_s.{deep} = 1"),
        SCENARIO.replace('kind = "piston"', f"kind.{deep} = 1"),
        SCENARIO.replace("1.0", "[" * depth + "]" * depth),
    ):
        assert "nested too deep, allowed are 20 levels" in refused(text)


def test_control_characters_do_not_reach_the_terminal() -> None:
    red, turned = "\\u001b[31mred\\u009b1m", "\\u202ecba\\u2066"  # an escape sequence; letters from right to left
    assert r"is '\x1b[31mred\x9b1m'" in refused(f'{SCENARIO}engine = "{red}"')
    assert r"run.\x1b[31mred\x9b1m: unknown key" in refused(f'{SCENARIO}"{red}" = 1')
    assert r"run.\u202ecba\u2066: unknown key" in refused(f'{SCENARIO}"{turned}" = 1')
    named = InputError("no such file", file="\x1b[2J\udc80.toml")
    assert str(named) == r"\x1b[2J\udc80.toml: no such file"


def test_long_values_are_shortened() -> None:
    long = "x" * 5000
    assert "...xx" in refused(f'{SCENARIO}engine = "{long}"')
    assert len(refused(f'{SCENARIO}engine = "{long}"')) < 200
    assert refused(SCENARIO.replace("piston", long)).endswith("allowed is 'strip', 'rectangle', 'piston'")
    assert "unknown key; allowed are" in refused(f"{SCENARIO}{long} = 1")
    many = "\n".join(f"key_{i} = 1" for i in range(20_000))
    assert "and 19999 more" in refused(f"{SCENARIO}{many}")  # in no time
    assert len(quoted(list(range(10_000)))) == 80
    assert quoted(int(HUGE, 16)) == "a value that is too long to show (int)"


@given(text=st.text())
def test_any_message_is_one_short_line(text: str) -> None:
    for error in (FeederSimError(text * 100), InputError(text, file=text, key=text)):
        assert str(error).isprintable() and len(str(error)) <= LONGEST_MESSAGE
