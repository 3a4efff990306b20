"""Appendages in existing spacecraft: the user's file stays his, the numbers stay theirs,
the whole is proved."""

import json
import pickle
import shutil
from pathlib import Path

import msgspec
import mujoco
import numpy as np
import pytest
from lxml import etree
from scipy.linalg import eigh

import beamchain as bc
import finite_elements as fe
from appendages import dense_port
from command import call, run
from craft_truth import hung
from plant_truth import Truth
from spacecraft import CRAFTS, STYLES, frequencies, spec
from specs import spec_of

SAME = 1e-12  # two forms of one model: the same numbers through the same code
COUPLED = 1e-3  # several appendages, each fitted with the others rigid: the bound
PANEL = 1e-9  # one plane, target hub: the chain's own precision through A and B, n up to 6


@pytest.fixture(scope="module")
def crafts(tmp_path_factory):
    """The fixtures' folder, copied, so that a file may be written into it."""
    return shutil.copytree(CRAFTS, tmp_path_factory.mktemp("crafts") / "crafts")


@pytest.fixture(scope="module")
def embedded(crafts):
    """Each style with its appendages, made once, when first asked for."""
    made = {}

    def get(style):
        if style not in made:
            file, mounts = STYLES[style]
            made[style] = bc.embed(crafts / file, mounts)
        return made[style]

    return get


@pytest.fixture(scope="module")
def observer(embedded):
    return embedded("free hub, two arrays and a boom")


@pytest.fixture(scope="module")
def written(observer, tmp_path_factory):
    return observer.write(tmp_path_factory.mktemp("deep") / "below" / "out.xml")[-1]


@pytest.mark.slow
def test_a_result_can_be_pickled(embedded, tmp_path):
    made = embedded("planar hub on slides and a hinge")
    again = pickle.loads(pickle.dumps(made))
    assert again.model.nv == made.model.nv
    assert [mode.mujoco for mode in again.assembly.modes] == [
        mode.mujoco for mode in made.assembly.modes
    ]
    first, other = (
        one.write(tmp_path / name)[-1].read_bytes()
        for one, name in ((made, "a.xml"), (again, "b.xml"))
    )
    assert first == other


def bare(path: Path, folder: Path) -> Path:
    """What `--remove` makes of a file, written into the folder of the spacecraft
    that it came from."""
    out = folder / "bare.xml"
    answer = call("embed", path, "--remove", "-o", out, "--force")
    assert (answer.status, answer.err) == (0, "")
    return out


DRIVEN = "nested bodies behind a solar-array drive"


class TestStyles:
    @pytest.mark.slow
    @pytest.mark.parametrize("style", STYLES)
    def test_written_elsewhere_compiles_and_comes_back(self, style, embedded, crafts, tmp_path):
        done = embedded(style)
        path = done.write(tmp_path / "a" / "b" / "out.xml")[-1]
        model = mujoco.MjModel.from_xml_path(str(path))
        assert model.nv > done.craft.nv
        np.testing.assert_allclose(frequencies(model), frequencies(done.model), rtol=SAME)
        assert bare(path, crafts).read_bytes() == (CRAFTS / STYLES[style][0]).read_bytes()

    @pytest.mark.parametrize("style", STYLES)
    @pytest.mark.slow
    def test_coupled_modes(self, style, embedded):
        assembly = embedded(style).assembly
        kept = [m for m in assembly.modes if m.kept]
        assert kept
        assert all(m.mujoco is not None for m in kept)
        assert assembly.worst < COUPLED
        # a frequency off by e moves a 0.5 % peak by e / 0.01
        assert assembly.in_band < 10 * COUPLED


NUMBERS = """mass inertia ipos iquat pos quat stiffness damping armature frictionloss range axis
size friction rgba gear ctrlrange springref group fovy"""


