"""A scenery as one HTML page that plays anywhere, offline, by viser and its player: plate, parts and lines in 3D.

It shows what the replay for the viewer shows in its scene, with fewer frames, so that the page can be mailed.
"""

from __future__ import annotations

import contextlib
import io
import pickle
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from feeder_sim.records.recording import Recording
from feeder_sim.replay.build import scenery_of
from feeder_sim.replay.colours import Colour
from feeder_sim.replay.layout import BACKGROUND, FIELD_OF_VIEW, framing
from feeder_sim.replay.scenery import TIMELINE, Cuboid, Entry, Item, Lines, Mesh, Parts, Scenery, Texts
from feeder_sim.replay.seed_view import SeedView

PLACE, TURN = 200.0, 256.0  # steps of a place over 1 mm, and of a component of an attitude over 1, that are kept
SPAN = 2.0  # of what is shown, in the units of the page: its player moves and clips for scenes of about this size
ASPECT = 1.5  # width over height of the page
WIDTHS = {"paths": 0.4, "plate": 2.0, "outlets": 2.0, "picked": 2.5}  # of lines [pixels], by the begin of their path
MOST_POINTS = 1500  # of a line
GAMMA = 2.2  # by which the player takes the colours of instances for others

Change = tuple[float, Callable[[], None]]  # what is done at a time [s]


def replay_page(recording: Recording, seed: int = 0, *, colour: Colour | None = None) -> str:
    """The page that shows a seed, as HTML.

    Args:
        recording: of the run.
        seed: index of the seed.
        colour: what the colours of parts stand for; see `default_colour`.

    Raises:
        InputError: there is no such seed, or nothing of it.
    """
    scenery = scenery_of(SeedView(recording, seed, colour), coarse=True)
    with _server() as server:
        return _Page(server, scenery).played(scenery)


