"""The command line in this process, without fixtures."""

import contextlib
import io
import sys

from command import main


def run(*words) -> tuple[int, str, str]:
    """Exit code, output and errors of `beamchain WORDS`."""
    out = io.StringIO()
    err = io.StringIO()
    before, code = sys.argv, 0
    sys.argv = ["beamchain", *(str(word) for word in words)]
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            main()
    except SystemExit as stop:
        code = stop.code if isinstance(stop.code, int) else int(stop.code is not None)
    finally:
        sys.argv = before
    return code, out.getvalue(), err.getvalue()
