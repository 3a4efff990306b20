"""Time of 1,000 variants of a three-dimensional appendage on two cores: run by hand or by `make bench`."""

import resource
import sys
import time
from importlib.resources import files
from pathlib import Path

from beamchain.fitting.spec import read_spec
from beamchain.studies.jobs import workers
from beamchain.studies.sweep import sweep


def main(samples: int = 1000, cores: int = 2) -> None:
    spec = read_spec(Path(str(files("beamchain"))) / "examples" / "array_uncertain.toml")
    start = time.perf_counter()
    with workers(cores) as pool:
        result = sweep(spec, samples, executor=pool)
    taken = time.perf_counter() - start
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    busy = (used.ru_utime + used.ru_stime) / cores
    print(
        f"{result.indices.size} variants of {samples} samples of a 3-D array on {cores} processes: {taken:.1f} s, "
        f"of which each process computed {busy:.1f} s"
    )


if __name__ == "__main__":
    main(*(int(word) for word in sys.argv[1:]))