class TestTheUsersFile:
    @pytest.mark.slow
    def test_every_number_of_the_craft(self, observer):
        """By name through MuJoCo's own accessors, apart from the comparison embed itself makes."""
        before = mujoco.MjModel.from_xml_path(str(CRAFTS / "observer.xml"))
        after, checked = observer.model, 0
        kinds = {
            "body": "nbody",
            "joint": "njnt",
            "geom": "ngeom",
            "site": "nsite",
            "mesh": "nmesh",
        }
        kinds |= {"camera": "ncam", "light": "nlight", "actuator": "nu", "sensor": "nsensor"}
        for kind, count in {**kinds, "material": "nmat"}.items():
            for i in range(getattr(before, count)):
                a = getattr(before, kind)(i)
                if not a.name:
                    continue
                b = getattr(after, kind)(a.name)
                for field in NUMBERS.split():
                    if hasattr(a, field):
                        np.testing.assert_array_equal(
                            getattr(a, field), getattr(b, field), err_msg=f"{a.name} {field}"
                        )
                        checked += 1
        assert checked > 80

    @pytest.mark.slow
    def test_every_element_and_comment_in_order(self, written):
        mine = [
            etree.tostring(n, with_tail=False)
            for n in etree.parse(str(CRAFTS / "observer.xml")).iter()
            if not len(n) and n.tag != "key"
        ]
        ours = [
            etree.tostring(n, with_tail=False)
            for n in etree.parse(str(written)).iter()
            if not len(n)
        ]
        place = -1
        for text in mine:
            place = ours.index(text, place + 1)

    @pytest.mark.slow
    def test_keyframe_by_joint(self, observer):
        before = mujoco.MjModel.from_xml_path(str(CRAFTS / "observer.xml"))
        after = observer.model
        assert after.nkey == before.nkey == 2
        for j in range(before.njnt):
            name = before.joint(j).name
            for adr, key, width in (("jnt_qposadr", "key_qpos", 7), ("jnt_dofadr", "key_qvel", 6)):
                n = width if name == "bus_free" else 1
                a = getattr(before, adr)[j]
                b = getattr(after, adr)[after.joint(name).id]
                np.testing.assert_array_equal(
                    getattr(before, key)[:, a : a + n], getattr(after, key)[:, b : b + n]
                )
        new = [j for j in range(after.njnt) if "hinge" in after.joint(j).name]
        assert np.all(after.key_qpos[:, after.jnt_qposadr[new]] == 0.0)
        assert np.all(after.key_qvel[:, after.jnt_dofadr[new]] == 0.0)
        np.testing.assert_array_equal(after.key_ctrl, before.key_ctrl)

    @pytest.mark.slow
    def test_twice_is_once(self, embedded, tmp_path):
        once = embedded(DRIVEN).write(tmp_path / "once.xml")[-1]
        again = bc.embed(once, STYLES[DRIVEN][1]).write(tmp_path / "again.xml")[-1]
        assert again.read_bytes() == once.read_bytes()

    @pytest.mark.slow
    def test_one_replaced_others_stay(self, written):
        boom = bc.embed(written, {"boom_mount": spec("rod")}, retime=False)
        names = [boom.model.body(i).name for i in range(boom.model.nbody)]
        assert "rod_link1" in names
        assert "array_link1" in names
        assert not any(name.startswith("boom_") for name in names)

    @pytest.mark.slow
    def test_one_taken_out(self, written, tmp_path):
        words = ["embed", written, "--remove", "-o", tmp_path / "left.xml"]
        words += ["--no-report", "--json", "--mount"]
        answer = call(*words, "left")
        assert [a["at"] for a in answer.record["appendages"]] == ["right", "boom_mount"]
        assert [path.name for path in tmp_path.iterdir()] == ["left.xml"]  # in one piece, as it was
        answer = call(*words[:-2], "--force", "--mount", "nowhere")
        assert answer.status == 2
        assert "no appendage at 'nowhere'" in answer.err

    @pytest.mark.slow
    def test_same_folder_changes_no_path(self, observer, crafts):
        text = observer.write(crafts / "out.xml")[-1].read_text()
        assert text.count("meshdir") == 1
        mujoco.MjModel.from_xml_path(str(crafts / "out.xml"))

    def test_units_of_the_craft_do_not_matter(self):
        """Degrees or radians, angles by default classes: the appendage's file holds no angle."""
        text = (CRAFTS / "drive.xml").read_text()
        turned = text.replace('angle="degree"', 'angle="radian"').replace(
            'euler="0 0 30"', f'euler="0 0 {np.pi / 6!r}"'
        )
        turned = turned.replace('range="-180 180"', f'range="{-np.pi!r} {np.pi!r}"')
        at = {"panel_mount": spec("rod")}
        np.testing.assert_allclose(
            frequencies(bc.embed(text, at, retime=False).model),
            frequencies(bc.embed(turned, at, retime=False).model),
            rtol=1e-10,
        )


