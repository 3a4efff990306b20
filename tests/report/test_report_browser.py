"""The reports in headless Chromium: no error, no request, zoom by button, key, wheel and drag, good on a phone.

What a user does is done by a script appended to a copy of the page; its findings are read from the dumped page.
"""

import json
import re
import shutil
import subprocess

import numpy as np
import pytest
from lxml import html

import beamchain as bc
from appendages import panels, seed_boom
from beamchain.cli import shipped
from beamchain.report.html import fit_report
from beamchain.report.plant_html import plant_report
from beamchain.report.study_html import stability_report
from spacecraft import CRAFTS, spec

CHROMIUM = next(
    (path for name in ("chromium", "chromium-browser", "google-chrome") if (path := shutil.which(name))), ""
)
LARGEST = 1_000_000  # bytes of a report
PIXEL = 0.05  # pt: coordinates are written with two digits
READABLE = 12.0  # px: text on a phone
POINTER = 3e-3  # of the axis: a pointer is at whole pixels

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not CHROMIUM, reason="no Chromium on the PATH"),
]

HUB = bc.Hub(mass=500.0, inertia=(500.0, 500.0, 500.0), offset=(1.0, 0.0, 0.0))


@pytest.fixture(scope="module")
def pages():
    made = {
        "boom": bc.fit(seed_boom(), name="boom", modes={"xy": 2}, root=bc.Root(hub=HUB)),
        "panels": bc.fit(panels(), modes={"xy": 2, "xz": 1}, damping=bc.Damping(ratio=0.005)),
    }
    embedded = bc.embed(CRAFTS / "observer.xml", {"left": spec("array_left"), "boom_mount": spec("boom")})
    source = shipped.pick(shipped.examples(), "seed_boom", "example").path
    found = bc.stability(source)
    return {
        **{name: fit_report(fit)[0] for name, fit in made.items()},
        "embed": embedded.report("observer.xml", "out.xml"),
        "plant": plant_report(bc.plant(embedded), [], "observer.xml"),
        "stability": stability_report(found, source),
    }


def browse(page, folder, script="", *options):
    """The dumped page and what the browser complained of, after `script` ran in it; `told` in it is read back."""
    runner = (
        "<script>window.addEventListener('load', async () => { const told = {};"
        "const still = () => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)));"
        f"try {{ {script} }} catch (error) {{ told.failed = String(error); }}"
        "document.body.dataset.told = JSON.stringify(told); });</script>"
    )
    file = folder / "report.html"
    # the dumping browser paints no frames: what waits for one must not wait for ever
    frames = "<script>window.requestAnimationFrame = (f) => setTimeout(f, 0);</script>" if "<script>" in page else ""
    content = page.replace("<body>", "<body>" + frames, 1).replace("</body>", runner + "</body>")
    file.write_text(content, encoding="utf-8")
    done = subprocess.run(
        [
            CHROMIUM, "--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--no-first-run",
            "--disable-background-networking", "--disable-component-update", "--disable-sync",
            f"--user-data-dir={folder / 'profile'}", "--host-resolver-rules=MAP * ~NOTFOUND",
            "--enable-logging=stderr", "--virtual-time-budget=4000", *options, "--dump-dom", file.as_uri(),
        ],
        capture_output=True, text=True, check=True, timeout=240,
    )  # fmt: skip
    complaints = [line for line in done.stderr.split("\n") if "CONSOLE" in line]
    root = html.fromstring(done.stdout)
    told = json.loads(root.xpath("//body/@data-told")[0])
    assert "failed" not in told, told
    return root, told, complaints


@pytest.mark.parametrize(("name", "plots"), [("boom", 2), ("panels", 4), ("embed", 2), ("plant", 2), ("stability", 2)])
def test_opens_without_complaint_or_request(name, plots, pages, tmp_path):
    assert len(pages[name].encode()) < LARGEST
    script = "told.asked = performance.getEntriesByType('resource').map((e) => e.name);"
    root, told, complaints = browse(pages[name], tmp_path, script)
    assert complaints == []
    assert told["asked"] == []
    zooming = root.xpath("//figure[contains(@class, 'zoom')]")
    assert len(zooming) == plots
    assert all("ready" in figure.get("class") for figure in zooming)


def test_the_policy_of_the_page_stops_requests(pages, tmp_path):
    """The other way round: were there a request in the page, these tests would see it stopped."""
    script = "const i = new Image(); i.src = 'http://127.0.0.1:9/x'; await new Promise((r) => setTimeout(r, 200));"
    _, _, complaints = browse(pages["boom"], tmp_path, script)
    assert any("Content Security Policy" in line for line in complaints)


