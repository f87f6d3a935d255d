/* Unpacks what the page carries compressed, the plotting library first; then runs what waits for it. */
async function unpacked(text) {
  const stream = new DecompressionStream("gzip"), writer = stream.writable.getWriter();
  writer.write(Uint8Array.from(atob(text), letter => letter.charCodeAt(0)));
  writer.close();
  const reader = stream.readable.getReader(), decoder = new TextDecoder(), parts = [];
  for (let part = await reader.read(); !part.done; part = await reader.read())
    parts.push(decoder.decode(part.value, {stream: true}));
  return parts.join("");
}
function run(text) {
  const script = document.createElement("script");
  script.textContent = text;
  document.body.append(script);
}
async function unpackPage() {
  if (!window.DecompressionStream) {
    const note = document.createElement("p");
    note.className = "note";
    note.textContent = "The figures of this page need a browser of 2023 or newer.";
    document.querySelector("main").prepend(note);
    return;
  }
  for (const element of document.querySelectorAll(".packed"))
    element.textContent = await unpacked(element.textContent);
  run(document.getElementById("plotly").textContent);
  document.getElementById("plotly").remove();
  /* What a robot did stays on the machine of its owner: no figure may be uploaded. */
  Plotly.setPlotConfig({showSendToCloud: false, plotlyServerURL: ""});
  for (const script of document.querySelectorAll("script.later")) run(script.textContent);
}