USER_DATA = {
    "on a body": ("", 'user="1 2"', ""),
    "room only": (
        '<size nuser_body="3" nuser_jnt="2" nuser_geom="1" nuser_site="2" nuser_tendon="1"/>',
        "",
        "",
    ),
    "both": ('<size nuser_body="3" nuser_actuator="2" nuser_sensor="2"/>', 'user="1"', ""),
    "by default": (
        '<default><joint user="7 8"/><geom user="9"/><site user="4"/></default>',
        "",
        "",
    ),
    "everywhere": (
        "",
        'user="1 2"',
        '<tendon><fixed name="t" user="6"><joint joint="wheel" '
        'coef="1"/></fixed></tendon><actuator><motor joint="wheel" '
        'user="1"/></actuator><sensor><jointpos joint="wheel" user="1 2"/></sensor>',
    ),
}


@pytest.mark.parametrize(
    ("case", "form"), [*((case, "file") for case in USER_DATA), ("everywhere", "spec")]
)
def test_user_data_stays(case, form, tmp_path):
    before, own, behind = USER_DATA[case]
    text = f"""<mujoco>{before}<worldbody><body name="hub" {own}><freejoint/>
    <geom size=".5" mass="50"/>
    <site name="mount"/><body name="w" pos="1 1 1"><joint name="wheel" user="5"/>
    <geom size=".1" mass="1"/></body>
    </body></worldbody>{behind}</mujoco>"""
    plain = mujoco.MjModel.from_xml_string(text)
    rod = spec("rod")
    if form == "spec":
        model = bc.embed(mujoco.MjSpec.from_string(text), {"mount": rod}, retime=False).model
    else:
        path = bc.embed(text, {"mount": rod}, retime=False).write(tmp_path / "out.xml")[-1]
        model = mujoco.MjModel.from_xml_path(str(path))
    assert model.nv > plain.nv
    for kind, name in (("body", "hub"), ("joint", "wheel")):
        had = np.ravel(getattr(plain, kind)(name).user)
        np.testing.assert_array_equal(np.ravel(getattr(model, kind)(name).user)[: had.size], had)


def test_a_scene_slower_than_every_mode():
    """Decades between the band and the beam's modes: a rigid appendage,
    and no word of NumPy's."""
    slow = msgspec.structs.replace(
        bc.read_spec(spec("boom")),
        modes=None,
        root=bc.spec.Root(),
        scene=bc.Scene(bandwidth=1e-9, axes=("z",)),
    )
    assembly = bc.embed(CRAFTS / "planar.xml", {"mount": slow}).assembly
    assert assembly.in_band < 1e-3
    assert all(np.isfinite(m.exact) for m in assembly.modes if m.exact is not None)


