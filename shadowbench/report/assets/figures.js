// The figures: the frame's line in the curves, and saving as SVG files that need no style sheet.

const STYLED = ["fill", "fill-opacity", "stroke", "stroke-width", "stroke-dasharray", "font-family", "font-size", "font-weight"];

function startFigures() {
  for (const figure of $$(".fly svg.figure")) figure.addEventListener("click", (event) => goToFrame(figure, event));
  for (const button of $$(".save-svg")) {
    button.addEventListener("click", () => {
      const figure = button.closest("figure").querySelector("svg");
      save(`${figure.dataset.name}.svg`, standalone(figure), "image/svg+xml");
    });
  }
  onChange(moveScrubbers);
}

const range = (scrub) => scrub.dataset.x.split(" ").map(Number);

function moveScrubbers() {
  for (const scrub of $$(".scrub")) {
    const [start, end, low, high] = range(scrub);
    const x = start + (chosen.frame - low) / (high - low) * (end - start);
    scrub.setAttribute("x1", x);
    scrub.setAttribute("x2", x);
  }
}

function goToFrame(figure, event) {
  const [start, end, low, high] = range(figure.querySelector(".scrub"));
  const box = figure.getBoundingClientRect();
  const x = (event.clientX - box.left) / box.width * figure.viewBox.baseVal.width;
  const wanted = low + (x - start) / (end - start) * (high - low);
  setFrame(FRAMES.reduce((best, frame) => (Math.abs(frame - wanted) < Math.abs(best - wanted) ? frame : best)));
}

/** The text of an SVG file with every colour and font written into it, on the page's ground. */
function standalone(figure) {
  const copy = figure.cloneNode(true);
  const [from, to] = [$$("*", figure), $$("*", copy)];
  to.forEach((part, i) => {
    const style = getComputedStyle(from[i]);
    if (style.display === "none") part.setAttribute("display", "none");
    for (const name of STYLED) part.setAttribute(name, style.getPropertyValue(name));
    part.removeAttribute("class");
  });
  const { width, height } = figure.viewBox.baseVal;
  copy.removeAttribute("class");
  copy.setAttribute("xmlns", "http://www.w3.org/2000/svg");
  copy.setAttribute("width", width);
  copy.setAttribute("height", height);
  const ground = document.createElementNS("http://www.w3.org/2000/svg", "rect");
  ground.setAttribute("width", width);
  ground.setAttribute("height", height);
  ground.setAttribute("fill", getComputedStyle(document.body).backgroundColor);
  copy.prepend(ground);
  return new XMLSerializer().serializeToString(copy);
}
