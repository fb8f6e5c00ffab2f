"""What the points of a case come to: its front, its default, the fastest methods that are accurate, the failures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from feeder_sim.measures.statistic import finite_or_none
from feeder_sim.studies.chart.points import Point, fastest_within, front, is_default

WITHIN_PERCENT = 5.0  # error up to which the fastest method of a case is named


@dataclass(frozen=True)
class CaseSummary:
    """The points of a case, by what they are good for.

    Attributes:
        case, title: of the case.
        front: points that nothing beats, in order of cost.
        default: the point that the package would compute; None without one.
        fastest: the fastest point within `WITHIN_PERCENT`; None without one.
        following: the fastest such point of another simulator; None without one.
        failed: points that do not count.
    """

    case: str
    title: str
    front: tuple[Point, ...]
    default: Point | None
    fastest: Point | None
    following: Point | None
    failed: tuple[Point, ...]

    @staticmethod
    def of(case: str, title: str, points: Sequence[Point]) -> CaseSummary:
        """The summary of the points of a case; points of other cases are left out."""
        own = [p for p in points if p.case == case]
        fastest = fastest_within(own, WITHIN_PERCENT)
        others = [p for p in own if fastest is not None and _family(p) != _family(fastest)]
        return CaseSummary(
            case=case,
            title=title,
            front=tuple(front(own)),
            default=next((p for p in own if is_default(p)), None),
            fastest=fastest,
            following=fastest_within(others, WITHIN_PERCENT),
            failed=tuple(p for p in own if not p.valid),
        )

    @property
    def default_on_front(self) -> bool:
        """Whether nothing beats the default."""
        return self.default in self.front

    def cost(self, point: Point) -> float:
        """Cost of a point over that of the default; wall over simulated time where there is no default."""
        return point.wall_s_per_simulated_s / (self.default.wall_s_per_simulated_s if self.default else 1.0)

    def as_json_object(self) -> dict[str, Any]:
        """As JSON takes it."""
        default, fastest, following = self.default, self.fastest, self.following
        return {
            "case": self.case,
            "title": self.title,
            "front": [self._named(p) for p in self.front],
            "default": self._named(default) | {"on_front": self.default_on_front} if default else None,
            "within_percent": WITHIN_PERCENT,
            "fastest": self._named(fastest) if fastest else None,
            "next": self._named(following) if following else None,
            "failed": [{"method": p.method, "setting": p.setting, "failure": p.failure} for p in self.failed],
        }

    def _named(self, point: Point) -> dict[str, Any]:
        return {
            "method": point.method,
            "setting": point.setting,
            "error_percent": finite_or_none(point.error_percent),
            "cost": finite_or_none(self.cost(point)),
        }


def _family(point: Point) -> str:
    """Name of the simulator, without the variant that follows the comma."""
    return point.method.split(",")[0]
