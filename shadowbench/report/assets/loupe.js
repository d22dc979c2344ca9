// The magnifier: both pictures around one pixel, and what is known of it.

const loupe = { x: null, y: null, held: false };

function startLoupe() {
  const stage = $("stage");
  stage.addEventListener("pointermove", (event) => {
    if (!loupe.held) follow(event);
  });
  stage.addEventListener("click", (event) => {
    follow(event);
    hold(!loupe.held);
  });
  stage.addEventListener("keydown", moveByKey);
  $("zoom").addEventListener("change", showLoupe);
  addEventListener("resize", showLoupe);
}

function hold(held) {
  loupe.held = held;
  $("held").textContent = held ? "Held." : "";
  showLoupe();
}

function follow(event) {
  const canvas = event.target.closest("figure")?.querySelector("canvas") ?? $("canvas-a");
  const box = canvas.getBoundingClientRect();
  moveTo(Math.floor((event.clientX - box.left) / box.width * canvas.width),
    Math.floor((event.clientY - box.top) / box.height * canvas.height));
}

function moveTo(x, y) {
  const method = view.painted.a ?? view.painted.b;
  if (!method) return;
  loupe.x = Math.min(Math.max(x, 0), method.width - 1);
  loupe.y = Math.min(Math.max(y, 0), method.height - 1);
  showLoupe();
}

function moveByKey(event) {
  const step = event.shiftKey ? 10 : 1;
  const move = { ArrowLeft: [-step, 0], ArrowRight: [step, 0], ArrowUp: [0, -step], ArrowDown: [0, step] }[event.key];
  if (move) moveTo(loupe.x + move[0], loupe.y + move[1]);
  else if (event.key === "Enter") hold(!loupe.held);
  else return;
  event.preventDefault();
  event.stopPropagation();
}

function showLoupe() {
  const { a, b } = view.painted;
  if (!a && !b) return;
  loupe.x ??= Math.floor($("canvas-a").width / 2);
  loupe.y ??= Math.floor($("canvas-a").height / 2);
  const zoom = Number($("zoom").value);
  for (const side of ["a", "b"]) enlarge(side, zoom);
  placeCursor(zoom);
  $("pixel").textContent = `${loupe.x}, ${loupe.y}`;
  $("readout").tBodies[0].replaceChildren(
    line("surface", a, b, (m, i) => SURFACES[m.kind[i]]),
    line("shadow", a, b, (m, i) => (m.kind[i] === 2 ? (m.shadow[i] / 255).toFixed(2).replace(/\.00$/, "") : "–")),
    line("answer", a, b, (m, i) => ERRORS[m.error[i]]),
    line("tests", a, b, (m, i) => (m.tests ? thousands(m.tests[i]) : "–")));
  const sides = view.b.kind === "heat" && view.a.kind !== "heat" ? "ba" : "ab";
  const series = [...sides].map((side) => DATA.series[view[side].series]).find((method) => method.unexplained === null);
  $("explain").parentElement.hidden = !series;
  if (series) $("explain").textContent = `${DATA.runs[series.run].explain} --algorithm '${series.spec}' --frame ${chosen.frame} --pixel ${loupe.x},${loupe.y}`;
}

function line(name, a, b, value) {
  const cell = (m) => element("td", {}, m && loupe.x < m.width && loupe.y < m.height ? value(m, loupe.y * m.width + loupe.x) : "–");
  return element("tr", {}, element("th", { scope: "row" }, name), cell(a), cell(b));
}

/** Draw the surroundings of the pixel; where A is the difference, B is drawn as it is. */
function enlarge(side, zoom) {
  const [from, to] = [$(`canvas-${side}`), $(`loupe-${side}`)];
  const context = to.getContext("2d");
  const left = to.width / 2 - zoom / 2 - zoom * loupe.x;
  const top = to.height / 2 - zoom / 2 - zoom * loupe.y;
  context.imageSmoothingEnabled = false;
  context.clearRect(0, 0, to.width, to.height);
  context.drawImage(from, left, top, zoom * from.width, zoom * from.height);
  context.strokeStyle = "#000";
  context.strokeRect(to.width / 2 - zoom / 2 - 1.5, to.height / 2 - zoom / 2 - 1.5, zoom + 3, zoom + 3);
  context.strokeStyle = "#fff";
  context.strokeRect(to.width / 2 - zoom / 2 - 0.5, to.height / 2 - zoom / 2 - 0.5, zoom + 1, zoom + 1);
}

/** Frame the magnified area on the picture. */
function placeCursor(zoom) {
  const canvas = $("canvas-a");
  const [stage, box] = [$("stage").getBoundingClientRect(), canvas.getBoundingClientRect()];
  const scale = box.width / canvas.width;
  const size = $("loupe-a").width / zoom * scale;
  Object.assign($("cursor").style, { display: box.width ? "block" : "none", width: `${size}px`, height: `${size}px`,
    left: `${box.left - stage.left + (loupe.x + 0.5) * scale - size / 2}px`,
    top: `${box.top - stage.top + (loupe.y + 0.5) * scale - size / 2}px` });
}
