// Colours pixels: what a number looks like, and the legends that say so.

const KINDS = { shaded: "shaded", shadow: "shadow buffer", heat: "heat map", error: "errors" };
const ERRORS = ["right", "false shadow", "false light", "edge tie"];
const ERROR_COLORS = [null, [213, 94, 0], [86, 180, 233], [240, 228, 66]];
const SURFACES = ["background", "faces away from the light", "lit candidate"];
const RAMP = Array.from({ length: 256 }, (_, i) => [0, 2, 4].map((k) => parseInt(DATA.ramp.substr(6 * i + k, 2), 16)));
const A_MORE = [213, 94, 0];
const B_MORE = [0, 114, 178];

/** Level 0..1 of a number of tests on the shared logarithmic scale. */
const level = (tests, limit) => Math.min(Math.log2(1 + tests) / Math.log2(1 + limit), 1);

/** What can be shown of a method's pixels. */
function kindsOf(method) {
  const names = ["shaded", "shadow", ...(method.tests ? ["heat"] : []), "error"];
  return [...names, ...Object.keys(method.extras)];
}

/** Paint one picture of a method: an ImageData. */
function paint(method, kind, limit) {
  if (kind === "shaded") return method.shaded;
  if (method.extras[kind]) return method.extras[kind];
  const image = new ImageData(method.width, method.height);
  const color = { shadow: shadowColor, heat: heatColor, error: dimmed }[kind];
  for (let i = 0; i < method.shadow.length; i++) {
    const [r, g, b] = color(method, i, limit);
    image.data[4 * i] = r;
    image.data[4 * i + 1] = g;
    image.data[4 * i + 2] = b;
    image.data[4 * i + 3] = 255;
  }
  if (kind === "error") markErrors(method, image);
  return image;
}

function shadowColor(method, i) {
  if (method.kind[i] === 0) return [93, 107, 133];
  if (method.kind[i] === 1) return [118, 118, 118];
  const light = 255 - method.shadow[i];
  return [light, light, light];
}

function heatColor(method, i, limit) {
  return RAMP[Math.floor(255 * level(method.tests[i], limit))];
}

function dimmed(method, i) {
  const data = method.shaded.data;
  const grey = 0.35 * (0.299 * data[4 * i] + 0.587 * data[4 * i + 1] + 0.114 * data[4 * i + 2]);
  return [grey, grey, grey];
}

/** Mark wrong pixels, each grown to 3 x 3 so that a single one can be seen; the worst class is painted last. */
function markErrors(method, image) {
  for (const error of [3, 2, 1]) {
    for (let i = 0; i < method.error.length; i++) {
      if (method.error[i] === error) stamp(image, i % method.width, Math.floor(i / method.width), ERROR_COLORS[error]);
    }
  }
}

function stamp(image, x, y, color) {
  for (let v = Math.max(y - 1, 0); v <= Math.min(y + 1, image.height - 1); v++) {
    for (let u = Math.max(x - 1, 0); u <= Math.min(x + 1, image.width - 1); u++) {
      image.data.set(color, 4 * (v * image.width + u));
    }
  }
}

/** Paint what differs between two methods; returns the image and a sentence. */
function paintDifference(a, b, kind, limit) {
  if (a.width !== b.width || a.height !== b.height) return { image: null, text: "The two images differ in size." };
  return kind === "heat" ? heatDifference(a, b, limit) : pixelDifference(a, b, kind, limit);
}

function heatDifference(a, b, limit) {
  const image = new ImageData(a.width, a.height);
  let [more, fewer] = [0, 0];
  for (let i = 0; i < a.tests.length; i++) {
    const difference = a.tests[i] - b.tests[i];
    const share = level(Math.abs(difference), limit);
    const end = difference > 0 ? A_MORE : B_MORE;
    for (let k = 0; k < 3; k++) image.data[4 * i + k] = 247 + share * (end[k] - 247);
    image.data[4 * i + 3] = 255;
    if (difference > 0) more += difference;
    else fewer -= difference;
  }
  return { image, text: `A makes ${thousands(more)} more tests in some places and ${thousands(fewer)} fewer in others.` };
}

function pixelDifference(a, b, kind, limit) {
  const [first, second] = [paint(a, kind, limit).data, paint(b, kind, limit).data];
  const image = new ImageData(a.width, a.height);
  let n = 0;
  for (let i = 0; i < a.shadow.length; i++) {
    image.data.set([...dimmed(a, i), 255], 4 * i);
  }
  for (let i = 0; i < a.shadow.length; i++) {
    const same = kind === "shadow" ? a.shadow[i] === b.shadow[i] : kind === "error" ? a.error[i] === b.error[i]
      : [0, 1, 2].every((k) => first[4 * i + k] === second[4 * i + k]);
    if (same) continue;
    n += 1;
    stamp(image, i % a.width, Math.floor(i / a.width), [240, 228, 66]);
  }
  return { image, text: n ? `${thousands(n)} pixels differ.` : "No pixel differs." };
}

function swatch(color, words) {
  const box = element("span", { class: "swatch" });
  box.style.background = `rgb(${color.join(",")})`;
  return element("span", {}, box, words);
}

/** A colour bar with marks at powers of four. */
function colorBar(limit, color, title) {
  const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
  const steps = Array.from({ length: 128 }, (_, i) => `<rect x="${6 + 3.5 * i}" y="4" width="3.8" height="12" fill="rgb(${color(i / 127).join(",")})"/>`);
  const marks = [0, 1, 4, 16, 64, 256, 1024, 4096, 16384, 65536].filter((t) => t <= limit)
    .map((t) => `<text x="${6 + 448 * level(t, limit)}" y="30" text-anchor="middle">${t}</text>`);
  svg.setAttribute("viewBox", "0 0 466 34");
  svg.setAttribute("class", "figure");
  svg.setAttribute("role", "img");
  svg.setAttribute("aria-label", title);
  svg.innerHTML = steps.join("") + marks.join("");
  return svg;
}

const towards = (end) => (t) => end.map((c) => Math.round(247 + t * (c - 247)));

/** Fill the legend for the kinds of pictures that are shown. */
function showLegend(parent, kinds, difference, limit) {
  parent.replaceChildren();
  if (difference && kinds.has("heat")) {
    parent.append(colorBar(limit, towards(A_MORE), "more tests in A"), "A makes so many more tests",
      colorBar(limit, towards(B_MORE), "more tests in B"), "B makes so many more tests");
  } else if (difference) {
    parent.append(swatch([240, 228, 66], "differs, each pixel grown to 3 × 3"));
  } else {
    if (kinds.has("heat")) parent.append(colorBar(limit, (t) => RAMP[Math.floor(255 * t)], "tests per pixel"), "tests per pixel, logarithmic");
    if (kinds.has("error")) parent.append(...[1, 2, 3].map((e) => swatch(ERROR_COLORS[e], `${ERRORS[e]}, grown to 3 × 3`)));
    if (kinds.has("shadow")) parent.append(swatch([255, 255, 255], "lit"), swatch([0, 0, 0], "in shadow"), swatch([118, 118, 118], SURFACES[1]), swatch([93, 107, 133], SURFACES[0]));
  }
}
