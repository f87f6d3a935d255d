/* Folded figures: drawn when they are opened, and for paper in any case. */
const panelElement = id => document.getElementById(id);
const isOpen = id => onPaper || panelElement(id).closest("details").open;
const curveCache = new Map();
function curve(code) {
  if (!curveCache.has(code)) curveCache.set(code, {x: decoded(code.x), y: decoded(code.y)});
  return curveCache.get(code);
}

/* Domains of some axes above each other, in two columns where there is room for them. */
function panelCells(count) {
  const columns = count > 3 && !narrow() ? 2 : 1, rows = Math.ceil(count / columns);
  const gapX = 0.11, gapY = count > 3 ? 0.075 : 0.13;
  const width = (1 - gapX * (columns - 1)) / columns, height = (1 - gapY * (rows - 1)) / rows;
  return Array.from({length: count}, (_, i) => {
    const column = i % columns, row = Math.floor(i / columns), top = 1 - row * (height + gapY);
    return {x: [column * (width + gapX), column * (width + gapX) + width], y: [Math.max(0, top - height), top],
      isLowest: i + columns >= count};
  });
}

/* The range of what happens from the start of the path on; the jolt of the start would leave no room for it. */
function rangeOnPath(panel, i) {
  let low = Infinity, high = -Infinity;
  for (const codes of data.laws.filter(shown).map(law => panel.curves[law.id] || [])) {
    const {x, y} = codes[i] ? curve(codes[i]) : {x: [], y: []};
    x.forEach((time, k) => {
      if (time < data.marks.path_start || y[k] === null || Number.isNaN(y[k])) return;
      low = Math.min(low, y[k]);
      high = Math.max(high, y[k]);
    });
  }
  const edge = 0.08 * (high - low);
  return edge > 0 ? [low - edge, high + edge] : undefined;
}
function drawPanel(panel) {
  if (!isOpen(panel.id)) return;
  const cells = panelCells(panel.axes.length), shapes = [], annotations = [];
  const extra = {shapes, annotations, hovermode: "closest", 
    /* Room for the buttons that appear above it. */
    margin: {l: 62, r: 14, t: onPaper || narrow() ? 26 : 44, b: 46}};
  panel.axes.forEach((axes, i) => {
    const n = i ? i + 1 : "";
    const ofLaws = name => data.laws.filter(shown).map(law => (panel.curves[law.id] || [])[i])
      .filter(Boolean).map(code => curve(code)[name]);
    extra["xaxis" + n] = axis({type: axes.x_log ? "log" : "linear", domain: cells[i].x, anchor: "y" + n,
      title: cells[i].isLowest || axes.x !== panel.axes[panel.axes.length - 1].x ? titled(axes.x) : undefined,
      range: axes.over_time ? [data.laws[0].line.t[0], data.marks.path_end] : undefined, exponentformat: "none",
      ...(axes.x_log ? logTicks(ofLaws("x")) : {nticks: 7})});
    extra["yaxis" + n] = axis({type: axes.y_log ? "log" : "linear", domain: cells[i].y, anchor: "x" + n,
      title: titled(axes.y), exponentformat: "none", range: axes.fits_path ? rangeOnPath(panel, i) : undefined,
      ...(axes.y_log ? logTicks(ofLaws("y")) : {nticks: panel.axes.length > 3 && narrow() ? 4 : 6})});
    for (const limit of axes.limits) shapes.push({type: "line", xref: "x" + n + " domain", yref: "y" + n,
      x0: 0, x1: 1, y0: limit, y1: limit, line: {color: css("--soft"), width: 1.2, dash: "dot"}});
    if (axes.over_time) for (const x of [data.marks.path_start, data.marks.dwell_start]) shapes.push({
      type: "line", xref: "x" + n, yref: "y" + n + " domain", x0: x, x1: x, y0: 0, y1: 1, layer: "below",
      line: {color: css("--soft"), width: 1, dash: "dot"}});
    if (axes.heading) annotations.push({text: axes.heading, showarrow: false, xref: "x" + n + " domain",
      yref: "y" + n + " domain", x: 0, y: 1, yanchor: "bottom", font: {size: 12, color: css("--soft")}});
  });
  const traces = [];
  for (const law of data.laws) (panel.curves[law.id] || []).forEach((code, i) => {
    const points = curve(code), n = i ? i + 1 : "";
    traces.push({type: "scatter", mode: "lines", x: points.x, y: points.y, xaxis: "x" + n, yaxis: "y" + n,
      name: law.title, legendgroup: law.id, showlegend: i === 0, visible: shown(law),
      line: {color: law.color, width: 1.4, shape: panel.axes[i].shape}});
  });
  show(panel.id, traces, layout(extra), config());
}

/* Robots at the instant of the largest error of each law; deviations magnified as on the path. */
function drawWorst() {
  const worst = data.worst;
  if (!worst || !isOpen("worst")) return;
  const line = (name, points, color, width, more) => Object.assign({type: "scatter3d", mode: "lines", name,
    x: points[0], y: points[1], z: points[2], line: {color, width},
    hovertemplate: name + "<br>%{x:.0f}, %{y:.0f}, %{z:.0f} mm<extra></extra>"}, more);
  const traces = [line("wanted path", worst.path, css("--ink"), 2)];
  for (const law of data.laws) {
    const {arm, wanted, deviation, time, distance} = worst.laws[law.id];
    const text = `${law.title}: ${distance.toPrecision(3)} mm at ${time.toFixed(2)} s`;
    const end = wanted.map((v, k) => v + magnification * deviation[k]);
    const group = {visible: shown(law), legendgroup: law.id};
    traces.push(line(text, arm, law.color, 9, Object.assign({mode: "lines+markers", opacity: 0.75,
      marker: {size: 4, color: law.color}}, group)));
    traces.push(line(`${law.title}: deviation ×${magnification}`, wanted.map((v, k) => [v, end[k]]), law.color, 5,
      Object.assign({mode: "lines+markers", marker: {size: [2, 5], color: law.color,
        symbol: ["circle", "diamond"]}, showlegend: false}, group)));
  }
  const far = narrow() ? 2.3 : 1.45, scene = {aspectmode: "data", uirevision: "worst", dragmode: "turntable",
    camera: {eye: {x: 1.2 * far, y: -0.9 * far, z: 0.5 * far}, center: {x: 0, y: 0, z: -0.1}}};
  for (const name of ["x", "y", "z"]) scene[name + "axis"] = {title: {text: name + " in mm",
    font: {size: 12, color: css("--soft")}}, gridcolor: css("--grid"), zerolinecolor: css("--grid"),
    showbackground: false, nticks: 5, tickfont: {color: css("--soft"), size: 11}, showspikes: false};
  show("worst", traces, layout({scene, showlegend: true, margin: {l: 0, r: 0, t: 0, b: 0}, uirevision: "worst",
    legend: {orientation: "h", x: 0, y: 0, font: {size: 12}}}), config());
}
function drawFolded() { data.panels.forEach(drawPanel); drawWorst(); }
for (const fold of document.querySelectorAll("details.card")) fold.addEventListener("toggle", () => {
  if (fold.open) drawFolded();
});
