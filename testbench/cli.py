"""The command line: ``testbench run | excite | simulate | identify | compare | diagnose | ...``.

Exit codes: 0 done, 2 bad input (one line on stderr), 1 a fault of ours. What a command needs is
imported when it is called, so that ``--help`` answers at once. The commands are in ``commands/``.
"""

# First, while what follows is being loaded.
from . import interrupt

# isort: split
import atexit
import gc
import os
import sys
import warnings
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

from . import standard_streams
from .blas import keep_blas_single
from .commands import blind, effects, study
from .commands.check import check
from .commands.comparison import compare, list_names, parity, scenarios, view
from .commands.diagnosis import diagnose, loop, predict
from .commands.identification import excite, identify, run, simulate
from .commands.recordings import import_recordings
from .containment.child import begin
from .memory import bound_memory

app = App(
    name="testbench",
    help="Why does the simulator disagree with the robot? Identify an arm from its logs, and see.",
    version=version("identification-testbench"),
    version_flags=["--version"],
    # ``main`` reports an interrupt.
    suppress_keyboard_interrupt=False,
)

for command in (
    run,
    excite,
    simulate,
    check,
    identify,
    diagnose,
    predict,
    loop,
    compare,
    parity,
    scenarios,
    view,
):
    app.command(command)
app.command(import_recordings, name="import")
app.command(list_names, name="list")
app.command(effects.app)
app.command(blind.app)
app.command(study.app)

# What a command imports is a quarter of a million objects that stay to the end: searched for garbage as
# often as Python does by default, and once more before it ends, they take a second.
OBJECTS_PER_SEARCH = 50_000
atexit.register(gc.freeze)

# What reads no logs and no models.
WITHOUT_FILES, HELP = {"list", "scenarios", "view", "--version"}, {"--help", "-h"}
# What an option wants that is not a word.
NUMBERS: dict[type | None, str] = {int: "a whole number", float: "a number"}


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the program and exit with its code."""
    keep_blas_single()
    bound_memory()
    gc.set_threshold(OBJECTS_PER_SEARCH)
    standard_streams.prepare()
    # Rerun's errors are reported in our words, in one line.
    os.environ.setdefault("RUST_LOG", "off")
    tokens = list(sys.argv[1:] if arguments is None else arguments)
    try:
        _run(tokens)
        sys.stdout.flush()
    except CycloptsError as error:
        _end(str(_usage(error)))
    except InputError as error:
        _end(str(error))
    except KeyboardInterrupt:
        _end(interrupt.LINE, interrupt.CODE)
    except BrokenPipeError:
        # Whoever read the output has seen enough; results are in files.
        standard_streams.discard_output()
    except OSError as error:
        # Full disks, folders that may not be written to: no fault of ours, wherever they are met.
        standard_streams.discard_output()
        got = error.strerror or str(error)
        _end(
            str(
                InputError("testbench", error.filename or "output", "files that can be read and written", got)
            )
        )
    except MemoryError:
        _end(
            str(
                InputError(
                    "testbench",
                    "memory",
                    "enough for these inputs",
                    "less; give shorter or fewer logs, or hold joints still (--joints with the others)",
                )
            )
        )


def _run(tokens: Sequence[str]) -> None:
    """Run a command. A warning of a library is nothing that a user can act on."""
    with warnings.catch_warnings():
        if not sys.warnoptions:
            warnings.simplefilter("ignore")
        if tokens and tokens[0] not in WITHOUT_FILES and not HELP & set(tokens):
            # It starts while this process imports what the command needs.
            begin()
        app(tokens, exit_on_error=False, print_error=False, result_action="return_value")


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


def _end(line: str, code: int = 2) -> None:
    standard_streams.say(line)
    sys.exit(code)


interrupt.loaded()
