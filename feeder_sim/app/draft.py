"""The scenario on the page: its text, which is all there is, with what was before each change."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from feeder_sim.errors import InputError
from feeder_sim.scenario import Scenario, parse_scenario
from feeder_sim.scenario.changes import path_of

MOST_BEFORE = 200  # texts that are kept to go back to


class Draft:
    """A scenario as text; every change is one of the text, and keeps its comments.

    Attributes:
        text: of the scenario.
        file: that it is, or would be: names of files in it are relative to its folder.
        saved: what the file held when the page last read or wrote it.
    """

    def __init__(self, text: str, file: Path) -> None:
        self.text, self.file, self.saved = text, file, text
        self.before: list[str] = []
        self.after: list[str] = []

    def write(self, text: str) -> None:
        """Put another text in its place."""
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

    @property
    def readable(self) -> bool:
        """Whether the text is TOML at all."""
        try:
            self._read()
        except InputError:
            return False
        return True

    def value(self, key: str, default: Any = None) -> Any:
        """The value at a key as it is written; the default where it is not."""
        found: Any = self._read()
        for element in path_of(key):
            try:
                found = found[element]
            except (KeyError, IndexError, TypeError):
                return default
        return found.unwrap() if hasattr(found, "unwrap") else found

    def change(self, key: str, value: Any) -> None:
        """Write a value at a key; None takes it out.

        Raises:
            InputError: the text is not TOML, or the key leads nowhere.
        """
        whole = self._read()
        table, last = self._table(whole, key)
        if value is None:
            if isinstance(last, int) or last in table:
                del table[last]
        elif isinstance(last, str) and last in table and isinstance(table[last], list) and isinstance(value, list):
            held = table[last]
            for i, entry in enumerate(value[: len(held)]):
                if held[i] != entry:
                    held[i] = entry
            if len(value) != len(held):
                table[last] = value
        else:
            table[last] = value
        self._dump(whole)

    def add(self, key: str, entry: dict[str, Any]) -> None:
        """Add a table to those of a key, such as `plate.actuator`."""
        import tomlkit

        whole = self._read()
        table, last = self._table(whole, key)
        if last not in table:
            table[last] = tomlkit.aot()
        if isinstance(table[last], tomlkit.items.AoT):
            table[last].append(tomlkit.item(entry))
        else:
            inline = tomlkit.inline_table()
            inline.update(entry)
            table[last].append(inline)
        self._dump(whole)

    def _read(self) -> Any:
        import tomlkit
        from tomlkit.exceptions import ParseError

        try:
            return tomlkit.parse(self.text)
        except (ParseError, ValueError) as error:
            raise InputError(str(error), file=self.file) from error

    def _table(self, whole: Any, key: str) -> tuple[Any, Any]:
        """The table that holds the last name of a key, and that name; tables that are missing are made."""
        import tomlkit

        *way, last = path_of(key)
        table = whole
        for element in way:
            if isinstance(element, str) and element not in table:
                table[element] = tomlkit.table()
            try:
                table = table[element]
            except (KeyError, IndexError, TypeError):
                raise InputError("leads nowhere", file=self.file, key=key) from None
        return table, last

    def _dump(self, whole: Any) -> None:
        import tomlkit

        self.write(tomlkit.dumps(whole))
