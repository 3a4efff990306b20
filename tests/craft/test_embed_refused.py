"""What embed refuses or warns of: one sentence with the figure and the cure, nothing written."""

import re
import tomllib

import mujoco
import numpy as np
import pytest

import beamchain as bc
from command import run
from spacecraft import frequencies, spec
from specs import spec_of

SAME = 1e-12  # two forms of one model: the same numbers through the same code


BODY = '<body name="hub"><freejoint/><inertial pos="0 0 0" mass="50" diaginertia="5 5 5"/>{}</body>'


def craft(
    inside: str = '<site name="mount"/>', before: str = "", behind: str = "", body: str = BODY
) -> str:
    return f"<mujoco>{before}<worldbody>{body.format(inside)}{behind}</worldbody></mujoco>"


# fits the shape
MESHED = (
    '<asset><mesh name="m" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/></asset><default><geom '
    'mesh="m"/></default>'
)
FIELD = (
    '<asset><hfield name="f" nrow="2" ncol="2" size="1 1 1 1"/></asset><default><geom '
    'hfield="f"/></default>'
)
ONE_PIECE = '<default><geom type="capsule" size="0.1" fromto="0 0 0 1 0 0"/></default>'
BESIDE = "appendage's too; take {} out of it"
REFUSED = {
    "unknown name": (craft(), "mounts", "did you mean 'mount'"),
    "quaternion not unit": (
        craft('<site name="mount" quat="1 0 0 0.1"/>'),
        "mount",
        "norm 1.00498756",
    ),
    "quaternion of zeros": (craft('<site name="mount" quat="0 0 0 0"/>'), "mount", "norm 0"),
    "axes not perpendicular": (
        craft('<site name="mount" xyaxes="1 0 0 0.1 1 0"/>'),
        "mount",
        "not perpendicular",
    ),
    "axes parallel": (
        craft('<site name="mount" xyaxes="1 0 0 1 0 0"/>'),
        "mount",
        "not perpendicular",
    ),
    "frame around it": (
        craft('<frame quat="2 0 0 0"><site name="mount"/></frame>'),
        "mount",
        "norm 2",
    ),
    "axis of no length": (craft('<site name="mount" zaxis="0 0 0"/>'), "mount", "no length"),
    "not a number": (craft('<site name="mount" quat="1 0 x 0"/>'), "mount", "4 finite numbers"),
    "site of the world": (craft(behind='<site name="fixed"/>'), "fixed", "belongs to the world"),
    "static body": (
        craft(behind='<body name="post"><geom size="1"/><site name="top"/></body>'),
        "top",
        "welded to the world",
    ),
    "site and body of one name": (craft('<site name="hub"/>'), "hub", "site:hub or body:hub"),
    "inside replicate": (
        craft('<replicate count="2"><site name="mount"/></replicate>'),
        "mount",
        "did you mean 'mount",
    ),
    "document type": ('<!DOCTYPE m [<!ENTITY a "b">]>' + craft(), "mount", "document type"),
    "other root": ("<robot/>", "mount", "not <mujoco>"),
    "no XML": ("<mujoco>", "mount", "not XML"),
    "name taken": (craft('<site name="mount"/><site name="rod_root"/>'), "mount", "another name"),
    "boundmass": (craft(before='<compiler boundmass="1"/>'), "mount", "boundmass = 1 kg"),
    "boundinertia": (
        craft(before='<compiler boundinertia="1"/>'),
        "mount",
        "boundinertia = 1 kg m^2",
    ),
    "settotalmass": (craft(before='<compiler settotalmass="100"/>'), "mount", "settotalmass = 100"),
    "fusestatic": (craft(before='<compiler fusestatic="true"/>'), "mount", "fusestatic"),
    "springs off": (craft(before='<option><flag spring="disable"/></option>'), "mount", "spring"),
    "shapes turned by default": (
        craft(before='<default><geom euler="0 0 30"/></default>'),
        "mount",
        BESIDE.format("euler"),
    ),
    "a mesh by default": (craft(before=MESHED), "mount", "take mesh out of them"),
    "a height field by default": (craft(before=FIELD), "mount", BESIDE.format("hfield")),
    "ends by default": (craft(before=ONE_PIECE), "mount", BESIDE.format("fromto")),
    "sites with ends": (
        craft(before=ONE_PIECE.replace("<geom", "<site")),
        "mount",
        BESIDE.format("fromto"),
    ),
    "shapes dropped": (
        craft(before='<compiler discardvisual="true"/>'),
        "mount",
        'write discardvisual="false" in <compiler>, or',
    ),
    "long keyframe": (
        craft(behind="</worldbody><keyframe><key qpos='0 0 0 1 0 0 0 0'/></keyframe><worldbody>"),
        "mount",
        "qpos",
    ),
}


