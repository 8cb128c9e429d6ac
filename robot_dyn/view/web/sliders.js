// A slider for each joint: forward kinematics, and the torque of gravity, by recursion over the bodies.
"use strict";

const times = (A, B) => [0, 3, 6].flatMap((i) => [0, 1, 2].map((j) => A[i] * B[j] + A[i + 1] * B[j + 3] + A[i + 2] * B[j + 6]));
const apply = (A, x) => [0, 3, 6].map((i) => A[i] * x[0] + A[i + 1] * x[1] + A[i + 2] * x[2]);
const add = (x, y) => x.map((value, i) => value + y[i]);
const scale = (a, x) => x.map((value) => a * value);
const dot = (x, y) => x[0] * y[0] + x[1] * y[1] + x[2] * y[2];
const cross = (x, y) => [x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]];

// exp(â angle), by Rodrigues' formula
function turn([x, y, z], angle) {
  const s = Math.sin(angle), c = 2 * Math.sin(angle / 2) ** 2;  // 1 − cos, without cancellation
  return [1 - c * (y * y + z * z), c * x * y - s * z, c * x * z + s * y,
    c * x * y + s * z, 1 - c * (x * x + z * z), c * y * z - s * x,
    c * x * z - s * y, c * y * z + s * x, 1 - c * (x * x + y * y)];
}

// q_full = S q + s₀
const full = (arm, q) => arm.S.map((row, i) => row.reduce((sum, s, j) => sum + s * q[j], arm.s0[i]));

// (R, p) of each body in its parent: gᵢ exp(ξ̂ᵢ qᵢ)
const inParent = (arm, q) => full(arm, q).map((x, i) => {
  const { R, p, axis, revolute } = arm.bodies[i];
  return revolute ? { R: times(R, turn(axis, x)), p } : { R, p: add(p, scale(x, apply(R, axis))) };
});

// τ = Sᵀ ∂V/∂q_full with ∂V/∂qᵢ = −gᵀ (zᵢ × (hᵢ − mᵢ pᵢ)) for a joint that turns, −mᵢ gᵀ zᵢ for one that slides;
// mᵢ and hᵢ are mass and first moment, in the base, of all that the joint carries
function gravityTorque(arm, q) {
  const poses = [];
  inParent(arm, q).forEach(({ R, p }, i) => {
    const parent = poses[arm.bodies[i].parent];
    poses.push(parent ? { R: times(parent.R, R), p: add(parent.p, apply(parent.R, p)) } : { R, p });
  });
  const mass = arm.bodies.map((body) => body.mass);
  const moment = arm.bodies.map((body, i) => add(scale(body.mass, poses[i].p), apply(poses[i].R, body.moment)));
  const torque = new Array(mass.length);
  for (let i = mass.length - 1; i >= 0; i--) {
    const { axis, revolute, parent } = arm.bodies[i], z = apply(poses[i].R, axis);
    torque[i] = -dot(arm.gravity, revolute ? cross(z, add(moment[i], scale(-mass[i], poses[i].p))) : scale(mass[i], z));
    if (parent >= 0) { mass[parent] += mass[i]; moment[parent] = add(moment[parent], moment[i]); }
  }
  return arm.joints.map((_, j) => arm.S.reduce((sum, row, i) => sum + row[j] * torque[i], 0));
}

const asPython = (q) => `q = [${Array.from(q, (x) => String(Number(x.toPrecision(12)))).join(", ")}]`;

function makeSliders(arm, viewer) {
  const make = (tag, properties = {}) => Object.assign(document.createElement(tag), properties);
  const q = arm.joints.map((joint) => joint.q);
  const box = make("section", { className: "sliders" });
  const python = make("input", { readOnly: true, type: "text", ariaLabel: "q as Python" });
  const unsigned = (text) => text.replace(/^-(0\.0+)$/, "$1");  // no "-0.000"
  const reading = (x, unit) => `${unsigned(x.toFixed(3))} ${unit}`;
  const place = () => {
    inParent(arm, q).forEach(({ R, p }, i) => viewer.handle_command({ type: "set_transform", path: arm.bodies[i].path,
      matrix: [R[0], R[3], R[6], 0, R[1], R[4], R[7], 0, R[2], R[5], R[8], 0, ...p, 1] }));
    const torque = gravityTorque(arm, q), largest = Math.max(...torque.map(Math.abs), 1e-12);
    rows.forEach((row, i) => row(q[i], torque[i], largest));
    python.value = asPython(q);
  };
  const heading = make("div", { className: "slider heading" });
  heading.append(...["joint", "q", "torque of gravity"].map((textContent) => make("span", { textContent })));
  box.append(heading);
  const rows = arm.joints.map((joint, i) => {
    const line = make("div", { className: "slider" }), id = `joint-${i}`;
    const range = make("input", { id, type: "range", min: joint.lower, max: joint.upper, step: "any", value: joint.q });
    const value = make("output"), bar = make("meter", { min: 0, max: 1 }), tau = make("output");
    bar.ariaLabel = `torque of gravity at ${joint.name}`;
    line.append(make("label", { htmlFor: id, textContent: joint.name }), range, value, bar, tau);
    const move = (x) => { q[i] = Math.min(Math.max(x, joint.lower), joint.upper); place(); };
    range.addEventListener("input", () => move(Number(range.value)));
    range.addEventListener("keydown", (event) => {  // finer than the hundredth of the range that browsers step by
      const way = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1 }[event.key];
      if (way === undefined || event.ctrlKey || event.altKey || event.metaKey) return;
      event.preventDefault();
      event.stopPropagation();
      move(q[i] + way * (event.shiftKey ? 0.1 : 0.01));
    });
    box.append(line);
    return (x, torque, largest) => {
      range.value = x;
      value.textContent = range.ariaValueText = reading(x, joint.unit);
      const share = Math.abs(torque) / (joint.limit ?? largest);
      bar.value = Math.min(share, 1);
      bar.classList.toggle("over", joint.limit !== null && share > 1);
      tau.textContent = `${unsigned(torque.toFixed(2))} ${joint.torque}` + (joint.limit === null ? "" : ` of ${joint.limit}`);
    };
  });
  const buttons = make("div", { className: "buttons" });
  const button = (textContent, act) => {
    const made = make("button", { type: "button", textContent });
    made.addEventListener("click", act);
    buttons.append(made);
  };
  const start = [...q];
  const set = (values) => { values.forEach((x, i) => { q[i] = x; }); place(); };
  button("Reset", () => set(start));
  button("Copy q as Python", () => { python.select(); navigator.clipboard?.writeText(python.value); });
  buttons.append(python);
  const limits = arm.joints.some((joint) => joint.limit !== null);
  const note = make("p", { textContent: "Bars: torque that holds the bodies against gravity, "
    + (limits ? "as a part of the effort limit of the file" : "as a part of the largest; the file has no effort limits")
    + ". Effects such as springs are not in it." });
  box.append(buttons, note);
  element("plots").append(box);
  place();
  return { arm, set, get q() { return [...q]; } };
}
