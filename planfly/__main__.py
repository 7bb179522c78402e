"""``python -m planfly``."""

import sys

from planfly.cli import main

sys.exit(main())