@pytest.fixture(scope="module")
def done():
    return bc.embed(craft(), {"mount": spec("rod")}, retime=False)


@pytest.fixture(scope="module")
def clean():
    """Without any default, in boxes on the body."""
    return bc.embed(craft(), {"hub": spec("rod_in_boxes")}, retime=False).model


class TestRefused:
    @pytest.mark.parametrize("name", REFUSED)
    def test_bad_craft(self, name, tmp_path, capsys, monkeypatch):
        text, at, word = REFUSED[name]
        path = tmp_path / "craft.xml"
        out = tmp_path / "sub" / "out.xml"
        path.write_text(text)
        code, _, error = run(
            ["embed", str(path), "--mount", f"{at}={spec('rod_in_boxes')}", "-o", str(out)],
            capsys,
            monkeypatch,
        )
        assert code == 2
        assert error.startswith("beamchain: ")
        sentences = [line for line in error.splitlines() if "MuJoCo warns: " not in line]
        assert len(sentences) == 1
        assert word in error, error
        assert not out.parent.exists()

    def test_the_way_out_of_dropped_shapes_leads_out(self):
        plain = spec_of({**tomllib.loads(spec("rod").read_text()), "scene": {"visuals": False}})
        text = craft(before='<compiler discardvisual="true"/>')
        assert bc.embed(text, {"mount": plain}, retime=False).model.ngeom == 0

    @pytest.mark.slow
    def test_material_that_the_compiler_drops(self):
        text = craft(before='<compiler discardvisual="true"/>')
        section = bc.Rectangle(width_y=0.02, width_z=1.2)
        material = bc.Material(youngs_modulus=2e9, density=80.0)
        panel = bc.Segment(length=2.5, section=section, material=material)
        with pytest.raises(bc.BeamchainError, match="0 of 1 are left"):
            bc.embed(text, {"mount": bc.Spec(segment=(panel,))})
        assert bc.embed(text, {"mount": spec("rod")}, rigid=True).model.nskin == 1

    def test_the_other_way_out_of_dropped_shapes_leads_out(self):
        text = craft(before='<compiler discardvisual="false"/>')
        assert bc.embed(text, {"mount": spec("rod_in_boxes")}, retime=False).model.ngeom > 0

    @pytest.mark.parametrize(
        "default",
        [
            MESHED,
            FIELD,
            ONE_PIECE,
            '<default><site euler="0 0 30"/></default>',
        ],
    )
    def test_the_way_out_of_a_default_leads_out(self, default, clean):
        """The attribute that the sentence names taken out; on a body, which a site's default does
        not move."""
        with pytest.raises(bc.BeamchainError) as refused:
            bc.embed(craft(before=default), {"hub": spec("rod_in_boxes")})
        word = re.search(r"; take (\w+) out of", str(refused.value)).group(1)
        without = re.sub(rf'(<(?:geom|site)[^>]*?) {word}="[^"]*"', r"\1", default)
        assert without != default
        done = bc.embed(craft(before=without), {"hub": spec("rod_in_boxes")}, retime=False)
        assert done.model.ngeom == clean.ngeom
        np.testing.assert_allclose(done.model.geom_size, clean.geom_size)
        np.testing.assert_allclose(frequencies(done.model), frequencies(clean), rtol=SAME)

    @pytest.mark.parametrize("default", [FIELD, '<default><geom euler="0 0 30"/></default>'])
    def test_a_class_that_does_not_reach_the_appendage_is_no_reason(self, default):
        inner = default.replace("<default>", '<default><default class="other">').replace(
            "</default>", "</default></default>"
        )
        made = bc.embed(craft(before=inner), {"mount": spec("rod_in_boxes")}, retime=False)
        assert made.model.ngeom > 0
        reached = craft(before=inner).replace(
            '<body name="hub"', '<body name="hub" childclass="other"'
        )
        with pytest.raises(bc.BeamchainError, match="out of it"):
            bc.embed(reached, {"mount": spec("rod_in_boxes")})

    def test_output_exists(self, done, tmp_path):
        (tmp_path / "out.xml").write_text("mine")
        with pytest.raises(bc.BeamchainError, match="--force"):
            done.write(tmp_path / "out.xml")
        assert (tmp_path / "out.xml").read_text() == "mine"

    def test_locked(self, done):
        with pytest.raises(bc.BeamchainError, match="cannot write"):
            done.write("/proc/beamchain/out.xml")


