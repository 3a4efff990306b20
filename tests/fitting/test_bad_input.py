"""Wrong input of every kind gets one clear sentence and exit status 2, and nothing is written.

Each case: the text of a spec, and a word its sentence must hold.
"""

import contextlib
import os
import socket
import stat
from pathlib import Path

import pytest

import beamchain as bc
from command import run

SEGMENT = """
[[segment]]
length = 15.0
section = { shape = "round", diameter = 0.012 }
material = { youngs_modulus = 2.06e11, density = 7800.0 }
"""
GOOD = 'name = "boom"\n' + SEGMENT

CRAFT = (
    '<mujoco><worldbody><body name="hub"><freejoint/><geom size=".5" '
    'mass="50"/></body></worldbody></mujoco>'
)


def changed(old: str, new: str) -> str:
    assert old in GOOD
    return GOOD.replace(old, new)


CASES = {
    "empty": ("", "segment"),
    "only a name": ('name = "boom"\n', "segment"),
    "no TOML": ("name = boom\n", "TOML"),
    "capital in the name": (changed('"boom"', '"Boom"'), "name"),
    "slash in the name": (changed('"boom"', '"../x"'), "name"),
    "length missing": (changed("length = 15.0\n", ""), "length is missing"),
    "length negative": (changed("15.0", "-15.0"), "length = -15.0"),
    "length nan": (changed("15.0", "nan"), "length = nan"),
    "length absurd": (changed("15.0", "1e300"), "length"),
    "length a string": (changed("15.0", '"15 m"'), "15 m"),
    "unknown key": (
        changed("length = 15.0", "lenght = 15.0\nlength = 15.0"),
        "did you mean 'length'",
    ),
    "unknown table": (GOOD + "[rooot]\n", "did you mean 'root'"),
    "unknown shape": (changed('"round"', '"ruond"'), "did you mean 'round'"),
    "diameter missing": (changed(", diameter = 0.012", ""), "diameter is missing"),
    "wall too thick": (
        changed('"round", diameter = 0.012', '"tube", outer_diameter = 0.012, wall = 0.01'),
        "wall = 0.01",
    ),
    "Poisson's ratio": (
        changed("7800.0 }", "7800.0, poissons_ratio = 0.7 }"),
        "poissons_ratio = 0.7",
    ),
    "two shear moduli": (
        changed("7800.0 }", "7800.0, poissons_ratio = 0.3, shear_modulus = 1e10 }"),
        "shear_modulus",
    ),
    "material and equivalent": (
        changed(
            '"round", diameter = 0.012', '"equivalent", bending_stiffness_xy = 1, linear_mass = 1'
        ),
        "material",
    ),
    "theory": (changed("length", 'theory = "bernoulli"\nlength'), "bernoulli"),
    "shear factor for Euler": (changed("length", "shear_factor = 0.9\nlength"), "shear_factor"),
    "taper of two shapes": (
        changed(
            "material",
            'section_end = { shape = "tube", outer_diameter = 0.012, wall = 0.001 }\nmaterial',
        ),
        "section_end",
    ),
    "nonstructural mass": (
        changed("length", "nonstructural_mass = -1.0\nlength"),
        "nonstructural_mass",
    ),
    "joint behind the tip": (
        GOOD + "[[joint]]\nafter_segment = 1\nstiffness_xy = 5.0\n",
        "after_segment = 1",
    ),
    "joint without stiffness": (GOOD + "[[joint]]\nafter_segment = 0\n", "stiffness"),
    "two joints at one place": (
        GOOD + 2 * "[[joint]]\nafter_segment = 0\nstiffness_xy = 5.0\n",
        "two joints",
    ),
    "lump beyond the tip": (GOOD + "[[lump]]\nx = 16.0\nmass = 1.0\n", "lump.x = 16.0"),
    "lump inertia of no body": (
        GOOD + "[[lump]]\nx = 1.0\nmass = 1.0\ninertia = [1, 1, 3]\n",
        "inertia",
    ),
    "damping above one": (GOOD + "[damping]\nratio = 1.5\n", "ratio = 1.5"),
    "damping form": (GOOD + '[damping]\nform = "rayleigh"\n', "rayleigh"),
    "damping of no port": (GOOD + "[damping]\nratio = { yx = [0.01] }\n", "yx"),
    "modes all zero": (GOOD + "[modes]\nxy = 0\n", "no mode"),
    "modes too many": (GOOD + "[modes]\nxy = 1000\n", "xy = 1000"),
    "modes a float": (GOOD + "[modes]\nxy = 1.5\n", "xy"),
    "target": (GOOD + '[root]\ntarget = "fixed"\n', "fixed"),
    "target hub without hub": (GOOD + '[root]\ntarget = "hub"\n', "hub"),
    "springs": (GOOD + '[fit]\nsprings = "mode"\n', "did you mean 'modes'"),
    "integrator": (GOOD + '[scene]\nintegrator = "euler"\n', "did you mean 'Euler'"),
    "torsion rigid": (
        'name = "a"\n[[segment]]\nlength = 1.0\n'
        'section = { shape = "equivalent", bending_stiffness_xy = 1, linear_mass = 1 '
        "}\n[modes]\ntorsion = 1\n",
        "torsion",
    ),
    "payload beyond double precision": (
        GOOD + "[payload]\nmass = 1e30\n",
        "payload.mass = 1e+30 kg is 7.6e+28 times",
    ),
    "lump beyond double precision": (
        GOOD + "[[lump]]\nx = 10.0\nmass = 1e15\n",
        "lump.mass = 1000000000000000.0 kg is",
    ),
    "lump's inertia beyond double precision": (
        GOOD + "[[lump]]\nx = 10.0\nmass = 1.0\ninertia = [1e20, 1e20, 1e20]\n",
        "lump.inertia = 1e+20 kg m^2 is",
    ),
    "hub too far away": (
        GOOD
        + "[root]\nhub = { mass = 1e20, inertia = [1e20, 1e20, 1e20], offset = [1e10, 0.0, 0.0] "
        "}\n",
        "offset = [10000000000.0, 0.0, 0.0] m puts the root so far",
    ),
}


