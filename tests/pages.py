"""Pages of reports as tests read them."""

from __future__ import annotations

import re
from html.parser import HTMLParser

LARGEST = 2_000_000  # bytes of a page
VOID = {"meta", "img", "br", "hr", "link", "input"}


class Checked(HTMLParser):
    """Reads a page; collects its text and tags, and refuses tags that are not closed."""

    def __init__(self, text: str) -> None:
        super().__init__(convert_charrefs=True)
        self.open: list[str] = []
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.words: list[str] = []
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if not self.open or self.open[-1] != "style":
            self.words.append(data)

    @property
    def text(self) -> str:
        return " ".join(" ".join(self.words).split())

    def all(self, tag: str) -> list[dict[str, str | None]]:
        return [attributes for name, attributes in self.tags if name == tag]


def checked(text: str) -> Checked:
    """A page that opens anywhere: nothing to load or to run, pictures embedded and described."""
    page = Checked(text)
    assert len(text.encode()) < LARGEST
    assert {tag for tag, _ in page.tags}.isdisjoint({"script", "link", "iframe", "object", "a", "form", "base"})
    for _, attributes in page.tags:
        assert not any(name.startswith("on") or name in ("href", "srcset", "action") for name in attributes)
    for image in page.all("img"):
        assert re.match(r"data:image/(png|jpeg);base64,", image["src"] or "")
        assert len(image["alt"] or "") > 20 and int(image["width"] or 0) > 100 and int(image["height"] or 0) > 50
    assert "url(" not in text and "@import" not in text and "http:" not in text and "https:" not in text
    policy = [meta["content"] for meta in page.all("meta") if meta.get("http-equiv") == "Content-Security-Policy"]
    assert policy == ["default-src 'none'; img-src data:; style-src 'unsafe-inline'"]
    assert len(page.all("h1")) == 1 and page.all("html") == [{"lang": "en"}]
    return page
