"""The drawing of a tree on the page of `embed`: everything is named at every pose, and no name
covers another or leaves the picture."""

from importlib.resources import files
from itertools import combinations

import pytest
from lxml import html
from matplotlib.backends.backend_agg import FigureCanvasAgg

import beamchain as bc
from beamchain.report.tree_plot import tree_figure

SHIPPED = files("beamchain") / "examples"
NAMES = ["bus, free", "elbow, hinge", "fore at forearm", "hand, welded", "upper at shoulder"]


@pytest.fixture(scope="module")
def arm():
    at = {"shoulder": SHIPPED / "upper.toml", "forearm": SHIPPED / "fore.toml"}
    return bc.embed(SHIPPED / "arm.xml", at, retime=False)


@pytest.mark.slow
def test_every_pose_names_what_hangs_where_and_no_names_overlap(arm):
    figure = tree_figure(arm)
    renderer = FigureCanvasAgg(figure).get_renderer()
    assert [ax.get_title("left") for ax in figure.axes] == [
        "at rest",
        "keyframe bent",
        "keyframe square",
    ]
    for ax in figure.axes:
        texts = [text for text in ax.texts if text.get_text()]
        assert sorted(text.get_text() for text in texts) == NAMES
        boxes = [text.get_window_extent(renderer) for text in texts]
        assert not any(a.overlaps(b) for a, b in combinations(boxes, 2))
        for box in boxes:
            assert box.x0 > 0.0
            assert box.x1 < figure.bbox.x1


@pytest.mark.slow
def test_the_hand_is_drawn_where_the_keyframe_puts_it(arm):
    # the elbow at 6.5 m, the forearm of 5 m turned by 90 degrees
    ax = tree_figure(arm).axes[2]
    ends = [tuple(line.get_xydata()[-1].round(6)) for line in ax.lines]
    assert (6.5, 5.0) in ends


@pytest.mark.slow
def test_the_page_shows_the_tree(arm):
    page = html.fromstring(arm.report())
    captions = [caption.text_content() for caption in page.iter("figcaption")]
    assert any(caption.strip().startswith("What hangs where") for caption in captions)
