"use strict";
const data = JSON.parse(document.getElementById("data").textContent);
const timeline = data.timeline, panel = document.getElementById("panel"), video = document.querySelector("video");
const boxes = new Map([...document.querySelectorAll("[data-path]")].map((g) => [g.dataset.path, g]));
const visitsOf = (path) => (timeline ? timeline.visits.filter((v) => v.path === path) : []);
const seconds = (s) => (s === null || s === undefined ? "-" : s < 1 ? `${(s * 1000).toFixed(1)} ms` : `${s.toFixed(2)} s`);
let chosen = null, bars = [];

function element(tag, attributes = {}, ...children) {
  const e = document.createElement(tag);
  for (const [k, v] of Object.entries(attributes)) if (k === "onclick") e.onclick = v; else if (v !== null) e.setAttribute(k, v);
  e.append(...children.filter((c) => c !== null && c !== undefined));
  return e;
}

function valueOf(v) {
  const box = element("div", { class: "value" });
  if (v === null || typeof v !== "object") { box.textContent = v === null ? "nothing" : JSON.stringify(v); return box; }
  if (v.$ref) { box.textContent = `from ${v.$ref}`; return box; }
  if (!("type" in v)) {
    if (Array.isArray(v)) return valueOf({ type: "list", items: v });
    return table(Object.entries(v));
  }
  if (v.image) { box.append(`${v.type} ${v.text}`, element("img", { src: v.image, alt: v.type })); return box; }
  if (v.type === "array") { box.textContent = v.items ? `[${v.items.join(", ")}]` : v.text; box.title = v.text; return box; }
  const inner = v.fields ? Object.entries(v.fields) : v.items ? v.items.map((item, i) => [String(i), item]) : null;
  if (inner === null) { box.textContent = v.text; return box; }
  if (inner.length && inner.every(([, x]) => typeof x !== "object")) {
    box.textContent = v.type === "list" ? `[${inner.map((p) => p[1]).join(", ")}]` : inner.map((p) => p.join(" ")).join(", ");
    return box;
  }
  const head = v.type === "list" ? `${v.text || inner.length + " items"}` : v.type;
  const open = element("details", {}, element("summary", {}, head), element("div", {}, table(inner)));
  open.open = inner.length <= 4;
  box.append(open);
  return box;
}

function table(pairs) {
  return element("table", {}, ...pairs.map(([k, v]) => element("tr", {}, element("td", {}, k), element("td", {}, valueOf(v)))));
}

function add(title, pairs) {
  const list = Object.entries(pairs || {});
  if (list.length) panel.append(element("h3", {}, title), table(list));
}

function show(path, visit) {
  chosen = path;
  for (const [p, g] of boxes) g.classList.toggle("chosen", p === path);
  for (const b of bars) b.bar.classList.toggle("on", b.visit === visit);
  panel.replaceChildren(element("h2", {}, path));
  const group = data.subgraphs[path], node = data.nodes[path];
  if (group) { subgraph(path, group); return; }
  panel.append(element("p", { class: "soft" }, [node.kind, node.calls].filter(Boolean).join(" - ")));
  if (node.description) panel.append(element("p", {}, node.description));
  const all = visitsOf(path);
  visit = visit || all[all.length - 1];
  if (all.length > 1) panel.append(element("div", { class: "visits" }, ...all.map((v, i) =>
    element("button", { class: v === visit ? "on" : "", onclick: () => { show(path, v); seek(v.start); } }, `visit ${i + 1}`))));
  if (visit) measured(visit);
  else { if (timeline) panel.append(element("p", { class: "soft" }, "did not run")); add("inputs", node.inputs); }
  for (const call of node.recovery || []) add(`recovery: ${call.tool}`, call.inputs);
  if (node.script && data.sources[node.script]) {
    panel.append(element("h3", {}, node.script), element("pre", {}, data.sources[node.script]));
  }
}

function measured(visit) {
  const world = visit.world_start === null || visit.world_end === null ? null : visit.world_end - visit.world_start;
  panel.append(element("p", {}, element("span", { class: `chip ${visit.status}` }, visit.status)));
  if (visit.error) panel.append(element("div", { class: "problem" }, visit.error));
  panel.append(element("h3", {}, "timing"), table([
    ["started", seconds(visit.start)], ["took", seconds(visit.end === null ? null : visit.end - visit.start)],
    ["computing", seconds(visit.compute_s)], ["world time", seconds(world)]].map(([k, v]) => [k, { type: "text", text: v }])));
  add("inputs", visit.data.inputs && (visit.data.inputs.fields || visit.data.inputs));
  if ("output" in visit.data && visit.data.output !== null) panel.append(element("h3", {}, "output"), valueOf(visit.data.output));
  for (const call of visit.data.calls || []) {
    const inside = element("div", {}, table(Object.entries((call.inputs && call.inputs.fields) || {})));
    if (call.output !== undefined) inside.append(element("h3", {}, "gave"), valueOf(call.output));
    if (call.error) inside.append(element("div", { class: "problem" }, call.error));
    panel.append(element("details", {}, element("summary", {}, `${call.tool}  ${seconds(call.duration_s)}`), inside));
  }
}

