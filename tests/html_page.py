"""What tests look for in a page."""

from html.parser import HTMLParser


class Page(HTMLParser):
    """The page's sources, ids, and the rows of its tables."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.sources: list[str] = []
        self.ids: set[str] = set()
        self.rows: list[list[str]] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = dict(attrs)
        if tag in ("script", "link", "img", "iframe"):
            self.sources += [v for k in ("src", "href") if (v := values.get(k))]
        if values.get("id"):
            self.ids.add(str(values["id"]))
        if tag == "tr":
            self.rows.append([])
        if tag == "td":
            self.rows[-1].append("")

    def handle_data(self, data: str) -> None:
        if self.rows and self.rows[-1] and self.lasttag == "td":
            self.rows[-1][-1] += data.strip()
