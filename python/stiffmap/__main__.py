"""``python -m stiffmap`` is the command ``stiffmap``."""

import sys

from stiffmap.ui.cli import main

sys.exit(main())
