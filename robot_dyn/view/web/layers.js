// What is drawn besides the arm: paths of frames, centre of mass, boxes of inertia, frames and names.
// Nodes of a robot are named "link …", and joints "0 …", "1 …"; its other nodes are what they say (stage.py).
"use strict";

const JOINT = /^\d+ (.*)$/, LINK = /^link (.*)$/, BOX = /^inertia /;
const LINE = 15, WIDE = 120;  // [px], height of a name, and width of most

// The nodes below a node whose names match: [object, what the name says].
function matching(node, pattern) {
  return Object.entries(node?.children ?? {}).flatMap(([name, child]) => {
    const found = pattern.exec(name);
    return [...(found ? [[child.object, (found[1] ?? name).replaceAll("∕", "/")]] : []), ...matching(child, pattern)];
  });
}

// Returns what makes a layer of names; names of all layers stand below each other where they would overlap.
function makeNames(viewer) {
  const layers = new Map(), place = new MeshCat.THREE.Vector3();
  let drawing = 0;
  const draw = () => {
    const labels = [...layers.values()].flat(), taken = [];
    const { clientWidth: width, clientHeight: height } = element("stage");
    for (const [object, label] of labels) {
      place.setFromMatrixPosition(object.matrixWorld).project(viewer.camera);
      const x = (place.x + 1) / 2 * width;
      let y = (1 - place.y) / 2 * height, over;
      while ((over = taken.find(([left, top]) => Math.abs(left - x) < WIDE && Math.abs(top - y) < LINE))) y = over[1] + LINE;
      taken.push([x, y]);
      label.style.transform = `translate(${x.toFixed(1)}px, ${y.toFixed(1)}px)`;
    }
    drawing = labels.length ? requestAnimationFrame(draw) : 0;
  };
  return (pattern, className) => (on) => {
    layers.get(className)?.forEach(([, label]) => label.remove());
    layers.set(className, !on ? [] : matching(viewer.scene_tree.children.run, pattern).map(([object, textContent]) =>
      [object, Object.assign(document.createElement("span"), { textContent, className })]));
    element("names").append(...layers.get(className).map(([, label]) => label));
    drawing ||= requestAnimationFrame(draw);
  };
}

function makeFrames(viewer, size) {
  let drawn = [];
  return (on) => {
    drawn.forEach((axes) => axes.removeFromParent());
    drawn = !on ? [] : matching(viewer.scene_tree.children.run, LINK).map(([link]) => {
      const axes = new MeshCat.THREE.AxesHelper(size);
      axes.material.depthTest = false;  // seen through the arm
      axes.renderOrder = 1;
      link.add(axes);
      return axes;
    });
  };
}

// The list of frames whose paths can be drawn; each run shows its own choice until the user makes one.
function makePaths(viewer, paths) {
  const list = element("path"), roots = Object.keys(paths);
  const names = [...new Set(roots.flatMap((root) => paths[root].frames))];
  list.append(...["", ...names].map((name) => new Option(name || "no frame", name)));
  element("pathed").hidden = !names.length;
  list.value = paths.run?.shown ?? "";
  let chosen = null;
  const apply = () => roots.forEach((root) => paths[root].frames.forEach((name) => {
    viewer.set_property([root, "paths", name.replaceAll("/", "∕")], "visible", name === (chosen ?? paths[root].shown));
  }));
  list.addEventListener("change", () => { chosen = list.value; apply(); viewer.set_dirty(); });
  return apply;
}

// Returns what draws all that is chosen, anew.
function makeLayers(viewer, data) {
  const roots = () => Object.entries(viewer.scene_tree.children).filter(([name]) => /^(run|ghost \d+)$/.test(name));
  const visible = (pattern) => (on) => roots().forEach(([, root]) =>
    matching(root, pattern).forEach(([object]) => { object.visible = on; }));
  const names = makeNames(viewer);
  const layers = [
    ["names of links", false, names(LINK, "link-name")],
    ["names of joints", false, names(JOINT, "joint-name")],
    ["frames of links (x red, y green, z blue)", false, makeFrames(viewer, 0.15 * data.scene.radius)],
    ["boxes of equal mass and inertia", data.layers.inertia, visible(BOX)],
    ...(data.plots.length ? [["centre of mass", true, visible(/^centre of mass$/)]] : []),
  ];
  const paths = makePaths(viewer, data.layers.paths);
  const boxes = layers.map(([text, on, apply]) => {
    const line = document.createElement("label"), box = document.createElement("input");
    Object.assign(box, { type: "checkbox", checked: on, autocomplete: "off" });
    box.addEventListener("change", () => { apply(box.checked); viewer.set_dirty(); });
    line.append(box, ` ${text}`);
    element("layers").append(line);
    return () => apply(box.checked);
  });
  disclose(element("show"), (on) => { element("layers").hidden = !on; });
  return () => { [...boxes, paths].forEach((apply) => apply()); viewer.set_dirty(); };
}
