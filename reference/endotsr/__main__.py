"""`python -m endotsr` is the command `endotsr`."""

import sys

from endotsr.cli.main import main

sys.exit(main())
