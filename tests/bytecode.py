"""Keep what Python has compiled of modules, also in the processes of tests.

Without it each of some twenty processes would compile all that it imports, half of the
time of an import.
"""

import os
import sys

os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False
