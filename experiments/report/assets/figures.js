/* A button above every figure that saves what it draws as a table: curve, x, y and z. */
function figureText(plot) {
  const layout = plot._fullLayout || plot.layout, titles = new Set();
  const quoted = value => /[",\n]/.test(String(value)) ? `"${String(value).replaceAll('"', '""')}"` : value ?? "";
  const titleOf = name => (((layout[name] || {}).title || {}).text || "").replace(/<[^>]*>/g, "");
  const rows = [];
  for (const trace of plot.data) {
    const x = trace.x || [], y = trace.y || [], z = trace.z;
    const key = (axis, short) => (trace[short + "axis"] || short).replace(short, axis);
    titles.add(titleOf(key("xaxis", "x")));
    const unit = titleOf(key("yaxis", "y"));
    for (let i = 0; i < Math.max(x.length, y.length); i++)
      rows.push([trace.name ?? "", unit, x[i], y[i], ...(z ? [Array.isArray(z[i]) ? z[i].join(" ") : z[i]] : [])]
        .map(quoted).join(","));
  }
  const head = ["curve", "y is", [...titles].filter(Boolean).join(" or ") || "x", "y",
    ...(plot.data.some(trace => trace.z) ? ["z"] : [])];
  return [head.map(quoted).join(","), ...rows].join("\n") + "\n";
}
function saveText(text, name) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([text], {type: "text/csv"}));
  link.download = name + ".csv";
  link.click();
  URL.revokeObjectURL(link.href);
}
/* Plotly prefers an angle that it once chose itself to one of exactly 0. */
const level = 1e-6;
/* Three columns of axes or more have no room on a narrow screen: there all axes stand above each other. */
function stacked(layout) {
  const named = letter => Object.keys(layout).filter(name => new RegExp(`^${letter}axis\\d*$`).test(name));
  const columns = named("x"), rows = named("y"), count = columns.length;
  const share = name => layout[name].domain[1] - layout[name].domain[0];
  if (count < 3 || rows.length !== count || columns.some(name => share(name) > 0.4)) return {};
  const gap = (share(rows[0]) > 0.9 ? 0.42 : 0.6) / count, high = (1 - gap * (count - 1)) / count;
  const change = {height: Math.round(0.7 * count * layout.height * Math.min(1, 1.15 * share(rows[0])))};
  columns.forEach((name, i) => {
    const top = 1 - i * (high + gap);
    change[`${name}.domain`] = [0, layout.coloraxis ? 0.92 : 1];
    Object.assign(change, {[`${name}.nticks`]: 5, [`${name}.tickangle`]: level});
    change[`${rows[i]}.domain`] = [Math.max(0, top - high), top];
    change[`${rows[i]}.showticklabels`] = true;
    if ((layout.annotations || []).length === count) Object.assign(change, {[`annotations[${i}].x`]: 0.5, [`annotations[${i}].y`]: top});
  });
  return change;
}
/* Long titles of axes in two lines. */
function inTwoLines(layout) {
  const change = {};
  for (const [name, axis] of Object.entries(layout)) {
    const text = /^xaxis/.test(name) && axis.title ? axis.title.text || "" : "";
    if (text.length < 38 || text.includes("<")) continue;
    const middle = text.length / 2, spaces = [...text.matchAll(/ /g)].map(found => found.index);
    const at = spaces.sort((a, b) => Math.abs(a - middle) - Math.abs(b - middle))[0];
    if (at) change[`${name}.title.text`] = `${text.slice(0, at)}<br>${text.slice(at + 1)}`;
  }
  return change;
}
/* Words in the colour of the page; where there is less room, small titles, axes beside each other with few numbers, and
   three dimensions from farther away in a figure that is not much higher than wide. */
function colorFigures() {
  const ink = getComputedStyle(document.documentElement).getPropertyValue("--soft").trim();
  for (const plot of document.querySelectorAll(".js-plotly-plot")) {
    const change = {"font.color": ink};
    if (window.innerWidth < 520) {
      if (plot._fullLayout.scene) {
        const far = plot.data.some(trace => trace.colorbar || trace.marker && trace.marker.colorbar) ? 1.2 : 1;
        change["scene.camera.eye"] = {x: 2.5 * far, y: 2.5 * far, z: 1.7 * far};
        for (const name of ["x", "y", "z"]) change[`scene.${name}axis.nticks`] = 4;
        change.height = Math.min(plot._fullLayout.height, Math.round(1.15 * plot.offsetWidth));
      }
      const isSquare = Object.values(plot._fullLayout).some(axis => axis && axis.scaleanchor);
      if (isSquare) change.height = Math.min(plot._fullLayout.height, plot.offsetWidth);
      Object.assign(change, inTwoLines(plot._fullLayout), stacked(plot._fullLayout));
      if (change.height) plot.style.height = plot.parentElement.style.height = change.height + "px";
      else for (const [name, axis] of Object.entries(plot._fullLayout)) if (/^xaxis/.test(name)
          && axis.domain[1] - axis.domain[0] < 0.6) Object.assign(change, {[`${name}.nticks`]: 4,
        [`${name}.tickangle`]: level, [`${name}.tickfont.size`]: 11, [`${name}.title.font.size`]: 11});
      (plot.layout.annotations || []).forEach((_, i) => { change[`annotations[${i}].font.size`] = 11; });
    }
    Plotly.relayout(plot, change);
  }
}
/* On paper words are dark, whatever the screen was. */
const paperInk = "#5b6675";
function prepareFigures() {
  let number = 0;
  for (const plot of document.querySelectorAll(".plot, .js-plotly-plot")) {
    const button = document.createElement("button"), card = plot.closest(".card");
    const heading = card && card.querySelector("h2") ? card.querySelector("h2").textContent : "figure";
    const name = /^[a-z]/.test(plot.id) && plot.classList.contains("plot") ? plot.id : `figure-${++number}`;
    button.type = "button";
    button.className = "csv of-figure";
    button.textContent = "CSV";
    button.setAttribute("aria-label", `CSV: save what “${heading}” draws as a table`);
    button.onclick = () => saveText(figureText(plot), name);
    /* A figure that is alone in its card has the button in the corner of the card. */
    if (card && card.querySelectorAll(".plot, .js-plotly-plot").length === 1) {
      card.classList.add("has-corner");
      card.append(button);
    } else plot.before(button);
  }
}
