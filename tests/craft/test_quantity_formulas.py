"""Closed forms beside the uncertain quantities of a compiled craft, and what a draw of them writes
into its model."""

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.special import ndtri

import beamchain as bc
from beamchain.fitting.uncertain import (
    UncertainBody,
    UncertainCraft,
    UncertainJoint,
    UncertainMode,
    UncertainModes,
)
from formulas import Quantity, apply_draw, draws, inertia_matrix, quantities, score

# two modes of an arm over three hinges that stand behind a free joint, a slide and a drive
MODEL = """<mujoco><worldbody><body name="bus" pos="0.1 0.2 0.3"><freejoint/>
<inertial pos="0.3 -0.1 0.2" quat="0.9 0.2 -0.3 0.1" mass="70" diaginertia="9 7 5"/>
<site pos="1 0 0"/>
<body name="rail"><joint name="rail" type="slide" axis="1 0 0" stiffness="30" damping="2"/>
<inertial pos="0.2 0 0" mass="6" diaginertia="0.3 0.2 0.4"/>
<body name="drive"><joint name="drive" axis="0 0 1" stiffness="400" damping="0"/>
<joint name="servo" axis="0 1 0"/>
<inertial pos="0 0.1 0" mass="5" diaginertia="0.3 0.2 0.4"/>
<body name="link1"><joint name="h1" axis="0 0 1"/><inertial pos="0 0 0" mass="3"
diaginertia="1 1 1"/>
<body name="link2"><joint name="h2" axis="0 0 1"/><inertial pos="0 0 0" mass="2"
diaginertia="1 1 1"/></body></body></body></body></body></worldbody>
<tendon>
<fixed name="arm_mode1_xy" stiffness="16" damping="0.4" springlength="0.6"><joint joint="h1"
coef="0.7"/><joint joint="h2" coef="-0.3"/></fixed>
<fixed name="arm_mode1_xz" stiffness="4" damping="0.1"><joint joint="h1" coef="0.2"/>
<joint joint="h2" coef="0.5"/></fixed>
<fixed name="arm_mode2_xy" stiffness="100" damping="3"><joint joint="h1" coef="0.1"/>
<joint joint="h2" coef="0.9"/></fixed>
<fixed name="own" stiffness="7"><joint joint="drive" coef="2"/></fixed>
</tendon>
<actuator><position joint="servo" kp="50" kv="3"/></actuator></mujoco>"""
ARM = ("arm_mode1_xy", "arm_mode1_xz", "arm_mode2_xy")


def model():
    return mujoco.MjModel.from_xml_string(MODEL)


def some(size=0.1, **more):
    return bc.spec.Uncertainty(relative=size, **more)


def about(size, **more):
    return bc.spec.Uncertainty(absolute=size, **more)


def found(uncertain=None, modes=None, correlations=()):
    return quantities(model(), uncertain, modes or {}, correlations)


# -- what is uncertain -----------------------------------------------------------------------------
def test_modes_are_found_by_their_port_and_by_their_number():
    """Numbered by frequency, 2, 4 and 10 rad/s; what is said of one mode goes before."""
    own = UncertainMode(number=1, port="xy", damping=about(0.01))
    numbered = UncertainMode(number=3, frequency=some(0.02, group="g"))
    given = UncertainModes(frequency=some(0.1), damping=some(0.3, each=True), mode=(own, numbered))
    table = {q.name: q for q in found(modes={"arm_": given})}
    assert list(table) == [f"{name}.{kind}" for name in ARM for kind in ("frequency", "damping")]
    w = {"arm_mode1_xy": 4.0, "arm_mode1_xz": 2.0, "arm_mode2_xy": 10.0}
    ratio = {"arm_mode1_xy": 0.05, "arm_mode1_xz": 0.025, "arm_mode2_xy": 0.15}
    for i, (name, number) in enumerate(zip(ARM, (2, 1, 3), strict=True)):
        frequency, damping = table[f"{name}.frequency"], table[f"{name}.damping"]
        assert frequency.nominal == pytest.approx(w[name])
        assert damping.nominal == pytest.approx(ratio[name])
        assert (frequency.unit, damping.unit) == ("rad/s", "")
        assert frequency.index == damping.index == i
        assert frequency.alias == f"arm_mode{number}.frequency"
        assert (frequency.owner, frequency.kind) == (name, "frequency")
        assert frequency.of_mode(model())
    keys = [table[f"{name}.frequency"].key for name in ARM]
    assert keys == ["arm_.frequency", "arm_.frequency", "g"]
    assert table["arm_mode2_xy.frequency"].uncertainty.relative == 0.02
    assert table["arm_mode1_xy.damping"].uncertainty.absolute == 0.01
    assert [table[f"{name}.damping"].key for name in ARM] == [f"{name}.damping" for name in ARM]


