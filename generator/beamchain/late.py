"""The lock under which modules are imported late.

Python lets a thread see a half imported module where two threads import modules that import each
other, as modules of Matplotlib, SciPy and MuJoCo do. So one thread at a time imports.
"""

from threading import RLock

importing = RLock()
