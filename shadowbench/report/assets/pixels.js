// Pictures as numbers: the frames' packed PNG images are decoded into arrays, a value per pixel.

const CACHED = 8;
const chunks = new Map(); // key "run/frame" -> promise of the parsed pictures
const decoded = new Map(); // "key#series" -> promise of arrays; the oldest is dropped

/** Called by the files that lie beside the page when the report is a zip file. */
const waitingFor = new Map();
function shadowbenchPictures(key, document) {
  waitingFor.get(key)(document);
}

function chunk(key) {
  if (!chunks.has(key)) chunks.set(key, DATA.beside.includes(key) ? loadBeside(key) : readInline(key));
  return chunks.get(key);
}

async function readInline(key) {
  return JSON.parse(document.querySelector(`script[data-pictures="${key}"]`).textContent);
}

function loadBeside(key) {
  return new Promise((resolve, reject) => {
    waitingFor.set(key, resolve);
    const script = element("script", { src: `pictures/${key.replace("/", "-")}.js` });
    script.addEventListener("error", () => {
      chunks.delete(key);
      reject(new Error("The pictures are missing: unpack the whole zip file, then open report.html."));
    });
    document.head.append(script);
  });
}

/** Pixels of a packed PNG image: RGBA bytes, exactly as they were packed. */
async function pixels(document_, name) {
  const text = atob(document_.blobs[name]);
  const bytes = Uint8Array.from(text, (c) => c.charCodeAt(0));
  const image = await createImageBitmap(new Blob([bytes], { type: "image/png" }),
    { colorSpaceConversion: "none", premultiplyAlpha: "none" });
  const canvas = element("canvas", { width: image.width, height: image.height });
  const context = canvas.getContext("2d", { willReadFrequently: true });
  context.drawImage(image, 0, 0);
  return context.getImageData(0, 0, image.width, image.height);
}

/** A base image with patches over it. */
async function layered(document_, names) {
  const image = await pixels(document_, names[0]);
  for (const name of names.slice(1)) {
    const patch = await pixels(document_, name);
    if (patch.data.length !== image.data.length) return patch;
    for (let i = 0; i < image.data.length; i += 4) {
      if (patch.data[i + 3]) image.data.set(patch.data.subarray(i, i + 3), i);
    }
  }
  return image;
}

/** Everything that is known of a method's pixels in a frame; null if it has no pictures there. */
function methodPixels(series, frame) {
  const key = `${DATA.series[series].run}/${frame}`;
  const name = `${key}#${series}`;
  if (!DATA.pictures.includes(key)) return Promise.resolve(null);
  if (!decoded.has(name)) {
    decoded.set(name, decode(key, series));
    if (decoded.size > CACHED) decoded.delete(decoded.keys().next().value);
  }
  return decoded.get(name);
}

async function decode(key, series) {
  const packed = await chunk(key);
  const method = packed.methods[series];
  if (!method) return null;
  const { width, height } = packed;
  const state = (await pixels(packed, method.state)).data;
  const n = width * height;
  const result = { width, height, shadow: new Uint8Array(n), error: new Uint8Array(n), kind: new Uint8Array(n), tests: null,
    shaded: await layered(packed, method.shaded), extras: {} };
  for (let i = 0; i < n; i++) {
    result.shadow[i] = state[4 * i];
    result.error[i] = state[4 * i + 1];
    result.kind[i] = state[4 * i + 2];
  }
  if (method.tests) {
    const bytes = (await pixels(packed, method.tests)).data;
    result.tests = new Uint32Array(n);
    for (let i = 0; i < n; i++) result.tests[i] = (bytes[4 * i] << 16) | (bytes[4 * i + 1] << 8) | bytes[4 * i + 2];
  }
  for (const [extra, name] of Object.entries(method.extras)) result.extras[extra] = await pixels(packed, name);
  return result;
}
