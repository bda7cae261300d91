"""The command `twincal` of the wheel: the program itself."""

from __future__ import annotations

import sys


def main() -> int:
    """Runs the program with the arguments of this process.

    Returns
    -------
    int
        Its exit code.
    """
    from twincal import _twincal

    return _twincal.command(["twincal", *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
