"""The report of five methods over 24 frames, opened from disk in headless Chromium with the network off; every control used.

Screenshots go to the folder that ``SHADOWBENCH_SCREENSHOTS`` names, or to a temporary one that the test prints.
"""

import csv
import io
import os
import shutil
import xml.etree.ElementTree as ElementTree
import zipfile
from pathlib import Path

import pytest

from shadowbench.report.command import report
from tests.command_line import call

pytestmark = pytest.mark.browser

METHODS = ["ptsv", "cluster", "ray_traced", "shadow_map[resolution=64]", "z_fail"]
SCENE = """
name: staircase
geometry: [{generate: treads}]
camera: {path: [{eye: [6, 5, 9], target: [0, 0.5, 0]}, {eye: [-4, 3, 9], target: [0, 1, 0]}]}
light: {position: [2, 9, 3]}
frames: 24
"""

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")


@pytest.fixture(scope="module")
def run_folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run") / "out"
    options = [word for method in METHODS for word in ("-a", method)]
    scene = folder.with_name("scene.yaml")
    scene.write_text(SCENE)
    done = call("run", scene, "--size", "120x90", "--repeats", "2", "--out", folder, *options)
    assert done.code == 0, done.errors
    return folder


@pytest.fixture(scope="module")
def browser():
    sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed: pip install '.[browser]'")
    executable = next((path for name in NAMES if (path := shutil.which(name))), None)
    with sync_api.sync_playwright() as playwright:
        if executable is None and not Path(playwright.chromium.executable_path).exists():
            pytest.skip("no Chromium found: install the package chromium, or run `playwright install chromium`")
        with_root = ["--no-sandbox"] if os.geteuid() == 0 else []
        launched = playwright.chromium.launch(executable_path=executable, args=with_root)
        yield launched
        launched.close()


@pytest.fixture(scope="module")
def screenshots(tmp_path_factory):
    folder = Path(os.environ.get("SHADOWBENCH_SCREENSHOTS") or tmp_path_factory.mktemp("screenshots"))
    folder.mkdir(parents=True, exist_ok=True)
    print(f"screenshots: {folder}")
    return folder


class Watched:
    """A page that keeps what must not happen: console errors, exceptions, requests for anything but the file's own."""

    def __init__(self, browser, file, **options):
        self.context = browser.new_context(offline=True, accept_downloads=True,
                                           viewport={"width": 1366, "height": 768}, **options)
        self.page, self.troubles = self.context.new_page(), []
        self.page.on("console", lambda m: self.troubles.append(m.text) if m.type == "error" else None)
        self.page.on("pageerror", lambda e: self.troubles.append(str(e)))
        self.page.on("request", lambda r: None if r.url.startswith(("file:", "data:", "blob:")) else
                     self.troubles.append(r.url))
        self.page.goto(Path(file).resolve().as_uri())
        self.settle()

    def settle(self):
        """Wait until everything that was asked for is painted."""
        self.wait_until("!document.getElementById('viewer') || (view.ticket > 0 && view.shown === view.ticket)")

    def wait_until(self, condition):
        """Ask the page again and again; its own polling would need `eval`, which the page's security policy forbids."""
        for _ in range(200):
            if self.page.evaluate(condition):
                return
            self.page.wait_for_timeout(50)
        raise AssertionError(f"never came true: {condition}")

    def pixels(self, side="a"):
        """A digest of what a canvas shows."""
        return self.page.evaluate("""(side) => { const c = document.getElementById('canvas-' + side);
            const d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data;
            let h = 7; for (let i = 0; i < d.length; i++) h = (h * 31 + d[i]) | 0; return [c.width, c.height, h]; }""", side)

    def choose(self, control, value):
        self.page.select_option(f"#{control}", value)
        self.settle()

    def save(self, selector):
        """Click something that saves a file; returns its name and text."""
        with self.page.expect_download() as caught:
            self.page.click(selector)
        return caught.value.suggested_filename, Path(caught.value.path()).read_text(encoding="utf-8")


