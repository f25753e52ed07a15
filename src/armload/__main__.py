"""`python -m armload` is `armload`."""

import sys

from armload.app.cli import main

sys.exit(main())
