"""A replay as one HTML page that plays anywhere, offline: plate, parts and nodal lines in 3D, by viser and its player.

It shows what the replay for the viewer shows in its scene, with fewer frames, so that the page can be mailed.
"""

from __future__ import annotations

import contextlib
import io
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feeder_sim.plate.drive import modal_terms
from feeder_sim.records.recording import PartRecord, Recording
from feeder_sim.records.seed import Cause
from feeder_sim.records.trajectory import Frames
from feeder_sim.replay.area import area_of, body_mesh
from feeder_sim.replay.colours import Colour, Colours, colours_of
from feeder_sim.replay.crowd import BLINK_S, RING, RING_SIZE, ring
from feeder_sim.replay.labels import plate_box, stage_texts
from feeder_sim.replay.layout import BACKGROUND, FIELD_OF_VIEW, framing
from feeder_sim.replay.parts import radius_of
from feeder_sim.replay.plate import (
    MM,
    NODE,
    NODE_HEIGHT_MM,
    PLATE_GREY,
    amplitude_fields,
    diverging,
    nodal_lines_of,
    thinned,
)
from feeder_sim.replay.replay import check_seed, is_crowd, times_of
from feeder_sim.replay.single import PATH, single_box
from feeder_sim.scenario import parse_scenario
from feeder_sim.scene.timetable import Timetable, timed

FRAMES_PER_S, MOST_FRAMES = 25.0, 500
PLACE, TURN = 200.0, 256.0  # steps of a place over 1 mm, and of a component of an attitude over 1, that are kept
COLOUR_STEP = 0.12  # of the largest amplitude; see `amplitude_fields`
SPAN = 2.0  # of what is shown, in the units of the page: its player moves and clips for scenes of about this size
ASPECT = 1.5  # width over height of the page


def replay_page(recording: Recording, shown_seed: int = 0, *, colour: Colour | None = None) -> str:
    """The page that shows a seed, as HTML.

    Args:
        recording: of the run.
        shown_seed: index of the seed.
        colour: what the colours of parts stand for; see `default_colour`.

    Raises:
        InputError: there is no such seed, or nothing of it.
    """
    check_seed(recording, shown_seed)
    with _scene() as server:
        return _Page(server, recording, shown_seed, colour).played()


@contextlib.contextmanager
def _scene() -> Iterator[Any]:
    """A server of viser's, which is what can hold a scene; nobody can reach it from another machine."""
    import viser

    with contextlib.redirect_stdout(io.StringIO()):
        server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
        try:
            yield server
        finally:
            server.stop()


