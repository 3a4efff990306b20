"""Coverage-guided fuzzing of every reader, where atheris installs:
`python tests/support/fuzz.py READER [SECONDS]`.

Without atheris it says so and stops with 0:
the properties of test_hostile.py have then run with many examples only.
"""

import sys
import tempfile
from pathlib import Path

SECONDS = 60


def main(name: str, seconds: int) -> None:
    """Fuzz one reader; an exception that is not ours ends it with the input that caused it."""
    try:
        import atheris
    except ImportError:
        sys.stdout.write(
            "atheris is not installed: no coverage-guided fuzzing (pip install atheris)\n"
        )
        return
    with atheris.instrument_imports(include=["beamchain"]):
        from beamchain import BeamchainError
        from hostile import READERS
    ending, good, read = READERS[name]
    folder = Path(tempfile.mkdtemp())
    (folder / "seed").mkdir()
    (folder / "seed" / "good").write_bytes(good)

    def once(content: bytes) -> None:
        path = folder / f"input.{ending}"
        path.write_bytes(content)
        try:
            read(path)
        except BeamchainError:
            return

    limits = [
        f"-max_total_time={seconds}",
        "-timeout=5",
        "-rss_limit_mb=1500",
        f"-artifact_prefix={folder}/",
    ]
    atheris.Setup([sys.argv[0], *limits, str(folder / "seed")], once)
    atheris.Fuzz()


if __name__ == "__main__":
    main(
        sys.argv[1] if len(sys.argv) > 1 else "spec",
        int(sys.argv[2]) if len(sys.argv) > 2 else SECONDS,
    )
