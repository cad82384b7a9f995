"""The command line: ``testbench run | excite | simulate | identify | compare | diagnose | ...``.

Exit codes: 0 done, 2 bad input (one line on stderr), 1 a fault of ours. What a command needs is
imported when it is called, so that ``--help`` answers at once. The commands are in ``commands/``.
"""

import atexit
import gc
import sys
from collections.abc import Sequence
from importlib.metadata import version

from cyclopts import (
    App,
    CoercionError,
    CycloptsError,
    MissingArgumentError,
    UnknownCommandError,
    UnknownOptionError,
)

from identification.errors import InputError

from .commands import blind, effects, study
from .commands.check import check
from .commands.comparison import compare, list_names, view
from .commands.diagnosis import diagnose, loop, predict
from .commands.identification import excite, identify, run, simulate

app = App(
    name="testbench",
    help="Why does the simulator disagree with the robot? Identify an arm from its logs, and see.",
    version=version("identification-testbench"),
    version_flags=["--version"],
    # An interrupt is told of in ``main``.
    suppress_keyboard_interrupt=False,
)

for command in (run, excite, simulate, check, identify, diagnose, predict, loop, compare, view):
    app.command(command)
app.command(list_names, name="list")
app.command(effects.app)
app.command(blind.app)
app.command(study.app)

# What a command imports is a quarter of a million objects that stay to the end: searched for garbage as
# often as Python does by default, and once more before it ends, they take a second.
OBJECTS_PER_SEARCH = 50_000
atexit.register(gc.freeze)

# What an option wants that is not a word.
NUMBERS: dict[type | None, str] = {int: "a whole number", float: "a number"}


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the program and exit with its code."""
    gc.set_threshold(OBJECTS_PER_SEARCH)
    tokens = list(sys.argv[1:] if arguments is None else arguments)
    try:
        app(tokens, exit_on_error=False, print_error=False, result_action="return_value")
    except CycloptsError as error:
        _complain(str(_usage(error)))
    except InputError as error:
        _complain(str(error))
    except KeyboardInterrupt:
        print("testbench: interrupted; what was finished is kept", file=sys.stderr)
        sys.exit(130)


def _usage(error: CycloptsError) -> InputError:
    """A fault of the arguments in the form of every other fault."""
    if isinstance(error, UnknownCommandError):
        names = sorted(name for name in app if not name.startswith("-"))
        return InputError("testbench", "command", "a command", repr((error.unused_tokens or [""])[0]), names)
    if isinstance(error, UnknownOptionError):
        got = error.token.keyword or error.token.value
        return InputError("testbench", "option", "an option that --help shows", got)
    if isinstance(error, CoercionError) and error.token is not None:
        expected = NUMBERS.get(error.target_type, "a valid value")
        return InputError("testbench", error.token.keyword or "argument", expected, repr(error.token.value))
    if isinstance(error, MissingArgumentError) and error.argument is not None:
        return InputError("testbench", error.keyword or error.argument.name, "a value", "none")
    return InputError("testbench", "arguments", "what --help shows", str(error))


def _complain(line: str) -> None:
    print(line, file=sys.stderr)
    sys.exit(2)
