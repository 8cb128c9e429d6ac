// Why each joint needs its torque at a time: bars by cause, those that push either way stacked at their side of 0.
"use strict";

const FAR = 5;  // a limit that is more times the largest torque is a number alone: a bar would be too short to see
const causeColor = (i) => {
  const color = COLORS[i % COLORS.length];
  return i < COLORS.length ? color : `repeating-linear-gradient(45deg, ${color} 0 4px, var(--paper) 4px 6px)`;
};

function makeWhy({ causes }, seek) {
  if (!causes) return null;
  const make = (tag, className, properties = {}) => Object.assign(document.createElement(tag), { className, ...properties });
  const swatch = (i) => {
    const mark = make("span", "swatch");
    mark.style.background = causeColor(i);
    return mark;
  };
  const box = makePanel("why", causes.whose ? `torque by cause: ${causes.whose}` : "torque by cause");
  const legend = make("p", "causes"), last = causes.names.length, count = causes.t.length;
  causes.names.forEach((name, i) => {
    const entry = make("span", "cause");
    entry.append(swatch(i), name);
    legend.append(entry);
  });
  legend.append(make("span", "cause sum", { textContent: "sum: actuation τ" }));
  if (causes.joints.some((joint) => joint.limit !== null)) legend.append(make("span", "cause limit", { textContent: "effort limit" }));
  legend.append(make("span", "", { textContent: "each joint to its own scale" }));
  box.append(legend);
  let sample = -1, selected = 0;
  const value = (joint, i) => joint.values[i * count + sample] * joint.step;
  const rows = causes.joints.map((joint, k) => {
    const line = make("div", "lane"), track = make("div", "track", { ariaHidden: "true" });
    const button = make("button", "joint", { type: "button", textContent: joint.name });
    const select = () => { selected = k; show(); };
    button.addEventListener("click", select);
    track.addEventListener("click", select);
    const near = joint.limit !== null && joint.limit <= FAR * joint.extent;
    const span = 1.05 * (near ? Math.max(joint.limit, joint.extent) : joint.extent) || 1, part = (x) => `${50 + 50 * x / span}%`;
    if (near) for (const limit of [-joint.limit, joint.limit]) {
      const mark = make("div", "limit");
      mark.style.left = part(limit);
      track.append(mark);
    }
    const bars = causes.names.map((_, i) => {
      const bar = make("div", "bar");
      bar.style.background = causeColor(i);
      return bar;
    });
    const sum = make("div", "sum"), text = make("output", "");
    track.append(...bars, make("div", "zero"), sum);
    line.append(button, track, text);
    box.append(line);
    const digits = decimals(joint);
    return () => {
      const ends = [0, 0];
      bars.forEach((bar, i) => {
        const x = value(joint, i), side = x < 0 ? 0 : 1, from = ends[side];
        ends[side] += x;
        bar.style.left = part(Math.min(from, ends[side]));
        bar.style.width = `${50 * Math.abs(x) / span}%`;
      });
      sum.style.left = part(value(joint, last));
      sum.classList.toggle("over", joint.limit !== null && Math.abs(value(joint, last)) > joint.limit);
      text.textContent = `${value(joint, last).toFixed(digits)} ${joint.limit === null ? "" : `of ${joint.limit} `}${joint.unit}`;
      button.setAttribute("aria-pressed", k === selected);
    };
  });
  const table = make("table", ""), caption = make("caption", "");
  const cells = [...causes.names, "sum: actuation τ", "effort limit"].map((name, i) => {
    const row = make("tr", i === last ? "total" : ""), head = make("th", "", { scope: "row" });
    head.append(...(i < last ? [swatch(i)] : []), name);
    const number = make("td", "number"), unit = make("td", "");
    row.append(head, number, unit);
    table.append(row);
    return { row, number, unit };
  });
  table.append(caption);
  box.append(table);
  const tabulate = () => {
    const joint = causes.joints[selected], digits = decimals(joint);
    caption.textContent = `${joint.name} at t = ${causes.t[sample].toFixed(3)} s`;
    cells.forEach(({ row, number, unit }, i) => {
      number.textContent = i > last ? joint.limit : value(joint, i).toFixed(digits);
      unit.textContent = joint.unit;
      row.hidden = i > last && joint.limit === null;
    });
  };
  const show = () => { rows.forEach((row) => row()); tabulate(); };
  const mark = (t) => {
    const at = latest(causes.t, t);
    if (at === sample) return;
    sample = at;
    show();
  };
  window.why = { mark, get sample() { return sample; }, value: (joint, cause) => value(causes.joints[joint], cause) };
  return mark;
}

// The last decimal is above the resolution: four digits of the largest torque.
function decimals(joint) {
  const largest = joint.step * joint.values.reduce((most, x) => Math.max(most, Math.abs(x)), 0);
  return Math.min(Math.max(3 - Math.floor(Math.log10(largest || 1)), 0), 12);
}

// Index of the latest time that is not after t, the first one if there is none.
function latest(times, t) {
  let low = 0, high = times.length;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (times[middle] <= t) low = middle; else high = middle;
  }
  return low;
}
