"use strict";
(async () => {
const $ = (id) => document.getElementById(id);
const make = (tag, text = "", about = {}) => Object.assign(document.createElement(tag), { textContent: text, ...about });
const bytes = (id) => Uint8Array.from(atob($(id).textContent.trim()), (c) => c.charCodeAt(0));
const inflated = (id) => new Response(new Blob([bytes(id)]).stream().pipeThrough(new DecompressionStream("deflate"))).arrayBuffer();
const about = JSON.parse($("about-data").textContent);
const floats = new Float32Array(await inflated("arrays-data"));
const array = (name) => {
  const [at, ...shape] = about.arrays[name];
  return floats.subarray(at, at + shape.reduce((a, b) => a * b, 1));
};
const time = array("time"), first = time[0], last = time[time.length - 1];
const number = (x) => (!Number.isFinite(x) ? "–" : Math.abs(x) >= 100 ? x.toFixed(0) : Math.abs(x) >= 10 ? x.toFixed(1) : x.toFixed(2));
const clamp = (x, low, high) => Math.min(Math.max(x, low), high);

// Words.
const SAYS = { feasible: "feasible", feasible_after_repair: "feasible after repair", infeasible: "infeasible" };
$("answer").textContent = SAYS[about.verdict];
$("answer").className = about.verdict;
$("name").textContent = about.name;
$("headline").textContent = about.headline.charAt(0).toUpperCase() + about.headline.slice(1) + ".";
for (const cause of about.causes) {
  const button = make("button", "because " + cause.sentence, { onclick: () => cause.time !== null && stand(cause.time) });
  $("causes").append(make("li")); $("causes").lastChild.append(button);
}
if (about.would.length) $("would").append(make("b", "It would do "), about.would.join(", or ") + ".");
if (about.repaired) $("would").append(" The ghost is repaired: " + about.repaired + ".");
let under = null;
for (const one of about.violations) {
  const button = make("button", "", { className: one.severity, onclick: () => one.time !== null && stand(one.time, button) });
  button.append(make("span", one.text));
  button.dataset.code = one.code;
  if (one.came_of === null) { $("violations").append(button); under = null; continue; }
  if (under === null) { under = make("details"); under.append(make("summary", "What came of it")); $("violations").append(under); }
  under.append(button);
}
if (!about.violations.length) $("violations").append(make("p", "Nothing: it is done as given.", { className: "none" }));
const fold = (title, text, open) => {
  const details = make("details", "", { open });
  details.append(make("summary", title), make("pre", text));
  $("about").append(details);
};
const listed = (object) => Object.entries(object).map(([key, value]) => `${key}: ${JSON.stringify(value)}`).join("\n");
if (about.command) fold("Command", about.command, true);
fold("Run", [...about.summary, `robot: ${about.robot}`, `scene: ${about.scene}`].join("\n"), true);
fold("Settings that are not the defaults", listed(about.changed) || "none", Object.keys(about.changed).length > 0);
fold("All settings", JSON.stringify(about.config, null, 1), false);
fold("Versions", listed(about.versions), false);
$("about").append(make("footer", `Drawn by K3D-jupyter ${about.versions.k3d} (MIT), inside this file.`));

// Three dimensions.
let library;
window.define = (name, needs, build) => { library = build(); };
const script = make("script", new TextDecoder().decode(await inflated("code-data")));
document.head.append(script);
delete window.define;
const plot = await new library.CreateK3DAndLoadBinarySnapshot(bytes("scene-data"), $("canvas"));
const world = plot.getWorld();
const find = (name) => (about.objects[name] || []).map((id) => plot.getObjectById(id)).filter(Boolean);
const hidden = new Set(about.legend.filter((one) => one.off).map((one) => one.name));

const multiply = ([a, b, c, d], [e, f, g, h]) => [
  a * e - b * f - c * g - d * h, a * f + b * e + c * h - d * g,
  a * g - b * h + c * e + d * f, a * h + b * g - c * f + d * e];
const turn = ([w, x, y, z], [a, b, c]) => {
  const s = 2 * (y * c - z * b), t = 2 * (z * a - x * c), u = 2 * (x * b - y * a);
  return [a + w * s + y * u - z * t, b + w * t + z * s - x * u, c + w * u + x * t - y * s];
};
const plus = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
const about_axis = (axis, angle) => { const s = Math.sin(angle / 2); return [Math.cos(angle / 2), axis[0] * s, axis[1] * s, axis[2] * s]; };
const normal = (q) => { const n = Math.hypot(...q); return q.map((x) => x / n); };

// Poses of all bodies, as MuJoCo places them: free joints 0, slides 2, hinges 3.
function poses(qpos) {
  const placed = [];
  for (const body of about.tree) {
    const parent = placed[body.parent] || { p: [0, 0, 0], q: [1, 0, 0, 0] };
    let p = plus(parent.p, turn(parent.q, body.position)), q = multiply(parent.q, body.quat);
    for (const joint of body.joints) {
      const x = qpos.subarray(joint.at, joint.at + 7);
      if (joint.kind === 0) { p = [x[0], x[1], x[2]]; q = normal([x[3], x[4], x[5], x[6]]); continue; }
      if (joint.kind === 2) { p = plus(p, turn(q, joint.axis).map((a) => a * (x[0] - joint.zero))); continue; }
      const anchor = plus(p, turn(q, joint.point));
      q = multiply(q, about_axis(joint.axis, x[0] - joint.zero));
      p = plus(anchor, turn(q, joint.point).map((a) => -a));
    }
    placed.push({ p, q });
  }
  return placed;
}

function put(object, p, q, scale = [1, 1, 1]) {
  const x = turn(q, [scale[0], 0, 0]), y = turn(q, [0, scale[1], 0]), z = turn(q, [0, 0, scale[2]]);
  object.matrixAutoUpdate = false;
  object.matrix.set(x[0], y[0], z[0], p[0], x[1], y[1], z[1], p[1], x[2], y[2], z[2], p[2], 0, 0, 0, 1);
  object.matrixWorldNeedsUpdate = true;
}

const robot = about.tree.map((body) => [...find(body.name), ...find("scene:" + body.name)]);
const ghost = about.arrays.ghost ? about.tree.map((body) => find(body.name).map((mesh) => {
  const copy = mesh.clone();
  copy.material = mesh.material.clone();
  Object.assign(copy.material, { transparent: true, opacity: 0.22, depthWrite: false, polygonOffset: true, polygonOffsetFactor: 3, polygonOffsetUnits: 30 });
  if (copy.material.color) copy.material.color.set(0x3f73f2);
  world.K3DObjects.add(copy);
  return copy;
})) : [];

// Values at an instant: between two frames, by quaternions where they are.
function at(times, t) {
  let low = 0, high = times.length - 1;
  while (high - low > 1) { const middle = (low + high) >> 1; if (times[middle] <= t) low = middle; else high = middle; }
  const share = high > low ? clamp((t - times[low]) / (times[high] - times[low]), 0, 1) : 0;
  return [low, high, share];
}
function between(values, width, [low, high, share]) {
  const out = new Float32Array(width);
  for (let i = 0; i < width; i++) out[i] = (1 - share) * values[low * width + i] + share * values[high * width + i];
  return out;
}
const nq = about.arrays.qpos[2];
const frees = about.tree.flatMap((body) => body.joints).filter((joint) => joint.kind === 0).map((joint) => joint.at + 3);
function configuration(values, place) {
  const out = between(values, nq, place), [low, high, share] = place;
  for (const f of frees) {
    let dot = 0;
    for (let i = 0; i < 4; i++) dot += values[low * nq + f + i] * values[high * nq + f + i];
    if (dot < 0) for (let i = 0; i < 4; i++) out[f + i] = (1 - share) * values[low * nq + f + i] - share * values[high * nq + f + i];
  }
  return out;
}

const UP = [1, 0, 0, 0];
const series = Object.fromEntries(["qpos", "asked", "commanded", "measured", "pressure", "capture_point", "com"].map((name) => [name, array(name)]));
const show = (name, visible) => find("mark:" + name).forEach((object) => { object.visible = visible && !hidden.has(name.split("_")[0]) && !(name === "plumb" && hidden.has("mass")); });
const mark = (name, p, scale, q = UP) => {
  const there = p.every(Number.isFinite);
  show(name, there);
  if (there) find("mark:" + name).forEach((object) => put(object, p, q, scale));
};
// A stick of unit length along z, from a to b.
function stick(name, a, b, radius) {
  const d = [b[0] - a[0], b[1] - a[1], b[2] - a[2]], length = Math.hypot(...d);
  if (!(length > 0.002)) return show(name, false);
  const axis = [-d[1] / length, d[0] / length, 0], sine = Math.hypot(axis[0], axis[1]);
  const q = sine > 1e-9 ? about_axis(axis.map((x) => x / sine), Math.acos(clamp(d[2] / length, -1, 1))) : d[2] > 0 ? UP : [0, 1, 0, 0];
  mark(name, a, [radius, radius, length], q);
}

let now = NaN, placed = [];
function draw(t) {
  const place = at(time, t);
  placed = poses(configuration(series.qpos, place));
  placed.forEach(({ p, q }, b) => robot[b].forEach((object) => put(object, p, q)));
  if (ghost.length) {
    const times = array("ghost_time"), seen = t >= times[0] - 1e-3 && t <= times[times.length - 1] + 1 && !hidden.has("ghost");
    const poised = seen ? poses(configuration(array("ghost"), at(times, t))) : [];
    ghost.forEach((meshes, b) => meshes.forEach((object) => { object.visible = seen; if (seen) put(object, poised[b].p, poised[b].q); }));
  }
  const [asked, commanded, measured] = ["asked", "commanded", "measured"].map((name) => between(series[name], 6, place));
  ["left", "right"].forEach((side, i) => {
    const [a, c, m] = [asked, commanded, measured].map((x) => Array.from(x.subarray(3 * i, 3 * i + 3)));
    mark("asked_" + side, a, [0.026, 0.026, 0.026]);
    mark("commanded_" + side, c, [0.02, 0.02, 0.02]);
    stick("error_" + side, m, a, 0.006);
  });
  const com = Array.from(between(series.com, 3, place));
  mark("mass", com, [0.02, 0.02, 0.02]);
  stick("plumb", [com[0], com[1], 0], com, 0.003);
  mark("pressure", [...between(series.pressure, 2, place), 0.007], [0.014, 0.014, 1]);
  mark("capture", [...between(series.capture_point, 2, place), 0.005], [0.019, 0.019, 1]);
  show("support", true);
  for (const name of ["asked", "commanded", "measured"]) find("way:" + name).forEach((object) => { object.visible = !hidden.has(name); });
  find("reach").forEach((object) => { object.visible = !hidden.has("reach"); });
  plot.render();
  const status = about.status[about.statuses[place[2] < 0.5 ? place[0] : place[1]]];
  $("now").replaceChildren(make("b", status.name, { style: "background:" + status.colour }));
  return place;
}

// Time lines.
const drawn = about.panels.map((panel, i) => {
  const box = make("div", "", { className: "panel" }), head = make("header"), values = make("span");
  const area = make("div", "", { className: "plot" }), canvas = make("canvas"), cursor = make("i");
  head.append(make("b", panel.title + (panel.unit ? ` [${panel.unit}]` : "")), values);
  area.append(canvas, cursor);
  box.append(head, area);
  $("panels").append(box);
  const lines = panel.lines.map((line, k) => ({ ...line, values: array(`line ${i} ${k}`), whose: line.names.length ? array(`whose ${i} ${k}`) : null }));
  const scrub = (event) => { pause(); const box = area.getBoundingClientRect(); seek(first + (last - first) * clamp((event.clientX - box.left) / box.width, 0, 1)); };
  area.onpointerdown = (event) => { area.setPointerCapture(event.pointerId); scrub(event); };
  area.onpointermove = (event) => { if (event.buttons) scrub(event); };
  return { panel, lines, canvas, cursor, values };
});

// Beyond the knee of a panel its scale is logarithmic: the bounds can be read, and so can a fall.
const bent = (panel) => (value) => panel.knee !== null && value > panel.knee ? panel.knee * (1 + Math.log(value / panel.knee)) : value;

function scale({ panel, lines }) {
  const bend = bent(panel), bounds = panel.bounds.map((bound) => bend(bound[0]));
  const all = lines.flatMap((line) => Array.from(line.values).filter(Number.isFinite).map(bend));
  let low = Math.min(0, ...bounds), high = Math.max(...bounds, 1e-6);
  for (const value of all) { low = Math.min(low, value); high = Math.max(high, value); }
  if (!panel.above) low = Math.max(low, 0);
  if (panel.most !== null) high = Math.min(high, panel.most);
  // What is far above a bound that it is to stay above says nothing.
  if (panel.above) high = Math.min(high, Math.max(...bounds, 0) + 3 * Math.max(...bounds.map(Math.abs), 40));
  return [low - 0.06 * (high - low) * (low < 0), high + 0.08 * (high - low)];
}

function paint(one) {
  const { panel, lines, canvas } = one, ratio = window.devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
  canvas.width = width * ratio; canvas.height = height * ratio;
  const c = canvas.getContext("2d"), style = getComputedStyle(document.documentElement), tint = (name) => style.getPropertyValue(name);
  const bend = bent(panel), [low, high] = scale(one), foot = height - 14, x = (t) => width * (t - first) / Math.max(last - first, 1e-9), y = (v) => foot - foot * (clamp(bend(v), low, high) - low) / (high - low);
  c.scale(ratio, ratio); c.font = "10px system-ui, sans-serif";
  c.fillStyle = tint("--soft");
  const step = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 30, 60, 120, 300, 600].find((s) => (last - first) / s <= width / 55) || 1200;
  for (let t = Math.ceil(first / step) * step; t <= last; t += step) {
    c.globalAlpha = 0.25; c.fillRect(x(t), 0, 1, foot); c.globalAlpha = 1;
    c.fillText(`${+t.toFixed(1)}`, Math.min(x(t) + 2, width - 22), height - 3);
  }
  const rough = (high - low) / 3, ten = 10 ** Math.floor(Math.log10(rough)), rise = [1, 2, 5, 10].map((s) => s * ten).find((s) => s >= rough);
  const marks = [];
  for (let v = Math.ceil(low / rise) * rise; v <= (panel.knee === null ? high : Math.min(high, panel.knee)); v += rise) marks.push(v);
  if (panel.knee !== null) for (let ten = 10 ** Math.floor(Math.log10(panel.knee)); bend(ten) <= high; ten *= 10) marks.push(...[1, 2, 5].map((s) => s * ten).filter((v) => v > 1.3 * panel.knee && bend(v) <= high));
  let under = Infinity;
  for (const v of marks) {
    c.globalAlpha = 0.25; c.fillRect(0, y(v), width, 1); c.globalAlpha = 1;
    if (under - y(v) < 11 || panel.bounds.some(([bound]) => Math.abs(y(v) - y(bound)) < 2)) continue;
    under = y(v); c.fillText(`${+v.toPrecision(6)}`, 2, Math.max(y(v) - 2, 9));
  }
  for (const one of about.violations) if (one.time !== null && one.severity !== "note") { c.fillStyle = tint(one.severity === "repair" ? "--repair" : "--bad"); c.globalAlpha = 0.5; c.fillRect(x(one.time) - 1, 0, 2, foot); c.globalAlpha = 1; }
  c.lineWidth = 1; c.setLineDash([4, 3]);
  panel.bounds.forEach(([value, name], k) => {
    if (bend(value) > high) return;
    c.strokeStyle = c.fillStyle = tint("--bad");
    c.beginPath(); c.moveTo(0, y(value)); c.lineTo(width, y(value)); c.stroke();
  });
  for (const line of lines) {
    c.strokeStyle = line.colour === "#737385" ? tint("--ink") : line.colour;
    c.setLineDash(line.dashed ? [3, 3] : []); c.lineWidth = line.dashed ? 1 : 1.4;
    c.beginPath();
    let pen = false;
    line.values.forEach((value, k) => { if (!Number.isFinite(value)) { pen = false; return; } c[pen ? "lineTo" : "moveTo"](x(time[k]), y(value)); pen = true; });
    c.stroke();
  }
  // Words last, on a ground of their own: curves run under them.
  c.setLineDash([]);
  panel.bounds.forEach(([value, name], k) => {
    if (bend(value) > high) return;
    const words = `${name}, ${+value.toPrecision(3)}`, place = [k % 2 ? 36 : width - 4, y(value) > 12 ? y(value) - 3 : y(value) + 10];
    c.textAlign = k % 2 ? "left" : "right"; c.lineWidth = 4; c.strokeStyle = tint("--card"); c.fillStyle = tint("--bad");
    c.strokeText(words, ...place); c.fillText(words, ...place);
  });
  c.textAlign = "left";
}
const repaint = () => drawn.forEach(paint);

function read([low, high, share]) {
  const k = share < 0.5 ? low : high, left = 100 * (now - first) / Math.max(last - first, 1e-9);
  for (const { lines, cursor, values, panel } of drawn) {
    cursor.style.left = left + "%";
    values.replaceChildren(...lines.map((line) => {
      const value = line.values[k], whose = line.whose ? line.names[line.whose[k]] : line.name;
      const said = make("em", `${whose} ${number(value)}`);
      if (lines.length > 1) said.style.color = line.colour === "#737385" ? "" : `color-mix(in srgb, ${line.colour} 65%, var(--ink))`;
      return said;
    }));
  }
}

// The player.
let playing = false, before = 0;
function seek(t) {
  now = clamp(t, first, last);
  const place = draw(now);
  read(place);
  $("time").value = now;
  $("clock").textContent = `${now.toFixed(2)} / ${last.toFixed(1)} s`;
}
function pause() { playing = false; $("play").textContent = "▶"; }
function play() {
  if (now >= last - 1e-6) seek(first);
  playing = true; before = performance.now(); $("play").textContent = "❚❚";
  requestAnimationFrame(step);
}
function step(stamp) {
  if (!playing) return;
  const passed = Math.min(Math.max(stamp - before, 0), 250) / 1000;
  before = stamp;
  seek(now + passed * Number($("speed").value));
  if (now >= last) pause(); else requestAnimationFrame(step);
}
function stand(t, button) {
  pause();
  document.querySelectorAll("#violations button").forEach((one) => one.setAttribute("aria-current", one === button));
  seek(t);
  if (window.innerWidth <= 900) $("stage").scrollIntoView({ behavior: "smooth", block: "start" });
}
Object.assign($("time"), { min: first, max: last, oninput: () => { pause(); seek(Number($("time").value)); } });
$("play").onclick = () => (playing ? pause() : play());
document.addEventListener("keydown", (event) => {
  if (event.target.matches("input, select, button, summary")) return;
  const moved = { ArrowLeft: -1 / 30, ArrowRight: 1 / 30 }[event.key];
  if (event.key === " ") { event.preventDefault(); $("play").click(); }
  if (moved) { pause(); seek(now + moved); }
});
const colours = about.statuses.map((status, k) => `${about.status[status].colour} ${(100 * (time[k] - first) / Math.max(last - first, 1e-9)).toFixed(2)}%`);
const edges = colours.filter((_, k) => k === 0 || k === colours.length - 1 || about.statuses[k] !== about.statuses[k - 1] || about.statuses[k] !== about.statuses[k + 1]);
$("band").style.background = `linear-gradient(90deg, ${edges.join(", ")}${edges.length < 2 ? ", " + edges[0] : ""})`;

for (const one of about.legend) {
  const button = make("button", "", { onclick: () => {
    hidden.has(one.name) ? hidden.delete(one.name) : hidden.add(one.name);
    button.setAttribute("aria-pressed", !hidden.has(one.name));
    seek(now);
  } });
  button.setAttribute("aria-pressed", !hidden.has(one.name));
  button.append(make("i", "", { style: "background:" + one.colour }), one.words);
  $("legend").append(button);
}
// Far enough for robot and palms, in a view that is tall, too.
function framed([x, y, z, ...rest]) {
  const box = $("view"), far = Math.max(1, 0.95 * box.clientHeight / Math.max(box.clientWidth, 1));
  return [rest[0] + far * (x - rest[0]), rest[1] + far * (y - rest[1]), rest[2] + far * (z - rest[2]), ...rest];
}
const home = about.camera, from = { "⟲": home, front: [2.5, 0, 0.95, ...home.slice(3)], side: [0.12, 2.5, 0.95, ...home.slice(3)], top: [0.119, 0, 3.0, ...home.slice(3)] };
for (const [name, camera] of Object.entries(from)) $("cameras").append(make("button", name, { title: "view", onclick: () => { plot.setCamera(framed(camera)); plot.render(); } }));

const dark = window.matchMedia("(prefers-color-scheme: dark)");
function theme(name) {
  document.documentElement.dataset.theme = name;
  plot.setClearColor(name === "dark" ? 0x20262f : 0xeef1f5);
  repaint(); plot.render();
}
$("theme").onclick = () => theme(document.documentElement.dataset.theme === "dark" ? "light" : "dark");
dark.onchange = () => theme(dark.matches ? "dark" : "light");
new ResizeObserver(() => { repaint(); plot.resizeHelper(); }).observe(document.body);

const addressed = () => { const t = /t=(\d+(\.\d+)?)/.exec(location.hash); seek(t ? Number(t[1]) : first); };
theme(dark.matches ? "dark" : "light");
plot.setCamera(framed(home));
addressed();
window.addEventListener("hashchange", () => { pause(); addressed(); });
window.report = { seek, play, pause, now: () => now, bodies: () => Object.fromEntries(about.tree.map((body, b) => [body.name, placed[b].p])), seen: (name) => find(name).map((object) => object.visible) };
})().catch((error) => {
  document.getElementById("now").textContent = "This browser does not draw in three dimensions (WebGL), so robot and time lines are missing here.";
  throw error;
});
