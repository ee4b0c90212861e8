"""Configure the test processes: no screen, one thread for linear algebra in each, and default signal handling.

Commands started by tests write bytecode, and they react to Ctrl-C even if the caller of the tests ignores it, as a
shell does for background jobs.
"""

import os
import signal

if "DISPLAY" not in os.environ:
    os.environ.setdefault("MUJOCO_GL", "egl")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)  # without bytecode a command takes twice as long
for number in (signal.SIGINT, signal.SIGHUP):
    if signal.getsignal(number) is signal.SIG_IGN:
        signal.signal(number, signal.SIG_DFL)
