"""An appendage that is fitted again: what of it goes where in the craft, what is drawn of it."""

from dataclasses import dataclass
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest

import beamchain as bc
from beamchain.errors import RealisationError
from beamchain.fitting.varied import varied_fit
from formulas import Refit

ALONE = """<mujoco><worldbody><body name="hub"><freejoint/>
<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
<body name="boom_link1" pos="{x} 0.1 0"><joint name="boom_{hinge}" axis="0 0 1" pos="0.1 0 0"
stiffness="{k}" damping="{d}"/>
<inertial pos="{x} 0.2 0.3" mass="{m}" diaginertia="{m} 1.2 1.1"/>
<body name="boom_link2" pos="{x} 0.2 0"><joint name="boom_hinge2" axis="0 0 1"/>
<inertial pos="0.3 0 {x}" mass="2" diaginertia="1 1 {m}"/>
<site name="boom_tip" pos="{x} 0 0.5"/></body></body></body></worldbody><tendon>
<fixed name="boom_mode1_xy" stiffness="{k}" damping="{d}" armature="{m}">
<joint joint="boom_{hinge}" coef="{x}"/><joint joint="boom_hinge2" coef="{k}"/></fixed></tendon>
</mujoco>"""
CRAFT = """<mujoco><worldbody><body name="bus"><joint name="lock" stiffness="3" damping="4"/>
<inertial pos="0 0 0" mass="50" diaginertia="9 9 9"/><site name="place" pos="0 0 1"/>
<body name="l_link1" pos="5 6 7"><joint name="l_hinge1" axis="0 0 1"/>
<inertial pos="0 0 0" mass="9" diaginertia="9 9 9"/>
<body name="l_link2"><joint name="l_hinge2" axis="0 0 1"/>
<inertial pos="0 0 0" mass="9" diaginertia="9 9 9"/><site name="l_tip"/></body></body>
</body></worldbody><tendon><fixed name="rope" stiffness="8"><joint joint="lock" coef="2"/></fixed>
<fixed name="l_mode1_xy" stiffness="7"><joint joint="l_hinge1" coef="1"/>
<joint joint="l_hinge2" coef="1"/></fixed></tendon></mujoco>"""
NOMINAL = {"x": 0.4, "k": 30.0, "d": 0.3, "m": 1.5, "hinge": "hinge1"}
DRAWN = {"x": 0.7, "k": 20.0, "d": 0.2, "m": 1.7, "hinge": "hinge1"}
OTHER = {**DRAWN, "hinge": "joint1"}


def into(monkeypatch, drawn):
    """The craft, its appendage fitted again, which is `drawn`."""
    spec = SimpleNamespace(name="boom")
    port = SimpleNamespace(participation=np.array([[1.0, 2.0], [3.0, 4.0]]))
    chain = SimpleNamespace(tendons=(), port=lambda _: port)
    target = {"xy": SimpleNamespace(modes=1)}
    fits = {
        "nominal": SimpleNamespace(spec=spec, of=NOMINAL, chain=chain, target=target),
        "drawn": SimpleNamespace(of=drawn, chain=chain),
    }
    asked = []

    def fitted(nominal, draw):
        asked.append((nominal, draw))
        return fits["drawn"]

    monkeypatch.setattr("beamchain.variants.refit.varied_fit", fitted)
    monkeypatch.setattr(
        "beamchain.variants.refit.compiled_alone",
        lambda fit: mujoco.MjModel.from_xml_string(ALONE.format(**fit.of)),
    )
    craft = mujoco.MjModel.from_xml_string(CRAFT)
    found = Refit("l_", fits["nominal"], "l_").into(craft, [0.9])
    assert found["xy"].tolist() == [[1.0, 2.0]]
    assert asked == [(fits["nominal"], [0.9])]
    return craft


