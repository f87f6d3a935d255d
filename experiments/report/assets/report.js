"use strict";
const data = JSON.parse(document.getElementById("data").textContent);
for (const law of data.laws) for (const traces of [law.line, law.measured]) {
  for (const name of ["t", "norm_mm", "angle_deg"]) traces[name] = decoded(traces[name]);
  for (const name of ["mm", "deg"]) traces[name] = traces[name].map(decoded);
}
const hidden = new Set();
let showMeasured = true, magnification = 1;
const css = name => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
let onPaper = null; // the figures that are drawn for printing, while they are collected
const narrow = () => !onPaper && window.innerWidth < 520;
const bare = {responsive: true, displayModeBar: false};
const config = () => narrow() ? bare : {responsive: true, displaylogo: false, displayModeBar: "hover",
  modeBarButtonsToRemove: ["select2d", "lasso2d", "autoScale2d", "resetCameraLastSave3d", "orbitRotation",
    "tableRotation"]};

function axis(extra) {
  return Object.assign({gridcolor: css("--grid"), zerolinecolor: css("--line"), linecolor: css("--line"),
    tickfont: {color: css("--soft"), size: 12}, automargin: true}, extra);
}
function titled(text) { return {text, font: {color: css("--soft"), size: 13}, standoff: 8}; }
function layout(extra) {
  return Object.assign({paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", showlegend: false,
    margin: {l: 58, r: 14, t: 12, b: 44}, font: {family: "system-ui, sans-serif", color: css("--ink"),
      size: 13},
    hoverlabel: {font: {size: 12}},
    modebar: {bgcolor: "rgba(0,0,0,0)", color: css("--line"), activecolor: css("--soft")}}, extra);
}
const shown = law => !hidden.has(law.id);
function show(id, traces, figureLayout, figureConfig) {
  if (onPaper) onPaper[id] = {data: traces, layout: figureLayout};
  else Plotly.react(id, traces, figureLayout, figureConfig);
}

/* Dashed marks where errors begin to count and where the path is at rest. */
function marks() {
  const line = x => ({type: "line", xref: "x", yref: "paper", x0: x, x1: x, y0: 0, y1: 1, layer: "below",
    line: {color: css("--soft"), width: 1, dash: "dot"}});
  const dwell = {type: "rect", xref: "x", yref: "paper", x0: data.marks.dwell_start, x1: data.marks.path_end,
    y0: 0, y1: 1,
    layer: "below", line: {width: 0}, fillcolor: css("--soft"), opacity: 0.1};
  return [dwell, line(data.marks.path_start), line(data.marks.dwell_start)];
}
function markLabels() {
  const label = (x, text, anchor) => ({x, y: 1, xref: "x", yref: "paper", text, showarrow: false,
    xanchor: anchor,
    yanchor: "bottom", font: {size: 12, color: css("--soft")}});
  return [label(data.marks.path_start, "path starts", "left"), label(data.marks.path_end, "dwell", "right")];
}

/* A number at each decade, and between them where the curves span so few that none or one might be there. */
function logTicks(curves) {
  let low = Infinity, high = 0;
  for (const values of curves) for (const value of values) if (value > 0) {
    low = Math.min(low, value);
    high = Math.max(high, value);
  }
  const decades = Math.log10(high / low);
  if (!(decades < 1.5)) return {dtick: 1};
  return {dtick: decades < 0.6 ? "D1" : "D2", tickformat: "~g"};
}

function stacked(id, rows, log) {
  const traces = [];
  const gap = 0.055, height = (1 - gap * (rows.length - 1)) / rows.length;
  const extra = {shapes: marks(), annotations: markLabels(), margin: {l: 58, r: 14, t: narrow() ? 26 : 50,
    b: 44},
    hovermode: "x", xaxis: axis({title: titled("time in s"), range: [data.laws[0].line.t[0],
      data.marks.path_end], anchor: "y" + (rows.length > 1 ? rows.length : "")})};
  rows.forEach((row, i) => {
    const name = i ? "y" + (i + 1) : "y", isFirst = i === 0, top = 1 - i * (height + gap);
    extra["yaxis" + (i ? i + 1 : "")] = axis({title: titled(row.title), domain: [Math.max(0, top - height),
      top],
      type: log ? "log" : "linear", range: row.range && row.range.slice(), exponentformat: "none",
      nticks: 6, ...(log ? logTicks(data.laws.filter(shown).map(law => row.of(law.line))) : {})});
    for (const law of data.laws) {
      const noise = row.of(law.measured), line = row.of(law.line);
      if (showMeasured && !log) traces.push({x: law.measured.t, y: noise, yaxis: name, type: "scatter",
        mode: "markers", showlegend: false,
        marker: {color: law.color, size: 2.5, opacity: 0.28}, hoverinfo: "skip", visible: shown(law)});
      traces.push({x: law.line.t, y: line, yaxis: name, type: "scatter", mode: "lines", name: law.title,
        showlegend: isFirst,
        /* In a range that fits the laws the open loop only passes through: keep it in the background. */
        line: {color: law.color, width: !log && law.id === "open_loop" ? 0.8 : 1.7}, visible: shown(law),
          hovertemplate: "%{y:.3f}"});
    }
  });
  show(id, traces, layout(extra), config());
}

