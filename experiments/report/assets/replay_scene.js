"use strict";
const data = JSON.parse(document.getElementById("data").textContent);
const THREE = MeshCat.THREE;
const wantedColor = "#cc79a7";
const list = codes => codes.map(decoded);
const times = decoded(data.times), count = times.length;
const wanted = list(data.wanted), wantedTurn = list(data.wanted_rotation);
const laws = data.laws.map(law => ({...law, isOn: true, q: list(law.q), deflection: list(law.deflection),
  deviation: list(law.deviation), turn: list(law.tip_rotation), mm: decoded(law.mm), deg: decoded(law.deg)}));
const matrix = rows => new THREE.Matrix4().set(...rows);
const vector = p => new THREE.Vector3(...p);
const isDark = matchMedia("(prefers-color-scheme: dark)");

/* Values of columns between two frames. */
function at(columns, frame) {
  const i = Math.min(Math.floor(frame), count - 1), j = Math.min(i + 1, count - 1), share = frame - i;
  return columns.map(column => column[i] + share * (column[j] - column[i]));
}
function turnAt(columns, frame) { return new THREE.Quaternion(...at(columns, frame)).normalize(); }

/* Meshes of files as geometries, made once. */
const meshes = data.robot.meshes.map(mesh => {
  const [x, y, z] = list(mesh.points), geometry = new THREE.BufferGeometry();
  const points = new Float32Array(3 * x.length);
  x.forEach((_, i) => points.set([x[i], y[i], z[i]], 3 * i));
  geometry.setAttribute("position", new THREE.BufferAttribute(points, 3));
  geometry.setIndex(decoded(mesh.faces));
  const flat = geometry.toNonIndexed();
  flat.computeVertexNormals();
  return flat;
});
function shapeMesh(shape, material) {
  let mesh;
  if (shape.kind === "mesh") mesh = new THREE.Mesh(meshes[shape.mesh], material);
  else if (shape.kind === "box") mesh = new THREE.Mesh(new THREE.BoxGeometry(...shape.size), material);
  else if (shape.kind === "sphere") mesh = new THREE.Mesh(new THREE.SphereGeometry(shape.size[0], 20, 14), material);
  else if (shape.from) {
    const from = vector(shape.from), to = vector(shape.to), length = from.distanceTo(to), r = shape.radius;
    const geometry = shape.kind === "capsule" ? new THREE.CapsuleGeometry(r, length, 6, 18)
      : new THREE.CylinderGeometry(shape.kind === "cone" ? 0.15 * r : r, r, length, 18);
    mesh = new THREE.Mesh(geometry, material);
    mesh.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), to.clone().sub(from).normalize());
    mesh.position.copy(from).add(to).multiplyScalar(0.5);
    return mesh;
  } else {
    const cylinder = new THREE.CylinderGeometry(shape.size[0], shape.size[0], shape.size[1], 20);
    mesh = new THREE.Mesh(cylinder.rotateX(Math.PI / 2), material);
  }
  mesh.applyMatrix4(matrix(shape.frame));
  return mesh;
}
/* A robot of nested groups, one per joint. */
class Arm {
  constructor(color, opacity) {
    /* Several robots in one place are told apart by their colours alone. */
    const tone = (share, to) => new THREE.Color(color).lerp(new THREE.Color(to), opacity < 1 ? 0 : share);
    const make = tint => new THREE.MeshLambertMaterial({color: tint, transparent: opacity < 1, opacity,
      depthWrite: opacity >= 1});
    const materials = {link: make(tone(0.12, "#ffffff")), base: make(tone(1, "#5a5d62")),
      flange: make(tone(1, "#3c4046")), tool: make(tone(0.45, "#20252b"))};
    this.root = new THREE.Group();
    this.root.matrixAutoUpdate = false;
    this.root.matrix.copy(matrix(data.robot.base));
    this.joints = [];
    let parent = this.root;
    data.robot.bodies.forEach((body, number) => {
      for (const shape of body) parent.add(shapeMesh(shape, materials[shape.part]));
      const joint = data.robot.joints[number];
      if (!joint) return;
      const socket = new THREE.Group(), link = new THREE.Group();
      socket.applyMatrix4(matrix(joint.placement));
      socket.add(link);
      parent.add(socket);
      this.joints.push({link, axis: vector(joint.axis)});
      parent = link;
    });
  }
  move(q) { this.joints.forEach(({link, axis}, i) => link.quaternion.setFromAxisAngle(axis, q[i])); }
}
function frameOf(length, opacity) {
  const group = new THREE.Group();
  for (const [axis, color] of [["x", 0xd91a1a], ["y", 0x1a991a], ["z", 0x1a40d9]]) {
    const bar = new THREE.Mesh(new THREE.CylinderGeometry(0.02 * length, 0.02 * length, length, 8),
      new THREE.MeshBasicMaterial({color, transparent: opacity < 1, opacity}));
    bar.position[axis] = 0.5 * length;
    if (axis === "x") bar.rotation.z = -Math.PI / 2;
    if (axis === "z") bar.rotation.x = Math.PI / 2;
    group.add(bar);
  }
  return group;
}
function ribbon(points, color, width) {
  const curve = new THREE.CatmullRomCurve3(points.map(vector), false, "chordal");
  const geometry = new THREE.TubeGeometry(curve, Math.min(900, 3 * points.length), width, 5);
  return new THREE.Mesh(geometry, new THREE.MeshBasicMaterial({color, transparent: true, opacity: 0.55}));
}

