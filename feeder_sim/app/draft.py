"""The scenario on the page: its text, which is all there is, with what was before each change."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from feeder_sim.errors import InputError
from feeder_sim.scenario import Scenario, parse_scenario
from feeder_sim.scenario.changes import path_of
from feeder_sim.scenario.tables import document_in, read_text
from feeder_sim.whole_files import write_whole

MOST_BEFORE = 200  # texts that are kept to go back to


class Draft:
    """A scenario as text; every change is one of the text, and keeps its comments.

    The text may be anything. What is read from it has the kind that was asked for, or is as if it was not written.

    Attributes:
        text: of the scenario.
        file: that it is, or would be: names of files in it are relative to its folder.
        saved: what the file held when the page last read or wrote it.
    """

    def __init__(self, text: str, file: Path) -> None:
        self.text, self.file, self.saved = text, file, text
        self.before: list[str] = []
        self.after: list[str] = []
        self._parsed: tuple[str, dict[str, Any]] = "", {}  # the document of a text: every field asks for it

    def write(self, text: str) -> None:
        """Put another text in its place."""
        text = text.encode("utf-8", "replace").decode()  # half of a pair of surrogates could be neither sent nor saved
        if text != self.text:
            self.before = [*self.before[-MOST_BEFORE:], self.text]
            self.after.clear()
            self.text = text

    def undo(self) -> None:
        """Go back to the text before the last change."""
        if self.before:
            self.after.append(self.text)
            self.text = self.before.pop()

    def redo(self) -> None:
        """Take the change again that was taken back."""
        if self.after:
            self.before.append(self.text)
            self.text = self.after.pop()

    def scenario(self) -> Scenario:
        """What the text says.

        Raises:
            InputError: it cannot be run as it is.
        """
        return parse_scenario(self.text, file=self.file)

    def save(self) -> None:
        """Write the text to its file, unless somebody else has.

        Raises:
            FeederSimError: somebody else has, or the file cannot be read or written.
        """
        try:
            file_text = read_text(self.file)
        except InputError as error:
            if not isinstance(error.__cause__, FileNotFoundError):
                raise
            file_text = self.saved
        if file_text not in (self.text, self.saved):
            raise InputError("was changed by somebody else; download the text instead", file=self.file)
        write_whole(self.file, self.text.encode())
        self.saved = self.text

    @property
    def readable(self) -> bool:
        """Whether the text is TOML at all."""
        try:
            document_in(self.text, self.file)
        except InputError:
            return False
        return True

    def value(self, key: str, default: Any = None) -> Any:
        """The value at a key as it is written, of any kind; the default where it is not."""
        value: Any = self._document()
        for element in path_of(key):
            try:
                value = value[element]
            except (KeyError, IndexError, TypeError):
                return default
        return value

    def number(self, key: str, default: float | None = None) -> float | None:
        """The number at a key, the default where nothing is written; None where there is another value."""
        value = self.value(key, default)
        return value if _is_number(value) else None

    def numbers(self, key: str) -> list[float]:
        """The numbers of the list at a key; none where there is another value."""
        value = self.value(key)
        return [*value] if isinstance(value, list) and all(map(_is_number, value)) else []

    def tables(self, key: str) -> list[dict[str, Any]]:
        """The tables of the list at a key; none where there is another value."""
        value = self.value(key)
        return [*value] if isinstance(value, list) and all(isinstance(entry, dict) for entry in value) else []

    @property
    def structure(self) -> Any:
        """Which keys are written, and of what kinds their values are: what fields there are depends on it."""
        return _structure(self._document())

    def _document(self) -> dict[str, Any]:
        """The document as it is written; an empty one where the text is no TOML."""
        if self._parsed[0] != self.text:
            document: dict[str, Any] = {}
            with contextlib.suppress(InputError):
                document = document_in(self.text, self.file)
            self._parsed = self.text, document
        return self._parsed[1]

    def change(self, key: str, value: Any) -> None:
        """Write a value at a key; None takes it out.

        Raises:
            InputError: the text is not TOML, or the key leads nowhere.
        """
        with self._table(key) as (table, last):
            if value is None:
                if isinstance(last, int) or last in table:
                    del table[last]
            elif isinstance(last, str) and last in table and isinstance(table[last], list) and isinstance(value, list):
                array = table[last]
                for i, entry in enumerate(value[: len(array)]):
                    if array[i] != entry:
                        array[i] = entry
                if len(value) != len(array):
                    table[last] = value
            else:
                table[last] = value

    def add(self, key: str, entry: dict[str, Any]) -> None:
        """Add a table to those of a key, such as `plate.actuator`.

        Raises:
            InputError: the text is not TOML, or there is something else than tables.
        """
        import tomlkit

        with self._table(key) as (table, last):
            if last not in table:
                table[last] = tomlkit.aot()
            if isinstance(table[last], tomlkit.items.AoT):
                table[last].append(tomlkit.item(entry))
            else:
                inline = tomlkit.inline_table()
                inline.update(entry)
                table[last].append(inline)

    @contextlib.contextmanager
    def _table(self, key: str) -> Iterator[tuple[Any, Any]]:
        """The table that holds the last name of a key, and that name, to be changed; missing tables are made."""
        import tomlkit
        from tomlkit.exceptions import TOMLKitError

        document_in(self.text, self.file)  # it is stricter, and says in the words of the command line what is wrong
        *before, last = path_of(key)
        try:
            document = tomlkit.parse(self.text)
            table: Any = document
            for element in before:
                if isinstance(element, str) and element not in table:
                    table[element] = tomlkit.table()
                table = table[element]
            yield table, last
            text = tomlkit.dumps(document)
        except (TOMLKitError, LookupError, TypeError, ValueError, AttributeError) as error:  # no table where one is due
            raise InputError(
                "leads to a value of another kind than is written here", file=self.file, key=key
            ) from error
        self.write(text)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _structure(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _structure(entry) for key, entry in value.items()}
    if isinstance(value, list):
        return [_structure(entry) for entry in value]
    return "number" if _is_number(value) else type(value).__name__