def is_one_sentence(text: str) -> bool:
    return text.startswith("beamchain: ") and text.count("\n") == 1 and "Traceback" not in text


@pytest.mark.parametrize("name", CASES)
def test_wrong_spec(name, tmp_path, capsys, monkeypatch):
    content, word = CASES[name]
    spec = tmp_path / "spec.toml"
    out = tmp_path / "out"
    spec.write_text(content)
    code, _, error = run(["fit", str(spec), "-o", str(out)], capsys, monkeypatch)
    assert code == 2
    assert is_one_sentence(error), error
    assert word in error
    assert not out.exists()


def test_good_spec_passes(tmp_path):
    (tmp_path / "spec.toml").write_text(GOOD)
    assert bc.fit(tmp_path / "spec.toml").status.ok


class TestFiles:
    def refused(self, arguments, capsys, monkeypatch, word):
        code, _, error = run(arguments, capsys, monkeypatch)
        assert code == 2
        assert is_one_sentence(error), error
        assert word in error

    def good(self, tmp_path: Path) -> Path:
        spec = tmp_path / "spec.toml"
        spec.write_text(GOOD)
        return spec

    def test_no_file(self, tmp_path, capsys, monkeypatch):
        self.refused(
            ["fit", str(tmp_path / "no.toml"), "-o", str(tmp_path / "o")],
            capsys,
            monkeypatch,
            "does not exist",
        )

    def test_folder_for_a_file(self, tmp_path, capsys, monkeypatch):
        self.refused(
            ["fit", str(tmp_path), "-o", str(tmp_path / "o")], capsys, monkeypatch, "is a folder"
        )

    def test_device_for_a_file(self, tmp_path, capsys, monkeypatch):
        self.refused(
            ["fit", "/dev/zero", "-o", str(tmp_path / "o")], capsys, monkeypatch, "regular file"
        )

    def test_binary(self, tmp_path, capsys, monkeypatch):
        spec = tmp_path / "spec.toml"
        spec.write_bytes(b"\xff\xfe\x00name")
        self.refused(["fit", str(spec), "-o", str(tmp_path / "o")], capsys, monkeypatch, "UTF-8")

    def test_null_in_the_name(self, tmp_path, capsys, monkeypatch):
        code, _, error = run(["fit", "a\0b", "-o", str(tmp_path / "o")], capsys, monkeypatch)
        assert code == 2
        assert "Traceback" not in error

    def test_huge(self, tmp_path, capsys, monkeypatch):
        spec = tmp_path / "spec.toml"
        with spec.open("wb") as stream:
            stream.truncate(200_000_000)
        self.refused(
            ["fit", str(spec), "-o", str(tmp_path / "o")], capsys, monkeypatch, "200000000 bytes"
        )

    def test_deeply_nested(self, tmp_path, capsys, monkeypatch):
        spec = tmp_path / "spec.toml"
        spec.write_text("a = " + "[" * 5000 + "]" * 5000)
        self.refused(["fit", str(spec), "-o", str(tmp_path / "o")], capsys, monkeypatch, "spec")

    def test_output_exists(self, tmp_path, capsys, monkeypatch):
        out = tmp_path / "o"
        out.mkdir()
        (out / "fit.json").write_text("mine")
        self.refused(
            ["fit", str(self.good(tmp_path)), "-o", str(out)], capsys, monkeypatch, "--force"
        )
        assert (out / "fit.json").read_text() == "mine"
        assert [p.name for p in out.iterdir()] == ["fit.json"]

    def test_output_is_a_file(self, tmp_path, capsys, monkeypatch):
        (tmp_path / "o").write_text("mine")
        self.refused(
            ["fit", str(self.good(tmp_path)), "-o", str(tmp_path / "o")],
            capsys,
            monkeypatch,
            "cannot write",
        )
        assert (tmp_path / "o").read_text() == "mine"

    def test_place_of_an_output_is_a_folder(self, tmp_path, capsys, monkeypatch):
        (tmp_path / "o" / "fit.json").mkdir(parents=True)
        arguments = ["fit", str(self.good(tmp_path)), "-o", str(tmp_path / "o"), "--force"]
        self.refused(arguments, capsys, monkeypatch, "is a folder")
        assert [p.name for p in (tmp_path / "o").iterdir()] == ["fit.json"]

    @pytest.mark.parametrize(
        ("kind", "command", "force"),
        [
            (kind, command, ["--force"] if (i + j) % 3 else [])
            for i, kind in enumerate(("device", "fifo", "socket", "folder", "link"))
            for j, command in enumerate(("fit", "embed", "init", "stability"))
        ],
    )
    def test_place_of_an_output_is_no_file(
        self, kind, command, force, tmp_path, capsys, monkeypatch
    ):
        out = tmp_path / "out"
        out.mkdir()
        at = out / {"fit": "fit.json", "stability": "stability.json", "init": "boom.toml"}.get(
            command, "craft.xml"
        )
        word = {"device": "a device", "link": "a device", "folder": "a folder"}.get(
            kind, f"a {kind}"
        )
        with contextlib.ExitStack() as stack:
            if kind == "fifo":
                os.mkfifo(at)
            elif kind == "folder":
                at.mkdir()
            elif kind == "socket":
                monkeypatch.chdir(out)  # a socket's path is short
                stack.enter_context(socket.socket(socket.AF_UNIX)).bind(at.name)
            elif kind == "link":
                at.symlink_to("/dev/full")
            else:
                try:
                    os.mknod(at, stat.S_IFCHR | 0o600, os.makedev(1, 7))
                except PermissionError:
                    pytest.skip("only root makes devices")
            before = os.lstat(at)
            good = str(self.good(tmp_path))
            craft = tmp_path / "craft.xml"
            craft.write_text(CRAFT)
            arguments = {
                "fit": ["fit", good, "-o", str(out)],
                "stability": ["inspect", good, "--steps", "-o", str(out)],
                "init": ["init", "boom", "-o", str(at)],
                "embed": ["embed", str(craft), "--mount", f"hub={good}", "-o", str(at)],
            }[command]
            self.refused([*arguments, *force], capsys, monkeypatch, word)
            after = os.lstat(at)
            assert (after.st_ino, after.st_mode, after.st_ctime_ns) == (
                before.st_ino,
                before.st_mode,
                before.st_ctime_ns,
            )
            assert list(out.iterdir()) == [at]

    @pytest.mark.parametrize(
        ("command", "place"),
        [("fit", "o"), ("inspect --steps", "o/deeper"), ("study", "o"), ("sweep", "o/deeper")],
    )
    def test_below_a_file(self, command, place, tmp_path, capsys, monkeypatch):
        (tmp_path / "o").write_text("mine")
        spec = self.good(tmp_path)
        spec.write_text(spec.read_text() + "[uncertain]\nstiffness = { relative = 0.05 }\n")
        arguments = [*command.split(), str(spec), "-o", str(tmp_path / place), "--force"]
        self.refused(arguments, capsys, monkeypatch, "cannot write to")
        assert (tmp_path / "o").read_text() == "mine"

    @pytest.mark.skipif(os.geteuid() == 0, reason="root may write into read-only folders")
    def test_read_only_folder(self, tmp_path, capsys, monkeypatch):
        (tmp_path / "o").mkdir(mode=0o500)
        self.refused(
            ["fit", str(self.good(tmp_path)), "-o", str(tmp_path / "o")],
            capsys,
            monkeypatch,
            "cannot write",
        )

    @pytest.mark.parametrize(
        ("content", "word"),
        [
            ("<mujoco>", "refuses"),
            ("no xml", "refuses"),
            ("<mujoco/>", "degree of freedom"),
            ("", "refuses"),
        ],
    )
    def test_inspect(self, content, word, tmp_path, capsys, monkeypatch):
        model = tmp_path / "model.xml"
        model.write_text(content)
        self.refused(["inspect", str(model)], capsys, monkeypatch, word)

    def test_inspect_nothing(self, tmp_path, capsys, monkeypatch):
        self.refused(["inspect", str(tmp_path / "no.xml")], capsys, monkeypatch, "does not exist")
