"""The schedule: stages as blocks on a time axis; without any, the drive."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from nicegui import events, ui

if TYPE_CHECKING:
    from feeder_sim.app.page import Page

NUMBERS = ("duration_s", "pause_s", "drive[0].frequency_hz", "drive[0].voltage_vpp", "drive[0].amplitude_um")
GATHER_S, THROW_S, PAUSE_S, CLEARANCE_MM, CYCLES = 2.0, 0.1, 0.4, 8.0, 4  # of a schedule to begin with


class StageBlocks(ui.element, component="schedule.js"):
    """The stages on a time axis."""


class SchedulePanel:
    """The stages of a page, of which one is chosen."""

    def __init__(self, page: Page) -> None:
        self.page = page
        self.chosen = 0

    @ui.refreshable_method
    def stages(self) -> None:
        """The blocks, and the numbers of the chosen one."""
        fields, n = self.page.fields, len(self._stage_tables())
        self.blocks = StageBlocks().classes("w-full")
        self.blocks.on("stretched", self.stretched).on("reordered", self.reordered).on("chosen", self.choose)
        self.update()
        with ui.row().classes("items-end"):
            if not n:
                fields.numbers("drive[0]", "frequency_hz", "voltage_vpp", "amplitude_um")
                ui.button("Gather, then throw apart", on_click=self.make).props("dense no-caps")
                return
            self.chosen = min(self.chosen, n - 1)
            fields.number("schedule.cycles")
            fields.numbers(f"schedule.stage[{self.chosen}]", *NUMBERS, "pick.clearance_mm")
            fields.remover(f"schedule.stage[{self.chosen}]")
            ui.button("Add a stage", on_click=self.add).props("dense flat no-caps")

    def _stage_tables(self) -> list[dict[str, Any]]:
        return self.page.draft.tables("schedule.stage")

    def update(self) -> None:
        """Show the stages of the draft."""
        number = self.page.draft.number
        self.blocks.props["stages"] = [
            {
                "name": str(stage.get("name", "")),
                "duration": float(number(f"schedule.stage[{i}].duration_s") or 1.0),
                "pause": float(number(f"schedule.stage[{i}].pause_s") or 0.0),
            }
            for i, stage in enumerate(self._stage_tables())
        ]
        self.blocks.update()

    def choose(self, event: events.GenericEventArguments) -> None:
        """Show the numbers of another stage."""
        self.chosen = int(event.args["index"])
        self._refresh()

    def _refresh(self) -> None:
        inputs = self.page.fields.inputs
        for key in [key for key in inputs if key.startswith("schedule.")]:
            del inputs[key]
        self.stages.refresh()

    async def stretched(self, event: events.GenericEventArguments) -> None:
        """A stage lasts longer or shorter."""
        key = f"schedule.stage[{int(event.args['index'])}].duration_s"
        await self.page.step(lambda: self.page.draft.change(key, float(event.args["duration"])))

    async def reordered(self, event: events.GenericEventArguments) -> None:
        """A stage comes earlier or later."""
        stages = self._stage_tables()
        stages.insert(int(event.args["to"]), stages.pop(int(event.args["index"])))
        await self.page.step(lambda: self._write(stages))
        self._refresh()

    def _write(self, stages: list[dict[str, Any]]) -> None:
        """Write all stages, each as a table of its own."""
        self.page.draft.change("schedule.stage", None)
        for stage in stages:
            self.page.draft.add("schedule.stage", stage)

    async def add(self) -> None:
        """A stage with the frequency and voltage of the page."""
        modes = self.page.modes
        drive = [modes.drive(modes.frequency, modes.names)]
        stage = {"name": f"stage_{len(self._stage_tables()) + 1}", "drive": drive, "duration_s": 1.0}
        await self.page.step(lambda: self.page.draft.add("schedule.stage", stage))

    async def make(self) -> None:
        """Two stages by the best pair of modes, with a pick after the second, in place of the drive."""
        pair, draft, modes = self.page.modes.best_pair(), self.page.draft, self.page.modes
        if pair is None:
            ui.notify("no mode moves enough of the plate at this voltage", type="warning")
            return

        def write() -> None:
            draft.change("drive", None)
            draft.change("run.duration_s", None)
            draft.change("schedule", {"cycles": CYCLES})
            for name, mode, lasts in (("gather", pair.gather, GATHER_S), ("separate", pair.throw, THROW_S)):
                drive = [modes.drive(mode.frequency, [mode.actuator])]
                stage: dict[str, Any] = {"name": name, "drive": drive, "duration_s": lasts}
                if name == "separate":
                    stage |= {"pause_s": PAUSE_S, "pick": {"clearance_mm": CLEARANCE_MM}}
                draft.add("schedule.stage", stage)

        await self.page.step(write)
