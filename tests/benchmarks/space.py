"""Prints the tables of appendages in space: how exact, where it is not, and how long it takes.

Run: .venv/bin/python tests/benchmarks/space.py
The bounds of these figures are tested in tests/test_*.py; times are printed here only.
"""

import sys
import time
import warnings
from pathlib import Path

import mujoco
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "support"))
warnings.simplefilter("error")


from appendages import seed_boom, unit_beam  # noqa: E402
from arrays import deployed_array, flat_bar, random_array, space_beam, tube  # noqa: E402
from beamchain import Beam, Lump, Modes, Scene, Spec, fit  # noqa: E402
from beamchain.fitting.options import Payload  # noqa: E402
from beamchain.structure import discretise  # noqa: E402
from readback import read, with_payload  # noqa: E402
from spinning import FLAP, spinning  # noqa: E402


def say(*words: object) -> None:
    print(*words)


def title(text: str) -> None:
    say(f"\n{text}\n{'-' * len(text)}")


def exactness() -> None:
    title("exact chains through MuJoCo: worst relative error of the kept modes")
    for name, beam, kept in (
        ("round tube", tube(), {"xy": 3, "xz": 3, "torsion": 2}),
        ("rectangle 5:1", flat_bar(), {"xy": 3, "xz": 3, "torsion": 2}),
        ("array, 2 deployment hinges", deployed_array(), {"xy": 3, "xz": 3, "torsion": 2}),
    ):
        result = fit(beam, modes=kept)
        worst = {p: max(e.frequency, e.participation) for p, e in result.readback_error.items()}
        words = ", ".join(f"{p} {v:.1e}" for p, v in worst.items())
        say(
            f"{name:28s} {words}, ports coupled by {result.measured.coupling:.0e}; "
            f"{result.status.message}"
        )


def random_arrays() -> None:
    for kept in ({"xy": 2, "xz": 2}, {"xy": 3, "xz": 3, "torsion": 2}):
        title(f"40 random arrays (seeds 0..39), modes {kept}")
        exact: list[float] = []
        links: list[float] = []
        for seed in range(40):
            result = fit(random_array(seed), modes=kept)
            if result.status.ok:
                exact.append(
                    max(max(e.frequency, e.participation) for e in result.readback_error.values())
                )
                links.append(
                    min(link.length for link in result.chain.links if link.mass > 0.0)
                    / result.chain.length
                )
        say(
            f"exact: {len(exact)} of 40 (worst error {max(exact):.1e}); shortest link "
            f"{min(links):.3f} of the length"
        )


def two_port() -> None:
    title(
        "a further port at the tip: cantilever frequencies with a payload on the exported file's "
        "tip site, relative error"
    )
    beam = seed_boom()
    mass = float(beam.rigid_mass()[0, 0])
    say(f"{'modes':>5s} {'payload / beam':>15s}   error of each frequency")
    for count in (1, 2, 3):
        spec = Spec(
            segment=beam.segments, payload=Payload(mass=5.0 * mass), modes=Modes(xy=count, xz=0)
        )
        start = time.perf_counter()
        result = fit(spec)
        seconds = time.perf_counter() - start
        for factor in (0.0, 0.05, 0.1, 0.3, 1.0, 2.0, 5.0):
            loaded = Beam(
                segments=beam.segments,
                lumps=(Lump(x=beam.length, mass=factor * mass),) if factor else (),
            )
            wanted = loaded.port("xy", 6).frequencies[:count]
            text = result.to_mjcf()
            carried = with_payload(text, "appendage_tip", factor * mass) if factor else text
            error = read(carried).frequencies[:count] / wanted - 1.0
            say(f"{count:5d} {factor:15g}   {' '.join(f'{e:+.1e}' for e in error)}")
        say(f"      {len(result.chain.links)} links, fit in {seconds:.2f} s")