class _Page:
    """A scene that is filled frame by frame."""

    def __init__(self, server: Any, recording: Recording, shown_seed: int, colour: Colour | None) -> None:
        self.server, self.scene = server, server.scene
        self.plate, self.parts = recording.plate, recording.parts
        record = recording.records[shown_seed]
        self.removals = record.removals
        self.scenario = parse_scenario(recording.scenario_text, file=recording.path)
        self.times: Timetable = times_of(recording, self.scenario, shown_seed)
        self.last = float(record.frames.time[-1])
        self.frames = _thinned(record.frames)
        self.colours: Colours = colours_of(self.scenario, colour, recording.parts)
        crowd = is_crowd(self.scenario)
        self.box = plate_box(recording.plate) if crowd else single_box(recording, shown_seed)
        self.scale = SPAN / float((self.box.high - self.box.low).max())  # units of the page in 1 mm
        self.path = None if crowd else record.frames.position[:, 0] * MM

    def played(self) -> str:
        """The page, with everything at its time."""
        recorder = self.server.get_scene_serializer()
        self._still()
        changes = [*self._surface(), *self._lines(), *self._texts(), *self._rings(), *self._parts()]
        now = 0.0
        for time, change in sorted(changes, key=lambda entry: entry[0]):
            if time > now:
                recorder.insert_sleep(time - now)
                now = time
            change()
        return str(recorder.as_html(dark_mode=True))

    def _still(self) -> None:
        """Background, camera, the body of the plate, and the path of one part."""
        self.scene.set_background_image(np.full((2, 2, 3), BACKGROUND, np.uint8), format="png")
        self.scene.set_up_direction("+z")
        self.scene.configure_default_lights(False)
        self.scene.add_light_ambient("/lights/around", intensity=0.9)
        self.scene.add_light_directional("/lights/sun", intensity=1.6, position=(-1.0, -1.2, 2.5))
        eye, camera = framing(self.box.framed(), ASPECT), self.server.initial_camera
        camera.position, camera.look_at = eye.position * self.scale, eye.target * self.scale
        camera.fov = FIELD_OF_VIEW
        # The surface is flat, so that only its edge needs corners.
        x, y = (axis[:: 4 if self.plate.outline else len(axis) - 1] for axis in (self.plate.x, self.plate.y))
        self.area = area_of(x, y, self.plate.outline)
        gap = 1e-4 * self.plate.length
        if self.plate.outline is None:
            size = np.array([self.plate.length, self.plate.width, self.plate.thickness]) * MM * self.scale
            place = (0.0, 0.0, -0.5 * size[2] - gap * MM * self.scale)
            self.scene.add_box("/plate/body", color=PLATE_GREY, dimensions=tuple(size), position=place)
        else:
            corners, faces = body_mesh(self.area, self.plate.outline, self.plate.thickness, gap)
            self.scene.add_mesh_simple(
                "/plate/body", self._units(corners), faces.astype(np.uint32), color=PLATE_GREY, side="double"
            )
        if self.path is not None and len(self.path) > 1:
            rows = np.unique(np.linspace(0, len(self.path) - 1, 1500).round().astype(int))
            self._strips("/path", [self.path[rows] / MM], PATH, 0.4)

    def _surface(self) -> Iterator[tuple[float, Any]]:
        """The surface in its colours: fields that come again are one mesh, which is shown or hidden."""
        terms = modal_terms(timed(self.plate.drives, self.times))
        grid = area_of(self.plate.x, self.plate.y, None)
        handles: dict[bytes, Any] = {}
        visible: list[Any] = []
        for time, field in amplitude_fields(self.plate, grid, terms, self.last, step=COLOUR_STEP):
            key = np.round(field / COLOUR_STEP).astype(np.int8).tobytes()
            if key not in handles:
                handles[key] = self._coloured(f"/plate/surface_{len(handles)}", diverging(field))
            yield time, self._showing(handles[key], visible)

    def _coloured(self, name: str, colours: NDArray[np.uint8]) -> Any:
        """The surface with colours (nx * ny, 4) at its grid, which glow, so that no light changes them."""
        import trimesh
        from PIL import Image
        from trimesh.visual import TextureVisuals
        from trimesh.visual.material import PBRMaterial

        x, y = self.plate.x, self.plate.y
        grid = colours[:, :3].reshape(len(x), len(y), 3)[thinned(len(x))[:, None], thinned(len(y))]
        pixels = grid.transpose(1, 0, 2)[::-1]
        of_pixels = 1.0 / np.array(pixels.shape[1::-1])
        inner = (self.area.points - [x[0], y[0]]) / [x[-1] - x[0], y[-1] - y[0]]
        glowing = PBRMaterial(
            emissiveTexture=Image.fromarray(np.ascontiguousarray(pixels)),
            emissiveFactor=[1.0, 1.0, 1.0],
            baseColorFactor=[0, 0, 0, 255],
            metallicFactor=0.0,
        )
        visual = TextureVisuals(uv=0.5 * of_pixels + inner * (1.0 - of_pixels), material=glowing)
        vertices = self._units(np.column_stack([self.area.points, np.zeros(len(self.area.points))]))
        mesh = trimesh.Trimesh(vertices, self.area.triangles, visual=visual, process=False)
        return self.scene.add_mesh_trimesh(name, mesh, visible=False, cast_shadow=False, receive_shadow=False)

    def _showing(self, handle: Any, visible: list[Any]) -> Any:
        """What shows a node, and hides the one that was shown in its place."""

        def change() -> None:
            for other in visible:
                if other is not handle:
                    other.visible = False
            visible[:] = [handle]
            handle.visible = True

        return change

    def _lines(self) -> Iterator[tuple[float, Any]]:
        """Nodal lines of the modes that a stage drives."""
        of_shapes = nodal_lines_of(self.plate)
        handles: dict[tuple[int, ...], Any] = {}
        visible: list[Any] = []
        for stage in self.times.stages:
            if stage.start > self.last:
                return
            shapes = tuple(sorted({self.plate.drives[i].shape for i in stage.excitations}))
            lines = [line for shape in shapes for line in of_shapes[shape]]
            if shapes not in handles:
                handles[shapes] = self._strips(f"/plate/lines_{len(handles)}", lines, NODE, 2.0, visible=False)
            yield stage.start, self._showing(handles[shapes], visible)

    def _texts(self) -> Iterator[tuple[float, Any]]:
        """Which stage it is, which drives act."""
        handles: dict[str, Any] = {}
        visible: list[Any] = []
        for time, text in stage_texts(self.plate, self.times, self.last):
            if text not in handles:
                handles[text] = self.scene.add_label(
                    f"/labels/{len(handles)}",
                    text.replace("\n", "; "),
                    position=tuple(self.box.stage_place * self.scale),
                    visible=False,
                )
            yield time, self._showing(handles[text], visible)

    def _rings(self) -> Iterator[tuple[float, Any]]:
        """Around the parts that are about to be picked."""
        picked = self.removals.cause == Cause.PICKED
        for number, time in enumerate(np.unique(self.removals.time[picked])):
            members = self.removals.part[picked & (self.removals.time == time)]
            row = self.frames.row_at(time - 1e-6)
            around = [
                ring(self.frames.position[row, m, :2] * MM, RING_SIZE * radius_of(self.parts[m])) / MM
                for m in members
                if np.isfinite(self.frames.position[row, m]).all()
            ]
            handle = self._strips(f"/picked_{number}", around, RING, 2.5, visible=False)
            yield max(0.0, float(time) - BLINK_S), lambda h=handle: setattr(h, "visible", True)
            yield float(time), lambda h=handle: setattr(h, "visible", False)

    def _parts(self) -> Iterator[tuple[float, Any]]:
        """Every kind of part as instances of one mesh, in every frame."""
        first = 0
        for kind, table in enumerate(self.scenario.part):
            members = list(range(first, first + table.count))
            first += table.count
            yield from self._kind(f"/parts/{kind}", self.parts[members[0]], members)

    def _kind(self, name: str, part: PartRecord, members: list[int]) -> Iterator[tuple[float, Any]]:
        is_present = self.frames.present[:, members]
        place = np.where(is_present[..., None], np.nan_to_num(self.frames.position[:, members]), 0.0)
        place = (np.round(place * (MM * PLACE)) * (self.scale / PLACE)).astype(np.float32)
        turn = np.where(is_present[..., None], self.frames.quaternion[:, members], [1.0, 0.0, 0.0, 0.0])
        turn = (np.round(turn * TURN) / TURN).astype(np.float32)
        palette = np.array([entry.colour for entry in self.colours.entries], np.uint8)
        palette = np.round(255.0 * (palette / 255.0) ** 2.2).astype(
            np.uint8
        )  # the player takes those of instances as linear
        colour = palette[self.colours.index(self.frames, members)]
        size = is_present.astype(np.float32)
        handle = self.scene.add_batched_meshes_simple(
            name,
            self._units(part.vertices),
            part.faces.astype(np.uint32),
            turn[0],
            place[0],
            batched_scales=size[0],
            batched_colors=colour[0],
            flat_shading=True,
            lod="off",
        )

        def at(row: int) -> Any:
            def change() -> None:
                for key, values in (("batched_positions", place), ("batched_wxyzs", turn)):
                    setattr(handle, key, values[row])
                for key, values in (("batched_scales", size), ("batched_colors", colour)):
                    if row and (values[row] != values[row - 1]).any():
                        setattr(handle, key, values[row])

            return change

        for row, time in enumerate(self.frames.time):
            yield float(time), at(row)

    def _strips(
        self,
        name: str,
        strips: list[NDArray[np.float64]],
        colour: tuple[int, int, int],
        width: float,
        *,
        visible: bool = True,
    ) -> Any:
        """Polylines (n, 2 or 3) [m] `width` pixels wide, just above the plate where they have no height."""
        raised = [
            np.column_stack([line[:, :2], line[:, 2] if line.shape[1] > 2 else np.full(len(line), NODE_HEIGHT_MM / MM)])
            for line in strips
        ]
        pieces = [np.stack([line[:-1], line[1:]], axis=1) for line in raised]
        segments = np.concatenate([np.zeros((0, 2, 3)), *pieces])
        return self.scene.add_line_segments(
            name, self._units(segments), colour, thickness=width, thickness_units="screen", visible=visible
        )

    def _units(self, places: NDArray[np.float64]) -> NDArray[np.float32]:
        """Places [m] in the units of the page."""
        return np.asarray(places * (MM * self.scale), np.float32)


def _thinned(frames: Frames) -> Frames:
    """Frames at even times, not more than a page needs."""
    last = float(frames.time[-1])
    count = int(min(MOST_FRAMES, FRAMES_PER_S * last + 1, len(frames)))
    rows = np.searchsorted(frames.time, np.linspace(0.0, last, max(count, 2)) - 1e-9)
    return frames[np.unique(rows.clip(0, len(frames) - 1))]