class TestHub:
    @pytest.mark.slow
    def test_rigid_hub_by_hand(self, observer):
        """The boom's hub: bus, wheel and both arrays, masses added by hand."""
        arrays = sum(
            bc.read_spec(spec(n)).beam.rigid_mass()[0, 0] for n in ("array_left", "array_right")
        )
        hub = next(a.hub for a in observer.appendages if a.at == "boom_mount")
        assert hub.mass == pytest.approx(412.3456789012345 + 6.0 + arrays, rel=1e-12)

    def test_moved_frame_moves_the_hub(self):
        craft = CRAFTS / "planar.xml"
        planar = bc.embed(craft, {"side": spec("rod")}, rigid=True).appendages[0].hub
        # centre at (0.03, -0.01), site at (0, 0.4), its x along the body's y, its y along minus x
        np.testing.assert_allclose(planar.offset, [0.41, 0.03, 0.0], atol=1e-12)
        np.testing.assert_allclose([planar.mass, planar.inertia[2]], [60.0, 8.0], rtol=1e-12)

    @pytest.mark.slow
    def test_planar_target_hub_needs_no_numbers(self):
        """One appendage in the plane it moves in:
        coupled modes of hub and beam to the chain's own precision."""
        done = bc.embed(CRAFTS / "planar.xml", {"mount": spec("rod")})
        beam = bc.read_spec(spec("rod")).beam.port("xy", 8)
        c = np.array([0.03 - 0.4, -0.01])
        mass = np.array(
            [[60.0, 0, -60 * c[1]], [0, 60.0, 60 * c[0]], [-60 * c[1], 60 * c[0], 8 + 60 * c @ c]]
        )
        # axial motion of the rod is rigid: it only adds its mass to x
        mass[0, 0] += beam.rigid_mass[0, 0]
        full = mass[1:, 1:] - np.outer(mass[1:, 0], mass[0, 1:]) / mass[0, 0]
        exact = beam.with_hub(full).free_frequencies
        ours = frequencies(done.model)
        np.testing.assert_allclose(ours[:2], exact[:2], rtol=1e-6)  # force differences of 1e-4 rad

    @pytest.mark.slow
    def test_drive(self, embedded):
        """What turns with the drive is 11 kg, what the array feels far more:
        only the apparent hub is right."""
        done = embedded(DRIVEN)
        hub = done.appendages[0].hub
        assert hub.mass == pytest.approx(11.0)
        assert any("array_drive" in w and "11 kg" in w and "locked" in w for w in done.warnings)
        assert done.assembly.worst < 1e-4
        loose = (CRAFTS / "drive.xml").read_text().replace('stiffness="4000"', 'stiffness="0"')
        given = bc.read_spec(spec("array_left"))
        # two modes in each plane: with one, a filler mode stands on the second hinge and moves the
        # coupled modes by 5e-5
        own = bc.Spec(
            **{f: getattr(given, f) for f in given.__struct_fields__}
            | {"modes": bc.Modes(xy=2, xz=2, torsion=1)}
        )
        done = bc.embed(loose, {"panel_mount": own})
        assert any("free, since nothing holds it" in w for w in done.warnings)
        assert done.assembly.worst < 1e-10

    @pytest.mark.slow
    @pytest.mark.parametrize("stiffness", [50.0, pytest.param(2000.0, marks=pytest.mark.slow)])
    def test_sprung_ball_joint(self, stiffness):
        """Modes called kept are right against finite elements on the craft's own matrices;
        those beyond are not judged."""
        craft = (
            '<mujoco><option gravity="0 0 0"/><worldbody><body name="bus"><freejoint/><inertial '
            'pos="0 0 0" mass="200" diaginertia="90 80 70"/><body name="gimbal" pos="1 0 '
            f'0"><joint name="ball" type="ball" stiffness="{stiffness}"/><inertial pos="0 0 0" '
            'mass="3" diaginertia=".1 .1 .1"/><site name="mount" pos="0.1 0 '
            '0"/></body></body></worldbody></mujoco>'
        )
        section = {"shape": "round", "diameter": 0.02}
        given = {
            "segment": [
                {
                    "length": 5.0,
                    "section": section,
                    "material": {"youngs_modulus": 7e10, "density": 2700.0},
                }
            ]
        }
        bare = mujoco.MjModel.from_xml_string(craft)
        own = Truth.modes(given, dict.fromkeys(fe.PORTS, 12))
        mass, _, stiff = hung(bare, {"mount": own})
        squares = eigh(stiff, mass, eigvals_only=True)
        true = np.sqrt(squares[squares > 1e-3])

        part = spec_of({"name": "rod", **given, "modes": {"xy": 1, "xz": 1}})
        short = bc.embed(craft, {"mount": part}, retime=False)
        # two modes that the beam's springs share in, and that one mode per plane cannot have
        if stiffness < 100.0:
            assert max(abs(m.error or 0.0) for m in short.assembly.modes if m.kept) > 0.06
            assert len(short.assembly.judged) == 2
        np.testing.assert_allclose(
            [m.mujoco for m in short.assembly.judged], true[: len(short.assembly.judged)], rtol=1e-3
        )
        scene = {"bandwidth": 20.0, "tolerance": 1e-2}
        whole = bc.embed(
            craft, {"mount": spec_of({"name": "rod", **given, "scene": scene}, "rod")}, retime=False
        )
        assert 1.01 * whole.craft_error <= 1e-2
        inside = true[true <= 20.0]
        np.testing.assert_allclose(frequencies(whole.model)[: inside.size], inside, rtol=1e-3)

    @pytest.mark.slow
    def test_scene_chooses_with_the_hub_of_the_craft(self):
        given = bc.read_spec(spec("rod"))
        own = bc.Spec(
            name="rod",
            segment=given.segment,
            scene=bc.Scene(bandwidth=10.0, tolerance=1e-3, axes=("z",)),
        )
        done = bc.embed(CRAFTS / "planar.xml", {"mount": own})
        first = next(m for m in done.assembly.modes if m.kept)
        assert abs(first.error) < COUPLED
        # the choice is made anew from the spec kept
        again = bc.embed(done.to_mjcf(), {"side": own})
        assert [a.at for a in again.appendages] == ["mount", "side"]

    @pytest.mark.slow
    def test_imported_modes(self, tmp_path):
        """A plate's modes, bending and torsion coupled: exact on any hub."""
        mass = np.diag([20.0, 20.0, 20.0, 9.0, 40.0, 46.0])
        mass[1, 5] = mass[5, 1] = 20.0
        mass[2, 4] = mass[4, 2] = -20.0
        lateral = [[0, 0, 3.5, 0.4, -5.5, 0], [0, 0, 1.2, -1.5, -1.1, 0]]
        # digits, as a program writes them
        mass, lateral = mass * np.pi / 3.0, np.array(lateral) * np.sqrt(np.pi / 3.0)
        record = {
            "frequencies": [2.0 / 3.0, 17.0 / 3.0],
            "participation": lateral.T.tolist(),
            "mass": mass.tolist(),
        }
        (tmp_path / "plate.json").write_text(json.dumps(record))
        (tmp_path / "plate.toml").write_text('name = "plate"\n[imported]\nfile = "plate.json"\n')
        done = bc.embed(
            CRAFTS / "drive.xml",
            {"radiator_edge": tmp_path / "plate.toml", "panel_mount": spec("array_left")},
        )
        labels = [t.label for t in done.appendages[0].fit.chain.tendons if t.is_mode]
        assert labels == ["mode1", "mode2"]
        alone = bc.embed(CRAFTS / "drive.xml", {"radiator_edge": tmp_path / "plate.toml"})
        assert [m.kept for m in alone.assembly.modes][:1] == [True]
        assert alone.assembly.worst < 1e-6
        assert done.assembly.worst < COUPLED

    @pytest.mark.slow
    def test_hub_of_the_spec_is_replaced(self):
        given = bc.read_spec(spec("rod"))
        own = bc.Spec(
            name="rod",
            segment=given.segment,
            root=bc.spec.Root(hub=bc.Hub(mass=1.0, inertia=(1.0, 1.0, 1.0))),
        )
        done = bc.embed(CRAFTS / "planar.xml", {"mount": own}, rigid=True)
        assert any("the specification's hub (1 kg)" in w for w in done.warnings)
        held = bc.embed(CRAFTS / "planar.xml", {"mount": spec("boom")}, rigid=True)
        assert any("hold" in w for w in held.warnings)


