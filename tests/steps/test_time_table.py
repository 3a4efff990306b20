"""The table of docs/time.md is what `bc.embed` states."""

import re
from pathlib import Path

import pytest

import beamchain as bc

PAGE = Path(__file__).parents[2] / "docs" / "time.md"
ROW = re.compile(
    r"^\| (one boom|two booms, 8 and 5 m|two booms of 8 m), hub (\d+) kg \| (\w+) \| (\S+) \| "
    r"(\S+) \| (< )?(\S+) \|$",
    re.M,
)
BOOMS = {"one boom": (8.0,), "two booms, 8 and 5 m": (8.0, 5.0), "two booms of 8 m": (8.0, 8.0)}
ROUNDED = 0.06  # of figures printed with two digits
LEAST = 0.6  # of a bound, which is printed where rounding decides between plans
NOTHING = 1e-9  # rounding differs from machine to machine


def stated(what, hub, integrator, ratio):
    """Both errors of the craft of a row."""
    tube = bc.Tube(outer_diameter=0.05, wall=0.002)
    parts = bc.Material(youngs_modulus=7e10, density=2700.0)
    at = {
        site: bc.Spec(
            name=f"boom_{site}",
            segment=(bc.Segment(length=length, section=tube, material=parts),),
            damping=bc.Damping(ratio=ratio),
            scene=bc.Scene(bandwidth=10.0, tolerance=1e-3),
        )
        for site, length in zip("ab", BOOMS[what], strict=False)
    }
    craft = (
        '<mujoco><option gravity="0 0 0" timestep="0.02" '
        f'integrator="{integrator}"/><worldbody><body name="bus"><freejoint/><inertial pos="0 0 0" '
        f'mass="{hub}" diaginertia="{0.3 * hub} {0.4 * hub} {0.5 * hub}"/><site name="a" pos="0.5 '
        '0 0"/><site name="b" pos="-0.5 0 0" euler="0 0 180"/></body></worldbody></mujoco>'
    )
    made = bc.embed(craft, at, retime=True)
    return made.time_error.error, made.sampled_error


@pytest.mark.skipif(not PAGE.is_file(), reason="docs are not beside the tests (an installed wheel)")
@pytest.mark.slow
def test_the_table_is_what_embed_states():
    rows = ROW.findall(PAGE.read_text())
    assert len(rows) >= 7
    for what, hub, integrator, ratio, poles, bound, response in rows:
        found = stated(what, float(hub), integrator, float(ratio))
        if poles == "exact":
            assert found[0] < NOTHING
        else:
            assert found[0] == pytest.approx(float(poles), rel=ROUNDED)
        if bound:
            assert LEAST < found[1] / float(response) < 1.0
        else:
            assert found[1] == pytest.approx(float(response), rel=ROUNDED)