STATE = (
    "const svg = document.querySelector('svg[data-plot]'); const plot = JSON.parse(svg.dataset.plot);"
    "const panel = document.getElementById(plot[0].id);"
    "const curve = () => [...panel.querySelectorAll('path[clip-path]')].filter((p) => !p.closest('[id*=axis]'))"
    ".at(-1).getAttribute('d');"
    "const shown = () => JSON.parse(svg.dataset.shown || '[0,1]');"
    "const ticks = () => [...panel.parentNode.querySelectorAll('text')]"
    ".filter((t) => t.checkVisibility({ visibilityProperty: true })).map((t) => t.textContent);"
    "told.before = curve(); told.plot = plot;"
)


def points(d):
    return np.array(re.findall(r"-?\d+(?:\.\d+)?", d), dtype=float).reshape(-1, 2)


def test_buttons_zoom_and_reset(pages, tmp_path):
    script = STATE + (
        "const button = (word) => document.querySelector(`figure.zoom button[title='${word}']`);"
        "button('zoom in').click(); await still(); told.once = shown(); told.curve = curve(); told.ticks = ticks();"
        "told.status = document.querySelector('figure.zoom [role=status]').textContent;"
        "button('to the right').click(); await still(); told.right = shown();"
        "button('stretch upwards').click(); await still(); told.tall = curve();"
        "button('show all').click(); await still(); told.all = shown(); told.after = curve();"
    )
    _, told, complaints = browse(pages["boom"], tmp_path, script)
    assert complaints == []
    low, high = told["once"]
    assert high - low == pytest.approx(1.0 / 1.6)
    assert (low + high) / 2.0 == pytest.approx(0.5)
    # every drawn point is where the part of the axis shown puts it
    left, _, width, _ = told["plot"][0]["box"]
    before, after = points(told["before"]), points(told["curve"])
    wanted = left + width * ((before[:, 0] - left) / width - low) / (high - low)
    np.testing.assert_allclose(after[:, 0], wanted, atol=PIXEL)
    np.testing.assert_allclose(after[:, 1], before[:, 1], atol=PIXEL)
    assert told["right"][0] > low
    assert not np.allclose(points(told["tall"])[:, 1], before[:, 1], atol=1.0)
    assert told["all"] == [0, 1]
    np.testing.assert_allclose(points(told["after"]), before, atol=PIXEL)
    x0, x1 = told["plot"][0]["x"]
    start, end = (float(v) for v in told["status"].split(" to "))
    assert start == pytest.approx(x0 * (x1 / x0) ** low, rel=6e-3)  # shown with three digits
    assert end == pytest.approx(x0 * (x1 / x0) ** high, rel=6e-3)


def test_ticks_after_zooming_are_round_and_in_place(pages, tmp_path):
    script = STATE + (
        "for (let k = 0; k < 9; k++) { document.querySelector(\"figure.zoom button[title='zoom in']\").click(); }"
        "await still(); told.shown = shown();"
        "const last = document.getElementById(plot.at(-1).id);"
        "told.words = [...last.querySelectorAll('g:not([id]) > text')]"
        ".map((t) => [+t.getAttribute('x'), t.textContent]);"
    )
    _, told, _ = browse(pages["boom"], tmp_path, script)
    axes = told["plot"][-1]
    left, _, width, _ = axes["box"]
    (x0, x1), (low, high) = axes["x"], told["shown"]
    seen = [(x, float(word)) for x, word in told["words"] if left <= x <= left + width]
    assert len(seen) >= 3
    for x, value in seen:
        part = low + (x - left) / width * (high - low)
        assert x0 * (x1 / x0) ** part == pytest.approx(value, rel=1e-5)


@pytest.mark.parametrize("name", ["embed", "stability"])
def test_the_other_pages_zoom_and_their_contents_lead_somewhere(name, pages, tmp_path):
    script = (
        "told.moved = []; for (const figure of document.querySelectorAll('figure.zoom')) {"
        "const svg = figure.querySelector('svg[data-plot]');"
        "figure.querySelector(\"button[title='zoom in']\").click(); await still();"
        "told.moved.push(JSON.parse(svg.dataset.shown));"
        "figure.querySelector(\"button[title='show all']\").click(); await still();"
        "told.moved.push(JSON.parse(svg.dataset.shown)); }"
        "told.lost = [...document.querySelectorAll('nav a')]"
        ".filter((a) => !document.querySelector(a.getAttribute('href'))).map((a) => a.textContent);"
        "const words = document.querySelector('details'); words.querySelector('summary').click(); await still();"
        "told.open = words.open;"
    )
    _, told, complaints = browse(pages[name], tmp_path, script)
    assert complaints == []
    assert told["moved"] == [pytest.approx([0.1875, 0.8125]), [0, 1]] * 2
    assert told["lost"] == []
    assert told["open"]