class TestMjSpec:
    @pytest.mark.slow
    def test_same_as_the_file(self):
        craft = mujoco.MjSpec.from_file(str(CRAFTS / "drive.xml"))
        at = {"panel_mount": spec("array_left")}
        done = bc.embed(craft, at, retime=False)
        reference = bc.embed(CRAFTS / "drive.xml", at, retime=False)
        np.testing.assert_allclose(
            frequencies(craft.compile()), frequencies(reference.model), rtol=SAME
        )
        assert done.as_dict()["modes"][0]["error"] == pytest.approx(0.0, abs=1e-9)
        with pytest.raises(bc.BeamchainError, match="to_xml"):
            done.to_mjcf()

    def test_unknown_place_changes_nothing(self):
        craft = mujoco.MjSpec.from_file(str(CRAFTS / "drive.xml"))
        with pytest.raises(bc.BeamchainError, match="nowhere"):
            bc.embed(craft, {"nowhere": spec("rod")})
        assert (
            craft.compile().nbody == mujoco.MjModel.from_xml_path(str(CRAFTS / "drive.xml")).nbody
        )


def panel(inertia: float, frequency: float, modes: int) -> bc.Spec:
    """A uniform beam with the panels' inertia about the root and the one panel's frequency."""
    length = 3.0
    linear = 3.0 * inertia / length**3
    stiffness = linear * length**4 * (frequency / 3.5160152685) ** 2
    section = {"shape": "equivalent", "bending_stiffness_xy": stiffness, "linear_mass": linear}
    segment = {"length": length, "section": section}
    return spec_of(
        {"name": "panel", "segment": [segment], "modes": {"xy": modes}, "root": {"target": "hub"}}
    )


