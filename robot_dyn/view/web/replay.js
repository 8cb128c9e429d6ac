// The replay page: one clock t moves the slider, the robot (meshcat's animator) and the marks of the panels.
"use strict";

async function inflate(text) {
  const packed = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

// A document with arrays: length of head, head as JSON, arrays; {"$array", offset, length} stands for one.
async function unpack(text) {
  const bytes = await inflate(text), start = 8 + Number(new DataView(bytes.buffer).getBigUint64(0, true));
  const types = { Int8Array, Uint8Array, Int16Array, Uint16Array, Uint32Array, Float32Array, Float64Array };
  const numbers = ({ $array, offset, length }) => {  // stored are the first bytes of all, then the second ones, …
    const array = new types[$array](length), own = new Uint8Array(array.buffer), size = array.BYTES_PER_ELEMENT;
    for (let i = 0, from = start + offset; i < size; i++) for (let k = 0; k < length; k++) own[k * size + i] = bytes[from++];
    return array;
  };
  return JSON.parse(new TextDecoder().decode(bytes.subarray(8, start)), (_, value) =>
    value && value.$array ? numbers(value) : value);
}

// The viewer's script runs only if its text has a digest of the page's content policy.
async function loadViewer(text) {
  const script = document.createElement("script");
  script.textContent = new TextDecoder().decode(await inflate(text));
  document.head.append(script);
  if (!window.MeshCat) throw new Error("the viewer's script in it is not the one that its content policy names");
}

const element = (id) => document.getElementById(id);
const SEEN = 0.05;  // of the run: for so long an event is named

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
  await loadViewer(element("meshcat").textContent);
  const viewer = window.viewer = makeViewer(data.scene);
  data.commands.forEach((command) => viewer.handle_command(command));
  const camera = makeCamera(viewer, data.scene), dress = makeLayers(viewer, data);
  const marks = [];
  let loaded = null;
  const show = (t) => {
    viewer.animator.pause();
    viewer.animator.seek(t);
    marks.forEach((mark) => mark(t));
    const latest = data.events.filter((each) => each.t <= t && t < each.t + SEEN * data.duration);
    element("event").textContent = latest.map((each) => `${each.t.toFixed(3)} s: ${each.name}`).join("\n");
  };
  const clock = window.replay = makeClock(data.duration, data.plots[0]?.t ?? [], show);
  const plots = clock.plots = makePlots(data.plots, data.events, clock.jump);
  marks.push(plots.mark, ...[makeDiffers, makeWhy, makeRests, makePrice].map((make) => make(data, clock.jump)).filter(Boolean));
  if (data.sliders) window.sliders = makeSliders(data.sliders, viewer);
  document.body.classList.toggle("bare", !element("plots").children.length);
  clock.seek(0);
  marks.push(makeAddress(clock));
  makeKeys({
    " ": () => clock.play(!clock.playing), Home: () => clock.jump(0), End: () => clock.jump(data.duration),
    ArrowLeft: () => clock.step(-1), ArrowRight: () => clock.step(1),
    "0": plots.end, "+": () => plots.zoom(ZOOM), "-": () => plots.zoom(1 / ZOOM),
    "Shift+ArrowLeft": () => camera.turn(-1, 0), "Shift+ArrowRight": () => camera.turn(1, 0),
    "Shift+ArrowUp": () => camera.turn(0, 1), "Shift+ArrowDown": () => camera.turn(0, -1),
    n: () => camera.approach(1), f: () => camera.approach(-1),
  });
  const redress = () => { dress(); paint(viewer); };
  dark.addEventListener("change", redress);
  const follow = () => {  // over a socket the scene comes when it comes, its animation last
    if (viewer.animator.actions[0] !== loaded) { loaded = viewer.animator.actions[0]; redress(); clock.again(); }
    requestAnimationFrame(follow);
  };
  requestAnimationFrame(follow);
  window.film = makeFilm(clock);
}

main().catch((error) => {
  const said = error.message.replace(/\.+$/, "");
  const remedy = /webgl/i.test(said)
    ? "The robot is drawn by WebGL, which this browser has not, or has switched off."
    : "It must be as it was written, and needs a browser of 2023 or later.";
  element("outcome").textContent = `This page cannot be shown: ${said}. ${remedy}`;
  throw error;
});
