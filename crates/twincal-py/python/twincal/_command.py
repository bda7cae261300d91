"""The command `twincal` of the wheel: the program itself."""

from __future__ import annotations

import signal
import sys


def main() -> int:
    """Runs the program with the arguments of this process.

    Returns
    -------
    int
        Its exit code.
    """
    # Until the program listens itself, Ctrl-C ends the process without a traceback.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    from twincal import _twincal

    return _twincal.command(["twincal", *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
