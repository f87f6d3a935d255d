/* Unpacks what the page carries compressed, the plotting library first; then runs what waits for it. */
/* Bytes of base 85: five digits are four bytes; a last group of n + 1 digits is n bytes. */
const digits85 = "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz!#$%&()*+-;<=>?@^_`{|}~";
function bytesOf(text) {
  const value = new Uint8Array(128), bytes = new Uint8Array(Math.ceil(text.length / 5) * 4);
  [...digits85].forEach((digit, i) => { value[digit.charCodeAt(0)] = i; });
  for (let i = 0, at = 0; i < text.length; i += 5) {
    let group = 0;
    for (let k = 0; k < 5; k++) group = group * 85 + (i + k < text.length ? value[text.charCodeAt(i + k)] : 84);
    for (const shift of [16777216, 65536, 256, 1]) bytes[at++] = Math.floor(group / shift) & 255;
  }
  return bytes.subarray(0, bytes.length - (5 - (text.length % 5 || 5)));
}
async function unpacked(text) {
  const stream = new DecompressionStream("gzip"), writer = stream.writable.getWriter();
  writer.write(bytesOf(text));
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
    (document.querySelector("main") || document.body).prepend(note);
    return;
  }
  for (const element of document.querySelectorAll(".packed"))
    element.textContent = await unpacked(element.textContent);
  const library = document.getElementById("library");
  run(library.textContent);
  library.remove();
  /* What a robot did stays on the machine of its owner: no figure may be uploaded. */
  if (window.Plotly) Plotly.setPlotConfig({showSendToCloud: false, plotlyServerURL: ""});
  for (const script of document.querySelectorAll("script.later")) run(script.textContent);
}
