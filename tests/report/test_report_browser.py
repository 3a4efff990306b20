"""The reports in headless Chromium: no error, no request, good on a phone.

What a user does is done by a script appended to a copy of the page;
its findings are read from the dumped page.
"""

import json
import re
import shutil
import subprocess

import pytest
from lxml import html

import beamchain as bc
from appendages import panels, seed_boom
from beamchain.report.replay import WIDTH
from command import call
from examples import example
from spacecraft import CRAFTS, spec

CHROMIUM = next(
    (
        path
        for name in ("chromium", "chromium-browser", "google-chrome")
        if (path := shutil.which(name))
    ),
    "",
)
LARGEST = 1_000_000  # bytes of a report
SHARE = 0.05  # of the page's width

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not CHROMIUM, reason="no Chromium on the PATH"),
]

HUB = bc.Hub(mass=500.0, inertia=(500.0, 500.0, 500.0), offset=(1.0, 0.0, 0.0))


@pytest.fixture(scope="module")
def pages(tmp_path_factory):
    folder = tmp_path_factory.mktemp("pages")
    made = {
        "boom": bc.fit(seed_boom(), name="boom", modes={"xy": 2}, root=bc.spec.Root(hub=HUB)),
        "panels": bc.fit(panels(), modes={"xy": 2, "xz": 1}, damping=bc.Damping(ratio=0.005)),
    }
    embedded = bc.embed(
        CRAFTS / "observer.xml", {"left": spec("array_left"), "boom_mount": spec("boom")}
    )
    for name, fit in made.items():
        fit.write(folder / name)
    file = embedded.write(folder / "craft" / "out.xml")[-1]
    answer = call("plant", file, "-o", folder / "craft" / "plant.npz")
    assert answer.status == 0, answer.err
    answer = call("inspect", example("seed_boom"), "--steps", "-o", folder / "stability")
    assert answer.status == 0, answer.err
    return {
        **{name: (folder / name / "report.html").read_text() for name in made},
        "embed": embedded.report("observer.xml", "out.xml"),
        "plant": (folder / "craft" / "plant_report.html").read_text(),
        "stability": (folder / "stability" / "report.html").read_text(),
    }


def browse(page, folder, script="", *options):
    """The dumped page and what the browser complained of, after `script` ran in it;
    `told` in it is read back."""
    runner = (
        "<script>window.addEventListener('load', async () => { const told = {};const still = "
        "() => new Promise((done) => requestAnimationFrame(() => "
        f"requestAnimationFrame(done)));try {{ {script} }} catch (error) {{ told.failed = "
        "String(error); }document.body.dataset.told = JSON.stringify(told); });</script>"
    )
    file = folder / "report.html"
    # the dumping browser paints no frames: what waits for one must not wait for ever
    frames = (
        "<script>window.requestAnimationFrame = (f) => setTimeout(f, 0);</script>"
        if "<script>" in page
        else ""
    )
    content = page.replace("<body>", "<body>" + frames, 1).replace("</body>", runner + "</body>")
    file.write_text(content, encoding="utf-8")
    done = subprocess.run(
        [
            CHROMIUM,
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--disable-dev-shm-usage",
            "--no-first-run",
            "--disable-background-networking",
            "--disable-component-update",
            "--disable-sync",
            f"--user-data-dir={folder / 'profile'}",
            "--host-resolver-rules=MAP * ~NOTFOUND",
            "--enable-logging=stderr",
            "--virtual-time-budget=4000",
            *options,
            "--dump-dom",
            file.as_uri(),
        ],
        capture_output=True,
        text=True,
        check=True,
        timeout=240,
    )
    complaints = [line for line in done.stderr.split("\n") if "CONSOLE" in line]
    root = html.fromstring(done.stdout)
    told = json.loads(root.xpath("//body/@data-told")[0])
    assert "failed" not in told, told
    return root, told, complaints


@pytest.mark.parametrize("name", ["boom", "panels", "embed", "plant", "stability"])
def test_opens_without_complaint_or_request(name, pages, tmp_path):
    assert len(pages[name].encode()) < LARGEST
    script = "told.asked = performance.getEntriesByType('resource').map((e) => e.name);"
    _, told, complaints = browse(pages[name], tmp_path, script)
    assert complaints == []
    assert told["asked"] == []


def test_the_policy_of_the_page_stops_requests(pages, tmp_path):
    """The other way round: were there a request in the page, these tests would see it stopped."""
    script = (
        "const i = new Image(); i.src = 'http://127.0.0.1:9/x'; await new Promise((r) => "
        "setTimeout(r, 200));"
    )
    _, _, complaints = browse(pages["boom"], tmp_path, script)
    assert any("Content Security Policy" in line for line in complaints)