def test_what_the_craft_says_of_modes_goes_before_their_own_specification():
    craft = UncertainCraft(appendage={"arm_": UncertainModes(participation=some(0.04))})
    out = found(craft, {"arm_": UncertainModes(frequency=some(0.1))})
    assert [q.name for q in out] == [f"{name}.participation" for name in ARM]
    assert [q.nominal for q in out] == [1.0] * 3


@pytest.mark.parametrize("number", [3, 4])
def test_a_mode_beyond_those_kept_is_refused(number):
    given = UncertainModes(mode=(UncertainMode(number=number, frequency=some()),))
    if number == 3:
        assert [q.name for q in found(modes={"arm_": given})] == ["arm_mode2_xy.frequency"]
        return
    with pytest.raises(bc.InputError, match="mode4.*They are the kept modes of 'arm_'"):
        found(modes={"arm_": given})


def test_quantities_of_a_body_are_in_its_axes():
    kinds = ("mass", "centre_x", "centre_y", "centre_z")
    kinds += tuple(f"inertia_{k}" for k in ("xx", "xy", "xz", "yy", "yz", "zz"))
    given = UncertainBody(**{kind: about(0.01) for kind in kinds})
    out = {q.kind: q for q in found(UncertainCraft(body={"bus": given}))}
    assert tuple(out) == kinds
    turn = Rotation.from_quat([0.2, -0.3, 0.1, 0.9]).as_matrix()
    inertia = turn @ np.diag([9.0, 7.0, 5.0]) @ turn.T
    wanted = [70.0, 0.3, -0.1, 0.2, *inertia[np.triu_indices(3)]]
    assert [out[kind].nominal for kind in kinds] == pytest.approx(wanted)
    assert [out[kind].unit for kind in kinds] == ["kg"] + ["m"] * 3 + ["kg m^2"] * 6
    assert {q.index for q in out.values()} == {1}
    assert out["mass"].name == out["mass"].key == "bus.mass"
    np.testing.assert_allclose(inertia_matrix(model(), 1), inertia, atol=1e-12)
    assert not out["mass"].of_mode(model())


def test_quantities_of_joints_have_their_units():
    given = UncertainJoint(stiffness=some(group="k"), damping=about(0.2))
    rail = found(UncertainCraft(joint={"rail": given}))
    assert [(q.name, q.unit, q.nominal, q.index) for q in rail] == [
        ("rail.stiffness", "N/m", 30.0, 1),
        ("rail.damping", "N s/m", 2.0, 1),
    ]
    assert [q.key for q in rail] == ["k", "rail.damping"]
    (drive,) = found(UncertainCraft(joint={"drive": UncertainJoint(stiffness=some())}))
    assert (drive.unit, drive.nominal, drive.index) == ("N m/rad", 400.0, 2)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"joint": {"drive": UncertainJoint(damping=some())}}, "drive.damping is 0, of which a"),
        ({"joint": {"servo": UncertainJoint(damping=about(1.0))}}, "what its servo has is not"),
        ({"joint": {"h1": UncertainJoint(stiffness=about(1.0))}}, "'h1' is a hinge of an app"),
        ({"body": {"link1": UncertainBody(mass=some())}}, "'link1' is a link of an appendage"),
        ({"body": {"world": UncertainBody(mass=some())}}, "'world' is unknown"),
        ({"joint": {"none": UncertainJoint(damping=some())}}, "'none' is unknown"),
        ({"body": {"bus": UncertainBody(centre_x=some())}}, "centre_x .* takes absolute only"),
        ({"body": {"bus": UncertainBody(inertia_xz=some())}}, "inertia_xz .* absolute only"),
        ({"body": {"rail": UncertainBody(mass=about(2.0))}}, "rail.mass = 6 kg may fall to 0 "),
        ({"joint": {"rail": UncertainJoint(stiffness=about(10.0))}}, "may fall to 0 .3 standard"),
        (
            {"joint": {"rail": UncertainJoint(damping=about(2.1, distribution="uniform"))}},
            "rail.damping = 2 N s/m may fall to -0.1 .half the width below",
        ),
    ],
)
def test_what_cannot_vary_is_said(given, said):
    with pytest.raises(bc.InputError, match=said):
        found(UncertainCraft(**given))


