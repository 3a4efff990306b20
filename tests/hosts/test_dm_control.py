"""dm_control's mjcf with a file that embed wrote,
and with a bare appendage that it attaches itself."""

import numpy as np
import pytest

import beamchain as bc
from spacecraft import APPENDAGES, CRAFTS, frequencies, response

pytestmark = pytest.mark.host
mjcf = pytest.importorskip(
    "dm_control.mjcf", reason="dm_control is not installed: pip install 'beamchain[dm-control]'"
)

FREQUENCY = 1e-12  # it writes 17 digits and compiles with the same MuJoCo
MOTION = 1e-9  # of the peak, over 10 000 steps


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    out = bc.embed(CRAFTS / "drive.xml", {"panel_mount": APPENDAGES / "array_left.toml"})
    folder = tmp_path_factory.mktemp("dm")
    (folder / "array.xml").write_text(out.appendages[0].fit.to_mjcf())
    return out, out.write(folder / "craft.xml")[-1]


def models(done) -> dict:
    path = done[1]
    own = mjcf.from_path(str(CRAFTS / "drive.xml"))
    own.find("site", "panel_mount").attach(mjcf.from_path(str(path.parent / "array.xml")))
    # dm_control's attachment frame is one more body, without mass
    own.find("key", "turned").remove()
    return {
        "embedded file": mjcf.Physics.from_mjcf_model(mjcf.from_path(str(path))).model.ptr,
        "embedded text": mjcf.Physics.from_mjcf_model(
            mjcf.from_xml_string(path.read_text())
        ).model.ptr,
        "attached by dm_control": mjcf.Physics.from_mjcf_model(own).model.ptr,
    }


def test_same_frequencies_and_motion(done):
    # embed's files are exact in time for the craft's step; the bare appendage,
    # which dm_control attaches, is for any
    exact = done[0].model
    plain = bc.embed(
        CRAFTS / "drive.xml", {"panel_mount": APPENDAGES / "array_left.toml"}, retime=False
    ).model
    for name, model in models(done).items():
        like = plain if name == "attached by dm_control" else exact
        reference = frequencies(like)
        motion = response(like)
        peak = np.abs(motion - motion[0]).max(axis=0)
        off = float(np.max(np.abs(frequencies(model) / reference - 1.0)))
        far = float(np.max(np.abs(response(model) - motion) / peak))
        print(f"dm_control, {name}: frequencies {off:.1e}, 20 s of motion {far:.1e} of the peak")  # noqa: T201
        assert off < FREQUENCY, name
        assert far < MOTION, name
