"""What people type in Python that is of the wrong kind: a sentence with the right kind,
never Python's own words.

No tolerances: words only. `files.to_json` is internal.
"""

import json
import pickle
from fractions import Fraction

import msgspec
import mujoco
import numpy as np
import pytest

import beamchain as bc
from beamchain.files import to_json

STEEL = bc.Material(youngs_modulus=2.06e11, density=7800.0)
BAY = bc.Segment(length=5.0, section=bc.Round(diameter=0.02), material=STEEL)
ROD = bc.Beam(segments=[BAY])
CRAFT = """<mujoco><worldbody><body name="hub"><freejoint/><geom size=".5" mass="50"/>
<site name="mount"/></body>
</worldbody></mujoco>"""


def test_whole_numbers_of_numpy_are_whole_numbers():
    assert bc.fit(ROD, modes={"xy": np.int64(2)}).target["xy"].modes == 2


def typed(n, seq):
    """A spec whose numbers are of kind `n` and whose lists are of kind `seq`."""
    steel = bc.Material(youngs_modulus=n(2.0**37), density=n(8000), poissons_ratio=n(0.25))
    tube = bc.Tube(outer_diameter=n(0.0625), wall=n(0.001953125))
    truss = bc.Equivalent(
        bending_stiffness_xy=n(8000), bending_stiffness_xz=n(8000), linear_mass=n(0.5)
    )
    return bc.Spec(
        name="rod",
        segment=seq(
            [
                bc.Segment(length=n(2), section=tube, material=steel),
                bc.Segment(length=n(3), section=truss),
            ]
        ),
        joint=seq(
            [bc.Joint(after_segment=int(n(1)) if n is float else np.int64(1), stiffness_xy=n(512))]
        ),
        lump=seq([bc.Lump(x=n(4), mass=n(1), inertia=seq([n(0.125), n(0.125), n(0.125)]))]),
        damping=bc.Damping(ratio={"xy": seq([n(0.0078125), n(0.00390625)])}),
        root=bc.spec.Root(
            target="hub",
            hub=bc.Hub(
                mass=n(100), inertia=seq([n(9), n(9), n(9)]), offset=seq([n(1), n(0), n(0)])
            ),
        ),
        scene=bc.Scene(tolerance=n(0.0625), timestep=n(0.0078125)),
        modes=bc.Modes(xy=2 if n is float else np.int32(2)),
    )


@pytest.mark.parametrize("kind", [np.float32, Fraction])
def test_numbers_of_any_kind_are_pythons_own(kind):
    plain = typed(float, tuple)
    other = typed(kind, list)
    assert other == plain
    assert hash(other.segment) == hash(plain.segment)
    assert msgspec.json.decode(msgspec.json.encode(other), type=bc.Spec) == plain


@pytest.mark.slow
def test_numbers_of_any_kind_are_written(tmp_path):
    plain, other = typed(float, tuple), typed(Fraction, list)
    record = json.loads(to_json(bc.fit(other).as_dict()))
    assert record["ports"]["xy"]["target"]["damping"] == [0.0078125, 0.00390625]
    bc.embed(CRAFT, {"mount": other}).write(tmp_path / "craft.xml")
    assert bc.embed(tmp_path / "craft.xml", {"mount": plain}).appendages[0].spec == plain


def test_arrays_stand_for_lists():
    assert bc.Lump(x=1.0, mass=2.0, inertia=np.ones(3)) == bc.Lump(
        x=1.0, mass=2.0, inertia=(1.0, 1.0, 1.0)
    )
    assert bc.Hub(mass=1.0, inertia=np.ones(3), apparent=np.eye(6)).apparent[0] == (
        1.0,
        0.0,
        0.0,
        0.0,
        0.0,
        0.0,
    )
    options = bc.spec.FitOptions(cuts=np.array([1.0, 2.0]))
    assert options == bc.spec.FitOptions(cuts=(1.0, 2.0))
    assert hash(options)


def test_attaching_twice_is_said():
    craft = mujoco.MjSpec.from_string(CRAFT)
    fit = bc.fit(ROD, name="rod")
    fit.attach(craft, "mount")
    with pytest.raises(bc.BeamchainError, match="'rod'"):
        fit.attach(craft, "mount")
    assert craft.compile().nbody == 2 + len(fit.chain.links)


def test_a_fit_goes_to_another_process():
    fit = bc.fit(ROD, modes={"xy": 2}, damping=bc.Damping(ratio=0.01))
    again = pickle.loads(pickle.dumps(fit))
    assert again.to_mjcf() == fit.to_mjcf()
    assert again.status == fit.status
    assert [row._asdict() for row in again.modes] == [row._asdict() for row in fit.modes]


def test_numbers_where_numbers_do():
    spec = bc.Spec(segment=ROD.segments).replace(modes=1, damping=0.01, target="free", name="short")
    assert (spec.kept, spec.damping.ratio) == ({"xy": 1, "xz": 1}, 0.01)
    assert (spec.root.target, spec.name) == ("free", "short")
    made = bc.fit(ROD, modes=1, damping=0.01)
    assert [(row.port, row.number) for row in made.modes] == [("xy", 1), ("xz", 1)]
    assert [row.damping_ratio for row in made.modes] == pytest.approx([0.01, 0.01], rel=1e-6)