function drawPath() {
  const wanted = data.laws[0].path.wanted;
  const traces = [{type: "scatter3d", mode: "lines", name: "wanted", x: wanted[0], y: wanted[1], z: wanted[2],
    line: {color: css("--ink"), width: 3},
      hovertemplate: "wanted<br>%{x:.1f}, %{y:.1f}, %{z:.1f} mm<extra></extra>"}];
  let low = [1e9, 1e9, 1e9], high = [-1e9, -1e9, -1e9];
  const grow = p => p.forEach((v, k) => { for (const u of v) { low[k] = Math.min(low[k], u);
    high[k] = Math.max(high[k], u); } });
  grow(wanted);
  for (const law of data.laws) {
    const p = law.path.wanted.map((w, k) => w.map((v, j) => v + magnification * law.path.deviation[k][j]));
    if (shown(law)) grow(p);
    traces.push({type: "scatter3d", mode: "lines", name: law.title, x: p[0], y: p[1], z: p[2],
      visible: shown(law),
      line: {color: law.color, width: 5}, hovertemplate: law.title + "<extra></extra>"});
  }
  const extent = Math.max(...high.map((v, k) => v - low[k])) || 1;  // of one point, where nothing else is shown
  /* A line that stays on the spot cannot be seen: a cross stands for it, the wanted one larger. */
  const spread = values => values.reduce((most, v) => Math.max(most, v), -1e9)
    - values.reduce((least, v) => Math.min(least, v), 1e9);
  traces.forEach((trace, number) => {
    const names = ["x", "y", "z"], arm = (number ? 0.02 : 0.04) * extent;
    if (names.some(name => spread(trace[name]) > 0.01 * extent)) return;
    names.forEach((name, k) => {
      const v = trace[name].at(-1);
      trace[name] = names.flatMap((_, j) => j === k ? [v - arm, v + arm, null] : [v, v, null]);
    });
  });
  const ratio = {}, scene = {aspectmode: "manual", dragmode: "turntable", uirevision: "path"};
  ["x", "y", "z"].forEach((name, k) => {
    const half = Math.max(0.54 * (high[k] - low[k]), 0.16 * extent), middle = 0.5 * (high[k] + low[k]);
    ratio[name] = 1.25 * half / (0.54 * extent);
    scene[name + "axis"] = {range: [middle - half, middle + half], title: {text: name + " in mm",
      font: {size: 12, color: css("--soft")}},
      gridcolor: css("--grid"), linecolor: css("--line"), zerolinecolor: css("--grid"),
        showbackground: false, nticks: 5,
      tickfont: {color: css("--soft"), size: 11}, showspikes: false};
  });
  scene.aspectratio = ratio;
  /* A square one, as of a circle, is looked at from further away than a long one. */
  const far = (narrow() ? 1.75 : 1) * Math.max(1, Math.hypot(ratio.x, ratio.y, ratio.z) / 1.36);
  scene.camera = {eye: {x: 1.05 * far, y: -0.62 * far, z: 0.62 * far}, center: {x: 0, y: 0, z: -0.04}};
  show("path", traces, layout({scene, margin: {l: 0, r: 0, t: 0, b: 0}, uirevision: "path"}),
    config());
}

