// The replay page: one clock t moves the slider, the robot (meshcat's animator) and the marks of the plots (uPlot).
"use strict";

// A document with arrays: gzip of (length of head, head as JSON, arrays); {"$array", offset, length} stands for one.
async function unpack(text) {
  const packed = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  const buffer = await new Response(stream).arrayBuffer();
  const length = Number(new DataView(buffer).getBigUint64(0, true));
  const types = { Int8Array, Uint8Array, Uint16Array, Uint32Array, Float32Array, Float64Array };
  return JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 8, length)), (_, value) =>
    value && value.$array ? new types[value.$array](buffer, 8 + length + value.offset, value.length) : value);
}

const element = (id) => document.getElementById(id);
const ink = () => getComputedStyle(document.body).color;
const gaps = (values) => Array.from(values, (value) => (Number.isNaN(value) ? null : value));  // as uPlot marks them
const tick = (value) => (value !== 0 && (Math.abs(value) >= 1e5 || Math.abs(value) < 1e-3)
  ? value.toExponential(Number.isInteger(Math.log10(Math.abs(value))) ? 0 : 1) : String(Number(value.toPrecision(6))));
const COLORS = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00", "#8c6d31", "#7f7f7f"];
const SEEN = 0.05;  // of the run: for so long an event is named
const DASHES = [[], [6, 3], [2, 3], [8, 3, 2, 3]];

function makePlot(plot, events, seek) {
  const box = document.createElement("section");
  box.className = "plot";
  const heading = document.createElement("h2");
  heading.textContent = plot.title;
  box.append(heading);
  element("plots").append(box);
  const axis = { stroke: ink, grid: { stroke: "#8884" }, ticks: { stroke: "#8884" }, font: "12px system-ui, sans-serif" };
  const number = (value) => (value == null ? "–" : Number(value).toPrecision(4));
  const series = plot.series.map((each) => ({
    label: each.label, width: 1.5, points: { show: plot.t.length === 1 }, value: (_, y) => number(y),
    stroke: COLORS[each.color % COLORS.length], dash: each.ghost ? [4, 4] : DASHES[(each.color / COLORS.length | 0) % 4],
    alpha: each.ghost ? 0.7 : 1,
  }));
  let now = 0;
  const place = (figure) => {  // after each change of time, size or zoom
    const left = figure.valToPos(now, "x");
    mark.style.left = left + "px";
    mark.hidden = !(left >= 0 && left <= figure.over.clientWidth);
    mark.dataset.t = now;
    ticks.forEach((each, i) => {
      const at = figure.valToPos(events[i].t, "x");
      each.style.left = at + "px";
      each.hidden = !(at >= 0 && at <= figure.over.clientWidth);
    });
  };
  const ticks = events.map((each) => Object.assign(document.createElement("div"), { className: "event", title: each.name }));
  const mark = document.createElement("div");
  mark.className = "mark";
  const wide = (u, low, high) => (low < high ? uPlot.rangeNum(low, high, 0.1, true) : [(low ?? 0) - 1, (low ?? 0) + 1]);
  const figure = new uPlot({
    width: box.clientWidth || 460, height: 230, legend: { live: true }, hooks: { draw: [place] },
    scales: { x: { time: false, range: (u, low, high) => (low < high ? [low, high] : [low - 1, low + 1]) }, y: { range: wide } },
    axes: [{ ...axis, label: "t [s]", labelSize: 18 },
      { ...axis, label: plot.unit, labelSize: 18, size: 70, values: (u, ticks) => ticks.map(tick) }],
    series: [{ label: "t", value: (_, t) => (t == null ? "–" : t.toFixed(3) + " s") }, ...series],
  }, [plot.t, ...plot.series.map((each) => gaps(each.values))], box);
  figure.over.append(...ticks, mark);
  figure.over.addEventListener("click", (event) => seek(figure.posToVal(event.offsetX, "x")));
  new ResizeObserver(() => figure.setSize({ width: box.clientWidth, height: 230 })).observe(box);
  const read = () => figure.setLegend({ idx: figure.valToIdx(now) });
  figure.over.addEventListener("mouseleave", () => requestAnimationFrame(read));
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => figure.redraw());
  return (t) => {
    now = t;
    place(figure);
    if (!figure.over.matches(":hover")) read();
  };
}

function makeRests(rests, duration, seek) {
  const make = (className, textContent = "") => Object.assign(document.createElement("div"), { className, textContent });
  const box = Object.assign(document.createElement("section"), { className: "rests" });
  box.append(Object.assign(document.createElement("h2"), { textContent: "held: by dry friction grey, at a stop in colour; events dotted" }));
  const marks = [], part = (t) => `${100 * t / (duration || 1)}%`;
  for (const each of rests) {
    const line = make("lane"), time = make("time"), mark = make("mark");
    for (const [start, end, stop] of each.spans) {
      const span = make(stop ? "rest stop" : "rest");
      Object.assign(span.style, { left: part(start), width: part(end - start) });
      span.title = `${each.joint} ${stop ? "rests at a stop" : "sticks"}, ${start.toFixed(3)} to ${end.toFixed(3)} s`;
      time.append(span);
    }
    for (const [t, name] of each.events) {
      const tick = make("event");
      tick.style.left = part(t);
      tick.title = `${t.toFixed(3)} s: ${name}`;
      time.append(tick);
    }
    time.append(mark);
    time.addEventListener("click", (click) => seek((click.clientX - time.getBoundingClientRect().left) / time.clientWidth * duration));
    line.append(make("joint", each.joint), time);
    box.append(line);
    marks.push(mark);
  }
  element("plots").append(box);
  return (t) => marks.forEach((mark) => { mark.style.left = part(t); });
}

