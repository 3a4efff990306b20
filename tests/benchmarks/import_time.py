"""Time from a Nastran print to a file verified through MuJoCo, and what came back;
one line per case.

python tests/benchmarks/import_time.py [ARRAY.f06 LENGTH_UNIT MASS_UNIT]
"""

import sys
import tempfile
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "support"))

from beamchain import BeamchainError, Damping, Modes, Spec, fit
from beamchain.spec import FitOptions
from beamchain.structure.readers.imported import Imported, Units
from prints import cantilever, plate, whole


def told(label: str, spec: Spec) -> None:
    """Best of three, and the figures of the last."""
    best = float("inf")
    for _ in range(3):
        start = time.perf_counter()
        try:
            result = fit(spec)
        except BeamchainError as error:
            print(f"{label}: {error}")
            return
        best = min(best, time.perf_counter() - start)
    space = result.space
    assert space is not None
    error = space.error
    scale = np.sqrt(np.diag(space.target.rigid_mass))
    residual = np.linalg.eigvalsh(space.target.residual_mass / np.outer(scale, scale))[0]
    print(
        f"{label}: {space.target.modes} modes, {1e3 * best:.0f} ms; through MuJoCo: "
        f"frequencies {error.frequency:.1e}, participation {error.participation:.1e}, rigid mass "
        f"{error.mass_error:.1e}, in-band error in six motions {error.accelerance_in_band:.1e}; "
        f"least residual mass {residual:.1e}"
    )


def main() -> None:
    """Own prints, and one given on the command line."""
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        (place / "plate.f06").write_text(whole(plate().in_units(1e-3, 1e3)))
        (place / "cbars.f06").write_text(whole(cantilever(0.3), weight=True))
        cases = [("plate of the tests", place / "plate.f06", Units(length=1e-3, mass=1e3))]
        if len(sys.argv) > 1:
            given = Units(length=float(sys.argv[2]), mass=float(sys.argv[3]))
            cases.append((Path(sys.argv[1]).name, Path(sys.argv[1]), given))
        for label, path, units in cases:
            imported = Imported(file=str(path), units=units)
            told(label, Spec(imported=imported, damping=Damping(ratio=0.005)))
            for modes in (1, 2):
                spec = Spec(imported=imported, modes=Modes(xz=modes))
                told(f"{label}, {modes} in xz", spec)
        cbars = Imported(file=str(place / "cbars.f06"), length=1.0)
        told("two lumped CBARs", Spec(imported=cbars))
        told(
            "two lumped CBARs, a tendon per mode",
            Spec(imported=cbars, fit=FitOptions(springs="modes")),
        )


if __name__ == "__main__":
    main()
