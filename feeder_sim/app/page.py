"""The page of one browser tab: a draft, the panels that show and change it, and what is wrong with it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from nicegui import app, events, run, ui

from feeder_sim.app.draft import Draft
from feeder_sim.app.fields import Fields, notify
from feeder_sim.app.guarded import put_in
from feeder_sim.app.modes_panel import ModesPanel
from feeder_sim.app.motion import Motion, displayed_modes
from feeder_sim.app.parts_panel import PartsPanel
from feeder_sim.app.plate_panel import PlatePanel
from feeder_sim.app.runs import Runs
from feeder_sim.app.runs_panel import RunsPanel
from feeder_sim.app.schedule_panel import SchedulePanel
from feeder_sim.errors import FeederSimError, InputError
from feeder_sim.scenario import Scenario

STYLE = ".nicegui-content { padding: 8px } .q-tab-panel { padding: 8px 0 } .q-field__bottom { padding-top: 2px }"


class Page:
    """What one tab shows; tabs share nothing but the folder and the runs in it.

    Attributes:
        draft: the scenario as text.
        scenario: what it says, or said before it could not be read.
        problem: what is wrong with it.
        motion: of its plate.
        runs: of all tabs.
    """

    def __init__(self, draft: Draft, runs: Runs) -> None:
        self.draft, self.runs = draft, runs
        self.scenario: Scenario | None = None
        self.problem: InputError | None = None
        self.motion: Motion | None = None
        self.solved = ""  # the plate that `motion` is of
        self.solving = False
        self.structure: Any = None  # of the draft that the panels show
        self.fields = Fields(self)
        self.plate, self.modes, self.parts = PlatePanel(self), ModesPanel(self), PartsPanel(self)
        self.schedule, self.results = SchedulePanel(self), RunsPanel(self)

    def build(self) -> None:
        """Lay the page out, and show the draft."""
        ui.on_exception(notify)
        ui.add_css(STYLE)
        with ui.row().classes("w-full items-center"):
            self.heading = ui.label().classes("text-lg font-bold")
            ui.space()
            for icon, tip, act in (
                ("undo", "Undo", lambda: self.step(self.draft.undo)),
                ("redo", "Redo", lambda: self.step(self.draft.redo)),
                ("save", "Save the file", self.save),
                ("download", "Download the TOML", self.download),
            ):
                ui.button(icon=icon, on_click=act).props(f'flat dense aria-label="{tip}"').tooltip(tip)
        self.error = ui.label().classes("text-red-700 error")
        panels: dict[str, Callable[[], Any]] = {
            "Plate": self.plate.numbers,
            "Modes": self.modes.table,
            "Part": self.parts.table,
            "Schedule": self.schedule.stages,
            "Run": self.results.table,
            "TOML": self.text,
        }
        with ui.row().classes("w-full no-wrap items-start"):
            with ui.column().classes("w-1/2"):
                self.plate.canvas()
            with ui.column().classes("w-1/2"):
                with ui.tabs().props("dense no-caps align=left") as tabs:
                    names = [ui.tab(name) for name in panels]
                with ui.tab_panels(tabs, value=names[0], keep_alive=True).classes("w-full"):
                    for name, panel in zip(names, panels.values(), strict=True):
                        with ui.tab_panel(name):
                            try:
                                panel()
                            except Exception as error:  # the text and undo are there, whatever else fails
                                app.handle_exception(error)
        ui.timer(0.5, self.results.update)
        ui.timer(0.05, self.changed, once=True)

    def text(self) -> None:
        """The scenario as it is, to edit."""
        self.code = ui.codemirror(self.draft.text, language="TOML").classes("w-full h-96")

        async def write_text() -> None:
            await self.step(lambda: self.draft.write(self.code.value or ""))

        ui.button("Take it over", on_click=write_text).props("dense no-caps")

    async def step(self, act: Callable[[], None]) -> None:
        """Change the draft, and show what came of it."""
        try:
            act()
        except InputError as error:
            notify(error)
        await self.changed()

    async def changed(self) -> None:
        """Check the draft, and bring everything up to date with it."""
        try:
            self.scenario, self.problem = self.draft.scenario(), None
        except InputError as error:
            self.problem = error
        self.error.text = str(self.problem) if self.problem else ""
        if self.code.value != self.draft.text:
            self.code.value = self.draft.text
        if not self.draft.readable:
            return
        self.heading.text = str(self.draft.value("title") or self.draft.file.stem)
        if self.structure != self.draft.structure:
            self.structure = self.draft.structure
            self.fields.inputs.clear()
            for panel in (self.plate.numbers, self.parts.table, self.schedule.stages, self.results.table):
                panel.refresh()
        self.fields.update()
        self.schedule.update()
        self.plate.update()
        if not self.solving:
            self.solving = True
            try:
                await self._solve()
            finally:
                self.solving = False

    async def _solve(self) -> None:
        """Compute the modes of the plate, until they are those of the draft as it is then."""
        while self.scenario and not self.problem and (plate := self.scenario.plate.model_dump_json()) != self.solved:
            scenario, self.solved = self.scenario, plate
            self.plate.words.text = "computing the modes ..."
            try:
                self.motion = await run.io_bound(_motion, scenario)
            except FeederSimError as error:
                self.motion = None
                self.plate.hide(str(error))
            self.plate.update()
            self.modes.begin(scenario)
            self.modes.show()
            if self.motion is not None:
                await run.io_bound(self.motion.learn, scenario)
        self.modes.show()

    async def put_in(self, event: events.UploadEventArguments) -> str | None:
        """The name of a file that was dropped, in the folder of the scenario; None where it is refused."""
        try:
            return put_in(self.draft.file.parent, event.file.name, await event.file.read()).name
        except FeederSimError as error:
            notify(error)
            return None

    def download(self) -> None:
        """Give the text as a file."""
        ui.download.content(self.draft.text, self.draft.file.name)

    def save(self) -> None:
        """Write the text to its file, unless somebody else has."""
        try:
            self.draft.save()
        except FeederSimError as error:
            notify(error)
            return
        ui.notify(f"saved as {self.draft.file}")


def _motion(scenario: Scenario) -> Motion:
    return Motion(displayed_modes(scenario))
