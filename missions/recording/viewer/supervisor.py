"""Runs a viewer for no longer than the process that asked for it lives, whatever ends that: `supervisor.py COMMAND`.

It is run as a script, in a session of its own. Its standard input is a pipe to whoever asked: when that closes, the
viewer ends, and what it has started; `LEAVE_OPEN` before lets it stay.
"""

import os
import signal
import subprocess
import sys
import threading

LEAVE_OPEN = b"leave open"


def _end_with_parent() -> None:
    said = b""
    while part := os.read(0, len(LEAVE_OPEN)):  # not by sys.stdin, whose lock would hold up the end of the interpreter
        said += part
    if said != LEAVE_OPEN:
        os.killpg(0, signal.SIGKILL)


def main() -> None:
    """Run the command until it ends, or has to."""
    viewer = subprocess.Popen(sys.argv[1:], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    sys.exit(viewer.wait())


if __name__ == "__main__":
    main()