@pytest.mark.parametrize("name", ["embed", "stability"])
def test_the_contents_of_a_page_lead_somewhere(name, pages, tmp_path):
    script = (
        "told.lost = [...document.querySelectorAll('nav a')].filter((a) => "
        "!document.querySelector(a.getAttribute('href'))).map((a) => a.textContent);const words = "
        "document.querySelector('details'); words.querySelector('summary').click(); await "
        "still();told.open = words.open;"
    )
    _, told, complaints = browse(pages[name], tmp_path, script)
    assert complaints == []
    assert told["lost"] == []
    assert told["open"]


def test_without_script_the_pictures_stand(pages, tmp_path):
    bare = re.sub(r"<script>.*?</script>", "", pages["boom"], flags=re.S)
    root, _, complaints = browse(bare, tmp_path)
    assert complaints == []
    assert len(root.xpath("//svg")) == 2
    assert root.xpath("//picture//img")
    assert root.xpath("//button") == []


@pytest.mark.parametrize("name", ["panels", "embed"])
def test_films_are_shown_and_respect_reduced_motion(name, pages, tmp_path):
    script = (
        "told.rows = "
        "[...document.images].map((e) => [e.naturalWidth, e.width > 0, e.currentSrc === e.src]);"
    )
    _, told, complaints = browse(pages[name], tmp_path, script)
    assert complaints == []
    assert len(told["rows"]) >= 2
    assert all(natural == WIDTH and shown and moves for natural, shown, moves in told["rows"])
    _, calm, _ = browse(pages[name], tmp_path, script, "--force-prefers-reduced-motion")
    assert not any(moves for _, _, moves in calm["rows"])


@pytest.mark.parametrize("name", ["panels", "embed", "plant", "stability"])
@pytest.mark.parametrize("width", [400, 1000])
def test_nothing_is_wider_than_the_page(width, name, pages, tmp_path):
    # the window itself cannot be made that narrow everywhere: a frame can
    script = (
        f"const frame = document.documentElement; frame.style.width = '{width}px'; await "
        "still();told.wide = [...document.querySelectorAll('main *')].filter((e) => "
        f"!e.closest('.scroll, pre, svg')).filter((e) => e.getBoundingClientRect().right > {width} "
        "+ 1).map((e) => e.outerHTML.slice(0, 80));"
    )
    _, told, _ = browse(pages[name], tmp_path, script, f"--window-size={width},800")
    assert told["wide"] == []


@pytest.mark.parametrize("name", ["boom", "embed"])
def test_what_scrolls_on_a_phone_says_so(name, pages, tmp_path):
    script = (
        "document.documentElement.style.width = '400px'; window.dispatchEvent(new "
        "Event('resize')); await still();const hint = (e) => getComputedStyle(e, "
        "'::before').content;told.hints = [...document.querySelectorAll('.scroll')].map((e) => "
        "[e.scrollWidth > e.clientWidth + 1, hint(e).includes('scroll'), e.tabIndex === 0]);"
    )
    _, told, _ = browse(pages[name], tmp_path, script, "--window-size=400,800")
    assert any(wider for wider, _, _ in told["hints"])
    assert all(wider == said == reached for wider, said, reached in told["hints"])


def test_figures_have_the_width_of_the_page(pages, tmp_path):
    script = (
        "const main = document.querySelector('main').getBoundingClientRect().width;"
        "told.shares = [...document.querySelectorAll('figure svg')]"
        ".map((e) => e.getBoundingClientRect().width / main);"
    )
    _, told, _ = browse(pages["boom"], tmp_path, script, "--window-size=1000,800")
    assert told["shares"] == pytest.approx([1.0] * len(told["shares"]), abs=SHARE)


@pytest.mark.parametrize("name", ["panels", "embed", "plant", "stability"])
def test_text_has_contrast(name, pages, tmp_path):
    """WCAG AA: 4.5 for text; what is drawn in the pictures is text too."""
    script = (
        "const lum = (c) => { const [r, g, b] = c.match(/[\\d.]+/g).map((v) => { v /= 255; return "
        "v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4; }); return 0.2126 * r + 0.7152 * "
        "g + 0.0722 * b; };const back = (e) => { for (; e; e = e.parentElement) { const c = "
        "getComputedStyle(e).backgroundColor; if (!/, 0\\)$/.test(c)) return c; } return 'rgb(255, "
        "255, 255)'; };told.poor = [...document.querySelectorAll('main *, header *, nav "
        "*')].filter((e) => [...e.childNodes].some((n) => n.nodeType === 3 && "
        "n.textContent.trim())).filter((e) => !e.closest('style, script')).map((e) => { const s = "
        "getComputedStyle(e); const a = lum(e.closest('svg') ? s.fill : s.color), b = "
        "lum(back(e)); return [(Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05), "
        "e.textContent.slice(0, 40)]; }).filter(([ratio]) => ratio < 4.5);"
    )
    _, told, _ = browse(pages[name], tmp_path, script)
    assert told["poor"] == []
