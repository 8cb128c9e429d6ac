// The plots (uPlot): one cursor, one zoom and one mark of the time for all.
"use strict";

const ink = () => getComputedStyle(document.body).color;
const gaps = (values) => Array.from(values, (value) => (Number.isNaN(value) ? null : value));  // as uPlot marks them
const tick = (value) => (value !== 0 && (Math.abs(value) >= 1e5 || Math.abs(value) < 1e-3)
  ? value.toExponential(Number.isInteger(Math.log10(Math.abs(value))) ? 0 : 1) : String(Number(value.toPrecision(6))));
const COLORS = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00", "#8c6d31", "#7f7f7f"];
const DASHES = [[], [6, 3], [2, 3], [8, 3, 2, 3]];
const HEIGHT = 230, ZOOM = 2;

// A section of the panels, with its heading.
function makePanel(className, title) {
  const box = Object.assign(document.createElement("section"), { className });
  box.append(Object.assign(document.createElement("h2"), { textContent: title }));
  element("plots").append(box);
  return box;
}

function makePlots(plots, events, seek) {
  const made = plots.filter((plot) => plot.series.length).map((plot) => makePlot(plot, events, seek, (span) => share(span)));
  const figures = made.map((each) => each.figure), silent = plots.filter((plot) => !plot.series.length);
  let now = 0;
  const times = plots[0]?.t ?? [0], whole = { min: times[0], max: times.at(-1) };
  const share = (span) => {
    figures.forEach((each) => {
      const { min, max } = each.scales.x;
      if (min !== span.min || max !== span.max) each.setScale("x", span);
    });
    element("whole").hidden = span.max - span.min >= whole.max - whole.min;
  };
  const zoom = (factor) => {  // about the time of the page
    if (!figures.length) return;
    const { min, max } = figures[0].scales.x, half = (max - min) / factor / 2;
    const low = Math.max(whole.min, Math.min(now - half, whole.max - 2 * half));
    share({ min: low, max: Math.min(low + 2 * half, whole.max) });
  };
  const end = () => share(whole);
  element("whole").addEventListener("click", () => { end(); element("time").focus(); });
  if (silent.length) {
    const line = Object.assign(document.createElement("p"), { className: "silent" });
    line.textContent = `Not drawn: ${silent.map((each) => `${each.title} (${each.why})`).join("; ")}.`;
    element("plots").append(line);
  }
  const read = () => made.forEach((each) => each.read());
  element("plots").addEventListener("mouseout", () => requestAnimationFrame(read));
  return {
    figures, end, zoom,
    mark: (t) => {
      now = t;
      made.forEach((each) => each.mark(t));
      if (!document.querySelector(".u-over:hover")) read();
    },
  };
}

