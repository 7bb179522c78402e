"""What the process imports that a campaign's processes are forked from, and how it ends.

Nothing else imports this module: `planfly.campaigns.worker_pool` names it to `multiprocessing`.
"""

import atexit
import os
import sys
from importlib import import_module

for _needed in ("planfly.campaigns.report", "planfly.pipeline", "scipy.stats"):
    import_module(_needed)

if "multiprocessing.forkserver" in " ".join(sys.orig_argv):
    # It ends when the campaign's own process has ended, at once instead of taking apart all that it has imported.
    # The processes that are forked from it end otherwise: they forget what was registered here.
    atexit.register(os._exit, 0)
