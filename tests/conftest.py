"""Makes `appendages`, the shared builders beside this file, importable from every test folder.

Pytest's default import mode puts the folder of the topmost conftest (this one) on `sys.path`.
"""

import os

# the matrices here are small: BLAS threads of several pytest workers only get in each other's way
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
