const element = id => document.getElementById(id);
const state = {frame: 0, isPlaying: true, speed: 1, magnify: 1, elastic: 1, robot: data.shown, view: "free"};
const slider = element("slider");
slider.max = count - 1;
const options = (select, entries, chosen) => {
  for (const [value, text] of entries) select.add(new Option(text, value, false, String(value) === String(chosen)));
};
options(element("robot"), [...laws.map(law => [law.id, law.title]), ["all", "all, translucent"], ["none", "none"]], data.shown);
const factors = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000];
{ /* The largest magnification at which the shown law stays within a fifth of the path. */
  const shown = laws.find(law => law.id === data.shown);
  const largest = Math.max(...shown.mm.slice(firstOnPath)) / 1000;
  state.magnify = factors.filter(factor => factor * largest <= 0.2 * extent).pop() || 1;
}
options(element("magnify"), factors.map(factor => [factor, "×" + factor]), state.magnify);
options(element("elastic"), [1, 10, 30, 100, 300].map(factor => [factor, "×" + factor]), 1);

/* Trails depend on the magnification alone. */
function layTrails() {
  for (const law of laws) for (const line of [law.trail, law.course]) {
    const positions = line.geometry.attributes.position;
    for (let i = 0; i < count; i++) positions.setXYZ(i,
      ...[0, 1, 2].map(k => wanted[k][i] + state.magnify * law.deviation[k][i]));
    positions.needsUpdate = true;
  }
}
function show() {
  const frame = state.frame, p = vector(at(wanted, frame));
  ghost.position.copy(p);
  ghost.quaternion.copy(turnAt(wantedTurn, frame));
  for (const law of laws) {
    const isSolid = state.robot === law.id, isShadow = state.robot === "all";
    law.arm.root.visible = law.isOn && isSolid;
    law.shadow.root.visible = law.isOn && isShadow;
    const deviation = vector(at(law.deviation, frame));
    const seen = isSolid ? law.arm : isShadow ? law.shadow : null;
    if (seen) {
      const q = at(law.q, frame), yielded = at(law.deflection, frame);
      seen.move(q.map((angle, i) => angle + (state.elastic - 1) * yielded[i]));
    }
    law.tip.position.copy(p).add(deviation);
    law.tip.quaternion.copy(turnAt(law.turn, frame));
    law.tip.visible = law.isOn && isSolid && state.elastic === 1;
    const end = p.clone().addScaledVector(deviation, state.magnify), way = end.clone().sub(p), size = way.length();
    law.ball.position.copy(end);
    law.arrow.position.copy(p);
    if (size > 1e-7) {
      law.arrow.setDirection(way.normalize());
      law.arrow.setLength(size, Math.min(0.03, 0.35 * size), Math.min(0.018, 0.2 * size));
    }
    for (const part of [law.ball, law.arrow, law.trail, law.course]) part.visible = law.isOn;
    law.trail.geometry.setDrawRange(firstOnPath, Math.max(0, Math.floor(frame) + 1 - firstOnPath));
    law.course.geometry.setDrawRange(firstOnPath, count - firstOnPath);
    if (isSolid) { markerBody.position.copy(law.tip.position); markerBody.quaternion.copy(law.tip.quaternion); }
  }
  markerBody.visible = data.markers.length > 0 && laws.some(law => law.id === state.robot);
  aim(p);
  renderer.render(scene, eye);
}
function tell() {
  const i = Math.round(state.frame);
  slider.value = i;
  slider.setAttribute("aria-valuetext", `${times[i].toFixed(2)} s`);
  element("time").textContent = `${times[i].toFixed(3)} s`;
  for (const law of laws) {
    const row = document.querySelector(`tr[data-law="${CSS.escape(law.id)}"]`);
    row.toggleAttribute("data-off", !law.isOn);
    row.querySelector(".mm").textContent = law.mm[i].toFixed(law.mm[i] < 1 ? 4 : 2);
    row.querySelector(".deg").textContent = law.deg[i].toFixed(law.deg[i] < 1 ? 4 : 2);
  }
  element("play").textContent = state.isPlaying ? "Pause" : "Play";
  drawCourse();
}

/* Views: a free one that turns about the path, one that goes with the tool, one from above. */
const field = 42;  // degrees of the view's height, or of its width where that is less
const eye = new THREE.PerspectiveCamera(field, 1, 0.005, 60);
eye.up.set(0, 0, 1);
const orbit = {target: new THREE.Vector3(0.5 * middle.x, 0.5 * middle.y, 0.75 * middle.z), azimuth: 0.42,
  height: 0.36, distance: 2.4 * reach};
