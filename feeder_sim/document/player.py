"""A page within a page, which plays: it runs the scripts it was made with, no others, and loads nothing."""

from __future__ import annotations

import base64
import hashlib
import html
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

SCRIPT = re.compile(r"<script[^>]*>(.*?)</script>", re.DOTALL)
HEAD, TITLE = '<meta charset="utf-8" />', re.compile("<title>[^<]*</title>")
STILL = "default-src 'none'; img-src data:; style-src 'unsafe-inline'"  # of a page that runs no scripts
PLAYS = "default-src 'none'; img-src data: blob:; style-src 'unsafe-inline'; font-src data:; connect-src data: blob:; "
PLAYS += "worker-src blob:; script-src {} 'strict-dynamic' 'wasm-unsafe-eval'"


@dataclass(frozen=True)
class Player:
    """What makes the page that plays, when it is needed; what it shows; and its legend."""

    kind: ClassVar[str] = "player"
    make: Callable[[], str]
    title: str
    caption: str

    @cached_property
    def page(self) -> str:
        """The page, whole."""
        return self.make()

    @property
    def source(self) -> Any:
        """The page as an attribute that holds it."""
        from markupsafe import Markup

        return Markup(html.escape(self.page, quote=True))

    @property
    def scripts(self) -> tuple[str, ...]:
        """By what a policy knows the scripts of the page."""
        digests = (hashlib.sha256(script.encode()).digest() for script in SCRIPT.findall(self.page))
        return tuple(f"'sha256-{base64.b64encode(digest).decode()}'" for digest in digests)

    def alone(self) -> str:
        """The page by itself, with its policy and its title."""
        policy = f'<meta http-equiv="Content-Security-Policy" content="{policy_for([self])}">'
        title = f"<title>{html.escape(self.title)}</title>"
        return TITLE.sub(lambda _: title, self.page, count=1).replace(HEAD, HEAD + policy, 1)


def policy_for(players: Sequence[Player]) -> str:
    """The policy of a page that holds players, which pages within it inherit."""
    return PLAYS.format(" ".join(dict.fromkeys(s for player in players for s in player.scripts))) if players else STILL
