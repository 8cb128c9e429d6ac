// What scrolls sideways can be reached by the keyboard.
"use strict";

addEventListener("DOMContentLoaded", () => {
  for (const box of document.querySelectorAll("pre, .table-wrapper, .math-wrapper, .robot-dyn")) box.tabIndex = 0;
});