@contextlib.contextmanager
def _server() -> Iterator[Any]:
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

    def __init__(self, server: Any, scenery: Scenery) -> None:
        self.server, self.scene = server, server.scene
        self.scale = SPAN / float((scenery.box.high - scenery.box.low).max())  # units of the page in 1 mm
        self.still: dict[str, Any] = {}  # what is always at a path, or is the same in all that is there in time
        self.nodes: dict[str, dict[bytes, Any]] = {}  # of viser's, by path and content; one of each path is visible

    def played(self, scenery: Scenery) -> str:
        """The page, with everything at its time."""
        recorder = self.server.get_scene_serializer()
        self._light()
        eye, camera = framing(scenery.box.framed(), ASPECT), self.server.initial_camera
        camera.position, camera.look_at = eye.position * self.scale, eye.target * self.scale
        camera.fov = FIELD_OF_VIEW
        changes = [change for entry in scenery.entries for change in self._changes(entry)]
        now = 0.0
        for time, change in sorted(changes, key=lambda entry: entry[0]):
            if time > now:
                recorder.insert_sleep(time - now)
                now = time
            change()
        return str(recorder.as_html(dark_mode=True))

    def _light(self) -> None:
        self.scene.set_background_image(np.full((2, 2, 3), BACKGROUND, np.uint8), format="png")
        self.scene.set_up_direction("+z")
        self.scene.configure_default_lights(False)
        self.scene.add_light_ambient("/lights/around", intensity=0.9)
        self.scene.add_light_directional("/lights/sun", intensity=1.6, position=(-1.0, -1.2, 2.5))

    def _changes(self, entry: Entry) -> Iterator[Change]:
        """What an entry changes; what comes again at a path is one node, which is shown or hidden."""
        path, item, times = entry
        if not times:
            self.still[path] = item
            self._node(f"/{path}", path, item)
        elif isinstance(item, Parts):
            yield from self._parts(f"/{path}", item, times[TIMELINE])
        elif TIMELINE in times:  # there is no slow motion
            nodes, content = self.nodes.setdefault(path, {}), pickle.dumps(item)
            if content not in nodes:
                nodes[content] = self._node(f"/{path}_{len(nodes)}", path, item, visible=False)
            yield times[TIMELINE], partial(self._show, nodes, nodes[content])

    def _show(self, nodes: dict[bytes, Any], node: Any) -> None:
        """Show a node, and hide the one that was shown in its place."""
        for other in nodes.values():
            if other is not None and other is not node and other.visible:
                other.visible = False
        if node is not None:
            node.visible = True

    def _node(self, name: str, path: str, item: Item, *, visible: bool = True) -> Any:
        """What viser shows of an item; None where that needs what comes in time."""
        match item:
            case Cuboid():
                sides, place = (tuple(np.asarray(v) * self.scale) for v in (item.sides, item.centre))
                return self.scene.add_box(name, color=item.colour, dimensions=sides, position=place)
            case Mesh(colour=colour) if colour is not None:
                corners, faces = self._units(item.vertices), item.triangles.astype(np.uint32)
                return self.scene.add_mesh_simple(name, corners, faces, color=colour, side="double")
            case Mesh(pixels=pixels) if pixels is not None:
                return self._textured(name, self.still[path], pixels)
            case Texts(texts=texts) if texts is not None:
                place = tuple(self.still[path].places[0] * self.scale)
                return self.scene.add_label(name, texts[0].replace("\n", "; "), position=place, visible=visible)
            case Lines():
                width = WIDTHS[path.split("/")[0]]
                rows = [np.unique(np.linspace(0, len(s) - 1, MOST_POINTS).round().astype(int)) for s in item.strips]
                strips = [strip[points] for strip, points in zip(item.strips, rows, strict=True)]
                pieces = [np.stack([strip[:-1], strip[1:]], axis=1) for strip in strips]
                segments = self._units(np.concatenate([np.zeros((0, 2, 3)), *pieces]))
                return self.scene.add_line_segments(
                    name, segments, item.colour, thickness=width, thickness_units="screen", visible=visible
                )
        return None

    def _textured(self, name: str, mesh: Mesh, pixels: NDArray[np.uint8]) -> Any:
        """A mesh with pixels that glow, so that no light changes them."""
        import trimesh
        from PIL import Image
        from trimesh.visual import TextureVisuals
        from trimesh.visual.material import PBRMaterial

        glowing = PBRMaterial(
            emissiveTexture=Image.fromarray(np.ascontiguousarray(pixels)),
            emissiveFactor=[1.0, 1.0, 1.0],
            baseColorFactor=[0, 0, 0, 255],
            metallicFactor=0.0,
        )
        visual = TextureVisuals(uv=mesh.uv, material=glowing)
        solid = trimesh.Trimesh(self._units(mesh.vertices), mesh.triangles, visual=visual, process=False)
        return self.scene.add_mesh_trimesh(name, solid, visible=False, cast_shadow=False, receive_shadow=False)

    def _parts(self, name: str, parts: Parts, times: NDArray[np.float64]) -> Iterator[Change]:
        """Parts as instances of one mesh, in every frame."""
        there = parts.present[..., None]
        place = np.where(there, np.nan_to_num(parts.position), 0.0)
        turn = np.where(there, parts.quaternion, [1.0, 0.0, 0.0, 0.0])
        linear = np.round(255.0 * (np.array(parts.palette) / 255.0) ** GAMMA).astype(np.uint8)
        rows: dict[str, Any] = {
            "batched_positions": (np.round(place * PLACE) * (self.scale / PLACE)).astype(np.float32),
            "batched_wxyzs": (np.round(turn * TURN) / TURN).astype(np.float32),
            "batched_scales": parts.present.astype(np.float32),
            "batched_colors": linear[parts.colour],
        }
        node = self.scene.add_batched_meshes_simple(
            name,
            self._units(parts.mesh.vertices),
            parts.mesh.triangles.astype(np.uint32),
            **{key: values[0] for key, values in rows.items()},
            flat_shading=True,
            lod="off",
        )

        def change(row: int) -> None:
            for key, values in rows.items():
                if row and (values[row] != values[row - 1]).any():
                    setattr(node, key, values[row])

        for row, time in enumerate(times):
            yield float(time), partial(change, row)

    def _units(self, places: ArrayLike) -> NDArray[np.float32]:
        """Places [mm] in the units of the page."""
        return np.asarray(np.asarray(places) * self.scale, np.float32)
