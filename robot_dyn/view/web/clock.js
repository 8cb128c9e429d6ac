// The time of the page: a slider, play and pause, steps of a sample, and #t=0.75 in the address.
"use strict";

function makeClock(duration, times, show) {
  let t = NaN, playing = false, last = 0;
  const slider = element("time"), button = element("play");
  slider.max = duration;
  slider.disabled = button.disabled = !(duration > 0);
  const seek = (to) => {  // what is shown is not computed again
    const next = Math.min(Math.max(to, 0), duration);
    if (next === t) return;
    t = next;
    slider.value = t;
    slider.setAttribute("aria-valuetext", `${t.toFixed(3)} s`);
    element("now").textContent = `${t.toFixed(3)} / ${duration.toFixed(3)} s`;
    show(t);
  };
  const play = (on) => {
    if (on && t >= duration) seek(0);
    playing = on && duration > 0;
    button.textContent = playing ? "❚❚" : "▶";
    button.setAttribute("aria-label", playing ? "Pause" : "Play");
    last = performance.now();
  };
  const jump = (to) => { play(false); seek(to); };
  const step = (by) => jump((by > 0 ? times.find((each) => each > t) : times.findLast((each) => each < t)) ?? t);
  const frame = (now) => {
    if (playing) {
      seek(t + (now - last) / 1000 * Number(element("speed").value));
      if (t >= duration) play(false);
    }
    last = now;
    requestAnimationFrame(frame);
  };
  requestAnimationFrame(frame);
  slider.addEventListener("input", () => jump(Number(slider.value)));
  button.addEventListener("click", () => play(!playing));
  return { seek, play, jump, step, again: () => show(t), get time() { return t; }, get playing() { return playing; }, duration };
}

const WRITE_MS = 400;  // browsers refuse to write the address more often than a few times a second

// Returns what keeps the address current; where a frame has no address of its own, nothing is read or written.
function makeAddress(clock) {
  let known = 0, waiting = 0;
  const entries = () => new URLSearchParams(location.hash.slice(1));
  const read = () => {
    const t = parseFloat(entries().get("t"));
    if (!Number.isFinite(t) || t === known) return;
    clock.jump(t);
    known = clock.time;
  };
  const write = () => {
    waiting = 0;
    const t = Number(clock.time.toFixed(6));
    if (t === known) return;
    known = t;
    try {
      const all = entries();
      all.set("t", t);
      history.replaceState(history.state, "", `#${all}`);
    } catch { /* the frame of a notebook has no address */ }
  };
  window.addEventListener("hashchange", read);
  read();
  return () => { waiting ||= setTimeout(write, WRITE_MS); };
}