@pytest.fixture
def opened(browser, run_folder):
    watched = Watched(browser, run_folder / "report.html", color_scheme="light")
    yield watched
    assert watched.troubles == []
    watched.context.close()


def test_any_two_pictures_can_be_compared(opened, screenshots):
    page = opened.page
    assert page.locator("#a-series option").count() == 5
    seen = set()
    for kind in ("shaded", "shadow", "heat", "error"):
        opened.choose("a-kind", kind)
        seen.add(tuple(opened.pixels("a")))
        for method in ("1", "3"):
            opened.choose("b-series", method)
            opened.choose("b-kind", "shadow" if kind == "shadow" else "heat")
            seen.add(tuple(opened.pixels("b")))
    assert len(seen) >= 7                       # four kinds of the first method, and the others' own
    opened.choose("a-kind", "heat")
    for mode in ("flip", "beside", "difference", "slider"):
        page.check(f'input[name="mode"][value="{mode}"]', force=True)
        opened.settle()
        assert page.locator("#stage").get_attribute("class").split()[0] == mode
        page.locator("#viewer").screenshot(path=screenshots / f"mode-{mode}.png")
    page.check('input[name="mode"][value="flip"]', force=True)
    opened.settle()
    page.click("#flip")
    assert page.locator("#canvas-b").is_visible() and not page.locator("#canvas-a").is_visible()
    before = page.locator("#title-a").text_content()
    page.click("#swap")
    opened.settle()
    assert page.locator("#title-b").text_content()[3:] == before[3:]


def test_slider_divides_by_mouse_and_keyboard(opened):
    page = opened.page
    page.locator("#stage").scroll_into_view_if_needed()
    box = page.locator("#stage").bounding_box()
    page.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 40)
    page.mouse.down()
    page.mouse.move(box["x"] + 0.2 * box["width"], box["y"] + 60)
    page.mouse.up()
    assert abs(page.evaluate("view.split") - 0.2) < 0.02
    page.focus("#split")
    page.keyboard.press("End")
    assert page.evaluate("view.split") == 1


def test_difference_is_exact(opened, run_folder):
    page = opened.page
    opened.choose("a-series", "0")
    opened.choose("b-series", "1")
    opened.choose("a-kind", "heat")
    page.check('input[name="mode"][value="difference"]', force=True)
    opened.settle()
    more, fewer = (int(word.replace(",", "")) for word in page.locator("#message").text_content().split()
                   if word.replace(",", "").isdigit())
    from shadowbench import image_io

    a, b = (image_io.read_exr(run_folder / "frames" / "0000" / label / "shadow.exr")["tests"].astype(int)
            for label in ("ptsv", "cluster"))
    assert (more, fewer) == ((a - b).clip(0).sum(), (b - a).clip(0).sum())
    assert page.locator("#b-kind").is_disabled()
    opened.choose("a-kind", "shadow")
    assert page.locator("#message").text_content() == "No pixel differs."
    opened.choose("b-series", "3")
    assert "pixels differ" in page.locator("#message").text_content()


def test_magnifier_tells_the_numbers_of_a_pixel(opened, run_folder):
    from shadowbench import image_io

    page = opened.page
    page.focus("#stage")
    for _ in range(3):
        page.keyboard.press("ArrowRight")
    page.keyboard.press("Shift+ArrowDown")
    x, y = (int(word) for word in page.locator("#pixel").text_content().split(","))
    assert (x, y) == (63, 55)
    tests = image_io.read_exr(run_folder / "frames" / "0000" / "ptsv" / "shadow.exr")["tests"]
    assert page.locator("#readout tbody tr").nth(3).locator("td").nth(0).text_content() == f"{tests[y, x]:,}"
    assert f"--pixel {x},{y}" in page.locator("#explain").text_content()
    page.keyboard.press("Enter")
    assert page.locator("#held").text_content() == "Held."
    corner = {"x": 5, "y": 5}
    page.hover("#stage", position=corner)
    assert page.locator("#pixel").text_content() == "63, 55"
    page.click("#stage", position=corner)                  # goes there and lets go
    assert page.locator("#pixel").text_content() == "0, 0"
    shown = opened.page.evaluate("document.getElementById('loupe-a').toDataURL()")
    page.select_option("#zoom", "24")
    assert opened.page.evaluate("document.getElementById('loupe-a').toDataURL()") != shown
    opened.choose("a-kind", "heat")
    fixed = opened.pixels("a")
    opened.choose("scale", "largest")
    assert opened.pixels("a") != fixed
    page.click('.copy[data-copies="explain"]')
    opened.wait_until("document.querySelector('.copy[data-copies=explain]').textContent !== 'Copy'")


