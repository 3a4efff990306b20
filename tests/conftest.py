"""For every test: small matrices in one thread.

The shared builders in `support/` are importable from every test folder (`pythonpath` in
pyproject.toml); this folder itself, which holds `extremes/`, is on `sys.path` because pytest puts
that of the topmost conftest there.
"""

import os

# the matrices here are small: BLAS threads of several pytest workers only get in each other's way
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