def test_keys_wheel_drag_and_double_click(pages, tmp_path):
    script = STATE + (
        "const key = (k) => svg.dispatchEvent("
        "new KeyboardEvent('keydown', { key: k, bubbles: true, cancelable: true }));"
        "key('+'); await still(); told.plus = shown(); key('ArrowLeft'); await still(); told.left = shown();"
        "key('0'); await still(); told.zero = shown();"
        "const box = plot[0].box; const m = svg.getScreenCTM();"
        "const at = (u, v) => { const p = new DOMPoint(box[0] + u * box[2], box[1] + v * box[3]).matrixTransform(m);"
        " return { clientX: p.x, clientY: p.y, bubbles: true, cancelable: true, pointerId: 1, button: 0 }; };"
        "svg.setPointerCapture = () => {};"
        "svg.dispatchEvent(new WheelEvent('wheel', { ...at(0.25, 0.5), deltaY: -200, ctrlKey: true })); await still();"
        "told.wheel = shown();"
        "const plain = new WheelEvent('wheel', { ...at(0.25, 0.5), deltaY: -200 }); svg.dispatchEvent(plain);"
        "told.scrolls = !plain.defaultPrevented;"
        "svg.dispatchEvent(new MouseEvent('dblclick', at(0.5, 0.5))); await still(); told.double = shown();"
        "svg.dispatchEvent(new PointerEvent('pointerdown', at(0.2, 0.2)));"
        "svg.dispatchEvent(new PointerEvent('pointermove', at(0.4, 0.6)));"
        "svg.dispatchEvent(new PointerEvent('pointerup', at(0.6, 0.8))); await still(); told.drag = shown();"
        "svg.dispatchEvent(new PointerEvent('pointerdown', { ...at(0.5, 0.5), shiftKey: true }));"
        "svg.dispatchEvent(new PointerEvent('pointermove', { ...at(0.25, 0.5), shiftKey: true }));"
        "svg.dispatchEvent(new PointerEvent('pointerup', { ...at(0.25, 0.5), shiftKey: true })); await still();"
        "told.pan = shown(); told.focusable = svg.tabIndex === 0;"
    )
    _, told, complaints = browse(pages["boom"], tmp_path, script)
    assert complaints == []
    assert told["plus"][1] - told["plus"][0] == pytest.approx(1.0 / 1.6)
    assert told["left"][0] < told["plus"][0]
    assert told["zero"] == [0, 1]
    low, high = told["wheel"]
    assert low < 0.25 < high
    assert high - low == pytest.approx(np.exp(-0.5))
    assert (0.25 - low) / (high - low) == pytest.approx(0.25, abs=POINTER)
    assert told["scrolls"]
    assert told["double"] == [0, 1]
    assert told["drag"] == pytest.approx([0.2, 0.6], abs=POINTER)
    assert told["pan"] == pytest.approx([0.3, 0.7], abs=POINTER)
    assert told["focusable"]


def test_without_script_the_pictures_stand(pages, tmp_path):
    bare = re.sub(r"<script>.*?</script>", "", pages["boom"], flags=re.S)
    root, _, complaints = browse(bare, tmp_path)
    assert complaints == []
    assert len(root.xpath("//svg")) >= 4
    assert root.xpath("//button") == []


def test_shapes_ring_pause_and_respect_reduced_motion(pages, tmp_path):
    script = (
        "const ring = document.querySelector('.ring'), box = document.querySelector('.play input');"
        "const state = () => { const s = getComputedStyle(ring); return [s.animationName, s.animationPlayState]; };"
        "told.running = state(); box.click(); told.paused = state(); told.labelled = box.labels[0].textContent.trim();"
    )
    _, told, _ = browse(pages["boom"], tmp_path, script)
    assert told["running"] == ["ring", "running"]
    assert told["paused"] == ["ring", "paused"]
    assert told["labelled"]
    _, still, _ = browse(pages["boom"], tmp_path, script, "--force-prefers-reduced-motion")
    assert still["running"][0] == "none"