def test_only_methods_with_a_trace_offer_to_explain_a_pixel(opened):
    page, of_maps = opened.page, str(METHODS.index("shadow_map[resolution=64]"))
    opened.choose("a-series", of_maps)
    page.focus("#stage")
    page.keyboard.press("ArrowRight")
    assert "--algorithm 'cluster'" in page.locator("#explain").text_content()      # that of the other side
    opened.choose("b-series", of_maps)
    page.focus("#stage")
    page.keyboard.press("ArrowRight")
    assert not page.locator("#explain").is_visible()


def test_frames_move_pictures_curves_and_table_together(opened):
    page = opened.page
    first = opened.pixels("a")
    page.focus("#frame")
    page.keyboard.press("End")
    opened.settle()
    assert page.locator("#frame-number").text_content() == "23 of 23" and opened.pixels("a") != first
    assert page.locator("#measurement-table tr.now").first.get_attribute("data-frame") == "23"
    lines = page.locator(".fly .scrub")
    assert lines.count() == 4 and float(lines.first.get_attribute("x1")) > 500
    page.locator(".fly svg").first.scroll_into_view_if_needed()
    box = page.locator(".fly svg").first.bounding_box()
    page.mouse.click(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    opened.settle()
    assert 9 <= page.evaluate("chosen.frame") <= 13
    page.click("#play")
    page.wait_for_timeout(900)
    moved = page.evaluate("chosen.frame")
    page.click("#play")
    assert moved not in (9, 10, 23) and page.locator("#play").text_content() == "Play"


def test_tables_sort_filter_choose_columns_and_save(opened):
    page = opened.page
    rows = page.locator("#measurement-table tbody tr:visible")
    assert rows.count() == 120
    page.fill("#filter", "z_fail 7")
    matching = rows.count()
    assert 0 < matching < 24 and page.locator("#n-rows").text_content() == f"{matching} of 120 rows"
    page.fill("#filter", "")
    for _ in range(2):
        page.click("#measurement-table thead button:has-text('all_work')")
    head = page.locator("#measurement-table thead th:has-text('all_work')")
    assert head.get_attribute("aria-sort") == "descending"
    column = head.evaluate("cell => cell.cellIndex")
    values = page.evaluate("""(c) => [...document.querySelectorAll('#measurement-table tbody tr')]
                              .map((row) => Number(row.cells[c].dataset.value))""", column)
    assert values == sorted(values, reverse=True) and values[0] > values[-1]
    page.click("#summary-table thead button:has-text('method')")
    names = page.locator("#summary-table tbody th").all_text_contents()
    assert [name.strip() for name in names] == sorted(name.strip() for name in names)
    page.click(".menu summary")
    page.check("#columns label:has-text('node_tests') input")
    assert page.locator("#measurement-table thead th:has-text('node_tests')").is_visible()
    page.uncheck('#methods input[value="4"]')
    assert rows.count() == 96 and not page.locator('#summary-table tr[data-series="4"]').is_visible()
    assert not page.locator('.fly [data-series="4"]').first.is_visible()
    name, text = opened.save("#save-table")
    table = list(csv.reader(io.StringIO(text)))
    assert name == "table.csv" and len(table) == 97 and "node_tests" in table[0]
    page.click("#methods-all")
    assert rows.count() == 120


def test_raw_data_and_figures_are_saved(opened, run_folder):
    page = opened.page
    for name in ("counts.csv", "timings.csv", "results.jsonl"):
        assert opened.save(f'.download[data-name="{name}"]') == (name, (run_folder / name).read_text())
    assert opened.save('.download[data-name="run.json"]')[0] == "run.json"
    n_figures = page.locator("svg.figure[data-name]").count()
    assert page.locator(".save-svg").count() == n_figures >= 9
    for i in range(n_figures):
        button = page.locator(".save-svg").nth(i)
        with page.expect_download() as caught:
            button.click()
        text = Path(caught.value.path()).read_text(encoding="utf-8")
        root = ElementTree.fromstring(text)
        assert root.tag == "{http://www.w3.org/2000/svg}svg" and "class=" not in text and "rgb(" in text


def test_keys_and_theme(opened):
    page = opened.page
    assert page.evaluate("document.documentElement.dataset.theme") == "light"
    page.keyboard.press("t")
    page.keyboard.press("t")
    assert page.evaluate("document.documentElement.dataset.theme") == "dark"
    page.click("#theme")
    assert page.locator("#theme").text_content() == "Theme: system"
    for key, mode in (("2", "flip"), ("3", "beside"), ("4", "difference"), ("1", "slider")):
        page.keyboard.press(key)
        opened.settle()
        assert page.evaluate("view.mode") == mode
    for key, kind in (("d", "shadow"), ("h", "heat"), ("e", "error"), ("s", "shaded")):
        page.keyboard.press(key)
        opened.settle()
        assert page.evaluate("[view.a.kind, view.b.kind]") == [kind, kind]
    page.keyboard.press(".")
    page.keyboard.press(".")
    page.keyboard.press(",")
    opened.settle()
    assert page.evaluate("chosen.frame") == 1
    a = page.evaluate("view.a.series")
    page.keyboard.press("x")
    assert page.evaluate("view.b.series") == a
    page.keyboard.press("f")
    opened.settle()
    assert page.evaluate("[view.mode, view.flipped]") == ["flip", True]
    page.keyboard.press("p")
    assert page.locator("#play").get_attribute("aria-pressed") == "true"
    page.keyboard.press("p")
    page.keyboard.press("/")
    assert page.evaluate("document.activeElement.id") == "filter"
    page.keyboard.press("t")                              # typed into the filter, not a command
    assert page.input_value("#filter") == "t" and page.locator("#theme").text_content() == "Theme: system"
    page.focus("#stage")
    page.keyboard.press("?")
    assert page.locator("#help").is_visible()
    page.keyboard.press("Escape")
    page.click("#help-open")
    page.click("#help button")
    assert not page.locator("#help").is_visible()
    page.keyboard.press("Tab")
    for link in page.locator("nav a").all():
        link.click()
        assert page.locator(link.get_attribute("href")).is_visible()
    page.locator("#work details").nth(1).locator("summary").click()


@pytest.mark.parametrize("look", ["light", "dark", "narrow", "print"])
def test_looks(browser, run_folder, screenshots, look):
    watched = Watched(browser, run_folder / "report.html", color_scheme="dark" if look == "dark" else "light")
    page = watched.page
    if look == "narrow":
        page.set_viewport_size({"width": 800, "height": 700})
    if look == "print":
        page.emulate_media(media="print")
        page.pdf(path=screenshots / "print.pdf", format="A4")
    watched.settle()
    page.screenshot(path=screenshots / f"{look}.png", full_page=True)
    wide = page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth")
    assert wide <= 0 and watched.troubles == []
    watched.context.close()


def test_zip_opens_from_disk(browser, run_folder, tmp_path):
    file = report([run_folder], tmp_path / "small.html", largest=100_000)
    assert file == tmp_path / "small.zip"
    with zipfile.ZipFile(file) as archive:
        archive.extractall(tmp_path / "unpacked")
    watched = Watched(browser, tmp_path / "unpacked" / "report.html")
    first = watched.pixels("a")
    watched.page.keyboard.press(".")
    watched.settle()
    assert first[2] != watched.pixels("a")[2] and watched.troubles == []
    (tmp_path / "unpacked" / "pictures" / "0-2.js").unlink()
    watched.page.keyboard.press(".")
    watched.settle()
    assert "unpack the whole zip file" in watched.page.locator("#message").text_content()
    watched.context.close()