@pytest.mark.parametrize(
    "given",
    [
        {"body": {"rail": UncertainBody(mass=about(1.99))}},
        {"body": {"rail": UncertainBody(mass=about(5.9, distribution="uniform"))}},
        {"joint": {"rail": UncertainJoint(damping=about(2.0, distribution="uniform"))}},
        {"body": {"bus": UncertainBody(centre_y=about(5.0))}},
    ],
)
def test_what_stays_above_zero_may_vary(given):
    assert len(found(UncertainCraft(**given))) == 1


@pytest.mark.parametrize(
    ("xx", "zz", "kept"),
    [(0.28, 0.1, True), (0.32, 0.1, False), (0.1, 0.28, True), (0.1, 0.32, False)],
)
def test_principal_moments_at_the_corners_of_two_ranges(xx, zz, kept):
    """Moments 3, 4 and 6.6, in hundredths: the largest and what it grows by stay below the sum of
    the others, 7 less the reach of xx; xy turns their axes."""
    text = MODEL.replace(
        'quat="0.9 0.2 -0.3 0.1" mass="70" diaginertia="9 7 5"',
        'mass="70" diaginertia=".03 .04 .066"',
    )
    given = UncertainBody(
        inertia_xx=about(0.01 * xx, distribution="uniform"),
        inertia_xy=about(0.001, distribution="uniform"),
        inertia_zz=about(0.01 * zz, distribution="uniform"),
    )
    craft, uncertain = mujoco.MjModel.from_xml_string(text), UncertainCraft(body={"bus": given})
    if kept:
        assert len(quantities(craft, uncertain, {}, ())) == 3
    else:
        with pytest.raises(bc.InputError, match="inertia of body 'bus'"):
            quantities(craft, uncertain, {}, ())


def test_a_body_that_floats_alone_varies_in_mass_alone():
    alone = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><body name="bus"><freejoint/><inertial pos="0 0 0" mass="7" '
        'diaginertia="1 1 1"/></body></worldbody></mujoco>'
    )
    mass = UncertainCraft(body={"bus": UncertainBody(mass=some())})
    assert quantities(alone, mass, {}, ())[0].nominal == 7.0
    inertia = UncertainCraft(body={"bus": UncertainBody(inertia_xx=some(0.01))})
    with pytest.raises(bc.InputError, match="inertia_xx of body 'bus' cannot vary"):
        quantities(alone, inertia, {}, ())


# -- draws -----------------------------------------------------------------------------------------
def quantity(name, nominal, how, key="", alias="", index=0):
    return Quantity(name, "", nominal, how, index, key or name, alias)


TABLE = (
    quantity("a", 5.0, some(0.1), "shared"),
    quantity("b", -2.0, some(0.2, distribution="uniform"), "shared"),
    quantity("c", 3.0, about(0.5), alias="c2"),
    quantity("d", 7.0, about(0.3)),
)


def test_draws_are_of_seed_and_index_alone():
    """Normal by the score, cut at three deviations; uniform by its probability."""
    indices = [4, 0, 11]
    values = draws(TABLE, indices, 5, ())
    assert values.shape == (3, 4)
    for row, index in zip(values, indices, strict=True):
        shared, c = score(5, index, "shared"), score(5, index, "c")
        assert row[0] == pytest.approx(5.0 * (1.0 + 0.1 * np.clip(shared, -3.0, 3.0)))
        # u = 2 P - 1 uniform in -1 .. 1
        assert ndtri((row[1] / -2.0 - 1.0) / 0.4 + 0.5) == pytest.approx(shared)
        assert row[2] == pytest.approx(3.0 + 0.5 * np.clip(c, -3.0, 3.0))
    np.testing.assert_array_equal(draws(TABLE, [0], 5, ())[0], values[1])
    assert draws(TABLE, [], 5, ()).shape[0] == 0