function subgraph(path, group) {
  panel.append(element("p", { class: "soft" }, `subgraph - ${group.skill}`));
  if (group.description) panel.append(element("p", {}, group.description));
  if (timeline && timeline.exits[path]) panel.append(element("p", {}, element("span", { class: "chip" }, `exit: ${timeline.exits[path].join(", ")}`)));
  add("inputs", group.inputs);
  add("outputs", group.outputs);
  add("parameters", group.parameters);
  const say = (text) => ({ type: "text", text });
  panel.append(element("h3", {}, "exits"), table([["success", say(group.exits.join(", "))], ["on error", say(group.on_error)]]));
}

function overview() {
  panel.replaceChildren(element("h2", {}, "The graph"), element("p", { class: "soft" }, "Choose a node to see what it calls, takes and gives."));
  if (timeline && timeline.error) panel.append(element("div", { class: "problem" }, timeline.error));
  const text = element("details", {}, element("summary", {}, "Mermaid"), element("pre", {}, data.mermaid));
  panel.append(element("h3", {}, "as text"), text);
}

function worldAt(t) {
  const c = timeline.clock;
  if (!c.length) return null;
  let i = c.findIndex((p) => p[0] > t);
  if (i === 0) return c[0][1];
  if (i < 0) return c[c.length - 1][1];
  const [[t0, w0], [t1, w1]] = [c[i - 1], c[i]];
  return t1 > t0 ? w0 + ((w1 - w0) * (t - t0)) / (t1 - t0) : w1;
}

function seek(t) {
  const slider = document.querySelector("#bar input"), world = worldAt(t);
  slider.value = t;
  document.querySelector("#bar output").textContent = `${t.toFixed(2)} s` + (world === null ? "" : `   world ${world.toFixed(2)} s`);
  const track = document.querySelector(".track"), lanes = document.getElementById("lanes");
  const left = track.getBoundingClientRect().left - lanes.getBoundingClientRect().left;
  document.getElementById("now").style.left = `${left + (t / timeline.duration) * track.clientWidth}px`;
  const running = new Set(timeline.visits.filter((v) => v.start <= t && (v.end === null || v.end >= t)).map((v) => v.path));
  for (const [p, g] of boxes) g.classList.toggle("now", running.has(p));
  if (video && world !== null && video.readyState) video.currentTime = Math.max(0, Math.min(video.duration || 0, world - data.videoStart));
}

function lanes() {
  const root = document.getElementById("lanes"), span = Math.max(timeline.duration, 1e-6), rows = new Map();
  const place = (i, a, b) => { i.style.left = `${(100 * a) / span}%`; i.style.width = `${(100 * Math.max(b - a, 0)) / span}%`; return i; };
  const row = (name, label, css) => {
    if (!rows.has(name)) {
      const track = element("div", { class: "track" });
      root.append(element("div", { class: `lane ${css}`, title: name }, element("span", {}, label), track));
      rows.set(name, track);
    }
    return rows.get(name);
  };
  const order = [...timeline.passes.map((p) => [p.start, p]), ...timeline.visits.map((v) => [v.start, v])].sort((a, b) => a[0] - b[0]);
  for (const [, x] of order) {
    if (x.name) { row(x.name, x.name, "pass").append(place(element("i", { class: "pass" }), x.start, x.end ?? span)); continue; }
    const track = row(x.path, x.path.split("/").slice(1).join("/"), "");
    const bar = place(element("i", { class: x.status, title: `${x.path}: ${x.status}`, onclick: () => { show(x.path, x); seek(x.start); } }), x.start, x.end ?? span);
    bars.push({ bar, visit: x });
    track.append(bar);
    for (const call of x.data.calls || []) track.append(place(element("i", { class: "call", title: call.tool }), call.began, call.began + call.duration_s));
  }
}

for (const [path, g] of boxes) {
  g.addEventListener("click", (event) => { event.stopPropagation(); show(path); });
  g.addEventListener("keydown", (event) => { if (event.key === "Enter") show(path); });
}
document.getElementById("graph").addEventListener("click", overview);
overview();
if (timeline) {
  for (const v of timeline.visits) { const g = boxes.get(v.path); if (g) { g.classList.remove("finished", "failed", "cancelled"); g.classList.add(v.status); } }
  if (boxes.has(timeline.end)) boxes.get(timeline.end).classList.add("reached");
  lanes();
  const slider = document.querySelector("#bar input"), button = document.querySelector("#bar button");
  slider.max = timeline.duration;
  slider.oninput = () => seek(Number(slider.value));
  let last = null;
  const play = (now) => {
    if (last === null) return;
    const t = Math.min(timeline.duration, Number(slider.value) + (now - last) / 1000);
    last = now;
    seek(t);
    if (t < timeline.duration) requestAnimationFrame(play); else { last = null; button.textContent = "play"; }
  };
  button.onclick = () => {
    if (last !== null) { last = null; button.textContent = "play"; return; }
    if (Number(slider.value) >= timeline.duration) slider.value = 0;
    last = performance.now(); button.textContent = "pause"; requestAnimationFrame(play);
  };
  if (video) video.addEventListener("loadedmetadata", () => seek(Number(slider.value)));
  addEventListener("resize", () => seek(Number(slider.value)));
  seek(0);
  const bad = timeline.visits.find((v) => v.status === "failed");
  if (bad) show(bad.path, bad);
}
if (location.hash.length > 1) show(decodeURIComponent(location.hash.slice(1)));
