"""Python keeps what it has compiled of modules, in the tests and in the processes that they start.

Without it each of some twenty processes would compile all that it imports, half of the
time of an import.
"""

import os
import sys

os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False