function makePlot(plot, events, seek, zoomed) {
  const box = makePanel("plot", plot.title);
  const axis = { stroke: ink, grid: { stroke: "#8884" }, ticks: { stroke: "#8884" }, font: "12px system-ui, sans-serif" };
  const number = (value) => (value == null ? "–" : value !== 0 && Math.abs(value) < 1e-3 ? value.toExponential(3) : value.toPrecision(4));
  const series = plot.series.map((each) => ({
    label: each.label, width: each.desired ? 2.5 : 1.5, points: { show: plot.t.length === 1 }, value: (_, y) => number(y),
    pxAlign: 0,  // otherwise points are rounded to pixels, and curves climb in steps
    stroke: COLORS[each.color % COLORS.length], dash: each.desired ? [2.5, 3.5] : each.ghost ? [4, 4] : DASHES[(each.color / COLORS.length | 0) % 4],
    ...(each.desired && { class: "desired" }),  // in the legend it belongs to its joint
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
  const follow = (u, i, { show }) => {  // a desired curve is hidden with that of its joint
    const { color, ghost, desired } = plot.series[i - 1] ?? { desired: true };
    if (desired || show == null) return;
    plot.series.forEach((each, k) => {
      if (each.desired && each.color === color && each.ghost === ghost) u.setSeries(k + 1, { show });
    });
  };
  const near = (value, low, high) => value >= low - (high - low) / 2 && value <= high + (high - low) / 2;
  const wide = (u, low, high) => {
    if (!(low < high)) return [(low ?? 0) - 1, (low ?? 0) + 1];
    const seen = plot.limits.map((each) => each.value).filter((value) => near(value, low, high));
    return uPlot.rangeNum(Math.min(low, ...seen), Math.max(high, ...seen), 0.1, true);
  };
  const figure = new uPlot({
    width: box.clientWidth || 460, height: HEIGHT, legend: { live: true, markers: { dash: (u, i) => (plot.series[i - 1]?.ghost ? "dashed" : "solid") } },
    hooks: { setSeries: [follow], draw: [place, (u) => drawLimits(u, plot.limits)], setScale: [(u, scale) => { if (scale === "x" && u.over.isConnected) zoomed({ ...u.scales.x }); }] },
    cursor: { y: false, sync: { key: "replay", scales: ["x", null], filters: { pub: (type) => /^mouse(move|leave)$/.test(type) } } },
    scales: { x: { time: false, range: (u, low, high) => (low < high ? [low, high] : [low - 1, low + 1]) }, y: { range: wide } },
    axes: [{ ...axis, label: "t [s]", labelSize: 18, size: 34 },
      { ...axis, label: plot.unit, labelSize: 18, size: 70, values: (u, ticks) => ticks.map(tick) }],
    series: [{ label: "t", value: (_, t) => (t == null ? "–" : t.toFixed(3) + " s") }, ...series],
  }, [plot.t, ...plot.series.map((each) => gaps(each.values))], box);
  if (plot.beyond) box.append(Object.assign(document.createElement("p"), { className: "beyond", textContent: `limits, not drawn: ${plot.beyond}` }));
  figure.over.append(...ticks, mark);
  figure.over.addEventListener("click", (event) => seek(figure.posToVal(event.offsetX, "x")));
  figure.root.querySelectorAll(".u-series + .u-series:not(.desired) > th").forEach(pressable);
  new ResizeObserver(() => figure.setSize({ width: box.clientWidth, height: HEIGHT })).observe(box);
  dark.addEventListener("change", () => figure.redraw());
  return { figure, mark: (t) => { now = t; place(figure); }, read: () => figure.setLegend({ idx: figure.valToIdx(now) }) };
}

// Limits of the file as thin lines, each with its joint below it or, at the top, above it.
function drawLimits(u, limits) {
  const { ctx, bbox } = u, scale = devicePixelRatio;
  ctx.save();
  ctx.beginPath();
  ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
  ctx.clip();
  Object.assign(ctx, { strokeStyle: ink(), fillStyle: ink(), lineWidth: scale, font: `${11 * scale}px system-ui, sans-serif` });
  Object.assign(ctx, { textAlign: "right", textBaseline: "bottom" });
  ctx.setLineDash([]);
  const right = bbox.left + bbox.width - 4 * scale;
  let last = NaN, taken = 0;  // labels of limits that are close to each other stand side by side
  for (const { value, label } of limits) {
    const y = Math.round(u.valToPos(value, "y", true)) + 0.5;
    ctx.globalAlpha = 0.55;
    ctx.beginPath();
    ctx.moveTo(bbox.left, y);
    ctx.lineTo(bbox.left + bbox.width, y);
    ctx.stroke();
    ctx.globalAlpha = 0.9;
    taken = Math.abs(y - last) < 13 * scale ? taken : 0;
    ctx.fillText(`limit ${label}`, right - taken, y - 2 * scale + (y - 14 * scale < bbox.top ? 15 * scale : 0));
    taken += ctx.measureText(`limit ${label}  `).width;
    last = y;
  }
  ctx.restore();
}

// A name in a legend, which hides its curve, for the keyboard.
function pressable(name) {
  Object.assign(name, { tabIndex: 0, title: "show or hide this curve" });
  name.setAttribute("role", "button");
  name.setAttribute("aria-pressed", true);
  name.addEventListener("click", () => name.setAttribute("aria-pressed", !name.parentElement.matches(".u-off")));
  name.addEventListener("keydown", (event) => {
    if (event.key !== " " && event.key !== "Enter") return;
    event.preventDefault();
    name.click();
  });
}
