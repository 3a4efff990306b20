"""A file of `embed` that was edited by hand, proved again as it stands."""

import re
import shutil

import numpy as np
import pytest
from lxml import etree

import beamchain as bc
from arms import Arm, Link, mjcf, side, toml
from command import call
from craft_truth import Pair, compiled

BAND = 20.0
SAME = 1e-9  # relative: the same numbers, computed in the same way
AGREE = 0.05  # stated and found error of the craft, relative
MODES = "[modes]\nxy = 2\nxz = 2\ntorsion = 1\n"
PLANE = "[modes]\nxy = 1\nxz = 0\n"  # where any modes do
BEND = {"elbow": {"fore": 0.8}}
FORE = Link("fore", 5.0, 0.04, 0.05, 2.0, (0.01, 0.01, 0.01), (0.0, 0.0, 1.0), 4000.0, 5.0)
ONE = Arm((Link("upper", 6.0, 0.05, 0.08),), hand_inertia=(0.4, 0.4, 0.4), keys={"as_built": {}})
TWO = Arm((ONE.links[0], FORE), hand_inertia=(0.4, 0.4, 0.4), keys=BEND)


def embedded(folder, arm, craft=None):
    """The file of an arm, and what `embed` said of it."""
    (folder / "arm.xml").write_text(craft or mjcf(arm))
    for link in arm.links:
        (folder / f"{link.name}.toml").write_text(
            toml(arm, link, BAND, 0.02, MODES if arm is ONE else PLANE)
        )
    at = {f"place_{link.name}": folder / f"{link.name}.toml" for link in arm.links}
    result = bc.embed(folder / "arm.xml", at)
    result.write(folder / "flexible.xml", force=True)
    return folder / "flexible.xml", result


@pytest.fixture(scope="module")
def one(tmp_path_factory):
    return embedded(tmp_path_factory.mktemp("one"), ONE)


@pytest.fixture(scope="module")
def two(tmp_path_factory):
    return embedded(tmp_path_factory.mktemp("two"), TWO)


@pytest.fixture
def file_of_one(one, tmp_path):
    """A copy of its file, to be edited."""
    return shutil.copy(one[0], tmp_path / "flexible.xml")


@pytest.fixture
def file_of_two(two, tmp_path):
    return shutil.copy(two[0], tmp_path / "flexible.xml")


def edited(file, old, new):
    """The file with one thing changed."""
    text = file.read_text()
    changed = re.sub(old, new, text)
    assert changed != text
    file.write_text(changed)
    return file


def stiffer(file, tendon, factor):
    """The file with a tendon that much stiffer."""
    return edited(
        file,
        rf'(<fixed name="{tendon}"[^>]*stiffness=")([^"]+)',
        lambda found: found[1] + repr(float(found[2]) * factor),
    )


def assert_same(proof, fresh):
    assert proof.promise.poses == pytest.approx(fresh.promise.poses, rel=SAME)
    # its maximum is looked for on a grid that starts from each file's own poles
    assert proof.sampled_error == pytest.approx(fresh.sampled_error, rel=1e-4)
    assert proof.time_error.error == pytest.approx(fresh.time_error.error, rel=1e-6)
    assert (proof.tolerance, proof.band, proof.met) == (fresh.tolerance, fresh.band, fresh.met)


@pytest.mark.slow
def test_a_file_as_it_was_written_is_proved_as_it_was(one):
    file, fresh = one
    assert_same(bc.prove(file), fresh)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arm", "edits"),
    [
        (
            ONE,
            {
                'mass="10.0"': 'mass="300.0"',
                'diaginertia="80.0 100.0 120.0"': 'diaginertia="8.0 10.0 12.0"',
            },
        ),
        (TWO, {'stiffness="4000.0"': 'stiffness="900.0"'}),
    ],
    ids=["hand and bus", "drive"],
)
def test_an_edited_spacecraft_is_what_a_fresh_embedding_of_it_states(
    one, two, arm, edits, tmp_path
):
    file, before = one if arm is ONE else two
    file, craft = shutil.copy(file, tmp_path / "edited.xml"), mjcf(arm)
    for old, new in edits.items():
        assert old in craft
        craft = craft.replace(old, new)
        edited(file, old, new)
    proof = bc.prove(file)
    fresh = embedded(tmp_path, arm, craft)[1]
    # the timing in the file is that for the spacecraft as it was, the fresh one's for it as it is
    assert proof.promise.poses == pytest.approx(fresh.promise.poses, rel=SAME)
    assert (proof.tolerance, proof.band) == (fresh.tolerance, fresh.band)
    assert proof.promise.poses != pytest.approx(before.promise.poses, rel=1e-3)