def test_correlated_draws_by_name_or_other_name():
    together = bc.spec.Correlation(of=("c2", "d"), matrix=((1.0, 1.0), (1.0, 1.0)))
    values = draws(TABLE, range(20), 3, (together,))
    # fully correlated: the same score of unit size
    np.testing.assert_allclose((values[:, 2] - 3.0) / 0.5, (values[:, 3] - 7.0) / 0.3, atol=1e-12)
    alone = draws(TABLE, range(20), 3, ())
    np.testing.assert_array_equal(values[:, :2], alone[:, :2])


def correlated(*names):
    return bc.spec.Correlation(of=names, matrix=tuple(map(tuple, np.eye(len(names)))))


@pytest.mark.parametrize(
    ("correlations", "said"),
    [
        ([correlated("arm_mode1_xy.damping")], "arm_mode1_xy.damping' is unknown"),
        ([correlated("arm_mode1_xy.frequency"), correlated("arm_mode1_xy.frequency")], "two corr"),
        ([correlated("rail.stiffness")], "rail.stiffness is uniform"),
        ([correlated("rail.damping")], "rail.damping is drawn together with bus.mass"),
        ([correlated("arm_mode1_xy.frequency", "arm_mode1.frequency")], ""),
    ],
)
def test_what_cannot_be_correlated_is_said(correlations, said):
    uncertain = UncertainCraft(
        joint={
            "rail": UncertainJoint(
                stiffness=some(distribution="uniform"), damping=some(group="all")
            )
        },
        body={"bus": UncertainBody(mass=some(0.01, group="all"))},
        correlation=tuple(correlations[1:]),
    )
    modes = {"arm_": UncertainModes(frequency=some(0.1, each=True))}
    if said:
        with pytest.raises(bc.InputError, match=said):
            found(uncertain, modes, tuple(correlations[:1]))
    else:
        assert len(found(uncertain, modes, tuple(correlations[:1]))) == 6


# -- what a draw writes ----------------------------------------------------------------------------
def written(*changes):
    """The model with values of quantities `(name, index, value)`."""
    out = model()
    uncertain = [quantity(name, 1.0, some(), index=index) for name, index, _ in changes]
    apply_draw(out, uncertain, np.array([value for *_, value in changes]))
    return out


def test_a_drawn_mode_keeps_its_modal_mass():
    """Stiffness w^2, damping 2 z w; coefficients b / p and the armature 1 - p^2."""
    p, w, z = 0.8, 5.0, 0.03
    out = written(
        ("arm_mode1_xy.frequency", 0, w),
        ("arm_mode1_xy.damping", 0, z),
        ("arm_mode1_xy.participation", 0, p),
        ("arm_mode1_xz.frequency", 1, 3.0),
        ("arm_mode2_xy.damping", 2, 0.2),
    )
    assert out.tendon_stiffness == pytest.approx([w**2, 9.0, 100.0, 7.0])
    # the ratio of the second stays, 0.1 / (2 x 2)
    assert out.tendon_damping == pytest.approx([2.0 * z * w, 0.15, 4.0, 0.0])
    wanted = np.array([0.7 / p, -0.3 / p, 0.2, 0.5, 0.1, 0.9, 2.0])
    assert out.wrap_prm == pytest.approx(wanted)
    assert out.tendon_armature == pytest.approx([1.0 - p**2, 0.0, 0.0, 0.0])
    assert out.tendon_margin == pytest.approx([1.0 - p**2, 0.0, 0.0, 0.0])
    before = model()
    assert out.tendon_lengthspring[0] == pytest.approx([0.75, 0.75])
    assert out.tendon_length0 == pytest.approx(before.tendon_length0 / [p, 1.0, 1.0, 1.0])


def test_a_drawn_lamina_stays_one():
    """Moments 0.25, 0.5 and their sum, of which a range or a draw in its plane keeps that."""
    flat = MODEL.replace(
        'quat="0.9 0.2 -0.3 0.1" mass="70" diaginertia="9 7 5"',
        'mass="70" diaginertia="0.25 0.5 0.75"',
    )
    made = mujoco.MjModel.from_xml_string(flat)
    product = UncertainBody(inertia_xy=about(0.01))
    (drawn,) = quantities(made, UncertainCraft(body={"bus": product}), {}, ())
    apply_draw(made, [drawn], np.array([0.02]))
    assert inertia_matrix(made, 1)[0, 1] == pytest.approx(0.02, rel=1e-9)
    assert np.sum(made.body_inertia[1]) == pytest.approx(1.5, rel=1e-9)
    thick = quantity("bus.inertia_zz", 0.75, some(), index=1)
    with pytest.raises(bc.InputError, match="no body"):
        apply_draw(made, [thick], np.array([0.75 * (1.0 + 1e-8)]))


