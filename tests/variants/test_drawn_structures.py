"""What is drawn of a structure: the scores themselves (`fitting.uncertain`, `fitting.varied`,
internals), and the values that a sweep records of every sample."""

import numpy as np
import pytest
from msgspec import structs
from test_sweep import ARRAY, SAME, variants

import beamchain as bc
from beamchain.fitting.quantity import draws
from beamchain.fitting.uncertain import Uncertain, Uncertainty
from beamchain.fitting.varied import structural_quantities
from varied_crafts import CRAFT, beam, drawn_spec, frequencies

CHANCE = 5.0  # standard errors a statistic of 4,000 draws may lie off
# relative: a sweep fits a structure again for the bus of the file, by whose mass its fillers
# stand, and embedding anew for the drawn one (5e-8 measured)
OTHER_HUB = 2e-7

__all__ = ["variants"]  # the fixture


@pytest.mark.slow
def test_draws_are_what_they_say():
    uncertain = Uncertain(
        stiffness=Uncertainty(relative=0.1, group="a"),
        density=Uncertainty(relative=0.1, group="a"),
        joint_stiffness=Uncertainty(relative=0.2, each=True),
        lump=Uncertainty(relative=0.5, distribution="uniform"),
    )
    segment = bc.Segment(
        length=1.0, section=bc.Equivalent(bending_stiffness_xy=900.0, linear_mass=3.0)
    )
    spec = bc.Spec(
        segment=(segment,) * 4,
        joint=tuple(bc.Joint(after_segment=i, stiffness_xy=10.0 * i) for i in (1, 2, 3)),
        lump=(bc.Lump(x=1.0, mass=0.01),),
        uncertain=uncertain,
    )
    numbers = structural_quantities(spec)
    rows = draws(numbers, range(4000), 7, ())
    np.testing.assert_array_equal(draws(numbers, [123], 7, ())[0], rows[123])
    values = dict(zip([q.name for q in numbers], rows.T, strict=True))
    for name in ("segment2.stiffness", "segment1.density"):
        np.testing.assert_array_equal(values["segment1.stiffness"], values[name])
    each = np.array([values[f"joint{i}.stiffness_xy"] / (10.0 * i) - 1.0 for i in (1, 2, 3)]) / 0.2
    error = 1.0 / np.sqrt(4000.0)
    assert np.max(np.abs(each.mean(axis=1))) < CHANCE * error
    assert np.max(np.abs(np.corrcoef(each) - np.eye(3))) < CHANCE * error
    lump = values["lump1.mass"]
    assert 0.005 < lump.min() < 0.0052
    assert 0.0148 < lump.max() < 0.015
    assert lump.std() == pytest.approx(0.005 / np.sqrt(3.0), rel=0.05)


def test_normal_draws_are_cut():
    given = Uncertainty(relative=0.1)
    assert given.value(1.0, 9.0) == pytest.approx(1.3)
    assert given.value(1.0, -1.0) == pytest.approx(0.9)
    assert Uncertainty(absolute=2.0).value(10.0, 1.0) == pytest.approx(12.0)


@pytest.mark.slow
def test_a_variant_is_the_fit_of_its_spec(variants):
    i = 4
    spec = drawn_spec(variants.nominal.spec, 3, int(variants.indices[i]))
    assert spec != variants.nominal.spec
    fresh = bc.fit(structs.replace(spec, uncertain=None))
    for port, values in variants.participation.items():
        np.testing.assert_allclose(
            np.abs(fresh.target[port].participation), np.abs(values[i]), rtol=1e-6, atol=1e-9
        )


@pytest.mark.slow
def test_every_variant_has_the_mass_that_was_drawn(variants):
    for mass, sample in zip(variants.fields["body_mass"], variants.indices, strict=True):
        spec = drawn_spec(variants.nominal.spec, 3, int(sample))
        assert np.sum(mass) == pytest.approx(spec.beam.rigid_mass()[0, 0] + 500.0, rel=1e-9)


