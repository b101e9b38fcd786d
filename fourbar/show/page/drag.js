// ---- dragging in the drawing -----------------------------------------------------------------------
parts.handles = make(picture, "g", { id: "handles" });
let holding = null, drags = 0;
const toPlane = ([x, y]) => [(x - view.x) / view.k, (view.y - y) / view.k];
const turned = (p, bar) => ({ 1: data.theta_1, 2: p.theta2, 3: p.theta3, 4: p.theta4 })[bar];
const arrowLength = () => 5 * sizeOf();

// Where the things that can be dragged are drawn: name, what the server calls it, place in the picture.
function placesOf(p) {
  const found = ["A", "B", "O4"].map(pin => [`pin ${pin}`, pin, toScreen(p[pin])]);
  for (const handle of data.handles ?? []) {
    const own = handle.turns ? turned(p, handle.bar) : 0, c = Math.cos(own), s = Math.sin(own), [x, y] = handle.beyond;
    const foot = framed(p, handle.bar, handle.at), place = toScreen([foot[0] + x * c - y * s, foot[1] + x * s + y * c]);
    found.push([handle.name, handle.path, place]);
    const arrow = handle.force && data.acting.find(one => one.kind === "force" && one.name === handle.name);
    if (!arrow) continue;
    const direction = Math.atan2(arrow.vector[1], arrow.vector[0]) + (arrow.turns ? turned(p, handle.bar) : 0);
    found.push([`arrow of ${handle.name}`, handle.force, [place[0] + arrowLength() * Math.cos(direction), place[1] - arrowLength() * Math.sin(direction)], place]);
  }
  return found;
}

function drawHandles() {
  const p = at(row);
  parts.handles.style.display = p && !playing ? "" : "none";
  if (!p || playing) return;
  const places = placesOf(p);
  while (parts.handles.childElementCount > places.length) parts.handles.lastChild.remove();
  places.forEach(([name, what, place, foot], n) => {
    const circle = parts.handles.children[n] ?? handleOf();
    circle.given = { name, what, place, foot };
    circle.setAttribute("aria-label", `${name}: drag it, or move it by the arrow keys`);
    set(circle, { cx: place[0], cy: place[1] });
  });
}

function handleOf() {
  const circle = make(parts.handles, "circle", { class: "handle", r: 12, tabindex: 0, role: "button" });
  circle.addEventListener("pointerdown", event => {
    event.preventDefault();
    circle.focus();
    circle.setPointerCapture(event.pointerId);
    circle.classList.add("held");
    holding = { ...circle.given, gesture: `drag:${++drags}` };
    held = true;
  });
  circle.addEventListener("pointermove", event => { if (holding) dragged(placeOf(event)); });
  const end = () => {
    if (!holding) return;
    circle.classList.remove("held");
    holding = null; held = false;
    refresh();
  };
  for (const name of ["pointerup", "pointercancel", "lostpointercapture"]) circle.addEventListener(name, end);
  circle.addEventListener("keydown", event => {
    const way = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
    if (!way) return;
    event.preventDefault(); event.stopPropagation();
    const far = event.shiftKey ? 10 : 2;
    holding = { ...circle.given, gesture: `keys:${++drags}` };
    dragged([circle.given.place[0] + far * way[0], circle.given.place[1] + far * way[1]]);
    holding = null;
  });
  return circle;
}

function dragged(place) {
  const to = toPlane(place), asked = { do: "drag", what: holding.what, to, grain: 1 / view.k, theta_2: holding.theta ??= grid[row], branch: table().sign[row], gesture: holding.gesture };
  if (holding.foot) asked.stretch = Math.max(0.02, Math.hypot(place[0] - holding.foot[0], place[1] - holding.foot[1]) / arrowLength());
  ask(asked, null, holding.what === "A" ? Math.atan2(to[1], to[0]) : null);
}

// ---- a linkage drawn by four clicks ----------------------------------------------------------------
const PINS_IN_TURN = ["O2", "A", "B", "O4"], JOINED = { O2: "the input to the ground", A: "the coupler to the input", B: "the output to the coupler", O4: "the output to the ground" };
const sketched = make(picture, "g", { id: "sketched" });
const sketchBar = element("div", { id: "sketch-bar", className: "bar", hidden: true },
  element("p", { id: "next-pin", className: "hint", role: "status" }),
  element("label", {}, "Width of the drawing", element("input", { id: "sketch-width", value: "500 mm", size: 8, spellcheck: false })),
  element("label", {}, "or type x, y in its unit", element("input", { id: "pin-xy", placeholder: "60, -5", size: 10, spellcheck: false })),
  element("button", { type: "button", id: "no-sketch", textContent: "Keep the linkage as it is" }));