class TestFlexiblePanel:
    """Basilisk's flexible panel keeps k = 600 N m/rad per hinge while it adds links."""

    HERTZ = (0.2906, 0.2770, 0.2357, 0.1853, 0.1388, 0.1011)

    def test_the_recipe_falls(self):
        """N equal rigid links on N hinges of k = 600, clamped, total inertia 180 kg m^2:
        Basilisk's printed figures."""
        length, mass = 3.0, 60.0
        for links, printed in zip((1, 2, 4, 8, 16, 32), self.HERTZ, strict=True):
            piece, m = length / links, mass / links
            rigid = [
                (0.0, 0.0, 0.0),
                *((m, (i + 0.5) * piece, m * piece**2 / 12.0) for i in range(links)),
            ]
            _, clamped, _ = dense_port(rigid, [(i * piece, 600.0) for i in range(links)])
            # four digits are printed
            assert clamped[0] / (2.0 * np.pi) == pytest.approx(printed, abs=6e-5)

    @pytest.mark.parametrize("n", [1, pytest.param(6, marks=pytest.mark.slow)])
    def test_fixed_beam_does_not(self, n):
        own = panel(180.0, 2.0 * np.pi * self.HERTZ[0], n)
        done = bc.embed(CRAFTS / "planar.xml", {"mount": own}, retime=False)
        assert done.appendages[0].fit.status.ok
        first = next(m for m in done.assembly.modes if m.kept)
        assert abs(first.error) < PANEL
        assert done.appendages[0].fit.achieved["xy"].modes == n