@pytest.mark.slow
def test_the_drawn_structure_is_recorded(variants, tmp_path):
    """The fit of a structure with the recorded numbers, written here, is the variant."""
    variants.write(tmp_path)
    arrays = np.load(tmp_path / "variants.npz")
    names = arrays["quantities"].tolist()
    record = variants.as_dict()["quantities"]
    assert [one["name"] for one in record] == names == [q.name for q in variants.quantities]
    spec = variants.nominal.spec
    lines = [name for name in names if "_joint" in name]
    assert lines == ["array_joint1.stiffness_xz", "array_joint2.stiffness_xz"]
    nominal = [one["nominal"] for one in record if one["name"] in lines]
    assert nominal == [900.0, 700.0]
    for row in (0, 5):
        drawn = dict(zip(names, arrays["values"][row].tolist(), strict=True))
        segments = []
        for i, segment in enumerate(spec.segment, 1):
            stiff = drawn[f"array_segment{i}.stiffness"]
            dense = drawn[f"array_segment{i}.density"]
            factors = dict.fromkeys(("bending_stiffness_xy", "bending_stiffness_xz"), stiff)
            factors |= dict.fromkeys(("torsion_stiffness", "axial_stiffness"), stiff)
            factors |= dict.fromkeys(("linear_mass", "polar_inertia"), dense)
            changes = {"nonstructural_mass": segment.nonstructural_mass * dense}
            section = segment.section
            if isinstance(section, bc.Equivalent):
                scaled = {key: getattr(section, key) * by for key, by in factors.items()}
                changes["section"] = structs.replace(section, **scaled)
            else:
                material = segment.material
                changes["material"] = structs.replace(
                    material,
                    youngs_modulus=material.youngs_modulus * stiff,
                    shear_modulus=material.shear_modulus and material.shear_modulus * stiff,
                    density=material.density * dense,
                )
            segments.append(structs.replace(segment, **changes))
        joints = [
            structs.replace(joint, stiffness_xz=drawn[line])
            for joint, line in zip(spec.joint, lines, strict=True)
        ]
        fresh = bc.fit(
            structs.replace(spec, segment=tuple(segments), joint=tuple(joints), uncertain=None)
        )
        for port, values in variants.participation.items():
            np.testing.assert_allclose(
                np.abs(fresh.target[port].participation), np.abs(values[row]), rtol=1e-6, atol=1e-9
            )


def test_varied_scales_what_it_should():
    spec = bc.read_spec(ARRAY)
    one = drawn_spec(spec, 0, 1)
    yoke, panel = one.segment[0], one.segment[1]
    stiff = yoke.material.youngs_modulus / 7e10
    heavy = yoke.material.density / 2700.0
    assert panel.section.bending_stiffness_xz == pytest.approx(2e4 * stiff, rel=SAME)
    assert panel.section.linear_mass == pytest.approx(4.0 * heavy, rel=SAME)
    assert (stiff - 1.0) / 0.05 == pytest.approx((heavy - 1.0) / 0.02, rel=1e-9)
    assert one.joint[0].stiffness_xz / 900.0 != pytest.approx(one.joint[1].stiffness_xz / 700.0)
    assert one.damping == spec.damping  # drawn on the tendons


@pytest.mark.slow
def test_structures_are_fitted_again_in_the_craft(tmp_path):
    """A structure and a mass drawn, against the craft embedded anew with that structure."""
    (tmp_path / "craft.xml").write_text(CRAFT)
    (tmp_path / "given.toml").write_text("[body.bus]\nmass = { relative = 0.05 }\n")
    table = {"stiffness": {"relative": 0.05}, "density": {"relative": 0.02}}
    at = {
        "left": beam("left", uncertain=table, xy=2, xz=1, torsion=1),
        "right": beam("right", 5.0, xy=2),
    }
    found = bc.sweep(
        tmp_path / "craft.xml", 2, mounts=at, uncertain=tmp_path / "given.toml", seed=2
    )
    assert not found.left_out
    for i in range(2):
        left = bc.Spec(
            **{
                name: getattr(drawn_spec(at["left"], 2, i, "left_"), name)
                for name in ("name", "segment", "modes", "damping")
            }
        )
        names = [q.name for q in found.quantities]
        assert "left_segment1.stiffness" in names
        mass = float(found.values[i, names.index("bus.mass")])
        craft = CRAFT.replace('mass="300"', f'mass="{mass!r}"')
        whole = bc.embed(craft, {"left": left, "right": at["right"]}).untimed
        np.testing.assert_allclose(frequencies(whole), found.coupled[i], rtol=OTHER_HUB)
