"""For every test: small matrices in one thread; and `--brief`.

The shared builders in `support/` are importable from every test folder (`pythonpath` in
pyproject.toml); this folder itself, which holds `extremes/`, is on `sys.path` because pytest puts
that of the topmost conftest there.
"""

import os
from pathlib import Path

# the matrices here are small: BLAS threads of several pytest workers only get in each other's way
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

#: test functions of which a case takes more than a twentieth of a second, and files whose fixtures
#: do; `pytest --brief --durations=20` shows what has to be added
LONGER = Path(__file__).with_name("longer.txt")


def pytest_addoption(parser):
    parser.addoption("--brief", action="store_true", help="without the tests in longer.txt")


def pytest_collection_modifyitems(config, items):
    if not config.getoption("--brief"):
        return
    longer = set(LONGER.read_text(encoding="utf-8").split())

    def is_long(item):
        function = item.nodeid.partition("[")[0]
        return function in longer or function.partition("::")[0] in longer

    config.hook.pytest_deselected(items=[item for item in items if is_long(item)])
    items[:] = [item for item in items if not is_long(item)]