def test_a_drawn_joint_has_its_stiffness_and_damping():
    out = written(("drive.stiffness", 2, 55.0), ("drive.damping", 2, 0.7))
    assert out.jnt_stiffness[:4] == pytest.approx([0.0, 30.0, 55.0, 0.0])
    assert out.dof_damping[6:9] == pytest.approx([2.0, 0.7, 0.0])


def test_a_drawn_body_has_its_mass_centre_and_inertia():
    before = inertia_matrix(model(), 1)
    changed = before.copy()
    changed[0, 2] = changed[2, 0] = 0.4
    changed[1, 1] = 7.3
    out = written(
        ("bus.mass", 1, 44.0),
        ("bus.centre_z", 1, 0.9),
        ("bus.inertia_xz", 1, 0.4),
        ("bus.inertia_yy", 1, 7.3),
    )
    assert out.body_mass[1] == 44.0
    assert out.body_ipos[1] == pytest.approx([0.3, -0.1, 0.9])
    turn = Rotation.from_quat(out.body_iquat[1][[1, 2, 3, 0]]).as_matrix()
    found = turn @ np.diag(out.body_inertia[1]) @ turn.T
    np.testing.assert_allclose(found, changed, atol=1e-12)
    assert out.body_sameframe[1] == 0
    assert out.body_subtreemass[1] == pytest.approx(44.0 + 6.0 + 5.0 + 3.0 + 2.0)
    # MuJoCo's own energy of it
    data = mujoco.MjData(out)
    data.qvel[:6] = [0.3, -0.2, 0.5, 0.7, 0.4, -0.6]
    mujoco.mj_forward(out, data)
    out.opt.enableflags |= int(mujoco.mjtEnableBit.mjENBL_ENERGY)
    mujoco.mj_energyVel(out, data)
    spin = np.array([0.7, 0.4, -0.6])
    masses = [44.0, 6.0, 5.0, 3.0, 2.0]
    centres = np.array([[0.3, -0.1, 0.9], [0.2, 0, 0], [0, 0.1, 0], [0, 0, 0], [0, 0, 0]])
    speeds = np.array([0.3, -0.2, 0.5]) + np.cross(spin, centres)
    inertias = changed + 2.0 * np.diag([0.3, 0.2, 0.4]) + 2.0 * np.eye(3)
    wanted = 0.5 * np.sum(masses * np.sum(speeds**2, axis=1)) + 0.5 * spin @ inertias @ spin
    assert data.energy[1] == pytest.approx(wanted, rel=1e-9)


def test_a_body_whose_mass_alone_is_drawn_keeps_its_frame():
    rail = model().body_sameframe[2]
    assert rail != 0
    assert written(("rail.mass", 2, 44.0)).body_sameframe[2] == rail
    moved = written(("rail.centre_x", 2, 0.5))
    data = mujoco.MjData(moved)
    mujoco.mj_kinematics(moved, data)
    assert data.xipos[2] == pytest.approx([0.6, 0.2, 0.3])
    assert moved.body_iquat[2] == pytest.approx([1.0, 0.0, 0.0, 0.0])


@pytest.mark.parametrize(("moment", "refused"), [(0.499, False), (0.501, True)])
def test_moments_that_no_body_has_are_not_written(moment, refused):
    """0.3, 0.2 and at most 0.5."""
    if refused:
        with pytest.raises(bc.InputError, match="body 'rail' has principal moments"):
            written(("rail.inertia_zz", 2, moment))
    else:
        out = written(("rail.inertia_zz", 2, moment))
        assert np.sort(out.body_inertia[2]) == pytest.approx([0.2, 0.3, moment])


def test_a_rod_without_a_moment_about_its_axis_is_no_body():
    with pytest.raises(bc.InputError, match="body 'rail' has principal moments"):
        written(("rail.inertia_yy", 2, 0.0), ("rail.inertia_zz", 2, 0.3))
