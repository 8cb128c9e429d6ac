// The keys of the page: { key: action }; what has the focus and needs a key itself keeps it.
"use strict";

const OWN = "select, textarea, input:not(#time, [type=checkbox])";  // take arrows and letters
const PRESSED = `${OWN}, button, summary, [role=button], input:not(#time)`;  // take the space bar

function makeKeys(keys) {
  document.addEventListener("keydown", (event) => {
    if (event.altKey || event.ctrlKey || event.metaKey) return;
    const name = (event.shiftKey && event.key.startsWith("Arrow") ? "Shift+" : "") + event.key;
    const key = name.length === 1 ? name.toLowerCase() : name;
    if (!Object.hasOwn(keys, key) || event.target.closest(key === " " ? PRESSED : OWN)) return;
    event.preventDefault();
    keys[key]();
  });
}

// A button that opens and closes what it controls.
function disclose(button, open) {
  button.addEventListener("click", () => {
    const on = button.getAttribute("aria-expanded") !== "true";
    button.setAttribute("aria-expanded", on);
    open(on);
  });
}
