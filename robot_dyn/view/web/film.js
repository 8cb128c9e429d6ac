// The page as a film: without controls, at times that are asked for; a promise ends when what it shows is drawn.
"use strict";

function makeFilm(clock) {
  const drawn = () => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)));
  return {
    begin: () => { document.body.classList.add("film"); return drawn(); },
    show: async (t) => { clock.jump(t); await drawn(); return clock.time; },
  };
}
