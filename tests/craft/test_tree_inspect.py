"""What `inspect` says of an arm: who bends in every coupled mode, against strain energies of the
file's tendons in modes of matrices by hand."""

import re

import numpy as np
import pytest
from scipy.linalg import eigh

from beamchain.craft.inspect import inspect_model
from craft_truth import compiled
from examples import shipped_arm

FREQUENCY = 5e-3  # of damped modes and undamped ones
SHARE = 5e-3  # the same of shares of the strain energy


@pytest.fixture(scope="module")
def arm():
    return shipped_arm(retime=False)


def energies(model):
    """Frequencies [rad/s] and, per mode, the share of the strain energy by link and port."""
    side = compiled(model, model.qpos0)
    shift = 100.0
    values, shapes = eigh(side.mass, side.stiffness + shift * side.mass)
    squares = 1.0 / values - shift
    keep = squares > 1.0
    out = []
    for shape in shapes[:, keep].T:
        parts = {}
        for i in range(model.ntendon):
            first = model.tendon_adr[i]
            wraps = range(first, first + model.tendon_num[i])
            length = sum(
                model.wrap_prm[k] * shape[model.jnt_dofadr[model.wrap_objid[k]]] for k in wraps
            )
            match = re.match(r"(upper|fore)_\w+?_(xy|xz|torsion)$", model.tendon(i).name)
            if match and model.tendon_stiffness[i] > 0.0:
                where = match.groups()
                parts[where] = parts.get(where, 0.0) + model.tendon_stiffness[i] * length**2
        total = sum(parts.values())
        out.append({where: value / total for where, value in parts.items()})
    return np.sqrt(squares[keep]), out


@pytest.mark.slow
def test_every_coupled_mode_says_which_link_bends(arm):
    found = inspect_model(arm.model)
    frequencies, true = energies(arm.model)
    assert len(found.moving) == len(found.frequencies) == len(frequencies)
    for w, shares in zip(found.frequencies, found.moving, strict=True):
        k = int(np.argmin(np.abs(frequencies - w)))
        assert frequencies[k] == pytest.approx(w, rel=FREQUENCY)
        assert true[k].keys() <= shares.keys()
        for where, share in shares.items():
            assert true[k].get(where, 0.0) == pytest.approx(share, abs=SHARE)


@pytest.mark.slow
def test_the_words_of_a_mode_name_what_moves_at_every_pose(arm):
    for key in ("rest", "bent", "square"):
        modes = arm.modes_at(key)
        assert all("shoulder" in m.words or "forearm" in m.words for m in modes)
