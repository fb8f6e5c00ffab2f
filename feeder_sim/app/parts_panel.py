"""The parts: what moves, how many, and how they can lie."""

from __future__ import annotations

import base64
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from nicegui import events, run, ui

from feeder_sim.app.fields import drop, notify
from feeder_sim.errors import FeederSimError, InputError
from feeder_sim.part.stable_poses import stable_poses
from feeder_sim.plate.materials import MATERIALS
from feeder_sim.plots.poses import draw_poses
from feeder_sim.scenario import Scenario
from feeder_sim.scene.part import build_part

if TYPE_CHECKING:
    from feeder_sim.app.page import Page

RETAINED_KEYS = ("name", "count", "start", "material")  # of a part that a mesh takes the place of


class PartsPanel:
    """The parts of a page."""

    def __init__(self, page: Page) -> None:
        self.page = page

    @ui.refreshable_method
    def table(self) -> None:
        """A row for each part, a place to drop a mesh, and the poses of one."""
        for i, part in enumerate(self.page.draft.tables("part")):
            with ui.row().classes("items-end"):
                shape = f"{part.get('shape', '')} {part.get('size', '')}"
                ui.label(str(part.get("name") or part.get("file") or shape)).classes("w-32 overflow-hidden")
                self.page.fields.number(f"part[{i}].count")
                self.page.fields.choice(f"part[{i}].material", sorted(MATERIALS), "steel")
                ui.button("How it lies", on_click=lambda _, i=i: self.show_poses(i)).props("dense flat no-caps")
        drop("Drop a part (STL, OBJ, PLY)", self.dropped)
        self.poses = ui.image().classes("w-full poses")
        self.poses.visible = False

    async def dropped(self, event: events.UploadEventArguments) -> None:
        """A mesh takes the place of the first part, where it is one that can be simulated."""
        name, draft = await self.page.put_in(event), self.page.draft
        if name is None:
            return
        retained = {key: value for key in RETAINED_KEYS if (value := draft.value(f"part[0].{key}")) is not None}
        before = draft.text
        await self.page.step(lambda: draft.change("part[0]", {"shape": "mesh", "file": name} | retained))
        if not await self.show_poses(0):
            draft.write(before)
        self.page.structure = None
        await self.page.changed()
        await self.show_poses(0)

    async def show_poses(self, index: int) -> bool:
        """Draw the stable poses of a part; says whether it could be."""
        if self.page.scenario is None or self.page.problem is not None:
            notify(self.page.problem or InputError("is not checked yet", file=self.page.draft.file))
            return False
        try:
            drawn = await run.io_bound(_poses, self.page.scenario, index)
        except FeederSimError as error:
            notify(error)
            return False
        self.poses.set_source(f"data:image/png;base64,{base64.b64encode(drawn or b'').decode()}")
        self.poses.visible = True
        return True


def _poses(scenario: Scenario, index: int) -> bytes:
    """The stable poses of a part as a picture."""
    body = build_part(scenario.part[index])
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "poses.png"
        draw_poses(body, stable_poses(body).poses, path)
        return path.read_bytes()