const beside = {azimuth: 0.9, height: 0.45, distance: Math.max(0.28, 0.2 * reach)};
const above = {azimuth: -Math.PI / 2, height: 1.5607, distance: 3.1 * reach};
const ways = {free: orbit, tool: beside, top: above};
function aim(tool) {
  const way = ways[state.view], target = state.view === "tool" ? tool
    : state.view === "top" ? (above.target ||= new THREE.Vector3(0.6 * middle.x, middle.y, middle.z)) : orbit.target;
  const flat = Math.cos(way.height) * way.distance;
  eye.position.set(target.x + flat * Math.cos(way.azimuth), target.y + flat * Math.sin(way.azimuth),
    target.z + Math.sin(way.height) * way.distance);
  eye.lookAt(target);
}
function setView(view) {
  state.view = view;
  for (const button of document.querySelectorAll("[data-view]"))
    button.setAttribute("aria-pressed", String(button.dataset.view === view));
  isStale = true;
}
const fingers = new Map();
holder.addEventListener("pointerdown", event => { fingers.set(event.pointerId, event); holder.setPointerCapture(event.pointerId); });
for (const name of ["pointerup", "pointercancel"]) holder.addEventListener(name, event => fingers.delete(event.pointerId));
holder.addEventListener("pointermove", event => {
  const before = fingers.get(event.pointerId), way = ways[state.view];
  if (!before) return;
  const dx = event.clientX - before.clientX, dy = event.clientY - before.clientY;
  if (fingers.size === 2) {
    const [a, b] = [...fingers.values()], other = a.pointerId === event.pointerId ? b : a;
    const span = from => Math.hypot(from.clientX - other.clientX, from.clientY - other.clientY);
    way.distance *= span(before) / Math.max(span(event), 1);
  } else if ((event.buttons & 2 || event.shiftKey) && state.view !== "tool") {
    const scale = way.distance / holder.clientHeight, target = state.view === "top" ? above.target : orbit.target;
    target.addScaledVector(new THREE.Vector3().setFromMatrixColumn(eye.matrix, 0), -dx * scale)
      .addScaledVector(new THREE.Vector3().setFromMatrixColumn(eye.matrix, 1), dy * scale);
  } else {
    way.azimuth -= 0.006 * dx;
    way.height = Math.max(-1.5, Math.min(1.5607, way.height + 0.006 * dy));
  }
  fingers.set(event.pointerId, event);
  isStale = true;
});
holder.addEventListener("contextmenu", event => event.preventDefault());
holder.addEventListener("wheel", event => {
  ways[state.view].distance *= Math.exp(0.001 * event.deltaY);
  isStale = true;
  event.preventDefault();
}, {passive: false});

/* Distances of all laws over time, on a logarithmic scale, above the slider. */
const canvas = element("course"), pen = canvas.getContext("2d"), cursor = element("cursor");
let courseKey = "";
// 120 and not 1.2e+2
const rounded = (mm, digits) => Number(mm.toPrecision(digits));

function drawCourse() {
  const width = canvas.clientWidth, height = 68, caption = 14, key = [width, isDark.matches, ...laws.map(law => law.isOn)].join();
  const x = i => 8 + (width - 16) * i / Math.max(count - 1, 1);
  if (key !== courseKey) {
    canvas.width = width;
    canvas.height = height;
    const all = laws.flatMap(law => law.mm), top = Math.log10(Math.max(...all)), floor = Math.max(Math.log10(Math.min(...all)), top - 5);
    const y = mm => 4 + (height - caption - 8) * (top - Math.max(Math.log10(mm), floor)) / Math.max(top - floor, 0.1);
    pen.fillStyle = "rgba(128,140,156,.14)";
    const rest = times.findIndex(t => t >= data.marks.dwell_start);
    if (rest > 0) pen.fillRect(x(rest), 0, width - x(rest), height - caption);
    for (const law of laws.filter(law => law.isOn)) {
      pen.strokeStyle = law.color;
      pen.lineWidth = 1.3;
      pen.beginPath();
      law.mm.forEach((mm, i) => pen.lineTo(x(i), y(mm)));
      pen.stroke();
    }
    pen.fillStyle = getComputedStyle(document.documentElement).getPropertyValue("--soft");
    pen.font = "11px system-ui, sans-serif";
    pen.textBaseline = "bottom";
    const ends = `${rounded(10 ** top, 2)} mm at the top, ${rounded(10 ** floor, 1)} mm at the bottom`;
    pen.fillText(width < 480 ? `distance: ${ends}` : `distance from the wanted point, ${ends}`, 8, height);
    courseKey = key;
  }
  cursor.style.transform = `translateX(${x(state.frame)}px)`;
}

