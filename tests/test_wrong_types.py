"""What people type in Python that is of the wrong kind: a sentence with the right kind, never Python's own words.

No tolerances: words only.
"""

import pickle

import mujoco
import numpy as np
import pytest

import beamchain as bc
from beamchain.report.record import to_json

STEEL = bc.Material(youngs_modulus=2.06e11, density=7800.0)
BAY = bc.Segment(length=5.0, section=bc.Round(diameter=0.02), material=STEEL)
ROD = bc.Beam(segments=[BAY])
CRAFT = """<mujoco><worldbody><body name="hub"><freejoint/><geom size=".5" mass="50"/><site name="mount"/></body>
</worldbody></mujoco>"""


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: bc.fit(ROD, modes=2), r'modes=\{"xy": 2\}'),
        (lambda: bc.fit(ROD, damping=0.01), r"Damping\(ratio=0.005\)"),
        (lambda: bc.fit(ROD, root="hub"), r"Root\(target="),
        (lambda: bc.fit(ROD, scene=5.0), r"Scene\(bandwidth="),
        (lambda: bc.fit(ROD, options="classical"), r"FitOptions\(method="),
        (lambda: bc.Beam(segments=BAY), r"segments=\[Segment\(\.\.\.\)\]"),
        (lambda: bc.Beam(segments=[ROD]), r"segments=\[Segment\(\.\.\.\)\]"),
        (lambda: bc.Segment(length=1.0, section="round", material=STEEL), r"Round\(diameter="),
        (
            lambda: bc.Segment(length=1.0, section=bc.Round(diameter=0.1), material="steel"),
            r"Material\(youngs_modulus=",
        ),
        (lambda: bc.Hub(mass=100.0, inertia=100.0), r"three numbers \[Ixx, Iyy, Izz\]"),
        (lambda: bc.fit(ROD).attach("craft.xml", "mount"), r"needs an mujoco\.MjSpec, not a str"),
        (lambda: bc.fit(ROD).attach(mujoco.MjModel.from_xml_string(CRAFT), "mount"), r"not a MjModel"),
        (lambda: bc.embed(CRAFT, "array.toml"), r'\{"mount": "array.toml"\}'),
    ],
)
def test_the_sentence_shows_the_right_kind(call, words):
    with pytest.raises(bc.BeamchainError, match=words):
        call()


def test_whole_numbers_of_numpy_are_whole_numbers():
    assert bc.fit(ROD, modes={"xy": np.int64(2)}).target["xy"].modes == 2


def test_attaching_twice_is_said():
    craft, fit = mujoco.MjSpec.from_string(CRAFT), bc.fit(ROD, name="rod")
    fit.attach(craft, "mount")
    with pytest.raises(bc.BeamchainError, match="already has an appendage 'rod'"):
        fit.attach(craft, "mount")
    assert craft.compile().nbody == 2 + len(fit.chain.links)


def test_a_fit_goes_to_another_process():
    fit = bc.fit(ROD, modes={"xy": 2}, damping=bc.Damping(ratio=0.01))
    again = pickle.loads(pickle.dumps(fit))
    assert again.to_mjcf() == fit.to_mjcf()
    assert to_json(again.as_dict()) == to_json(fit.as_dict())
