"""The program `sgmds`. Ctrl-C is one line also while packages are loaded."""

import signal
import sys

CANCELLED = 130
"""Exit status of what Ctrl-C stopped: 128 and the number of the signal."""


def main() -> int:
    """Runs the command line; see `sgmds.cli`."""
    interrupts = []
    heard = signal.getsignal(signal.SIGINT)
    try:
        # Numpy makes an ImportError of an interrupt, so loading is finished first, which takes a second.
        if heard is signal.default_int_handler:
            signal.signal(signal.SIGINT, lambda *_: interrupts.append(True))
        from .cli import main as run

        signal.signal(signal.SIGINT, heard)
        if interrupts:
            raise KeyboardInterrupt
        return run()
    except KeyboardInterrupt:
        sys.stderr.write("cancelled\n")
        return CANCELLED


if __name__ == "__main__":
    sys.exit(main())