class TestCommand:
    @pytest.mark.slow
    def test_json_table_and_remove(self, tmp_path, capsys, monkeypatch):
        out = tmp_path / "out.xml"
        craft, at = CRAFTS / "planar.xml", f"mount={spec('rod')}"
        words = ["embed", str(craft), "--mount", at, "-o", str(out)]
        answer = call(*words, "--json", "--no-report")
        record = answer.record
        assert answer.status == 0
        assert set(record) >= {"appendages", "modes", "warnings"}
        assert set(record["appendages"][0]) >= {"at", "prefix", "hub", "target"}
        assert set(record["appendages"][0]["hub"]) >= {"mass", "inertia", "com"}
        assert record["appendages"][0]["prefix"] == "rod_"
        back = tmp_path / "back.xml"
        code, _, error = run(["embed", str(out), "--remove", "-o", str(back)], capsys, monkeypatch)
        assert (code, error) == (0, "")
        assert back.read_bytes() == (CRAFTS / "planar.xml").read_bytes()

    @pytest.mark.parametrize(
        ("words", "message"),
        [
            ([], "nothing to embed"),
            (["--mount", "mount"], "NAME=SPEC.toml"),
            (["--mount", "=x.toml"], "NAME=SPEC.toml"),
            (["--mount", "mount=none.toml"], "does not exist"),
            (["--remove"], "no appendage"),
            (["--mount", f"mount={spec('rod')}", "--mount", f"mount={spec('rod')}"], "twice"),
        ],
    )
    def test_bad_words(self, words, message, tmp_path, capsys, monkeypatch):
        out = tmp_path / "out.xml"
        code, _, error = run(
            ["embed", str(CRAFTS / "planar.xml"), *words, "-o", str(out)], capsys, monkeypatch
        )
        assert code == 2
        assert message in error
        assert not out.exists()


def slender(length, port=""):
    return (
        f"[[segment]]\nlength = {length}\n"
        "section = { shape = 'tube', outer_diameter = 0.1, wall = 0.003 }\n"
        "material = { youngs_modulus = 7e10, density = 2700.0 }\n"
        f"[modes]\nxy = 1\nxz = 0\n{port}"
    )


HAND = """<mujoco><option gravity="0 0 0"/><worldbody><body name="bus"><freejoint/>
<inertial pos="0 0 0" mass="300" diaginertia="90 90 90"/><site name="mount" pos="0.5 0 0"/>
<body name="hand" pos="5.5 0 0"><joint axis="0 0 1"/>
<inertial pos="0 0 0" mass="5" diaginertia="1 1 1"/></body></body></worldbody></mujoco>"""


@pytest.mark.parametrize(
    ("length", "x", "carries", "code", "words"),
    [
        (5.0, 5.0, (), "not-carried", 'carries = ["hand"]'),
        (5.0, 3.0, (), "not-carried", '[[port]] name = "end", x = 5, carries = ["hand"]'),
        (4.0, 4.0, ("hand",), "carried-apart", "stands 1 m from port 'end'"),
        (4.95, 4.95, ("hand",), "", ""),
        (4.0, 4.0, (), "", ""),
    ],
)
def test_a_body_that_does_not_hang_where_it_stands_is_named(
    length, x, carries, code, words, tmp_path
):
    """Forgotten `carries`, and a length that ends before the body; brackets are left alone."""
    port = f"[[port]]\nname = 'end'\nx = {x}\ncarries = {list(carries)}\n"
    (tmp_path / "spec.toml").write_text(slender(length, port))
    made = bc.embed(HAND, {"mount": tmp_path / "spec.toml"}, rigid=True)
    said = [w for w in made.warnings if w.code in ("not-carried", "carried-apart")]
    assert [w.code for w in said] == ([code] if code else [])
    assert all(words in w for w in said)


@pytest.mark.parametrize(
    ("at", "site", "hand", "said"),
    [
        ("mount", "", "4.9 0.4 0", ""),  # the hand outweighs the bus, and the beam runs to it
        ("mount", 'euler="0 0 180"', "5.5 0 0", "stands behind it, at (-5, 0, 0) m"),
        ("mount", 'euler="0 0 90"', "5.5 0 0", "stands beside it, at (0, -5, 0) m"),
        ("bus", "", "0 0 5", "body 'hand', which the appendage carries"),
    ],
)
def test_an_appendage_runs_to_what_it_carries(at, site, hand, said, tmp_path):
    port = "[[port]]\nname = 'end'\nx = 5.0\ncarries = ['hand']\n"
    (tmp_path / "spec.toml").write_text(slender(5.0, port))
    craft = HAND.replace('pos="0.5 0 0"', f'pos="0.5 0 0" {site}').replace("5.5 0 0", hand)
    craft = craft.replace('mass="5"', 'mass="3000"')
    made = bc.embed(craft, {at: tmp_path / "spec.toml"}, rigid=True)
    found = [w for w in made.warnings if w.code == "points-inward"]
    assert len(found) == bool(said)
    assert not said or (said in found[0] and "site whose x axis points to the body" in found[0])


