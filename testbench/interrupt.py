"""An interrupt while the program is being loaded, before anything can catch it."""

import os
import signal
import threading
from types import FrameType

LINE = "testbench: interrupted; what was finished is kept"
CODE = 130


def _leave(number: int, frame: FrameType | None) -> None:
    os.write(2, f"{LINE}\n".encode())
    os._exit(CODE)


def while_loading() -> None:
    """End the program at once, and in one line, when it is interrupted before ``loaded`` is called."""
    is_main = threading.current_thread() is threading.main_thread()
    if is_main and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _leave)


def loaded() -> None:
    """Have an interrupt raise KeyboardInterrupt again."""
    if signal.getsignal(signal.SIGINT) is _leave:
        signal.signal(signal.SIGINT, signal.default_int_handler)


while_loading()
