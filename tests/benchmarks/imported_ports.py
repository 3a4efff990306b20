"""Whether a chain exists for an imported body that is exact at its root and at a further port:
`python tests/benchmarks/imported_ports.py`.

A boom with a body at the port, straight or with a kink and a side arm, of the tests' own finite
elements. All six motions of the port are wanted, by attachment modes, on a cut for all ports.
"""

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "support"))

import beamchain as bc
import frames
from beamchain.chain.build import cut_chain
from beamchain.chain.tendons import ModeGroup, group_motion
from beamchain.errors import BeamchainError, RealisationError
from beamchain.ports.model import PortModel
from beamchain.ports.motions import PORTS

AT = (4.0, 0.0, 0.0)
LENGTH = 4.5
POWERS = (0, 1, 2, 4)  # of x, with which mass grows from the root


def boom(kind):
    """Modes of a boom of a kind, with the motion of the port."""
    middle = (1.0, 0.0, 0.0) if kind == "straight" else (1.0, 0.0, 0.1)
    legs = [frames.tube((0.0, 0.0, 0.0), middle, 4), frames.tube(middle, AT, 6)]
    if kind != "straight":
        legs.append(frames.strip(AT, (4.5, 1.0, 0.3), 4))
    body = frames.Body(AT, 3.0, (0.1, 0.1, 0.1))
    found = frames.frame_modes(legs, [body], modes=60, tip=AT)
    return bc.ModalData(
        found.rigid, found.frequencies, found.participation, tip=found.tip, length=LENGTH
    )


def chain_of(data, modes):
    """What becomes of so many modes and the static responses of the port."""
    full = PortModel(
        data.rigid_mass,
        frequencies=data.frequencies,
        participation=data.participation,
        tip=data.tip,
    )
    wanted = full.attached(modes, range(6))
    motion = group_motion(PORTS)
    group = ModeGroup(
        tuple(PORTS),
        wanted.frequencies,
        np.hstack([wanted.participation @ motion, wanted.tip @ motion]),
        np.zeros(wanted.modes),
        weights=dict(zip(PORTS, data.shares[:modes].sum(axis=0) + 1.0, strict=True)),
        rigid=motion.T @ data.rigid_mass @ motion,
        normal=modes,
    )
    reasons = []
    for power in POWERS:
        try:
            how = cut_chain(data.line(power), [group], (), (AT[0],)).how
        except RealisationError as error:
            reasons.append(str(error))
        except BeamchainError:
            continue
        else:
            return how
    return min(reasons, key=len)


def main():
    for kind in ("straight", "kink and side arm"):
        data = boom(kind)
        for modes in (2, 4, 8):
            print(f"{kind}, {modes} modes: {chain_of(data, modes)}")


if __name__ == "__main__":
    main()