@pytest.mark.parametrize(("times", "asked"), [(99.0, False), (101.0, True)])
def test_an_appendage_a_hundred_times_as_heavy_as_its_spacecraft_is_asked_about(times, asked):
    craft = """<mujoco><worldbody><body name="bus"><freejoint/>
    <inertial pos="0 0 0" mass="2" diaginertia="9 9 9"/><site name="mount"/></body></worldbody>
    </mujoco>"""
    section = bc.Equivalent(bending_stiffness_xy=90.0, linear_mass=times * 2.0 / 5.0)
    boom = bc.Spec(name="boom", segment=(bc.Segment(length=5.0, section=section),))
    made = bc.embed(craft, {"mount": boom}, rigid=True)
    found = [str(w) for w in made.warnings if w.code == "heavy-appendage"]
    assert len(found) == asked
    assert not asked or "weighs 202 kg, the spacecraft 2 kg" in found[0]


def test_what_an_appendage_should_carry_is_no_mass_to_point_away_from(tmp_path):
    """The hand outweighs the bus, stands at the end, and `carries` was forgotten: one note."""
    (tmp_path / "spec.toml").write_text(slender(5.0))
    craft = HAND.replace('mass="5"', 'mass="3000"')
    made = bc.embed(craft, {"mount": tmp_path / "spec.toml"}, rigid=True)
    codes = [getattr(w, "code", "") for w in made.warnings]
    assert "not-carried" in codes
    assert "points-inward" not in codes


DRUM = HAND.replace(
    '<body name="hand" pos="5.5 0 0"><joint axis="0 0 1"/>',
    '<body name="drum" pos="0.5 0 0"><joint axis="0 0 1"/><site name="root"/>{link}',
)


@pytest.mark.parametrize(
    ("at", "link", "twice"),
    [
        ("root", '<geom type="capsule" size="0.05" fromto="0 0 0 4 0 0" mass="8"/>', True),
        ("root", '<geom type="capsule" size="0.05" fromto="0 0 0 0 0 4" mass="8"/>', False),
        ("root", "", False),
        ("mount", '<geom type="capsule" size="0.05" fromto="0 0 0 4 0 0" mass="8"/>', False),
    ],
)
def test_a_link_that_was_left_in_is_asked_for(at, link, twice, tmp_path):
    (tmp_path / "spec.toml").write_text(slender(4.0))
    craft = DRUM.format(link=link)
    if link:
        craft = craft.replace('<inertial pos="0 0 0" mass="5" diaginertia="1 1 1"/>', "")
    said = bc.embed(craft, {at: tmp_path / "spec.toml"}, rigid=True).warnings
    found = [w for w in said if w.code == "counted-twice"]
    assert len(found) == twice
    assert not twice or "'drum' has 8 kg" in found[0]


def test_joints_behind_are_named_together_with_what_holds_them(tmp_path):
    text = HAND.replace('<joint axis="0 0 1"/>', '<joint name="free_one" axis="0 0 1"/>').replace(
        "</body></body></worldbody>",
        '<body name="next" pos="0.1 0 0"><joint name="driven" axis="0 1 0"/>'
        '<inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/><site name="far"/></body>'
        '</body></body></worldbody><actuator><position joint="driven" kp="1e4"/></actuator>',
    )
    (tmp_path / "spec.toml").write_text(slender(3.0))
    made = bc.embed(text, {"far": tmp_path / "spec.toml"}, rigid=True)
    [said] = [w for w in made.warnings if w.code == "joints-behind"]
    assert "driven as locked" in said
    assert "free_one as free" in said
