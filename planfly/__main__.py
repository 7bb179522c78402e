"""``python -m planfly``."""

import sys

from planfly.cli import main

if __name__ == "__main__":
    sys.exit(main())
