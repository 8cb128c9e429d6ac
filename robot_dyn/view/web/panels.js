// Panels below the plots: makers take the document and seek(t), and return what shows a time, or nothing.
"use strict";

function makeRests({ rests, duration }, seek) {
  if (!rests.length) return null;
  const make = (className, textContent = "") => Object.assign(document.createElement("div"), { className, textContent });
  const box = makePanel("rests", "held: by dry friction grey, at a stop in colour; events dotted");
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
  return (t) => marks.forEach((mark) => { mark.style.left = part(t); });
}

const makePrice = ({ price }) => makeTable(price, "What it took", "price");
const makeDiffers = ({ differs }) => makeTable(differs, "What differs in their settings", "differs");

function makeTable(table, title, name) {
  if (!table.rows.length) return null;
  const make = (tag, text) => Object.assign(document.createElement(tag), { textContent: text });
  const box = makePanel(`table ${name}`, title), lines = document.createElement("table");
  const row = (cells, tag) => {
    const line = document.createElement("tr");
    line.append(...cells.map((text, i) => make(!text ? "td" : i ? tag : "th", text)));
    lines.append(line);
  };
  if (table.runs.length > 1) row(["", ...table.runs], "th");
  table.rows.forEach((cells) => row(cells, "td"));
  box.append(lines);
  return null;
}
