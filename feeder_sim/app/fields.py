"""Fields for the numbers and words of the draft, each with what is wrong with it beside it."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

from nicegui import events, ui

from feeder_sim.app.guarded import MOST_BYTES
from feeder_sim.document.words import split_unit
from feeder_sim.errors import FeederSimError, cause_of

if TYPE_CHECKING:
    from feeder_sim.app.page import Page

KEY = re.compile(r"(.*?)(?:\[(\d)\])?")
SHORT = {"V peak to peak": "Vpp", "degrees": "°"}  # units as narrow fields have them
SIDES = {"at": ("x", "y"), "centre": ("x", "y"), "size": ("long", "wide")}


class Fields:
    """The fields of a page, by their keys."""

    def __init__(self, page: Page) -> None:
        self.page = page
        self.inputs: dict[str, Any] = {}

    def number(self, key: str, default: float | None = None) -> None:
        """A number of the draft, if it has one there or a default is said."""
        draft = self.page.draft
        if draft.number(key, default) is None:
            return
        name, unit = worded(key)
        field = ui.number(name, value=draft.number(key, default), format="%.6g").classes("w-24")
        field.props("dense" + (f" suffix={unit}" if unit else "") + f' data-key="{key}"')
        self.inputs[key] = field

        async def leave() -> None:
            current, value = draft.number(key, default), field.value
            if value is not None and value != current:
                new = int(value) if isinstance(current, int) and float(value).is_integer() else float(value)
                await self.page.step(lambda: draft.change(key, new))

        field.on("blur", leave).on("keydown.enter", leave)

    def numbers(self, table: str, *names: str) -> None:
        """Those of some numbers of a table that are there."""
        for name in names:
            self.number(f"{table}.{name}")

    def choice(self, key: str, options: list[str], default: str) -> None:
        """One of several words; nothing where the draft has a table there."""
        draft, value = self.page.draft, self.page.draft.value(key, default)
        if not isinstance(value, str):
            return

        async def chosen(event: events.ValueChangeEventArguments[Any]) -> None:
            if event.value != draft.value(key, default):
                await self.page.step(lambda: draft.change(key, event.value))

        field = ui.select(sorted({*options, value}), value=value, label=worded(key)[0], on_change=chosen)
        self.inputs[key] = field.props("dense").classes("w-32")

    def remover(self, key: str) -> None:
        """A button that takes a table out."""

        async def remove() -> None:
            if not key.startswith("plate.") or self.page.plate.described():
                await self.page.step(lambda: self.page.draft.change(key, None))

        ui.button(icon="close", on_click=remove).props('flat dense size=sm aria-label="remove"')

    def update(self) -> None:
        """Show the values of the draft, and what is wrong with one."""
        problem = self.page.problem
        for key, field in self.inputs.items():
            value = self.page.draft.value(key)
            if value is not None and field.value != value:
                field.value = value
            field.error = problem.problem if problem is not None and problem.key in (key, key.split("[")[0]) else None


def worded(key: str) -> tuple[str, str]:
    """What a key is called on the page, and its unit."""
    match = KEY.fullmatch(key.rsplit(".", 1)[-1])
    assert match is not None
    (word, unit), place = split_unit(match[1]), match[2]
    name = SIDES[word][int(place)] if place is not None and word in SIDES else word
    return name, SHORT.get(unit, unit)


def notify(error: Exception) -> None:
    """Say on the page what has failed, in one line."""
    if isinstance(error, FeederSimError):
        line = str(error)
    elif isinstance(error, OSError):
        line = f"{error.filename or 'the system'}: {cause_of(error)}"
    else:
        line = f"the page has failed here ({type(error).__name__}: {error}); the text is as it was"
    ui.notify(FeederSimError(line).args[0], type="negative")


def drop(label: str, act: Any) -> None:
    """Where a file is dropped."""
    field = ui.upload(label=label, on_upload=act, auto_upload=True, max_file_size=MOST_BYTES)
    field.props("flat dense").classes("w-64 h-20")
