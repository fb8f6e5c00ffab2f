"""The modes of the plate, what a voltage makes of them, and the motion that is shown."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from nicegui import events, ui
from numpy.typing import NDArray

from feeder_sim.plate.pairs import ModePair, mode_pairs
from feeder_sim.plate.response import frequency_response, rank_modes
from feeder_sim.scenario import Excitation, Scenario, excitations_of

if TYPE_CHECKING:
    from feeder_sim.app.page import Page

VOLTS = 60.0  # peak to peak, until somebody says another
NEAR = 0.01  # of a frequency; a drive as near as this is the one that is shown
SWEEP_POINTS = 2000  # of a response that is drawn
HEADS = {
    "mode": "mode",
    "frequency": "Hz",
    "amplitude": "amplitude (µm)",
    "hop": "hop (mm)",
    "by": "by",
    "purpose": "best pair",
}


class ModesPanel:
    """Which frequency and voltage a page shows."""

    def __init__(self, page: Page) -> None:
        self.page = page
        self.frequency, self.volts = 0.0, VOLTS
        self.names: list[str] = []  # of the patches that are driven, in phase

    def drive(self, frequency: float, names: Sequence[str]) -> dict[str, Any]:
        """A drive of these patches at this frequency, as the draft has it."""
        motion = self.page.motion
        if motion is None or not motion.mode_file.actuators:
            return {"frequency_hz": round(frequency, 2), "amplitude_um": 1.0}
        named = {"actuator": list(names)} if len(motion.mode_file.actuators) > 1 else {}
        return {"frequency_hz": round(frequency, 2), "voltage_vpp": self.volts} | named

    def begin(self, scenario: Scenario) -> None:
        """Show another plate: at the frequency of its first drive, if none was chosen."""
        drives = [drive for _, drive in excitations_of(scenario, Excitation)]
        if not self.frequency and drives:
            self.frequency, self.volts = drives[0].frequency_hz, drives[0].voltage_vpp or VOLTS
        if self.page.motion is not None:
            self.frequency = self.frequency or float(self.page.motion.oscillators.natural_frequency[0])
            patch_names = [actuator.name for actuator in self.page.motion.mode_file.actuators]
            self.names = [name for name in self.names if name in patch_names] or patch_names
        self.table.refresh()

    def best_pair(self) -> ModePair | None:
        """The modes that gather parts and throw them apart best."""
        motion = self.page.motion
        if motion is None or not motion.mode_file.actuators:
            return None
        return next(iter(mode_pairs(motion.mode_file, 0.5 * self.volts)), None)

    @ui.refreshable_method
    def table(self) -> None:
        """All modes, and the response over the frequency with a cursor."""
        motion = self.page.motion
        if motion is None:
            ui.label("No modes; below the plate stands why.")
            return
        rows = self._rows()
        low, high = math.floor(0.9 * rows[0]["frequency"]), math.ceil(1.02 * rows[-1]["frequency"])
        with ui.row().classes("w-full items-end"):
            frequency = round(self.frequency, 1)
            self.tuned = ui.number("frequency", value=frequency, on_change=lambda event: self.tune(event.value))
            self.tuned.props('dense suffix=Hz data-key="frequency"').classes("w-28")
            volts = ui.number("voltage", value=self.volts, on_change=lambda event: self.tune(None, event.value))
            volts.props('dense suffix=Vpp data-key="volts"').classes("w-28")
            if len(motion.mode_file.actuators) > 1:
                patch_names = [actuator.name for actuator in motion.mode_file.actuators]
                ui.select(patch_names, value=self.names, multiple=True, label="by", on_change=self.name).props("dense")
            ui.button("Drive with this", on_click=self.write_drive).props("dense no-caps")
        at = min(max(self.frequency, low), high)
        self.slider = ui.slider(min=low, max=high, step=0.1, value=at, on_change=lambda event: self.tune(event.value))
        self.slider.props('aria-label="frequency"')
        if motion.mode_file.actuators:
            self.chart = ui.echart(self._response(low, high)).classes("w-full h-48")
            self.chart.on_point_click(lambda event: self.tune(event.data[0]))
        columns = [
            {"name": name, "label": label, "field": name, "sortable": True, "align": "right"}
            for name, label in HEADS.items()
            if name in rows[0]
        ]
        table = ui.table(rows=rows, columns=columns, row_key="mode").props("dense virtual-scroll")
        table.classes("w-full h-64").on("rowClick", lambda event: self.tune(event.args[1]["frequency"]))

    def _rows(self) -> list[dict[str, Any]]:
        motion = self.page.motion
        assert motion is not None
        frequencies = motion.oscillators.natural_frequency.round(1).tolist()
        rows: list[dict[str, Any]] = [{"mode": j + 1, "frequency": f} for j, f in enumerate(frequencies)]
        if motion.mode_file.actuators:
            pair = self.best_pair()
            purpose = {pair.gather.mode: "gathers", pair.throw.mode: "throws apart"} if pair else {}
            for mode in rank_modes(motion.mode_file, 0.5 * self.volts, None):
                rows[mode.mode] |= {"amplitude": round(1e6 * mode.antinode, 2), "hop": round(1e3 * mode.hop_height, 2)}
                rows[mode.mode] |= {"by": mode.actuator, "purpose": purpose.get(mode.mode, "")}
        return rows

    def _response(self, low: float, high: float) -> dict[str, Any]:
        """The largest amplitude over the frequency, as a chart."""
        motion = self.page.motion
        assert motion is not None
        response = frequency_response(motion.mode_file, motion.voltages(self.volts, self.names), low=low, high=high)
        rows = np.unique(np.linspace(0, len(response.frequency) - 1, SWEEP_POINTS).astype(int))
        points = np.column_stack([response.frequency[rows].round(2), 1e6 * response.amplitude[rows]]).tolist()
        across = {"type": "value", "name": "Hz", "min": low, "max": high, "nameLocation": "middle", "nameGap": 22}
        return {
            "animation": False,
            "grid": {"left": 56, "right": 12, "top": 24, "bottom": 36},
            "tooltip": {"trigger": "axis"},
            "xAxis": across,
            "yAxis": {"type": "log", "name": "µm"},
            "series": [{"type": "line", "showSymbol": False, "data": points, "markLine": self._cursor()}],
        }

    def _cursor(self) -> dict[str, Any]:
        return {"silent": True, "symbol": "none", "label": {"show": False}, "data": [{"xAxis": self.frequency}]}

    def name(self, event: events.ValueChangeEventArguments[Any]) -> None:
        """Drive other patches."""
        self.names = list(event.value) or self.names
        self.table.refresh()
        self.show()

    def tune(self, frequency: float | None, volts: float | None = None) -> None:
        """Show the motion at another frequency [Hz] or voltage (peak to peak) [V]."""
        if volts and volts > 0.0 and volts != self.volts:
            self.volts = float(volts)
            self.table.refresh()
        if frequency and frequency > 0.0 and round(frequency, 1) != round(self.frequency, 1):
            self.frequency = float(frequency)
            self.tuned.value = self.slider.value = round(self.frequency, 1)
            if self.page.motion is not None and self.page.motion.mode_file.actuators:
                self.chart.options["series"][0]["markLine"] = self._cursor()
                self.chart.update()
        self.show()

    async def write_drive(self) -> None:
        """Write frequency and voltage into the drive, or into that of the stage that is chosen."""
        draft = self.page.draft
        key = f"schedule.stage[{self.page.schedule.chosen}].drive" if draft.tables("schedule.stage") else "drive"
        drive = self.drive(self.frequency, self.names)

        def write() -> None:
            if draft.tables(key):
                for name, value in drive.items():
                    draft.change(f"{key}[0].{name}", value)
            else:
                draft.add(key, drive)

        await self.page.step(write)

    def show(self) -> None:
        """Draw the motion at this frequency and voltage."""
        motion = self.page.motion
        if motion is None:
            return
        if motion.mode_file.actuators:
            self._draw(motion.driven(self.frequency, self.volts, self.names))
        else:
            mode = int(np.abs(motion.oscillators.natural_frequency - self.frequency).argmin())
            amplitude = motion.measured(mode, self.volts) or 1e-6 * self._drawn_um()
            self._draw(motion.of_mode(mode, amplitude))

    def _drawn_um(self) -> float:
        """The amplitude of the draft's drive at this frequency, or 1 µm."""
        drives = excitations_of(self.page.scenario, Excitation) if self.page.scenario else ()
        amplitudes = (d.amplitude_um for _, d in drives if abs(d.frequency_hz - self.frequency) < NEAR * self.frequency)
        return next((amplitude for amplitude in amplitudes if amplitude), 1.0)

    def follow(self, index: int, at: tuple[float, float], stamp: float) -> None:
        """Draw the motion with one patch at another place [m], for a drag that began at a time of the browser."""
        motion = self.page.motion
        if motion is not None and index < len(motion.mode_file.actuators):
            self._draw(motion.driven(self.frequency, self.volts, self.names, motion.moved(index, at)), stamp)

    def _draw(self, q: NDArray[np.complex128], stamp: float = 0.0) -> None:
        assert self.page.motion is not None
        field, plate = self.page.motion.field(q, self.frequency), self.page.plate
        plate.words.text = field.pop("words")
        plate.drawing.run_method("show", field | {"stamp": stamp}, plate.view.value)
