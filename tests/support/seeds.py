"""Seeds of random tests: fixed in `make test` and `make test-full`,
another one every day in `make fuzz`."""

import datetime
import os

FIXED = 739942


def seed() -> int:
    """BEAMCHAIN_SEED where it is given; the day's number while BEAMCHAIN_FUZZ asks for more
    examples; else the fixed one."""
    if "BEAMCHAIN_SEED" in os.environ:
        return int(os.environ["BEAMCHAIN_SEED"])
    if "BEAMCHAIN_FUZZ" in os.environ:
        return datetime.datetime.now(datetime.UTC).date().toordinal()
    return FIXED
