"""What the readers of drawings share: strokes, the account of every entity, names of layers, bounds on what is read.

Nothing is dropped in silence: an entity is taken as a stroke, ignored by a rule that the account names, or refused.
"""

from __future__ import annotations

import difflib
import functools
import math
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from feeder_sim.errors import InputError, printable, shortened

SAGITTA = 0.002  # [mm]; how far straight pieces may be from a curve
FARTHEST_MM = 1e5  # of a point from the origin, as for all lengths of a scenario
MOST_ENTITIES = 20_000  # with those that inserts repeat; plates have some hundred
MOST_POINTS = 200_000  # of all strokes together
MOST_BYTES = 4_000_000  # a larger file takes longer than anyone waits for a message
MM = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "inch": 25.4}  # units of `drawing_unit`
LAYERS = ("outline", "holes", "patches", "feet", "fixtures", "outlets")
# With a group for each of the layers, in their order.
MISSPELT = re.compile(
    r"(?:(outlines?)|(holes?)|(patch(?:es)?)|(foot|feet)|(fixtures?)|(outlets?))[\W\d_]*", re.IGNORECASE
)
ALIKE = 0.8  # as difflib counts: names this near to that of a layer are taken for misspelt
LONGEST_NAME, MOST_LETTERS = 40, 400  # of a name that may be misspelt, and of one that is looked at
ROUND = 1e-3  # sagitta over radius, at most: so that small circles have their area within 0.2 %
MOST_NAMES = 3  # of other layers, in the account

Points = NDArray[np.float64]


class Stroke(NamedTuple):
    """A line or curve as it is drawn, of straight pieces.

    Attributes:
        layer: one of `LAYERS`.
        points: of the pieces [mm], shape (n, 2); one alone is a point.
        closed: whether its last point is its first one.
        kind: `line`; `filled`, a line that closes by itself since what it encloses is painted; `fill`, paint alone.
    """

    layer: str
    points: Points
    closed: bool
    kind: Literal["line", "filled", "fill"] = "line"


class Account:
    """What became of the entities of a drawing.

    Args:
        path: of the drawing, for messages.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.strokes: Counter[str] = Counter()
        self.ignored: Counter[str] = Counter()
        self.foreign_layers: Counter[str] = Counter()
        self._entities = self._points = 0

    def refusal(self, problem: str) -> InputError:
        """An error that names the drawing."""
        return InputError(problem, file=self.path)

    def hidden(self, kind: str, layer: str) -> InputError:
        """A hidden entity in a layer that counts: nobody can say whether it is meant."""
        return self.refusal(f"has a hidden {kind} in the layer {layer}, must be what is shown: show it or delete it")

    def count(self, number: int = 1) -> None:
        """So many entities more are looked at.

        Raises:
            InputError: they are too many.
        """
        self._entities += number
        if self._entities > MOST_ENTITIES:
            raise self.refusal(f"has more than {MOST_ENTITIES} entities, must be fewer: delete what is not plate")

    def ignore(self, rule: str, number: int = 1) -> None:
        """So many entities are ignored by a rule, in the plural of what it holds for."""
        if number:
            self.ignored[rule] += number

    def ignore_layer(self, layer: str, rule: str) -> None:
        """What was taken in a layer is needed by nothing after all."""
        self.ignore(rule, self.strokes.pop(layer, 0))

    def ignore_foreign(self, layer: str) -> None:
        """The entity is on a layer that does not count.

        Raises:
            InputError: the name of the layer is all but that of one that counts.
        """
        nearest = misspelt(layer)
        if nearest is not None:
            name = shortened(layer)
            raise self.refusal(f"has lines in the layer {name!r} (did you mean {nearest!r}?), must be another name")
        self.foreign_layers[layer] += 1

    def add_stroke(
        self, layer: str, points: Points, *, closed: bool, kind: Literal["line", "filled", "fill"] = "line"
    ) -> Iterator[Stroke]:
        """The entity is taken, as a stroke; nothing of one without length.

        Raises:
            InputError: it reaches too far, or there are too many points.
        """
        self.check_reach(layer, points)
        self.check_points(len(points))
        self._points += len(points)
        if len(points):
            points = points[np.r_[True, (np.diff(points, axis=0) != 0.0).any(axis=1)]]
        if len(points) < 2:
            self.ignore("lines without length")
            return
        self.strokes[layer] += 1
        yield Stroke(layer, np.vstack([points, points[:1]]) if closed else points, closed, kind)

    def add_point(self, layer: str, point: Points) -> Stroke:
        """The entity is taken, as a point (1, 2).

        Raises:
            InputError: it is too far away.
        """
        self.check_reach(layer, point)
        self.strokes[layer] += 1
        return Stroke(layer, point, False)

    def check_points(self, number: int) -> None:
        """Refuse so many points more.

        Raises:
            InputError: they are too many.
        """
        if self._points + number > MOST_POINTS:
            raise self.refusal(f"has more than {MOST_POINTS} points on its curves, must be fewer")

    def check_reach(self, layer: str, points: Points) -> None:
        """Refuse points, or points of control, that no plate has.

        Raises:
            InputError: one is not finite or too far away.
        """
        reach = float(np.abs(points).max(initial=0.0))
        if not reach <= FARTHEST_MM:
            size = (
                f"reaches {reach:.3g} mm from its origin" if math.isfinite(reach) else "has a place that is no number"
            )
            raise self.refusal(f"{size} in the layer {layer}, must be up to {FARTHEST_MM:g} mm")

    def to_text(self) -> str:
        """The account in one line."""
        per_layer = ", ".join(f"{layer} {self.strokes[layer]}" for layer in LAYERS if self.strokes[layer])
        ignored = [f"{count} {rule}" for rule, count in self.ignored.items()]
        if self.foreign_layers:
            names = [printable(shortened(name, 24)) for name in sorted(self.foreign_layers)]
            more = f" and {len(names) - MOST_NAMES} more" if len(names) > MOST_NAMES else ""
            ignored.append(f"{self.foreign_layers.total()} in other layers ({', '.join(names[:MOST_NAMES])}{more})")
        return f"{self.path.name}: {self.strokes.total()} taken ({per_layer}), ignored {'; '.join(ignored) or 'none'}"


@functools.lru_cache(maxsize=1024)
def layer_of(name: str) -> str | None:
    """The layer that a name stands for, bound references of DXF included; None where it does not count."""
    bare = _bare(name)
    return bare if bare in LAYERS else None


@functools.lru_cache(maxsize=1024)
def misspelt(name: str) -> str | None:
    """The layer that a name is all but equal to, or begins with, as a copy of it does; None where it is another."""
    bare = _bare(name)
    begins = next((layer for layer in LAYERS if bare.startswith(layer)), None)
    if begins or len(bare) > LONGEST_NAME:
        return begins
    near = difflib.get_close_matches(bare, LAYERS, n=1, cutoff=ALIKE)
    if near:
        return near[0]
    match = MISSPELT.fullmatch(bare)
    return LAYERS[(match.lastindex or 1) - 1] if match else None


def _bare(name: str) -> str:
    """A name without what a reference to another drawing puts before it, in small letters."""
    return re.split(r"\||\$\d+\$", name[-MOST_LETTERS:])[-1].strip().lower()


def place_text(point: Sequence[float] | Points) -> str:
    """A point [mm] in words."""
    return f"({point[0]:.5g}, {point[1]:.5g}) mm"