@pytest.mark.parametrize("name", ["panels", "embed", "plant", "stability"])
@pytest.mark.parametrize("width", [400, 1000])
def test_nothing_is_wider_than_the_page(width, name, pages, tmp_path):
    # the window itself cannot be made that narrow everywhere: a frame can
    script = (
        f"const frame = document.documentElement; frame.style.width = '{width}px'; await still();"
        "told.wide = [...document.querySelectorAll('main *')].filter((e) => !e.closest('.scroll, pre, svg'))"
        f".filter((e) => e.getBoundingClientRect().right > {width} + 1).map((e) => e.outerHTML.slice(0, 80));"
    )
    _, told, _ = browse(pages[name], tmp_path, script, f"--window-size={width},800")
    assert told["wide"] == []


@pytest.mark.parametrize("name", ["boom", "embed"])
def test_legends_are_readable_on_a_phone_and_what_scrolls_says_so(name, pages, tmp_path):
    script = (
        "document.documentElement.style.width = '400px'; window.dispatchEvent(new Event('resize')); await still();"
        "told.small = [...document.querySelectorAll('.legend li')].map((e) => parseFloat(getComputedStyle(e).fontSize));"
        "told.ends = [...document.querySelectorAll('.legend li')].map((e) => e.getBoundingClientRect().right);"
        "const hint = (e) => getComputedStyle(e, '::before').content;"
        "told.hints = [...document.querySelectorAll('.scroll')]"
        ".map((e) => [e.scrollWidth > e.clientWidth + 1, hint(e).includes('scroll'), e.tabIndex === 0]);"
    )
    _, told, _ = browse(pages[name], tmp_path, script, "--window-size=400,800")
    assert min(told["small"]) >= READABLE
    assert max(told["ends"]) <= 400
    assert any(wider for wider, _, _ in told["hints"])
    assert all(wider == said == reached for wider, said, reached in told["hints"])


def test_figures_have_the_width_of_the_page(pages, tmp_path):
    script = (
        "const main = document.querySelector('main').getBoundingClientRect().width;"
        "told.shares = [...document.querySelectorAll('figure svg[data-plot], .shapes')]"
        ".map((e) => e.getBoundingClientRect().width / main);"
    )
    _, told, _ = browse(pages["boom"], tmp_path, script, "--window-size=1000,800")
    assert told["shares"] == pytest.approx([1.0] * len(told["shares"]), abs=PIXEL)


def test_hertz_follow_the_zoom(pages, tmp_path):
    script = STATE + (
        "for (let k = 0; k < 4; k++) { document.querySelector(\"figure.zoom button[title='zoom in']\").click(); }"
        "await still(); told.shown = shown();"
        "told.words = [...panel.querySelectorAll('g:not([id]) > text')]"
        ".map((t) => [+t.getAttribute('x'), +t.getAttribute('y'), t.textContent]);"
    )
    _, told, _ = browse(pages["boom"], tmp_path, script)
    axes = told["plot"][0]
    left, top, width, _ = axes["box"]
    (x0, x1), (low, high) = axes["x"], told["shown"]
    above = [(x, float(word)) for x, y, word in told["words"] if y < top]
    assert len(above) > 1
    for x, hertz in above:
        part = low + (x - left) / width * (high - low)
        assert x0 * (x1 / x0) ** part == pytest.approx(2.0 * np.pi * hertz, rel=1e-5)


@pytest.mark.parametrize("name", ["panels", "embed", "plant", "stability"])
def test_text_has_contrast(name, pages, tmp_path):
    """WCAG AA: 4.5 for text; what is drawn in the pictures is text too."""
    script = (
        "const lum = (c) => { const [r, g, b] = c.match(/[\\d.]+/g).map((v) => { v /= 255;"
        " return v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4; });"
        " return 0.2126 * r + 0.7152 * g + 0.0722 * b; };"
        "const back = (e) => { for (; e; e = e.parentElement) { const c = getComputedStyle(e).backgroundColor;"
        " if (!/, 0\\)$/.test(c)) return c; } return 'rgb(255, 255, 255)'; };"
        "told.poor = [...document.querySelectorAll('main *, header *, nav *')]"
        ".filter((e) => [...e.childNodes].some((n) => n.nodeType === 3 && n.textContent.trim()))"
        ".filter((e) => !e.closest('style, script'))"
        ".map((e) => { const s = getComputedStyle(e);"
        " const a = lum(e.closest('svg') ? s.fill : s.color), b = lum(back(e));"
        " return [(Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05), e.textContent.slice(0, 40)]; })"
        ".filter(([ratio]) => ratio < 4.5);"
    )
    _, told, _ = browse(pages[name], tmp_path, script)
    assert told["poor"] == []
