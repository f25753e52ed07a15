"""`python -m armload` is `armload`."""

import sys

from armload.app.cli import main

if __name__ == "__main__":
    sys.exit(main())
