"""Tests an internal, `cli.init.commented`: the comments of a template come from the schema.

The templates that `beamchain init` writes are read back, comments and all, in test_manners.py.
"""

from beamchain.cli.init import add_comments


def test_templates_take_their_comments_from_the_schema():
    template = (
        "[[segment]]\nlength = 2.0\n# [segment.section]\nwidth_y = 1.0  # "
        "mine\nlinear_mass "
        "= 2.0\n[scene]\nnothing = 1\n"
    )
    assert add_comments(template).splitlines() == [
        "[[segment]]",
        f"{'length = 2.0':<38} # length along x [m]",
        "# [segment.section]",
        "width_y = 1.0  # mine",
        f"{'linear_mass = 2.0':<38} # mass per length [kg/m]",
        "[scene]",
        "nothing = 1",
    ]
