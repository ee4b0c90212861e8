"""What the server that workers are forked from loads besides; nothing else does.

A worker that cannot start, because who asked for it has just ended, says nothing: whoever is left hears it of the pool.
"""

from __future__ import annotations

import sys

sys.excepthook = lambda *_: None