@pytest.mark.slow
def test_an_edited_tendon_is_stated_as_finite_elements_find_it(one, file_of_one):
    proof = bc.prove(stiffer(file_of_one, "upper_mode1_xy", 1.01))
    assert proof.craft_error > 5.0 * one[1].craft_error
    assert not proof.met
    model = proof.model
    for stated in proof.promise.poses.values():
        found, _ = Pair(
            side(ONE, BAND), compiled(model, model.qpos0), list(range(6)), BAND
        ).search()
        assert stated == pytest.approx(found, rel=AGREE)


@pytest.mark.slow
def test_an_edited_keyframe_is_the_pose_that_is_proved(file_of_two, tmp_path):
    proof = bc.prove(edited(file_of_two, r'(?<=")([^"]* )0\.8( [^"]*)(?=")', r"\g<1>1.4\2"))
    other = Arm(**{**TWO.__dict__, "keys": {"elbow": {"fore": 1.4}}})
    fresh = embedded(tmp_path, other)[1]
    assert proof.promise.poses == pytest.approx(fresh.promise.poses, rel=SAME)


def renamed(root):
    next(root.iter("key")).set("name", "other")


def added_key(root):
    positions = " ".join(["0"] * len(next(root.iter("key")).get("qpos").split()))
    etree.SubElement(next(root.iter("keyframe")), "key", name="more", qpos=positions)


def put_on_link(root):
    link = next(node for node in root.iter("body") if node.get("name") == "upper_link2")
    camera = etree.SubElement(link, "body", name="camera")
    etree.SubElement(camera, "inertial", pos="0 0 0", mass="1", diaginertia="1 1 1")


def moved_to_another_link(root):
    mark = next(n for n in root.iter(etree.Comment) if '"piece": "load"' in n.text)
    frame = mark.getnext()
    other = next(node for node in root.iter("body") if node.get("name") == "upper_link1")
    other.append(mark)
    other.append(frame)


def appendage_taken_out(root):
    link = next(node for node in root.iter("body") if node.get("name") == "upper_link1")
    link.getparent().remove(link)
    for tag in ("tendon", "sensor", "contact", "keyframe", "deformable"):
        for node in list(root.iter(tag)):
            node.getparent().remove(node)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (renamed, "a keyframe was put in, taken out or renamed"),
        (added_key, "does not compile any more"),
        (put_on_link, "body 'camera' was put on body 'upper_link2'"),
        (moved_to_another_link, "carries body 'hand' on its port 'end'"),
        (appendage_taken_out, "is not found|nothing stands behind"),
    ],
)
def test_what_the_marks_do_not_say_any_more_is_said_in_a_sentence(file_of_one, change, sentence):
    root = etree.fromstring(file_of_one.read_bytes())
    change(root)
    file_of_one.write_bytes(etree.tostring(root))
    answer = call("inspect", file_of_one, "--prove")
    assert answer.status == 2
    assert re.search(sentence, " ".join(answer.err.split())), answer.err
    assert "Traceback" not in answer.err


@pytest.mark.slow
def test_the_command_prints_the_proof_and_exits_with_3_where_it_is_missed(file_of_one):
    kept = call("inspect", file_of_one, "--prove", "--json")
    assert kept.status == 0
    assert kept.record["proof"]["met"]
    stiffer(file_of_one, "upper_mode1_xy", 1.2)
    missed = call("inspect", file_of_one, "--prove")
    assert missed.status == 3
    assert "above the tolerance 0.02" in " ".join(missed.out.split())


@pytest.mark.slow
def test_text_is_taken_as_a_file_is_and_a_keyframe_that_bends_an_appendage_is_warned_of(two):
    file, fresh = two
    proof = bc.prove(file.read_text())
    assert proof.promise.poses == pytest.approx(fresh.promise.poses, rel=SAME)
    assert "bent-keyframe" not in {said.code for said in proof.warnings}
    root = etree.fromstring(file.read_bytes())
    next(root.iter("key")).set("qpos", "0 0 0 1 0 0 0 0.8")  # the rest is filled up at the end
    short = bc.prove(etree.tostring(root, encoding="unicode"))
    (said,) = [said for said in short.warnings if said.code == "bent-keyframe"]
    assert re.search(rf"0.8 rad for 'upper_.*write all {short.model.nq} values", said)


@pytest.mark.slow
def test_a_rigid_twin_is_proved_as_one(tmp_path):
    (tmp_path / "arm.xml").write_text(mjcf(ONE))
    (tmp_path / "upper.toml").write_text(toml(ONE, ONE.links[0], BAND, 0.02, PLANE))
    twin = bc.embed(tmp_path / "arm.xml", {"place_upper": tmp_path / "upper.toml"}, rigid=True)
    twin.write(tmp_path / "rigid.xml")
    proof = bc.prove(tmp_path / "rigid.xml")
    assert proof.craft_error == pytest.approx(twin.craft_error, rel=SAME)
    assert np.isfinite(proof.craft_error)