function makePrice(price) {
  const make = (tag, text) => Object.assign(document.createElement(tag), { textContent: text });
  const box = Object.assign(document.createElement("section"), { className: "price" }), table = document.createElement("table");
  const row = (cells, tag) => {
    const line = document.createElement("tr");
    line.append(...cells.map((text, i) => make(i ? tag : "th", text)));
    table.append(line);
  };
  if (price.runs.length > 1) row(["", ...price.runs], "th");
  price.rows.forEach((cells) => row(cells, "td"));
  box.append(make("h2", "What it took"), table);
  element("plots").append(box);
}

function makeViewer(scene) {
  const viewer = new MeshCat.Viewer(element("view"));
  const [x, y, z] = scene.center, away = scene.radius;  // the camera's frame has y up
  let stood = 0;
  const fit = () => {
    const { clientWidth: width, clientHeight: height } = element("stage");
    viewer.set_3d_pane_size(width, height);
    const half = viewer.camera.fov * Math.PI / 360, narrow = Math.min(half, Math.atan(Math.tan(half) * width / height));
    const distance = away / Math.sin(narrow);  // from which a sphere about all that is drawn fills the view
    if (stood) return;  // the user's view stays
    const [right, deep, up] = scene.camera;
    viewer.camera.position.set(x + right * distance, z + up * distance, -y - deep * distance);
    stood = distance;
  };
  new ResizeObserver(fit).observe(element("stage"));
  window.addEventListener("load", fit);  // after meshcat's own, which takes the window's height
  window.addEventListener("resize", fit);
  requestAnimationFrame(() => requestAnimationFrame(fit));
  viewer.controls.target.set(x, z, -y);
  viewer.camera.near = away / 100;
  viewer.camera.far = 100 * away;
  viewer.set_property(["Background"], "top_color", [0.96, 0.97, 0.98]);
  viewer.set_property(["Background"], "bottom_color", [0.82, 0.85, 0.88]);
  viewer.set_property(["Axes"], "visible", false);
  viewer.set_property(["Grid"], "visible", false);  // the scene brings its own
  viewer.scene_tree.find(["Background"]).on_update();
  viewer.animator.folder.hide();  // one clock is enough: the page's
  return viewer;
}

function makeClock(duration, show) {
  let t = 0, playing = false, last = 0;
  const slider = element("time"), button = element("play");
  slider.max = duration;
  slider.disabled = button.disabled = !(duration > 0);
  const seek = (to) => {
    t = Math.min(Math.max(to, 0), duration);
    slider.value = t;
    element("now").textContent = `${t.toFixed(3)} / ${duration.toFixed(3)} s`;
    show(t);
  };
  const play = (on) => {
    if (on && t >= duration) seek(0);
    playing = on && duration > 0;
    button.textContent = playing ? "❚❚" : "▶";
    last = performance.now();
  };
  const step = (now) => {
    if (playing) {
      seek(t + (now - last) / 1000 * Number(element("speed").value));
      if (t >= duration) play(false);
    }
    last = now;
    requestAnimationFrame(step);
  };
  requestAnimationFrame(step);
  slider.addEventListener("input", () => { play(false); seek(Number(slider.value)); });
  button.addEventListener("click", () => play(!playing));
  element("speed").addEventListener("change", () => element("speed").blur());
  document.addEventListener("keydown", (event) => {
    if (event.code !== "Space" || event.target.closest("select, button")) return;
    event.preventDefault();
    play(!playing);
  });
  return { seek, play, get time() { return t; }, get playing() { return playing; }, duration };
}

async function main() {
  const data = await unpack(JSON.parse(element("data").textContent));
  element("title").textContent = data.title;
  element("outcome").textContent = data.outcome;
  element("gravity").textContent = data.gravity;
  document.body.classList.toggle("still", !data.plots.length);
  for (const [list, notes] of [["remarks", data.remarks], ["problems", data.problems], ["notes", data.notes]]) {
    element(list).append(...notes.map((note) => Object.assign(document.createElement("li"), { textContent: note })));
  }
  element("trouble").hidden = !data.problems.length;
  element("count").textContent = `drawn otherwise than its files describe, in ${data.problems.length} place${data.problems.length > 1 ? "s" : ""}`;
  const viewer = window.viewer = makeViewer(data.scene);
  if (data.live) viewer.connect(); else data.commands.forEach((command) => viewer.handle_command(command));
  const marks = [];
  let loaded = null;
  const show = (t) => {
    viewer.animator.pause();
    viewer.animator.seek(t);
    marks.forEach((mark) => mark(t));
    const latest = data.events.filter((each) => each.t <= t && t < each.t + SEEN * data.duration);
    element("event").textContent = latest.map((each) => `${each.t.toFixed(3)} s: ${each.name}`).join("\n");
  };
  const clock = window.replay = makeClock(data.duration, show);
  marks.push(...data.plots.map((plot) => makePlot(plot, data.events, (t) => { clock.play(false); clock.seek(t); })));
  if (data.rests.length) marks.push(makeRests(data.rests, data.duration, (t) => { clock.play(false); clock.seek(t); }));
  if (data.price.rows.length) makePrice(data.price);
  clock.seek(0);
  const follow = () => {  // over a socket the animation comes when it comes
    if (viewer.animator.actions[0] !== loaded) { loaded = viewer.animator.actions[0]; clock.seek(clock.time); }
    requestAnimationFrame(follow);
  };
  requestAnimationFrame(follow);
}

main().catch((error) => {
  element("outcome").textContent = `This page cannot be shown: ${error.message}. It needs a browser of 2023 or later.`;
  throw error;
});
