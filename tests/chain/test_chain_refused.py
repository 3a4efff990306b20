"""What a chain cannot be is refused by one sentence that names what is wrong, its value and the
cure. No tolerances: sentences only."""

import numpy as np
import pytest

from appendages import unit_beam
from beamchain import Equivalent, InputError, PortModel, Segment, Spec, fit
from beamchain.chain import cut as cuts
from beamchain.chain.baselines import seed_parameters
from beamchain.chain.chain import Chain, Hinge, Link
from beamchain.chain.recursion import realise
from beamchain.chain.tendons import ModeGroup
from beamchain.errors import RealisationError
from beamchain.spec import FitOptions
from formulas import check_masses

LINK = Link(0.0, 1.0, 1.0, 0.5, (0.1, 0.1, 0.1))


def of_section(modes, **inertia):
    section = Equivalent(bending_stiffness_xy=50.0, linear_mass=1.0, **inertia)
    return fit(Spec(segment=(Segment(length=2.0, section=section),)), modes=modes)


def massless_root():
    # one point mass on a sprung massless rod: the chain would need a hinge at the root
    rigid = np.array([[1.0, 1.0], [1.0, 1.0 + 1e-3]])
    realise(PortModel(rigid, np.array([3.0]), np.array([[1.0, 1.0]])))


def next_to_nothing_at_the_root():
    heavy = np.linalg.cholesky(0.999 * unit_beam().port("xy", 2).rigid_mass).T
    modes = ModeGroup(("xy",), np.array([1.0, 2.0]), heavy, np.zeros(2))
    cuts.choose_cut(unit_beam().line, [cuts.HingeDemand(modes, {"xy": 2}, {})], ())


def springs_on_hinges(**options):
    fit(unit_beam(), modes={"xy": 2}, options=FitOptions(springs="hinges", **options))


REFUSED = {
    "no mass at the root": (massless_root, RealisationError, ("displacement", "no mass")),
    "hinges too few": (
        lambda: Chain(links=(LINK, LINK), hinges=(), length=2.0),
        RealisationError,
        ("2 links", "1 hinges", "not 0"),
    ),
    "negative stiffness": (
        lambda: Hinge(x=1.0, stiffness={"xy": -2.0}),
        RealisationError,
        ("x = 1 m", "xy = -2.0", "not be negative"),
    ),
    "unknown port": (
        lambda: Hinge(x=1.0, stiffness={"yx": 2.0}),
        ValueError,
        ("hinge.stiffness", "'yx'", "xy, xz, torsion, axial"),
    ),
    **{
        f"the paper's frequencies {pair}": (
            lambda pair=pair: seed_parameters(1.0, 1.0, *pair),
            InputError,
            ("between 0 and 1", "three links"),
        )
        for pair in ((2.0, 1.0), (1.0, 1.0), (0.0, 1.0))
    },
    "no cut": (
        next_to_nothing_at_the_root,
        RealisationError,
        ("no cut", f"tried: {cuts.MOST_ADDED})", "keep fewer modes"),
    ),
    "springs and cuts": (
        lambda: springs_on_hinges(cuts=(0.3,)),
        InputError,
        ('fit.springs = "hinges"', "not go together"),
    ),
    "too wide": (
        lambda: of_section({"xy": 2}, polar_inertia=50.0),
        RealisationError,
        ("100 kg m^2", "too wide", "fewer modes"),
    ),
    "no stiffness": (lambda: of_section({"torsion": 1}), InputError, ('port "torsion"',)),
}


@pytest.mark.parametrize("case", REFUSED)
@pytest.mark.slow
def test_what_a_chain_cannot_be_is_refused(case):
    call, kind, words = REFUSED[case]
    with pytest.raises(kind) as caught:
        call()
    said = str(caught.value)
    assert [word for word in words if word not in said] == []
    assert "\n" not in said


@pytest.mark.parametrize(("mass", "fine"), [(0.0, False), (0.9e-12, False), (1.1e-12, True)])
def test_links_beyond_the_first_have_mass(mass, fine):
    """Of 1 kg; what stands before the first hinge does not move against the root."""
    spin = (1e-3, 1e-3, 1e-3)
    links = [Link(0.0, 0.5, 0.0, 0.2, spin), Link(0.5, 0.5, mass, 0.7, spin)]
    links.append(Link(1.0, 0.5, 1.0, 1.2, spin))
    cuts = np.array([0.5, 1.0])
    if fine:
        check_masses(links, cuts)
        return
    with pytest.raises(RealisationError, match=r"link 2, from x = 0.5 m, would have no mass: .*"):
        check_masses(links, cuts)


def test_stiffness_of_a_hinge_is_not_set_later():
    with pytest.raises(TypeError):
        Hinge(x=1.0, stiffness={"xy": 2.0}).stiffness["xy"] = 3.0