function drawBars(id, unit, digits) {
  const laws = data.laws.filter(shown).reverse(), names = laws.map(law => law.title);
  const values = key => laws.map(law => law.bars[key + "_" + unit]);
  const all = values("max").concat(values("static")).filter(v => v > 0);
  if (!all.length) { show(id, [], layout({}), bare); return; }
  const low = Math.floor(Math.log10(Math.min(...all)) - 0.3), high = Math.log10(Math.max(...all));
  const text = v => v === null ? "" : v >= 0.01 ? v.toFixed(digits) : v.toPrecision(1);
  const bar = (key, opacity, label) => ({type: "bar", orientation: "h", y: names, x: values(key), name: label,
    marker: {color: laws.map(law => law.color), opacity}, text: values(key).map(v => label + " " + text(v)),
    textposition: "outside", cliponaxis: false, textfont: {size: 12, color: css("--ink")},
    hovertemplate: label + " %{x:.4g} " + (unit === "mm" ? "mm" : "°") + "<extra>%{y}</extra>"});
  show(id, [bar("static", 0.45, "static"), bar("max", 1, "largest")], layout({barmode: "group",
    bargap: 0.28,
    margin: {l: 10, r: 14, t: 6, b: 44}, xaxis: axis({type: "log", dtick: narrow() ? 2 : 1,
      exponentformat: "none", tickangle: 0,
      range: [low, high + (narrow() ? 0.55 : 0.38) * (high - low)],
        title: titled(unit === "mm" ? "distance in mm" : "angle in degrees")}),
    yaxis: axis({showgrid: false, tickfont: {color: css("--ink"), size: 13}})}), bare);
}

function drawEvents() {
  if (!document.getElementById("events")) return;
  const traces = data.laws.map(law => ({type: "scatter", mode: "markers", name: law.title,
    visible: shown(law),
    x: law.events.map(e => e[0]), y: law.events.map(e => e[1].replaceAll("_", " ")),
    customdata: law.events.map(e => e[2]), marker: {color: law.color, size: 9, symbol: "line-ns-open",
      line: {width: 2}},
    hovertemplate: "%{x:.3f} s<br>%{customdata}<extra>" + law.title + "</extra>"}));
  show("events", traces, layout({shapes: marks(), margin: {l: 10, r: 14, t: 10, b: 44},
    xaxis: axis({title: titled("time in s"), range: [data.laws[0].line.t[0], data.marks.path_end]}),
    yaxis: axis({type: "category", tickfont: {color: css("--ink"), size: 12}})}), bare);
}

{% include "panels.js" %}

function drawAll() {
  const xyz = ["x", "y", "z"];
  drawPath();
  stacked("distance", [{title: "distance in mm", of: t => t.norm_mm}, {title: "angle in °",
    of: t => t.angle_deg}], true);
  stacked("position", xyz.map((a, k) => ({title: "Δ" + a + " in mm", of: t => t.mm[k],
    range: data.axis_range.mm})), false);
  stacked("orientation", xyz.map((a, k) => ({title: "ρ" + a + " in °", of: t => t.deg[k],
    range: data.axis_range.deg})), false);
  drawBars("bars-mm", "mm", 2);
  drawBars("bars-deg", "deg", 2);
  drawEvents();
  drawFolded();
}
function draw() { drawAll(); preparePrint(); }

/* All figures in the colours of paper and with a legend, which a reader of the screen has in the buttons. */
window.figuresForPaper = () => {
  document.documentElement.classList.add("paper");
  onPaper = {};
  drawAll();
  const figures = onPaper;
  onPaper = null;
  document.documentElement.classList.remove("paper");
  for (const id in figures) if (!id.startsWith("bars"))
    Object.assign(figures[id].layout, {showlegend: true, margin: {...figures[id].layout.margin, t: 62},
      /* At the top of the picture, above the words that stand at the top of its axes. */
      legend: {orientation: "h", x: 0, y: 1, yref: "container", yanchor: "top"}});
  return figures;
};

for (const button of document.querySelectorAll(".chips button")) {
  button.addEventListener("click", () => {
    const on = button.getAttribute("aria-pressed") !== "true";
    button.setAttribute("aria-pressed", String(on));
    if (button.dataset.law) { if (on) hidden.delete(button.dataset.law); else hidden.add(button.dataset.law);
      }
    else showMeasured = on;
    draw();
  });
}
const select = document.getElementById("magnification");
magnification = Number(select.value);
select.addEventListener("change", () => { magnification = Number(select.value); drawPath();
  drawWorst(); preparePrint(); });
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
draw();
prepareFigures();
prepareTables();
document.body.dataset.drawn = "yes";