def spin() -> None:
    title(
        "spinning cantilever: first frequency against Wright et al. (1982), flap / lag, relative "
        "error"
    )
    say(f"{'n':>3s} " + " ".join(f"{f'eta {eta}':>21s}" for eta in FLAP))
    for n in (1, 2, 3, 4, 5):
        result = fit(space_beam(), name="blade", modes={"xy": n, "xz": n})
        cells = []
        for eta, wanted in FLAP.items():
            flap, lag = spinning(result, eta)
            cells.append(
                f"{flap[0] / wanted[0] - 1.0:+9.3%} "
                f"/{lag[0] / np.sqrt(wanted[0] ** 2 - eta**2) - 1.0:+9.3%}"
            )
        say(f"{n:3d} " + " ".join(f"{cell:>21s}" for cell in cells))


def static() -> None:
    title(
        "static check: slow base acceleration, uniform beam, against q L^4/8EI, q L^3/6EI and the "
        "free root's turn"
    )
    c = np.array([[1.0 / 20.0, 13.0 / 360.0], [13.0 / 360.0, 11.0 / 420.0]])
    m = np.array([[1.0, 0.5], [0.5, 1.0 / 3.0]])
    root = (np.linalg.inv(m) @ c @ np.linalg.inv(m))[1, 0]
    say("  n  tip matched   tip deflection  tip rotation  root rotation")
    for n in (1, 2, 3, 5):
        for tip in (False, True) if n < 3 else (False,):
            result = fit(unit_beam(), modes={"xy": n}, scene=Scene(tip=True) if tip else None)
            port = result.chain.port("xy")
            sag = port.tip.T @ (port.participation[:, 0] / port.frequencies**2)
            own = port.participation.T @ (port.participation / port.frequencies[:, None] ** 2)
            turn = (np.linalg.inv(port.rigid_mass) @ own @ np.linalg.inv(port.rigid_mass))[1, 0]
            say(
                f"{n:3d}  {tip!s:11s}   {sag[0] * 8.0 - 1.0:+14.3%}  {sag[1] * 6.0 - 1.0:+12.3%}  "
                f"{turn / root - 1.0:+12.4%}"
            )


def tip() -> None:
    title(
        "tip displacement of each kept mode, relative error: as it comes, and with scene.tip = true"
    )
    for n in (1, 2, 3):
        for asked in (False, True):
            result = fit(tube(), modes={"xy": n}, scene=Scene(tip=True) if asked else None)
            errors = " ".join(f"{e:+.1e}" for e in result.tip_error["xy"])
            root = max(
                result.readback_error["xy"].frequency, result.readback_error["xy"].participation
            )
            say(f"n = {n}, scene.tip = {asked!s:5s}: {errors}   (root {root:.0e})")


def times() -> None:
    title("spec to verified MJCF inside the process, best of 5 [ms] (beam models not remembered)")
    for name, beam, kept in (
        ("planar boom, n = 3", seed_boom(), {"xy": 3}),
        ("round tube, 3 + 3 + 2", tube(), {"xy": 3, "xz": 3, "torsion": 2}),
        ("array, 3 + 3 + 2", deployed_array(), {"xy": 3, "xz": 3, "torsion": 2}),
    ):
        best, parts = np.inf, {}
        for _ in range(5):
            discretise.converged_model.cache_clear()
            start = time.perf_counter()
            result = fit(beam, modes=kept)
            result.to_mjcf()
            taken = time.perf_counter() - start
            if taken < best:
                best, parts = taken, result.seconds
        say(
            f"{name:24s} {best * 1e3:6.0f}   "
            + ", ".join(f"{k} {v * 1e3:.0f}" for k, v in parts.items())
        )


if __name__ == "__main__":
    say(f"MuJoCo {mujoco.__version__}, NumPy {np.__version__}")
    for table in (
        exactness,
        random_arrays,
        two_port,
        spin,
        static,
        tip,
        times,
    ):
        table()