picture.before(sketchBar);
let sketch = null;   // pins placed so far, and where the next one would be
function beginSketch() {
  if (playing) play(false);
  const origin = [0.35 * view.width, 0.6 * view.height];   // of what is typed
  sketch = { pins: [], origin, here: [...origin], typed: false };
  document.body.classList.add("sketching");
  sketchBar.hidden = false;
  picture.focus();
  drawSketch();
}
function endSketch() {
  sketch = null;
  document.body.classList.remove("sketching");
  sketchBar.hidden = true;
  sketched.replaceChildren();
}
function drawSketch() {
  const next = PINS_IN_TURN[sketch.pins.length];
  byId("next-pin").textContent = `Click where pin ${next} joins ${JOINED[next]}; or move the cross with the arrow keys and press Enter.`;
  sketched.replaceChildren();
  for (let x = 0.1; x < 1; x += 0.1) make(sketched, "line", { class: "grid", x1: x * view.width, x2: x * view.width, y1: 0, y2: view.height });
  for (let y = 0.1 * view.width; y < view.height; y += 0.1 * view.width) make(sketched, "line", { class: "grid", x1: 0, x2: view.width, y1: y, y2: y });
  const chain = [...sketch.pins, sketch.here];
  chain.slice(1).forEach((q, n) => make(sketched, "line", { class: `bar b${n + 2}`, x1: chain[n][0], y1: chain[n][1], x2: q[0], y2: q[1] }));
  sketch.pins.forEach(([x, y], n) => {
    make(sketched, "circle", { class: "pin", r: 6, cx: x, cy: y });
    make(sketched, "text", { class: "label", x: x + 16, y: y - 10 }).textContent = PINS_IN_TURN[n];
  });
  const [x, y] = sketch.here;
  make(sketched, "path", { class: "cross", d: `M${x - 9} ${y}H${x + 9}M${x} ${y - 9}V${y + 9}` });
}
const sketchWidth = () => {
  const [, wide, unit] = /^\s*([\d.]+)\s*(.*)$/.exec(byId("sketch-width").value) ?? [null, "500", "mm"];
  return [Number(wide), unit];
};
function putPin() {
  if (sketch.pins.push([...sketch.here]) < PINS_IN_TURN.length) { drawSketch(); return; }
  const [wide, unit] = sketchWidth(), grain = wide / view.width, [x0, y0] = sketch.origin;
  const pins = sketch.pins.map(([x, y]) => [(x - x0) * grain, (y0 - y) * grain]), finest = sketch.typed ? 1e-6 * wide : grain;
  endSketch();
  ask({ do: "draw", pins, unit, grain: finest }, null, Math.atan2(pins[1][1] - pins[0][1], pins[1][0] - pins[0][0]));
}
const placeOf = event => {
  const box = picture.getBoundingClientRect();
  return [(event.clientX - box.left) * view.width / box.width, (event.clientY - box.top) * view.height / box.height];
};
picture.addEventListener("pointermove", event => { if (sketch) { sketch.here = placeOf(event); drawSketch(); } });
picture.addEventListener("click", event => { if (sketch) { sketch.here = placeOf(event); putPin(); } });
picture.addEventListener("keydown", event => {
  if (!sketch || event.target !== picture || event.ctrlKey || event.metaKey) return;
  const way = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key], far = event.shiftKey ? 1 : 10;
  if (way) { sketch.here = sketch.here.map((x, j) => x + far * way[j]); drawSketch(); }
  else if (event.key === "Enter" || event.key === " ") putPin();
  else if (event.key === "Escape") endSketch();
  else return;
  event.preventDefault(); event.stopPropagation();
});
byId("pin-xy").addEventListener("keydown", event => {
  if (event.key !== "Enter") return;
  const place = event.target.value.trim().split(/[,;\s]+/).map(Number), good = place.length === 2 && place.every(Number.isFinite), grain = sketchWidth()[0] / view.width;
  event.target.setAttribute("aria-invalid", String(!good));
  if (!good) return;
  event.target.value = "";
  sketch.here = [sketch.origin[0] + place[0] / grain, sketch.origin[1] - place[1] / grain];
  sketch.typed = true;
  putPin();
});
byId("no-sketch").addEventListener("click", endSketch);
