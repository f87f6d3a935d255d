let printTimer = null, printRun = 0;
/* A folded section is opened on paper. */
window.addEventListener("beforeprint", () => {
  for (const fold of document.querySelectorAll("details:not([open])")) { fold.open = true; fold.dataset.folded = "yes"; }
});
window.addEventListener("afterprint", () => {
  for (const fold of document.querySelectorAll("details[data-folded]")) fold.open = false;
});
function preparePrint() { clearTimeout(printTimer); printTimer = setTimeout(drawForPaper, 300); }
async function drawForPaper() {
  const run = ++printRun, own = window.figuresForPaper ? window.figuresForPaper() : {};
  const plots = new Set(document.querySelectorAll(".js-plotly-plot"));
  for (const id in own) plots.add(document.getElementById(id));
  for (const plot of plots) {
    if (!own[plot.id] && !plot.layout) continue;  /* not drawn yet: what draws it comes here again */
    const figure = own[plot.id] || {data: plot.data,
      layout: {...plot.layout, font: {...plot.layout.font, color: paperInk}}};
    const isDeep = figure.data.some(trace => /3d|surface|gl/.test(trace.type || ""));
    /* Curves a little flatter than on the screen, so that two fit on a page. */
    const tall = plot.offsetHeight || parseInt(plot.style.height) || 450, height = Math.round(tall * (isDeep ? 1 : 0.88));
    const options = {format: isDeep ? "png" : "svg", width: 760, height, scale: isDeep ? 2 : 1};
    const source = await Plotly.toImage({data: figure.data,
      layout: Object.assign({}, figure.layout, {autosize: false})}, options);
    if (run !== printRun) return;
    let picture = plot.nextElementSibling;
    if (!picture || !picture.classList.contains("paper-only")) {
      picture = document.createElement("img");
      picture.className = "paper-only";
      picture.id = plot.id + "-on-paper";
      picture.alt = "";
      plot.after(picture);
    }
    picture.src = source;
    plot.classList.add("screen-only");
  }
  document.body.dataset.printable = "yes";
}