function seek(frame) { state.frame = Math.max(0, Math.min(count - 1, frame)); isStale = true; }
function step(frames) { state.isPlaying = false; seek(Math.round(state.frame) + frames); }
function play(on) {
  if (on && state.frame >= count - 1) state.frame = 0;
  state.isPlaying = on;
  isStale = true;
}
function choose(select, by) {
  const next = select.selectedIndex + by;
  if (next < 0 || next >= select.options.length) return;
  select.selectedIndex = next;
  select.dispatchEvent(new Event("change"));
}
element("play").onclick = () => play(!state.isPlaying);
element("back").onclick = () => step(-1);
element("forward").onclick = () => step(1);
slider.oninput = () => { state.isPlaying = false; seek(Number(slider.value)); };
canvas.onpointerdown = event => { state.isPlaying = false;
  seek((event.offsetX - 8) / (canvas.clientWidth - 16) * (count - 1)); };
element("speed").onchange = event => { state.speed = Number(event.target.value); };
element("magnify").onchange = event => { state.magnify = Number(event.target.value); layTrails(); isStale = true; };
element("elastic").onchange = event => { state.elastic = Number(event.target.value); isStale = true; };
element("robot").onchange = event => { state.robot = event.target.value; beginAnew(); isStale = true; };
for (const button of document.querySelectorAll("[data-view]")) button.onclick = () => setView(button.dataset.view);
for (const button of document.querySelectorAll("button.law")) button.onclick = () => {
  const law = laws.find(each => each.id === button.dataset.law);
  law.isOn = !law.isOn;
  button.setAttribute("aria-pressed", String(law.isOn));
  isStale = true;
};
document.addEventListener("keydown", event => {
  if (event.ctrlKey || event.altKey || event.metaKey || event.target.tagName === "SELECT") return;
  const isButton = event.target.tagName === "BUTTON", second = Math.round((count - 1) / (times[count - 1] - times[0]));
  const keys = {ArrowLeft: () => step(event.shiftKey ? -second : -1), ArrowRight: () => step(event.shiftKey ? second : 1),
    Home: () => step(-count), End: () => step(count), "+": () => choose(element("magnify"), 1),
    "-": () => choose(element("magnify"), -1), 1: () => setView("free"), 2: () => setView("tool"), 3: () => setView("top"),
    r: () => { const s = element("robot"); s.selectedIndex = (s.selectedIndex + 1) % s.options.length;
      s.dispatchEvent(new Event("change")); }};
  if (!isButton) keys[" "] = () => play(!state.isPlaying);
  const action = keys[event.key] || keys[event.key.toLowerCase()];
  if (!action) return;
  action();
  event.preventDefault();
});

let isStale = true, before = null, drawn = 0, told = 0;
/* Without a graphics card pixels in motion get coarser until it draws thirty frames a second; several robots that one
   sees through begin with coarser ones. What stands still is fine. */
const wantedRate = 31, coarsest = 0.4, watched = 15;
let inMotion = 1, watchedFrom = null, watchedFrames = 0;
function beginAnew() {
  inMotion = isSoft && state.robot === "all" ? 0.6 : 1;
  watchedFrom = null;
}
function keepPace(now) {
  if (!isSoft || !state.isPlaying || drawn < 2 * watched) { watchedFrom = null; return; }
  if (watchedFrom === null) { watchedFrom = now; watchedFrames = 0; return; }
  if (++watchedFrames < watched) return;
  const rate = 1000 * watchedFrames / (now - watchedFrom);
  watchedFrom = null;
  if (rate < wantedRate) inMotion = Math.max(coarsest, 0.8 * inMotion);
}
function fit() {
  renderer.setSize(holder.clientWidth, holder.clientHeight);
  eye.aspect = holder.clientWidth / Math.max(holder.clientHeight, 1);
  eye.fov = 2 * THREE.MathUtils.radToDeg(
    Math.atan(Math.tan(THREE.MathUtils.degToRad(0.5 * field)) / Math.min(eye.aspect, 1)));
  eye.updateProjectionMatrix();
  isStale = true;
}
function paint() {
  scene.background = new THREE.Color(isDark.matches ? "#1a2028" : "#eef1f5");
  isStale = true;
}
function tick(now) {
  if (state.isPlaying && before !== null) {
    const rate = (count - 1) / (times[count - 1] - times[0]);
    state.frame += state.speed * Math.min(now - before, 250) / 1000 * rate;
    if (state.frame >= count - 1) state.frame = 0;
    isStale = true;
  }
  before = now;
  const wanted = state.isPlaying ? inMotion : 1;
  if (fineness !== wanted) { setFineness(wanted); isStale = true; }
  if (isStale) {
    show();
    /* Numbers that change thirty times a second nobody can read. */
    if (!state.isPlaying || now - told > 100) { tell(); told = now; } else drawCourse();
    isStale = false;
    window.replayFrames = ++drawn;
    keepPace(now);
  }
  requestAnimationFrame(tick);
}
isDark.addEventListener("change", paint);
new ResizeObserver(fit).observe(holder);
fit();
paint();
layTrails();
document.body.dataset.printable = "yes";
requestAnimationFrame(tick);
