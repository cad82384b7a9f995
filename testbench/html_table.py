"""Short tables as HTML, for notebooks."""

from collections.abc import Iterable, Sequence
from html import escape


def html_table(headings: Sequence[str], rows: Iterable[Sequence[object]], above: Sequence[str] = ()) -> str:
    """A table as HTML, all text escaped. above: sentences that stand before it, a paragraph each."""
    paragraphs = "".join(f"<p>{escape(sentence)}</p>" for sentence in above)
    head = "".join(f"<th>{escape(heading)}</th>" for heading in headings)
    body = "".join(f"<tr>{''.join(f'<td>{escape(_text(cell))}</td>' for cell in row)}</tr>" for row in rows)
    return f"{paragraphs}<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def _text(cell: object) -> str:
    """A number to three digits, anything else as it is."""
    return f"{cell:.3g}" if isinstance(cell, float) else str(cell)