def test_what_is_drawn_goes_to_the_elements_of_its_name(monkeypatch):
    found = into(monkeypatch, DRAWN)
    x, k, d, m = (DRAWN[name] for name in "xkdm")
    first, second = found.body("l_link1"), found.body("l_link2")
    assert (first.mass[0], second.mass[0]) == (m, 2.0)
    assert first.inertia.tolist() == [m, 1.2, 1.1]
    assert second.inertia.tolist() == [1.0, 1.0, m]
    assert first.ipos.tolist() == [x, 0.2, 0.3]
    assert second.ipos.tolist() == [0.3, 0.0, x]
    # the first link stands where the craft carries it
    assert first.pos.tolist() == [5.0, 6.0, 7.0]
    assert second.pos.tolist() == [x, 0.2, 0.0]
    hinges = [found.joint(f"l_hinge{k}") for k in (1, 2)]
    assert [float(hinge.stiffness[0]) for hinge in hinges] == [k, 0.0]
    assert [float(hinge.damping[0]) for hinge in hinges] == [d, 0.0]
    assert found.site("l_tip").pos.tolist() == [x, 0.0, 0.5]
    tendon, rope = (found.tendon(name).id for name in ("l_mode1_xy", "rope"))
    for field, value, other in (("stiffness", k, 8.0), ("damping", d, 0.0), ("armature", m, 0.0)):
        values = np.ravel(getattr(found, f"tendon_{field}").T)
        assert (values[tendon], values[rope]) == (value, other)
    assert found.wrap_prm.tolist() == [2.0, x, k]
    # nothing else
    assert (found.body("bus").mass[0], found.joint("lock").damping[0]) == (50.0, 4.0)
    assert float(found.joint("lock").stiffness[0]) == 3.0
    assert found.body("bus").inertia.tolist() == [9.0, 9.0, 9.0]
    assert found.site("place").pos.tolist() == [0.0, 0.0, 1.0]


def test_a_chain_whose_hinges_have_other_names_is_refused(monkeypatch):
    with pytest.raises(RealisationError):
        into(monkeypatch, OTHER)


SECTION = bc.Equivalent(bending_stiffness_xy=2e3, linear_mass=4.0)
SPEC = bc.Spec(
    name="boom",
    segment=(bc.Segment(length=8.0, section=SECTION),),
    modes=bc.Modes(xy=1),
    root=bc.spec.Root(target="clamped"),
    uncertain=bc.spec.Uncertain(
        stiffness=bc.spec.Uncertainty(relative=0.1), density=bc.spec.Uncertainty(relative=0.05)
    ),
)


@dataclass
class Nominal:
    """What is asked of a fit."""

    spec: bc.Spec
    target: dict
    chain: object
    cut: object = None


def nominal(modes, stiffness):
    tendons = (SimpleNamespace(stiffness=0.0), SimpleNamespace(stiffness=stiffness))
    return Nominal(SPEC, {"xy": SimpleNamespace(modes=modes)}, SimpleNamespace(tendons=tendons))


def test_numbers_of_a_structure_have_the_appendage_s_prefix():
    first, second = Refit("l_", nominal(1, 0.0), "o_").quantities
    assert (first.name, second.name) == ("l_segment1.stiffness", "l_segment1.density")
    assert (first.key, first.nominal, first.index) == ("o_stiffness", 1.0, -1)


def test_a_cantilever_is_fitted_again_with_what_is_drawn():
    """Its first mode moves 0.7829915 and 0.5688256 of the root of its mass, per displacement and
    per turn and length."""
    stiff, dense = 1.07, 0.96
    sample = varied_fit(nominal(1, 0.0), [stiff, dense])
    root = np.sqrt(4.0 * 8.0 * dense)
    wanted = np.array([[0.7829915, 0.5688256 * 8.0]]) * root
    port = sample.chain.port("xy")
    assert np.abs(port.participation[:1]) == pytest.approx(wanted, rel=1e-6)
    found = port.frequencies[0]
    assert found == pytest.approx(1.8751040687**2 * np.sqrt(500.0 * stiff / dense) / 64.0, rel=1e-6)


@pytest.mark.parametrize("stiffness", [0.0, 0.05])
def test_it_is_on_tendons_where_the_nominal_one_is(stiffness, monkeypatch):
    turned = []

    def on_tendons(fit):
        turned.append(fit)
        return fit

    monkeypatch.setattr("beamchain.variants.refit.fit_on_tendons", on_tendons)
    monkeypatch.setattr("beamchain.variants.refit.varied_fit", lambda fit, _: fit)
    monkeypatch.setattr("beamchain.variants.refit.compiled_alone", lambda _: empty)
    empty = mujoco.MjModel.from_xml_string("<mujoco/>")
    fit = nominal(1, stiffness)
    fit.chain.port = lambda _: SimpleNamespace(participation=np.ones((1, 2)))
    Refit("l_", fit, "l_").into(empty, [1.0, 1.0])
    assert len(turned) == (1 if stiffness else 0)


def test_a_sample_that_holds_fewer_modes_than_the_nominal_one_is_none():
    with pytest.raises(RealisationError, match="fewer modes in xy"):
        varied_fit(nominal(2, 0.0), [1.0, 1.0])
