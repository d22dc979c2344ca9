// The comparison of two pictures: any method and kind on either side, by slider, flip, side by side or difference.

const view = { a: { series: 0, kind: "shaded" }, b: { series: 0, kind: "shaded" }, mode: "slider", split: 0.5, flipped: false,
  painted: { a: null, b: null }, ticket: 0, shown: 0, playing: null };

const withPictures = (series) => DATA.pictures.some((key) => Number(key.split("/")[0]) === DATA.series[series].run);

function startViewer() {
  const choices = DATA.series.map((_, i) => i).filter(withPictures);
  for (const side of ["a", "b"]) {
    $(`${side}-series`).append(...choices.map((i) => element("option", { value: i }, DATA.series[i].title)));
    $(`${side}-series`).addEventListener("change", (event) => choose(side, "series", Number(event.target.value)));
    $(`${side}-kind`).addEventListener("change", (event) => choose(side, "kind", event.target.value));
  }
  view.a.series = choices[0];
  view.b.series = choices[Math.min(1, choices.length - 1)];
  view.b.kind = "heat";
  Object.assign($("frame"), { max: FRAMES.length - 1 });
  $("frame").addEventListener("input", () => setFrame(FRAMES[$("frame").value]));
  $("play").addEventListener("click", togglePlay);
  $("swap").addEventListener("click", swap);
  $("flip").addEventListener("click", flip);
  $("scale").addEventListener("change", repaint);
  for (const radio of $$('input[name="mode"]')) radio.addEventListener("change", () => setMode(radio.value));
  $("split").addEventListener("input", () => setSplit($("split").value / 1000));
  $("stage").addEventListener("pointerdown", startDrag);
  onChange(repaint);
}

function choose(side, what, value) {
  view[side][what] = value;
  repaint();
}

function setKind(kind) {
  view.a.kind = view.b.kind = kind;
  repaint();
}

function swap() {
  [view.a, view.b] = [view.b, view.a];
  repaint();
}

function setMode(mode) {
  view.mode = mode;
  if (mode === "difference") view.b.kind = view.a.kind;
  repaint();
}

function flip() {
  if (view.mode !== "flip") setMode("flip");
  view.flipped = !view.flipped;
  $("stage").classList.toggle("flipped", view.flipped);
  $("flip").textContent = view.flipped ? "Show A" : "Show B";
}

function setSplit(share) {
  view.split = Math.min(Math.max(share, 0), 1);
  $("split").value = 1000 * view.split;
  $("stage").style.setProperty("--split", `${100 * view.split}%`);
}

function startDrag(event) {
  const place = (at) => (at.clientX - $("stage").getBoundingClientRect().left) / $("stage").clientWidth;
  if (view.mode !== "slider" || Math.abs(place(event) - view.split) > 0.03) return;
  const move = (at) => setSplit(place(at));
  const stop = () => removeEventListener("pointermove", move);
  addEventListener("pointermove", move);
  addEventListener("pointerup", stop, { once: true });
  addEventListener("pointercancel", stop, { once: true });
}

function togglePlay() {
  if (view.playing) clearInterval(view.playing);
  view.playing = view.playing ? null : setInterval(() => stepFrame(1), 350);
  $("play").textContent = view.playing ? "Stop" : "Play";
  $("play").setAttribute("aria-pressed", String(Boolean(view.playing)));
}

/** End of the heat maps' scale: fixed, or the largest number of tests on either side. */
function heatLimit(...methods) {
  if ($("scale").value === "fixed") return DATA.heatLimit;
  let largest = 1;
  for (const method of methods) for (const tests of method?.tests ?? []) if (tests > largest) largest = tests;
  return largest;
}

async function repaint() {
  const ticket = ++view.ticket;
  let a, b;
  try {
    [a, b] = await Promise.all([methodPixels(view.a.series, chosen.frame), methodPixels(view.b.series, chosen.frame)]);
  } catch (error) {
    $("message").textContent = error.message;
    view.shown = ticket;
    return;
  }
  if (ticket !== view.ticket) return; // the reader has moved on
  fillControls(a, b);
  const limit = heatLimit(a, b);
  const difference = view.mode === "difference";
  let message = a && b ? "" : "One side has no picture of this frame.";
  if (difference && a && b) {
    view.b.kind = $("b-kind").value = view.a.kind;
    const { image, text } = paintDifference(a, b, view.a.kind, limit);
    message = text;
    put("a", image, `${titleOf("a")} against ${DATA.series[view.b.series].title}`);
  } else {
    put("a", a && paint(a, view.a.kind, limit), titleOf("a"));
  }
  put("b", b && paint(b, view.b.kind, limit), titleOf("b"));
  view.painted = { a, b };
  $("message").textContent = message;
  showLegend($("legend"), new Set([view.a.kind, view.b.kind]), difference, limit);
  showTotals(a, b);
  $("stage").className = `${view.mode}${view.flipped && view.mode === "flip" ? " flipped" : ""}`;
  const wide = $("canvas-a").clientWidth > $("canvas-a").width;
  $("stage").classList.toggle("enlarged", wide);
  showLoupe();
  view.shown = ticket; // all that was asked for is on the screen
}

function titleOf(side) {
  return `${side.toUpperCase()}: ${DATA.series[view[side].series].title}, ${KINDS[view[side].kind] ?? view[side].kind}`;
}

function put(side, image, title) {
  const canvas = $(`canvas-${side}`);
  $(`title-${side}`).textContent = title;
  canvas.setAttribute("aria-label", title);
  canvas.setAttribute("role", "img");
  if (!image) {
    canvas.getContext("2d").clearRect(0, 0, canvas.width, canvas.height);
    return;
  }
  Object.assign(canvas, { width: image.width, height: image.height });
  $("stage").style.setProperty("--aspect", image.width / image.height);
  canvas.getContext("2d").putImageData(image, 0, 0);
}

/** Bring every control in line with what is shown. */
function fillControls(a, b) {
  for (const [side, method] of [["a", a], ["b", b]]) {
    const kinds = method ? kindsOf(method) : ["shaded"];
    $(`${side}-kind`).replaceChildren(...kinds.map((kind) => element("option", { value: kind }, KINDS[kind] ?? kind)));
    if (!kinds.includes(view[side].kind)) view[side].kind = "shaded";
    $(`${side}-kind`).value = view[side].kind;
    $(`${side}-series`).value = view[side].series;
  }
  $("b-kind").disabled = view.mode === "difference";
  document.querySelector(`input[name="mode"][value="${view.mode}"]`).checked = true;
  $("frame").value = FRAMES.indexOf(chosen.frame);
  $("frame-number").textContent = `${chosen.frame} of ${FRAMES[FRAMES.length - 1]}`;
  $("frame").disabled = $("play").disabled = FRAMES.length < 2;
  $("flip").hidden = view.mode !== "flip";
  $("split-label").style.visibility = view.mode === "slider" ? "visible" : "hidden";
  setSplit(view.split);
}

function showTotals(a, b) {
  const line = (name, method) => {
    if (!method?.tests) return `${name}: no heat map`;
    const total = method.tests.reduce((sum, tests) => sum + tests, 0);
    return `${name}: ${thousands(total)} tests, ${thousands(total / method.tests.length)} a pixel`;
  };
  $("totals").replaceChildren(line("A", a), element("br"), line("B", b));
}
