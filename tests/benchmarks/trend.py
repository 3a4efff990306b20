"""The first coupled frequency's error over the number of hinges, on four hubs:
the table README quotes.

Truth: the transcendental uniform beam on the hub. Every recipe has the same number of hinges in a
column. Run: python tests/benchmarks/trend.py
"""

import numpy as np

import beamchain as bc
from beamchain.chain import baselines
from beamchain.chain.chain import Chain
from beamchain.chain.recursion import planar_chain, realise
from beamchain.structure.exact import UniformBeam

HUBS = (0.1, 1.0, 10.0, 1000.0)  # hub mass over beam mass; hub inertia = hub mass x (L / 3)^2
HINGES = (1, 2, 3, 4, 5, 7)
MANY = (1, 2, 4, 8, 16, 32)


def unit_beam() -> bc.Beam:
    section = bc.Equivalent(bending_stiffness_xy=1.0, linear_mass=1.0)
    return bc.Beam(segments=(bc.Segment(length=1.0, section=section),))


def error(chain: Chain, hub: np.ndarray, truth: float) -> float:
    return float(chain.port("xy").with_hub(hub).free_frequencies[0] / truth - 1.0)


def equal_links(beam: bc.Beam, count: int, recipe: str) -> Chain:
    """Equal links; "naive": EI N/L everywhere, a hinge at the inner end of every link."""
    if recipe != "naive":
        return baselines.equal_links(beam, count, recipe)
    h = beam.length / count
    hinges = h * np.arange(count)
    stiffness = np.array([1.0 / beam.compliance(x, x + h, "xy") for x in hinges])
    return baselines.freeze_between(beam, hinges, stiffness, "xy")


def main() -> None:
    beam = unit_beam()
    full = beam.port("xy", 20)
    exact = UniformBeam(1.0, 1.0, 1.0)
    for ratio in HUBS:
        hub = np.diag([ratio, ratio / 9.0])
        truth = float(exact.coupled_frequencies(hub, 1)[0])
        print(
            f"\nhub / beam mass {ratio:g}: first coupled frequency {truth:.6f}; relative error by "
            "number of hinges"
        )
        print(f"{'':14}" + "".join(f"{n:>11}" for n in HINGES))
        for name, target in (("clamped", None), ("free", np.zeros((2, 2))), ("hub", hub)):
            cells = []
            for n in HINGES:
                reduced = full.truncated(n) if target is None else full.reduced(n, target)
                chain = planar_chain(realise(reduced), beam.line)
                cells.append(f"{error(chain, hub, truth):>+11.1e}")
            print(f"exact, {name:7}" + "".join(cells))
        for recipe in ("naive", "classical", "midpoint"):
            cells = [f"{error(equal_links(beam, n, recipe), hub, truth):>+11.1e}" for n in HINGES]
            print(f"{recipe:14}" + "".join(cells))
        for recipe in ("naive", "classical", "midpoint"):
            errors = [abs(error(equal_links(beam, n, recipe), hub, truth)) for n in MANY]
            slope = np.log2(errors[-1] / errors[-2])
            print(
                f"{recipe}: slope {slope:+.2f} between {MANY[-2]} and {MANY[-1]} hinges "
                f"({errors[-1]:.1e} there)"
            )


if __name__ == "__main__":
    main()
