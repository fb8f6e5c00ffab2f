"""The plate: its picture, on which it is drawn and things are dragged, and its numbers."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from nicegui import events, ui
from numpy.typing import ArrayLike, NDArray

from feeder_sim.app.fields import drop, notify
from feeder_sim.plate.materials import MATERIALS
from feeder_sim.scenario import BendingPlate
from feeder_sim.scenario.drawing import read_drawing
from feeder_sim.scene.outlet import build_outlets
from feeder_sim.scene.outlines import outline_of
from feeder_sim.scene.plate_modes import shift_of

if TYPE_CHECKING:
    from feeder_sim.app.page import Page

PATCH = {"size_mm": [20.0, 20.0], "thickness_mm": 1.0, "d31_pm_per_v": 180.0}
FIXTURE = {"shape": "extrusion", "height_mm": 20.0}
FOOT = {"diameter_mm": 8.0, "stiffness_n_per_mm": 20.0, "loss_factor": 0.2}
TOOLS = {"move": "move", "outline": "draw outline", "actuator": "put patch", "support": "put foot"}
ON_PLATE = {
    "actuator": ("at_mm[0]", "at_mm[1]", "size_mm[0]", "size_mm[1]", "thickness_mm"),
    "support": ("at_mm[0]", "at_mm[1]", "stiffness_n_per_mm", "loss_factor"),
    "hole": ("centre_mm[0]", "centre_mm[1]", "diameter_mm"),
}
NUMBERS = ("length_mm", "width_mm", "thickness_mm", "damping_ratio", "highest_frequency_hz")
LARGEST = (180.0, 60.0)  # [mm]; of a plate whose size is nowhere to be read


class PlateCanvas(ui.element, component="plate.js"):
    """The plate, with all that can be dragged on it, and its motion."""


class PlatePanel:
    """What there is of the plate on a page."""

    def __init__(self, page: Page) -> None:
        self.page = page

    def canvas(self) -> None:
        """The picture, and what a click on it means."""
        with ui.row():
            self.tool = ui.toggle(TOOLS, value="move", on_change=self.update).props("dense no-caps")
            self.view = ui.toggle(["shape", "drift"], value="shape", on_change=self.page.modes.show)
            self.view.props("dense no-caps")
        self.drawing = PlateCanvas().classes("w-full")
        self.drawing.on("moved", self.moved).on("drawn", self.drawn).on("put", self.put)
        self.words = ui.label().classes("words")

    @ui.refreshable_method
    def numbers(self) -> None:
        """The plate in numbers."""
        fields, draft = self.page.fields, self.page.draft
        with ui.row().classes("items-end"):
            fields.numbers("plate", *NUMBERS)
            fields.choice("plate.material", sorted(MATERIALS), "aluminium")
        drop("Drop a drawing (DXF, SVG)", self.dropped)
        for kind, names in ON_PLATE.items():
            for i, table in enumerate(draft.tables(f"plate.{kind}")):
                with ui.row().classes("items-end no-wrap gap-2"):
                    name = table.get("name") or f"{'foot' if kind == 'support' else kind} {i + 1}"
                    ui.label(str(name)).classes("w-16 overflow-hidden")
                    fields.numbers(f"plate.{kind}[{i}]", *names)
                    if kind == "actuator":
                        fields.number(f"plate.{kind}[{i}].angle_deg", default=0.0)
                    fields.remover(f"plate.{kind}[{i}]")

    def described(self) -> bool:
        """Whether the draft describes the plate, so that it can be changed; that of a file is written out first."""
        scenario, draft = self.page.scenario, self.page.draft
        if scenario is None or not isinstance(scenario.plate, BendingPlate):
            ui.notify('the picture changes plates of kind "plate"; the text has all others', type="warning")
            return False
        if draft.value("plate.file") or draft.value("plate.drawing"):
            description = scenario.plate.model_dump(mode="json", exclude_unset=True, exclude_none=True)
            draft.change("plate", {key: value for key, value in description.items() if key not in ("file", "drawing")})
            ui.notify("the plate of the file is written out in the scenario now")
        return True

    def hide(self, why: str) -> None:
        """Show no motion."""
        self.words.text = why
        self.drawing.run_method("hide")

    def update(self) -> None:
        """Draw the plate as it is now."""
        scenario = self.page.scenario
        if scenario is None:
            return
        rings, things = self._plate(scenario.plate)
        for i, part in enumerate(scenario.part):
            for key in ("position_mm", "centre_mm"):
                if (at := getattr(part.start, key, None)) is not None:
                    size = getattr(part.start, "size_mm", None) or (0.0, 0.0)
                    things.append(_thing("part", i, at, size=size, label=part.name or part.label))
                    break
        length, width = np.ptp(rings[0], axis=0).tolist()
        outline, *holes = (ring.tolist() for ring in rings)
        scene = {"length": length, "width": width, "outline": outline, "holes": holes, "things": things}
        scene["fixtures"] = [ring for fixture in scenario.fixtures for ring in fixture.footprints()]
        scene["outlets"] = [(1e3 * outlet.outline).tolist() for outlet in build_outlets(scenario)]
        self.drawing.props["scene"], self.drawing.props["tool"] = scene, self.tool.value
        self.drawing.update()

    def _plate(self, plate: Any) -> tuple[list[NDArray[np.float64]], list[dict[str, Any]]]:
        """Its edges and what is on it, in the coordinates of the scenario [mm]."""
        if not isinstance(plate, BendingPlate):
            half = 0.5 * np.array([getattr(plate, key, None) or LARGEST[i] for i, key in enumerate(NUMBERS[:2])])
            if self.page.motion is not None:
                body = self.page.motion.mode_file.modes.plate
                half = 500.0 * np.array([body.length, body.width])
            return [half * [[-1, -1], [1, -1], [1, 1], [-1, 1]]], []
        shift = self._shift()
        things = [
            _thing("actuator", i, shift + a.at_mm, size=a.size_mm, angle=a.angle_deg, label=a.name)
            for i, a in enumerate(plate.actuator)
        ]
        things += [
            _thing("support", i, shift + s.at_mm, size=s.diameter_mm or 0.0) for i, s in enumerate(plate.support)
        ]
        points = plate.outline.points_mm if plate.outline else None
        things += [_thing("corner", i, shift + point) for i, point in enumerate(points or ())]
        return [1e3 * ring + shift for ring in outline_of(plate.ring, plate.hole).rings], things

    def _shift(self) -> NDArray[np.float64]:
        """From places on the plate as the draft has them to those of the scenario [mm]."""
        plate = self.page.scenario.plate if self.page.scenario else None
        return shift_of(plate.as_file(1.0)) if isinstance(plate, BendingPlate) else np.zeros(2)

    def _on_plate(self, at: ArrayLike) -> list[float]:
        """A place as the draft has it."""
        return [round(float(c), 3) for c in np.subtract(at, self._shift())]

    async def moved(self, event: events.GenericEventArguments) -> None:
        """While a thing is dragged the motion follows; when it is dropped the draft does."""
        kind, index, at = event.args["kind"], int(event.args["index"]), event.args["at"]
        draft, keys = self.page.draft, {"actuator": "actuator[{}].at_mm", "support": "support[{}].at_mm"}
        if not event.args["done"]:
            if kind == "actuator":
                self.page.modes.follow(index, (1e-3 * at[0], 1e-3 * at[1]), event.args["stamp"])
        elif kind == "part":
            start = f"part[{index}].start"
            key = f"{start}.{'centre_mm' if draft.value(f'{start}.centre_mm') is not None else 'position_mm'}"
            height = draft.numbers(key)[2:]
            await self.page.step(lambda: draft.change(key, [*at, *height]))
        elif self.described():
            key = f"plate.{keys.get(kind, 'outline.points_mm[{}]').format(index)}"
            await self.page.step(lambda: draft.change(key, self._on_plate(at)))

    async def drawn(self, event: events.GenericEventArguments) -> None:
        """A new outline; what is on the plate stays where it was."""
        if not self.described():
            return
        draft, shift = self.page.draft, self._shift()
        points = [[round(float(c), 3) for c in point] for point in event.args["points"]]

        def write() -> None:
            for kind, names in ON_PLATE.items():
                name = names[0].split("[")[0]
                for i in range(len(draft.tables(f"plate.{kind}"))):
                    key = f"plate.{kind}[{i}].{name}"
                    if len(at := draft.numbers(key)) == 2:
                        draft.change(key, [float(c) for c in shift + at])
            draft.change("plate.length_mm", None)
            draft.change("plate.width_mm", None)
            draft.change("plate.outline", {"points_mm": points})

        self.tool.value = "move"
        await self.page.step(write)

    async def put(self, event: events.GenericEventArguments) -> None:
        """A new patch or foot."""
        if not self.described():
            return
        kind, draft = event.args["tool"], self.page.draft
        entry: dict[str, Any] = {"at_mm": self._on_plate(event.args["at"])}
        if kind == "actuator":
            used_names = [table.get("name") for table in draft.tables("plate.actuator")]
            free = (f"{letter}{number}" for number in ["", *range(1, 100)] for letter in "abcdefghijklmnopqrstuvwxyz")
            entry = {"name": next(name for name in free if name not in used_names)} | entry | PATCH
        else:
            entry |= FOOT
        self.tool.value = "move"
        await self.page.step(lambda: draft.add(f"plate.{kind}", entry))

    async def dropped(self, event: events.UploadEventArguments) -> None:
        """A drawing replaces outline, holes, patches and feet, and fixtures and outlets where it has any."""
        name, draft = await self.page.put_in(event), self.page.draft
        if name is None or not self.described():
            return
        before, patch = draft.text, {"name": "a"} | PATCH | next(iter(draft.tables("plate.actuator")), {})
        without_place = {key: value for key, value in patch.items() if key not in ("at_mm", "size_mm", "angle_deg")}
        foot = {key: value for key, value in FOOT.items() if key != "diameter_mm"}

        def write() -> None:
            drawing = read_drawing(draft.file.parent / name, draft.value("plate.drawing_unit"), "plate.drawing_unit")
            for key in ("length_mm", "width_mm", "outline", "hole", "support", "actuator"):
                draft.change(f"plate.{key}", None)
            draft.change("plate.drawing", name)
            for key, drawn, table in (
                ("plate.actuator", drawing.rings["patches"], without_place),
                ("plate.support", drawing.rings["feet"] or drawing.points, foot),
                ("fixture", drawing.rings["fixtures"], FIXTURE | {"drawing": name}),
                ("outlet", drawing.rings["outlets"], {"name": "outlet", "drawing": name}),
            ):
                if drawn:
                    draft.change(key, None)
                    draft.add(key, table)

        await self.page.step(write)
        if self.page.problem is None:
            self.described()
        else:
            notify(self.page.problem)
            draft.write(before)
        await self.page.changed()


def _thing(kind: str, index: int, at: ArrayLike, **more: Any) -> dict[str, Any]:
    """A thing on the canvas."""
    x, y = np.asarray(at, float)[:2].tolist()
    return {"kind": kind, "index": index, "x": x, "y": y} | more
