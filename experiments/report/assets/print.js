let printTimer = null, printRun = 0;
function preparePrint() { clearTimeout(printTimer); printTimer = setTimeout(drawForPaper, 300); }
async function drawForPaper() {
  const run = ++printRun, own = window.figuresForPaper ? window.figuresForPaper() : {};
  for (const plot of document.querySelectorAll(".js-plotly-plot")) {
    const figure = own[plot.id] || {data: plot.data, layout: plot.layout};
    const isDeep = figure.data.some(trace => /3d|surface|gl/.test(trace.type || ""));
    const options = {format: isDeep ? "png" : "svg", width: 760, height: plot.offsetHeight || 450,
      scale: isDeep ? 2 : 1};
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
