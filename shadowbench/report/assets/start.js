// Starts every part, then the keys.

const KEYS = { t: nextTheme, "?": () => $("help").showModal(), ",": () => stepFrame(-1), ".": () => stepFrame(1),
  "/": () => $("filter").focus() };
const VIEWER_KEYS = { p: togglePlay, f: flip, x: swap, s: () => setKind("shaded"), d: () => setKind("shadow"),
  h: () => setKind("heat"), e: () => setKind("error"), 1: () => setMode("slider"), 2: () => setMode("flip"),
  3: () => setMode("beside"), 4: () => setMode("difference") };

function onKey(event) {
  const typing = event.target.closest("select, input[type=search], dialog");
  if (typing || event.ctrlKey || event.metaKey || event.altKey) return;
  const act = KEYS[event.key] ?? ($("viewer") ? VIEWER_KEYS[event.key] : undefined);
  if (!act) return;
  event.preventDefault();
  act();
}

startPage();
startTables();
startFigures();
if ($("viewer")) {
  startViewer();
  startLoupe();
}
document.addEventListener("keydown", onKey);
applyTheme();
