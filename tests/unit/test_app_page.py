"""The page builds whatever the text is and whatever fails: with the text, with what is wrong, and with undo."""

from __future__ import annotations

import asyncio
import datetime
import errno
import itertools
import math
import tomllib
from collections.abc import AsyncIterator, Iterator, Mapping
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest
import tomli_w
from conftest import REPOSITORY
from nicegui import Client, json, ui
from nicegui.testing.user import User
from nicegui.testing.user_simulation import user_simulation

from feeder_sim.app import page as page_module
from feeder_sim.app.draft import Draft
from feeder_sim.app.fields import Fields
from feeder_sim.app.page import Page
from feeder_sim.app.runs import Runs
from feeder_sim.errors import InputError

EXAMPLE = REPOSITORY / "scenarios/patch_place.toml"
# Keys that fields, pictures and blocks of the page read, beside those of the example.
MORE = """
[plate.outline]
points_mm = [[-100.0, -70.0], [100.0, -70.0], [100.0, 70.0], [-100.0, 70.0]]
[[plate.support]]
at_mm = [80.0, 50.0]
stiffness_n_per_mm = 20.0
[[plate.hole]]
centre_mm = [50.0, -40.0]
diameter_mm = 10.0
[schedule]
cycles = 2
[[schedule.stage]]
name = "shake"
duration_s = 1.0
pause_s = 0.5
pick = { clearance_mm = 8.0 }
[[schedule.stage.drive]]
frequency_hz = 1000.0
voltage_vpp = 60.0
"""
ELSE: tuple[Any, ...] = (
    *(3, -2.5, math.nan, math.inf, 10**200, True, "", "x", "\0", datetime.date(2020, 2, 2)),
    *([], [1, 2], ["x"], [[]], [{}], [{}, 1], [{"name": 1}], {}, {"name": []}, {"at_mm": 0}),
)
NO_SCENARIO = (
    "",
    "\0\x01\x7f\ufeff",
    "\ud800",
    "[plate",
    "plate = 3\nplate = 4",
    "[[plate]]\n[plate]\n",
    "a = " + "[" * 5000,
    "a" + ".a" * 5000 + " = 1",
    "a = " + "9" * 5000,
    "[part]\nshape = 'ball'",
    "[plate.actuator]\nname = 'a'",
    "part = [1, 2]",
    "plate = 3",
    "run = []",
    "schedule = 'x'",
    "<script>alert(1)</script>",
    b"\x89PNG\r\n\x1a\n\xff".decode("latin-1"),
)


def described() -> dict[str, Any]:
    """A scenario with a value at every key that the page reads."""
    document = tomllib.loads(EXAMPLE.read_text(encoding="utf-8"))
    more = tomllib.loads(MORE)
    document["plate"] |= more.pop("plate")
    return document | more


def keys_of(value: Any, before: tuple[str | int, ...] = ()) -> Iterator[tuple[str | int, ...]]:
    """Where a document has values, those that have others in them included."""
    entries = value.items() if isinstance(value, Mapping) else enumerate(value) if isinstance(value, list) else ()
    for name, entry in entries:
        yield (*before, name)
        yield from keys_of(entry, (*before, name))


def with_value(value: Any, path: tuple[str | int, ...], new: Any) -> Any:
    """A copy with another value at a path."""
    copy = dict(value) if isinstance(value, Mapping) else list(value)
    copy[path[0]] = with_value(value[path[0]], path[1:], new) if path[1:] else new  # type: ignore[index]
    return copy


