"""``python -m greybed`` is the ``greybed`` command."""

import sys

from greybed.cli import main

sys.exit(main())
