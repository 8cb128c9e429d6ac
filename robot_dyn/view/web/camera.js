// The viewer (meshcat) in its pane, and its camera. Directions and points have z up, as the scene; three.js has y up.
"use strict";

const VIEWS = { front: [0, -1, 0], side: [1, 0, 0], top: [0, -1e-4, 1] };  // from the middle to the camera
const MARGIN = 0.9;  // of the pane, for what is seen
const FOV = 45;  // [degrees], from top to bottom; wider ones draw what is upright aslant at the sides
const TURN = Math.PI / 36, NEARER = 0.9;  // of a key
const THEMES = {  // background at the top and at the bottom, the lines on the floor, the arrow of gravity
  light: [[0.96, 0.97, 0.98], [0.82, 0.85, 0.88], [0.7, 0.73, 0.77, 1], [0.42, 0.24, 0.6, 1]],
  dark: [[0.27, 0.29, 0.33], [0.13, 0.14, 0.16], [0.4, 0.43, 0.48, 1], [0.79, 0.65, 0.93, 1]],
};
const dark = matchMedia("(prefers-color-scheme: dark)");

function makeViewer(scene) {
  const viewer = new MeshCat.Viewer(element("view"));
  viewer.camera.fov = FOV;
  viewer.camera.near = scene.radius / 100;
  viewer.camera.far = 100 * scene.radius;
  viewer.set_property(["Axes"], "visible", false);
  viewer.set_property(["Grid"], "visible", false);  // the scene brings its own
  viewer.animator.folder.hide();  // one clock is enough: the page's
  const panel = viewer.gui.domElement;
  panel.hidden = true;
  viewer.gui.open();
  disclose(element("panel"), (on) => { panel.hidden = !on; });
  return viewer;
}

function paint(viewer) {
  const [top, bottom, floor, gravity] = THEMES[dark.matches ? "dark" : "light"];
  viewer.set_property(["Background"], "top_color", top);
  viewer.set_property(["Background"], "bottom_color", bottom);
  viewer.scene_tree.children.ground?.set_property("color", floor);
  viewer.scene_tree.children.gravity?.set_property("color", gravity);
  viewer.set_dirty();
}

// dot and cross: sliders.js
const unit = (a) => a.map((x) => x / Math.sqrt(dot(a, a)));

// Where to stand, and what to look at, so that points fill the view in a direction; tan: of half the angles of view.
// A point at (x, z), right and towards the camera, is seen if |x − x₀| ≤ tan (D − z).
function standing(points, direction, tan, least) {
  const d = unit(direction), right = unit(cross([0, 0, 1], d)), up = cross(d, right);
  const most = (axis, k) => Math.max(...points.map((p) => dot(p, axis) + tan[k] * dot(p, d)));
  const sides = [right, up].map((axis, k) => [most(axis, k), most(axis.map((x) => -x), k)]);
  const nearest = Math.max(...points.map((p) => dot(p, d)));
  const distance = Math.max(nearest + least, ...sides.map(([a, b], k) => (a + b) / (2 * tan[k])));
  const [across, along] = sides.map(([a, b]) => (a - b) / 2);
  const target = right.map((x, i) => across * x + along * up[i]);
  return { target, position: target.map((x, i) => x + distance * d[i]) };
}

function makeCamera(viewer, scene) {
  const { camera, controls } = viewer, stage = element("stage");
  let chosen = "iso";  // null once the user has moved the camera
  const fit = () => {
    const { clientWidth: width, clientHeight: height } = stage;
    if (!width || !height) return;
    viewer.set_3d_pane_size(width, height);
    if (!chosen) return;
    const tan = Math.tan(camera.fov * Math.PI / 360) * MARGIN;
    const { target, position } = standing(scene.outline, VIEWS[chosen] ?? scene.camera,
      [tan * width / height, tan], scene.radius / 10);
    controls.target.set(target[0], target[2], -target[1]);
    camera.position.set(position[0], position[2], -position[1]);
    controls.update();
    viewer.set_dirty();
  };
  const buttons = document.querySelectorAll("[data-view]");
  const look = (name) => {
    chosen = name;
    buttons.forEach((each) => each.setAttribute("aria-pressed", each.dataset.view === name));
    fit();
  };
  buttons.forEach((each) => each.addEventListener("click", () => look(each.dataset.view)));
  controls.addEventListener("start", () => look(null));
  const move = (change) => {  // in spherical coordinates about the target
    const from = camera.position.clone().sub(controls.target);
    const at = change(new MeshCat.THREE.Spherical().setFromVector3(from)).makeSafe();
    look(null);
    camera.position.setFromSpherical(at).add(controls.target);
    controls.update();
    viewer.set_dirty();
  };
  new ResizeObserver(fit).observe(stage);
  window.addEventListener("load", fit);  // after meshcat's own, which takes the window's height
  window.addEventListener("resize", fit);
  requestAnimationFrame(() => requestAnimationFrame(fit));
  look("iso");
  return {
    look,
    turn: (right, up) => move((at) => at.set(at.radius, at.phi - up * TURN, at.theta + right * TURN)),
    approach: (by) => move((at) => at.set(at.radius * NEARER ** by, at.phi, at.theta)),
  };
}