const scene = new THREE.Scene(), holder = document.getElementById("scene");
scene.up.set(0, 0, 1);
scene.add(new THREE.HemisphereLight(0xffffff, 0x8a919c, 1.9));
const sun = new THREE.DirectionalLight(0xffffff, 1.6);
sun.position.set(1.2, -0.6, 2.2);
scene.add(sun);
let renderer;
/* Smooth edges cost a browser without a graphics card most of its time. */
function hasGraphicsCard() {
  const gl = document.createElement("canvas").getContext("webgl"), about = gl && gl.getExtension("WEBGL_debug_renderer_info");
  const isSoft = about && /swiftshader|llvmpipe|software/i.test(gl.getParameter(about.UNMASKED_RENDERER_WEBGL));
  if (gl) gl.getExtension("WEBGL_lose_context")?.loseContext();
  return !isSoft;
}
const isSoft = !hasGraphicsCard();
try { renderer = new THREE.WebGLRenderer({antialias: devicePixelRatio < 2 && !isSoft}); } catch (error) {
  holder.innerHTML = "<p class=note style='padding:80px 20px'>This replay needs WebGL, which the browser does not have or has switched off.</p>";
  throw error;
}
/* Pixels of the picture for one of the screen. Without a graphics card they are most of what a frame costs. */
let fineness = 1;
function setFineness(share) {
  fineness = share;
  renderer.setPixelRatio(Math.min(devicePixelRatio, 2) * share);
}
setFineness(1);
renderer.domElement.setAttribute("role", "img");
renderer.domElement.setAttribute("aria-label", "The robot on its path");
holder.append(renderer.domElement);

const [low, high] = data.box.map(vector), middle = low.clone().add(high).multiplyScalar(0.5);
const extent = Math.max(high.distanceTo(low), 0.05);
const reach = Math.max(...wanted.map(column => Math.max(...column.map(Math.abs))), 0.3);
const grid = new THREE.GridHelper(2.4 * reach, 24, 0x9aa5b4, 0x9aa5b4);
grid.rotation.x = Math.PI / 2;
grid.material.transparent = true;
grid.material.opacity = 0.35;
scene.add(grid);

/* The wanted path, drawn where it changes. */
const firstOnPath = Math.max(0, times.findIndex(t => t >= data.marks.path_start)), stations = [];
for (let i = firstOnPath, last = null; i < count; i++) {
  const p = wanted.map(column => column[i]);
  if (!last || Math.hypot(...p.map((v, k) => v - last[k])) > 0.004) { stations.push(p); last = p; }
}
if (stations.length > 1) scene.add(ribbon(stations, wantedColor, 0.0012 * Math.sqrt(reach)));
/* The ghost: tool and frame where they should be. */
const ghost = new THREE.Group();
{
  const material = new THREE.MeshLambertMaterial({color: wantedColor, transparent: true, opacity: 0.4, depthWrite: false});
  const inside = new THREE.Group();
  inside.applyMatrix4(matrix(data.robot.tool).invert());
  for (const shape of data.robot.bodies[data.robot.bodies.length - 1]) inside.add(shapeMesh(shape, material));
  ghost.add(inside, frameOf(0.13, 0.5));
  scene.add(ghost);
}
for (const rows of data.cameras) {
  const body = new THREE.Group(), grey = new THREE.MeshLambertMaterial({color: 0x4a525e});
  const box = new THREE.Mesh(new THREE.BoxGeometry(0.08, 0.08, 0.12), grey);
  box.position.z = -0.06;
  const cone = new THREE.Mesh(new THREE.ConeGeometry(0.11, 0.16, 4, 1, true), new THREE.MeshBasicMaterial({
    color: 0x0f7cc0, wireframe: true}));
  cone.rotation.x = -Math.PI / 2;
  cone.position.z = 0.08;
  body.add(box, cone);
  body.applyMatrix4(matrix(rows));
  scene.add(body);
}
const markerMaterial = new THREE.MeshLambertMaterial({color: 0xf4f6f8});
const markerBody = new THREE.Group();
for (const p of data.markers) {
  const ball = new THREE.Mesh(new THREE.SphereGeometry(data.marker_radius, 14, 10), markerMaterial);
  ball.position.copy(vector(p));
  markerBody.add(ball);
}
scene.add(markerBody);

/* Of each law: arm, frame of the tip, arrow of the deviation and its trail. */
for (const law of laws) {
  law.arm = new Arm(law.color, 1);
  law.shadow = new Arm(law.color, 0.3);
  law.tip = frameOf(0.1, 1);
  law.ball = new THREE.Mesh(new THREE.SphereGeometry(0.006, 14, 10), new THREE.MeshBasicMaterial({color: law.color}));
  law.arrow = new THREE.ArrowHelper(new THREE.Vector3(1, 0, 0), new THREE.Vector3(), 0.1, law.color, 0.02, 0.012);
  const material = new THREE.LineBasicMaterial({color: law.color});
  law.trail = new THREE.Line(new THREE.BufferGeometry(), material);
  law.trail.geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(3 * count), 3));
  law.trail.frustumCulled = false;
  law.course = new THREE.Line(law.trail.geometry.clone(), new THREE.LineBasicMaterial({color: law.color,
    transparent: true, opacity: 0.3}));
  law.course.frustumCulled = false;
  scene.add(law.arm.root, law.shadow.root, law.tip, law.ball, law.arrow, law.trail, law.course);
}
