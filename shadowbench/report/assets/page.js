"use strict";
// What every part of the page uses: elements, the page's data, the frame and the methods that are shown.

const $ = (id) => document.getElementById(id);
const $$ = (selector, root = document) => [...root.querySelectorAll(selector)];
const DATA = JSON.parse($("page-data").textContent);
const thousands = (value) => value.toLocaleString("en-US", { maximumFractionDigits: 2 });

/** Frames of all runs, ascending. */
const FRAMES = [...new Set(DATA.runs.flatMap((run) => run.frames))].sort((a, b) => a - b);

/** What the reader chose; parts of the page that depend on it call `onChange`. */
const chosen = { frame: FRAMES[0], hidden: new Set() };
const listeners = [];
const onChange = (listener) => listeners.push(listener);
const changed = () => listeners.forEach((listener) => listener());

function setFrame(frame) {
  if (frame === chosen.frame || !FRAMES.includes(frame)) return;
  chosen.frame = frame;
  changed();
}

function stepFrame(step) {
  const at = FRAMES.indexOf(chosen.frame) + step;
  setFrame(FRAMES[(at + FRAMES.length) % FRAMES.length]);
}

function element(name, attributes = {}, ...children) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  made.append(...children);
  return made;
}

/** Offer text as a file. */
function save(name, text, type) {
  const link = element("a", { href: URL.createObjectURL(new Blob([text], { type })), download: name });
  document.body.append(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

// Theme: as the system is, light or dark.
const THEMES = ["system", "light", "dark"];
const systemDark = matchMedia("(prefers-color-scheme: dark)");
let theme = 0;

function applyTheme() {
  const dark = THEMES[theme] === "dark" || (THEMES[theme] === "system" && systemDark.matches);
  document.documentElement.dataset.theme = dark ? "dark" : "light";
  $("theme").textContent = `Theme: ${THEMES[theme]}`;
  changed();
}

function nextTheme() {
  theme = (theme + 1) % THEMES.length;
  applyTheme();
}

function startPage() {
  systemDark.addEventListener("change", applyTheme);
  $("theme").addEventListener("click", nextTheme);
  $("help-open").addEventListener("click", () => $("help").showModal());
  for (const button of $$(".copy")) button.addEventListener("click", () => copy(button));
  for (const button of $$(".download")) {
    button.addEventListener("click", () => {
      const files = JSON.parse(document.querySelector(`script[data-files="${button.dataset.run}"]`).textContent);
      save(button.dataset.name, files[button.dataset.name], "text/plain");
    });
  }
  for (const box of $$("#methods input")) box.addEventListener("change", () => showMethod(Number(box.value), box.checked));
  $("methods-all").addEventListener("click", () => {
    for (const box of $$("#methods input")) box.checked = true;
    chosen.hidden.clear();
    changed();
  });
  onChange(() => {
    for (const part of $$("[data-series]:not(#measurement-table tr)")) {
      part.classList.toggle("off", chosen.hidden.has(Number(part.dataset.series)));
    }
  });
}

function showMethod(series, visible) {
  if (visible) chosen.hidden.delete(series);
  else chosen.hidden.add(series);
  changed();
}

/** Copy a command; where the browser refuses, select it for the reader to copy. */
function copy(button) {
  const source = $(button.dataset.copies);
  const done = () => {
    button.textContent = "Copied";
    setTimeout(() => { button.textContent = "Copy"; }, 1200);
  };
  const select = () => {
    getSelection().selectAllChildren(source);
    button.textContent = "Selected";
  };
  if (navigator.clipboard) navigator.clipboard.writeText(source.textContent).then(done, select);
  else select();
}