@pytest.fixture
def no_modes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Modes take seconds, and the text is read without them."""

    def refuse(_: object) -> None:
        raise InputError("are not computed here", key="modes")

    monkeypatch.setattr(page_module, "_motion", refuse)


@asynccontextmanager
async def opened() -> AsyncIterator[tuple[User, Client]]:
    """A browser tab with nothing on it."""

    async def root() -> None:
        ui.label("empty")

    async with user_simulation(root) as user:
        client = await user.open("/")
        with client:
            yield user, client


async def built(draft: Draft, client: Client) -> Page:
    """The page of a draft, as it is after a reload, checked to be one that a browser can be sent."""
    client.content.clear()
    page = Page(draft, Runs())
    with client.content:
        page.build()
        await page.changed()
    check_sent(page, client)
    return page


def check_sent(page: Page, client: Client) -> None:
    """The page shows the text and what is wrong with it."""
    json.dumps({number: element._to_dict() for number, element in client.elements.items()})
    assert page.code.value == page.draft.text
    try:
        page.draft.scenario()
    except InputError as error:
        assert page.error.text == str(error) and "\n" not in page.error.text
    else:
        assert page.error.text == ""


async def clicked(user: User, icon: str) -> None:
    """Click on a button of the page, and let it act."""
    user.find(kind=ui.button, content=icon).click()
    await asyncio.sleep(0.1)


async def check_text(text: str, client: Client) -> None:
    """A text that is taken over on a page that shows another one, after a reload, and taken back on each of them."""
    before = tomli_w.dumps(described())
    draft = Draft(before, EXAMPLE)
    page = await built(draft, client)
    fields = set(page.fields.inputs)
    for _ in ("as it is", "after a reload"):
        with client.content:
            await page.step(lambda: draft.write(text))
        check_sent(page, client)
        page = await built(draft, client)
        with client.content:
            await page.step(draft.undo)
        assert draft.text == before and set(page.fields.inputs) == fields
        check_sent(page, client)


def test_any_text_leaves_a_page_with_the_text_its_error_and_undo(
    no_modes: None, caplog: pytest.LogCaptureFixture
) -> None:
    async def check() -> None:
        async with opened() as (user, client):
            for text in NO_SCENARIO:
                await check_text(text, client)
            assert not user.notify.messages

    asyncio.run(check())
    assert not [record for record in caplog.records if record.levelname in ("ERROR", "WARNING")]


@pytest.mark.slow
def test_another_value_at_any_key_leaves_a_page(no_modes: None, caplog: pytest.LogCaptureFixture) -> None:
    """A tenth of all pairs of a key and a value, which takes a minute; every key and every value is among them."""
    document = described()
    pairs = list(itertools.product(keys_of(document), ELSE))

    async def check() -> None:
        async with opened() as (user, client):
            for path, value in pairs[::9]:  # no divisor of the number of values
                await check_text(tomli_w.dumps(with_value(document, path, value)), client)
                assert not user.notify.messages, (path, value)

    asyncio.run(check())
    assert not [record for record in caplog.records if record.levelname in ("ERROR", "WARNING")]


@pytest.mark.parametrize("obstacle", ["no text", "folder", "no folder", "file in place of the folder", "changed"])
def test_a_file_that_cannot_be_saved_is_said_in_one_line(
    no_modes: None, tmp_path: Path, caplog: pytest.LogCaptureFixture, obstacle: str
) -> None:
    file = tmp_path / "mine" / "scenario.toml"
    if obstacle == "file in place of the folder":
        (tmp_path / "mine").write_text("")
    elif obstacle != "no folder":
        (tmp_path / "mine").mkdir()
    if obstacle == "no text":
        file.write_bytes(b"\xff\xfe")
    elif obstacle == "folder":
        file.mkdir()
    elif obstacle == "changed":
        file.write_text("title = 'theirs'")

    async def check() -> None:
        async with opened() as (user, client):
            await built(Draft(EXAMPLE.read_text(encoding="utf-8"), file), client)
            await clicked(user, "save")
            (line,) = user.notify.messages
            assert line.startswith(f"{file}: ") and "\n" not in line

    before = sorted(tmp_path.rglob("*"))
    asyncio.run(check())
    assert sorted(tmp_path.rglob("*")) == before
    assert not [record for record in caplog.records if record.levelname == "ERROR"]


@pytest.mark.parametrize(
    ("error", "line"),
    [
        (OSError(errno.EACCES, "no", "some/file"), "some/file: Permission denied"),
        (OSError(errno.ENOSPC, "no"), "the system: No space left on device"),
        (ValueError("of\ntwo lines"), "the page has failed here (ValueError: of two lines); the text is as it was"),
    ],
)
@pytest.mark.parametrize("later", [False, True])
def test_whatever_fails_is_said_in_one_line(
    no_modes: None, monkeypatch: pytest.MonkeyPatch, error: Exception, line: str, later: bool
) -> None:
    def fail(_: object) -> None:
        raise error

    async def check() -> None:
        async with opened() as (user, client):
            await built(Draft(EXAMPLE.read_text(encoding="utf-8"), EXAMPLE), client)
            monkeypatch.setattr(*((Draft, "scenario", fail) if later else (page_module.Page, "changed", fail)))
            await clicked(user, "undo")
            assert set(user.notify.messages) == {line}

    asyncio.run(check())


def test_a_panel_that_fails_leaves_the_text_and_undo(no_modes: None, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise RuntimeError("of a panel")

    async def check() -> None:
        async with opened() as (user, client):
            draft = Draft("", EXAMPLE)
            draft.write("title = 'a'")
            monkeypatch.setattr(Fields, "numbers", fail)
            page = Page(draft, Runs())
            with client.content:
                page.build()
            assert page.code.value == draft.text
            assert "the page has failed here (RuntimeError: of a panel); the text is as it was" in user.notify.messages
            await clicked(user, "undo")
            assert page.code.value == draft.text == ""

    asyncio.run(check())
