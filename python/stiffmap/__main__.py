"""``python -m stiffmap`` is the command ``stiffmap``."""

import sys

from stiffmap.cli import main

sys.exit(main())
