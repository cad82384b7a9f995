"""The one error that means "the input is wrong", said in one line."""

from collections.abc import Iterable

# Characters of what was expected and of what came that a line shows.
LONGEST = 1000


class InputError(Exception):
    """Bad input, said in one line: where, which field, what was expected, what came, valid names.

    The command line prints it on stderr and exits with code 2.
    """

    def __init__(
        self,
        source: object,
        field: str,
        expected: str,
        got: object,
        choices: Iterable[str] | None = None,
    ):
        self.source = str(source)
        self.field = field
        self.expected = expected
        self.got = got
        self.choices = None if choices is None else tuple(choices)
        super().__init__(self._line())

    def __reduce__(self) -> tuple[type["InputError"], tuple[object, ...]]:
        # An exception is copied from its line alone otherwise, and a worker's complaint would be lost.
        return InputError, (self.source, self.field, self.expected, self.got, self.choices)

    def _line(self) -> str:
        line = f"{self.source}: {self.field}: expected {_short(self.expected)}, got {_short(str(self.got))}"
        if self.choices is not None:
            line += f" (valid: {', '.join(self.choices)})"
        return _printable(" ".join(line.split()))

    def located(self, source: object) -> "InputError":
        """The same complaint with the file named, for code that knows the file only at the edge."""
        return InputError(source, self.field, self.expected, self.got, self.choices)


def _short(text: str) -> str:
    """A text that a line has room for."""
    return text if len(text) <= LONGEST else f"{text[:LONGEST]}..."


def _printable(text: str) -> str:
    """A text that no terminal obeys: what is no character to print is escaped."""
    return "".join(
        character if character.isprintable() else character.encode("unicode_escape").decode()
        for character in text
    )