class TestHostile:
    DEFAULTS = """<default>
    <joint springref="0.3" ref="0.1" damping="3" armature="2" stiffness="7 2 1" margin="0.2"
        solreflimit="0.5 2" range="-1 1" frictionloss="1"/>
        <geom contype="3" conaffinity="5" friction="3 1 1" group="4"
        margin="0.1" type="box" size="1 2 3"/><site size="0.4" group="4"/>
        <tendon stiffness="30" springlength="0.2" frictionloss="0.4"/>
        <default class="near"><joint damping="5"/><site rgba="1 0 0 1"/></default></default>"""

    @pytest.mark.slow
    def test_defaults_and_child_classes(self):
        hostile = craft(before=f'<compiler angle="radian"/>{self.DEFAULTS}').replace(
            'name="hub"', 'name="hub" childclass="near"'
        )
        made, plain = (
            bc.embed(text, {"mount": spec("array_left")}, retime=False).model
            for text in (hostile, craft())
        )
        np.testing.assert_allclose(frequencies(made), frequencies(plain), rtol=SAME)

    @pytest.mark.slow
    def test_warnings_carry_figure_and_cure(self):
        text = craft(
            before='<option timestep="0.5" gravity="0 0 -9.81" density="1.2" integrator="Euler"/>'
        )
        done = bc.embed(text, {"mount": spec("array_left")}, retime=False)
        for word in ("-9.81 m/s^2", "density 1.2", "timestep 0.5 s is above", "explicitly"):
            assert any(word in w for w in done.warnings), word
        assert "implicitfast" in done.cure.words
        if hasattr(mujoco.mjtIntegrator, "mjINT_DISCRETE"):
            text = craft(before='<option timestep="0.01" gravity="0 0 0" integrator="discrete"/>')
            assert any(
                "adds a damping ratio of" in w
                for w in bc.embed(text, {"mount": spec("rod")}).warnings
            )

    @pytest.mark.slow
    def test_the_warned_step_is_the_limit(self):
        """MuJoCo blows up above the step that the warning names, and not below."""
        text = craft(before='<option timestep="{}" gravity="0 0 0" integrator="implicitfast"/>')
        warned = bc.embed(text.format(1.0), {"mount": spec("rod")}, retime=False).warnings
        limit = float(re.search(r"above the ([0-9.e-]+) s", " ".join(warned)).group(1))
        for factor, stable in ((0.98, True), (1.02, False)):
            model = bc.embed(
                text.format(factor * limit), {"mount": spec("rod")}, retime=False
            ).model
            model.opt.disableflags |= (
                int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
                if hasattr(mujoco.mjtDisableBit, "mjDSBL_AUTORESET")
                else 0
            )
            data = mujoco.MjData(model)
            data.qvel[-1] = 1e-6
            for _ in range(2000):
                mujoco.mj_step(model, data)
            assert (np.abs(data.qvel[-1]) < 1e-3) == stable

    @pytest.mark.slow
    def test_a_preloaded_spring_behind_the_mount(self, tmp_path, capsys, monkeypatch):
        """A drive whose spring pulls against a stop:
        the same modes as with a slack spring, and a word."""
        yoke = (
            '<body name="yoke"><joint name="drive" axis="0 0 1" stiffness="1000" springref="{}"/>'
            '<inertial pos=".3 .1 0" mass="5" diaginertia="1 1 1"/><site name="mount"/></body>'
        )
        pulled, slack = (
            bc.embed(
                craft(yoke.format(turn), before='<option gravity="0 0 0"/>'),
                {"mount": spec("rod")},
                retime=False,
            )
            for turn in (30, 0)
        )
        assert any("'drive' is preloaded: it pulls with 523.6 N m" in w for w in pulled.warnings)
        assert not any("preloaded" in w for w in slack.warnings)
        np.testing.assert_allclose(
            *([m.mujoco for m in one.assembly.modes if m.mujoco] for one in (pulled, slack)),
            rtol=1e-9,
        )
        path = tmp_path / "pulled.xml"
        pulled.write(path)
        code, _, error = run(["inspect", str(path), "--steps"], capsys, monkeypatch)
        assert code == 2
        assert "'drive' is preloaded: it pulls with 523.6 N m" in error

    def test_alignfree_is_said(self):
        text = craft(before='<compiler alignfree="true"/>').replace(
            'pos="0 0 0" mass', 'pos="0.1 0 0" mass'
        )
        made = bc.embed(text, {"mount": spec("rod")}, rigid=True)
        assert any("alignfree" in w for w in made.warnings)
