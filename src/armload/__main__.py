"""`python -m armload` is `armload`."""

import sys

from armload.cli import main

sys.exit(main())
