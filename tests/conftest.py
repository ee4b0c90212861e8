"""Pictures are taken without a screen; tests run side by side, each with one thread for linear algebra.

Commands that tests start keep the bytecode that they make, and take Ctrl-C even where whoever started the tests wants
it ignored, as in the background.
"""

import os
import signal

if "DISPLAY" not in os.environ:
    os.environ.setdefault("MUJOCO_GL", "egl")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)  # a command that compiles each module anew takes twice as long
for number in (signal.SIGINT, signal.SIGHUP):
    if signal.getsignal(number) is signal.SIG_IGN:
        signal.signal(number, signal.SIG_DFL)
