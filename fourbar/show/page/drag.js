// ---- dragging in the drawing -----------------------------------------------------------------------
parts.handles = make(picture, "g", { id: "handles" });
let holding = null, drags = 0;
const toPlane = ([x, y], from = view) => [(x - from.x) / from.k, (from.y - y) / from.k];
const moved = (from, [x, y]) => ({ x: from.x + from.k * x, y: from.y - from.k * y });
const turned = (p, bar) => ({ 1: data.theta_1, 2: p.theta2, 3: p.theta3, 4: p.theta4 })[bar];
const arrowLength = () => 5 * sizeOf();

// Where the things that can be dragged are drawn: name, what the server calls it, place in the picture.
function placesOf(p) {
  const found = [...plain.pins ? ["O2"] : [], "A", "B", "O4"].map(pin => [`pin ${pin}`, pin, toScreen(p[pin])]);
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
  offerPlaces(places);
}

function handleOf() {
  const circle = make(parts.handles, "circle", { class: "handle", r: 12, tabindex: 0, role: "button" });
  circle.addEventListener("pointerdown", event => {
    event.preventDefault();
    circle.focus();
    circle.setPointerCapture(event.pointerId);
    circle.classList.add("held");
    holding = { ...circle.given, gesture: `drag:${++drags}`, from: { ...view } };
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
    holding = { ...circle.given, gesture: `keys:${++drags}`, from: { ...view } };
    dragged([circle.given.place[0] + far * way[0], circle.given.place[1] + far * way[1]]);
    holding = null;
  });
  return circle;
}

function dragged(place) {
  const to = toPlane(place, holding.from), asked = { do: "drag", what: holding.what, to, grain: 1 / view.k, theta_2: holding.theta ??= grid[row], branch: table().sign[row], gesture: holding.gesture };
  if (holding.foot) asked.stretch = Math.max(0.02, Math.hypot(place[0] - holding.foot[0], place[1] - holding.foot[1]) / arrowLength());
  ask(asked, null, holding.what === "A" ? Math.atan2(to[1], to[0]) : null);
}

// ---- a click in place of a drag: what is chosen is put where the picture is clicked --------------------
let aimed = null;   // what the next click places
const NEW_POINT = "a new point of the coupler";
function offerPlaces(places) {
  const names = ["", ...places.map(([name]) => name).filter(name => !name.startsWith("arrow")), NEW_POINT], select = byId("place");
  // what is still offered stays in place, so that an open list stays open
  for (const option of [...select.options]) if (!names.includes(option.value)) option.remove();
  names.forEach((name, i) => { if (select.options[i]?.value !== name) select.add(new Option(name || "choose", name), i); });
  select.length = names.length;
}
function aim(name) {
  aimed = name || null;
  byId("place").value = name;
  document.body.classList.toggle("measuring", Boolean(name));
  say(name ? `Click where ${name} is; Escape leaves it.` : "");
}
byId("place").addEventListener("change", event => aim(event.target.value));
picture.addEventListener("click", event => {
  if (!aimed) return;
  if (aimed === NEW_POINT) {
    const name = nextPoint();
    ask({ do: "add", part: offers.parts.findIndex(({ at }) => at[0] === "points"), name });
    holding = { what: ["points", name, "from_pin"] };
  } else holding = { ...byId("handles").children[placesOf(at(row)).findIndex(([name]) => name === aimed)].given };
  Object.assign(holding, { gesture: `click:${++drags}`, from: { ...view } });
  dragged(placeOf(event));
  holding = null;
  aim("");
});
document.addEventListener("keydown", event => { if (event.key === "Escape" && aimed) aim(""); });

// ---- a picture to trace: it lies under the drawing, in the drawing's coordinates ----------------------
const traced = make(picture, "image", { id: "traced", preserveAspectRatio: "none" }), LARGEST = 1.4e6;   // bytes that a request can take
picture.insertBefore(traced, parts.ground);
let tracedSize = null, measured = null;   // pixels of the picture; the points between which a length is known
const tracedScale = () => data.traced.scale ?? 1.2 * Math.max(...lengths) / tracedSize[0];
function ofPixel([x, y]) {   // the place of a pixel, from O2
  const { origin, angle, shift } = data.traced, k = tracedScale(), [u, v] = origin ?? tracedSize.map(n => 0.5 * n), c = Math.cos(angle), s = Math.sin(angle);
  return [k * (c * (x - u) + s * (y - v)) - shift[0], k * (s * (x - u) - c * (y - v)) - shift[1]];
}
tracedCorners = () => data.traced && tracedSize ? [[0, 0], [tracedSize[0], 0], tracedSize, [0, tracedSize[1]]].map(ofPixel) : [];
function drawTraced() {
  traced.style.display = data.traced ? "" : "none";
  if (!data.traced) return;
  const source = `picture?${encodeURIComponent(data.traced.file)}`;
  if (traced.getAttribute("href") !== source) {
    traced.setAttribute("href", source);
    tracedSize = null;
    const probe = new Image();
    probe.onload = () => { tracedSize = [probe.naturalWidth, probe.naturalHeight]; refresh(); if (sketch && !sketch.pins.length) beginSketch(); };
    probe.onerror = () => say(`${data.traced.file}: the picture cannot be read`, true);
    probe.src = source;
  }
  if (!tracedSize) return;
  const [x, y] = toScreen(ofPixel([0, 0]));
  set(traced, { width: tracedSize[0], height: tracedSize[1], opacity: data.traced.opacity, transform: `translate(${x} ${y}) rotate(${-data.traced.angle * DEG}) scale(${tracedScale() * view.k})` });
}
async function takePicture(file) {
  if (!/^image\/(png|jpeg|svg\+xml)$/.test(file?.type)) { say("A picture is a PNG, JPEG or SVG file.", true); return; }
  let blob = file;
  if (file.type !== "image/svg+xml") {
    const bitmap = await createImageBitmap(file), canvas = element("canvas");   // turned as its EXIF says
    for (let share = 1; blob === file || blob.size > LARGEST; share *= 0.8) {
      Object.assign(canvas, { width: Math.round(share * bitmap.width), height: Math.round(share * bitmap.height) });
      canvas.getContext("2d").drawImage(bitmap, 0, 0, canvas.width, canvas.height);
      blob = await new Promise(done => canvas.toBlob(done, file.type, 0.9));
    }
  } else if (blob.size > LARGEST) { say(`An SVG picture has ${LARGEST} bytes at most.`, true); return; }
  const reader = new FileReader();
  reader.onload = () => ask({ do: "picture", data: reader.result });
  reader.readAsDataURL(blob);
}
byId("picture-file").addEventListener("change", event => { takePicture(event.target.files[0]); event.target.value = ""; });
document.addEventListener("paste", event => { const [file] = event.clipboardData.files; if (file) takePicture(file); });
document.addEventListener("dragover", event => event.preventDefault());
document.addEventListener("drop", event => { event.preventDefault(); const [file] = event.dataTransfer.files; if (file) takePicture(file); });
byId("measure").addEventListener("click", () => {
  sketchAgain = Boolean(sketch);
  if (sketch) endSketch();
  measured = [];
  document.body.classList.add("measuring");
  hideLinkage(sketchAgain);
  say("Click two points of the picture between which you know the length.");
});
picture.addEventListener("click", event => {
  if (!measured) return;
  const [x, y] = placeOf(event);
  measured.push([x, y]);
  make(sketched, "path", { class: "cross", d: `M${x - 9} ${y}H${x + 9}M${x} ${y - 9}V${y + 9}` });
  if (measured.length < 2) return;
  const [p, q] = measured, pixels = Math.hypot(q[0] - p[0], q[1] - p[1]) / view.k / tracedScale(), stated = window.prompt("Length between the two points", `100 ${unit.name}`);
  measured = null;
  sketched.replaceChildren();
  document.body.classList.remove("measuring");
  const [, long, of] = /^\s*([\d.]+)\s*(.+)$/.exec(stated ?? "") ?? [];
  if (long > 0 && pixels > 0) ask({ do: "set", path: ["picture", "scale"], value: `${Number((long / pixels).toPrecision(6))} ${of}` }, ["picture", "scale"]);
  else if (sketchAgain) beginSketch();
});

// ---- a linkage drawn by four clicks ----------------------------------------------------------------
const PINS_IN_TURN = ["O2", "A", "B", "O4"], JOINED = { O2: "the input to the ground", A: "the coupler to the input", B: "the output to the coupler", O4: "the output to the ground" };
const sketched = make(picture, "g", { id: "sketched" });
const sketchBar = element("div", { id: "sketch-bar", className: "bar", hidden: true },
  element("p", { id: "next-pin", className: "hint", role: "status" }),
  element("label", {}, "Width of the drawing", element("input", { id: "sketch-width", value: "500 mm", size: 8, spellcheck: false })),
  element("label", {}, "or type x, y in its unit", element("input", { id: "pin-xy", placeholder: "60, -5", size: 10, spellcheck: false })),
  element("button", { type: "button", id: "no-sketch", textContent: "Keep the linkage as it is" }));
picture.before(sketchBar);
let sketch = null, sketchAgain = false, isFresh = false;   // pins placed so far, and where the next one would be; whether to go on after a measurement; whether the linkage is a placeholder
function hideLinkage(hidden) {
  document.body.classList.toggle("sketching", hidden);
  refresh();   // a picture that is traced then fills the drawing
}
function beginSketch() {
  if (playing) play(false);
  sketchAgain = false;
  hideLinkage(true);
  const [, number, stated] = isFresh && /^\s*([\d.e-]+)\s*(.+)$/.exec(plain.picture?.scale ?? "") || [];   // a new scene takes the unit of the measured length
  const [name, factor] = stated ? [stated, number / data.traced.scale] : [unit.name, unit.factor];
  const origin = data.traced ? toScreen(data.traced.shift.map(x => -x)) : [0.35 * view.width, 0.6 * view.height];   // of what is typed
  const wide = view.width / view.k * factor, decade = 10 ** Math.floor(Math.log10(wide));
  byId("sketch-width").value = `${data.traced ? wide : Math.round(wide / decade) * decade} ${name}`;
  byId("sketch-width").parentElement.hidden = Boolean(data.traced);
  sketch = { pins: [], origin, here: [...origin], typed: false };
  sketchBar.hidden = false;
  picture.focus();
  drawSketch();
}
function endSketch() {
  sketch = null;
  hideLinkage(false);
  sketchBar.hidden = true;
  sketched.replaceChildren();
}
function drawSketch() {
  const next = PINS_IN_TURN[sketch.pins.length];
  byId("next-pin").textContent = `Click where pin ${next} joins ${JOINED[next]}; or move the cross with the arrow keys and press Enter.`;
  sketched.replaceChildren();
  const grid = gridOf();
  if (!data.traced) [view.width, view.height].forEach((size, j) => {
    for (let n = Math.ceil(-sketch.origin[j] / grid.pixels); sketch.origin[j] + n * grid.pixels < size; n++) {
      const at = sketch.origin[j] + n * grid.pixels, number = String(Number(((j ? -n : n) * grid.step).toPrecision(6)));
      make(sketched, "line", { class: "grid", ...j ? { x1: 0, x2: view.width, y1: at, y2: at } : { x1: at, x2: at, y1: 0, y2: view.height } });
      if (n % 2 === 0) make(sketched, "text", { class: "small", ...j ? { x: 3, y: at - 3 } : { x: at + 3, y: view.height - 4 } }).textContent = number;
    }
  });
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
// The grid: a round step of which some twenty fill the width, in the unit of the drawing.
function gridOf() {
  const [wide] = sketchWidth(), rough = wide / 20, decade = 10 ** Math.floor(Math.log10(rough)), step = [1, 2, 5, 10].find(m => m * decade >= rough) * decade;
  return { step, pixels: step * view.width / wide };
}
// A place on the grid; Shift frees it, and so does a picture that is traced.
function snapped(event) {
  const place = placeOf(event), { pixels } = gridOf();
  return event.shiftKey || data.traced ? place : place.map((x, j) => sketch.origin[j] + Math.round((x - sketch.origin[j]) / pixels) * pixels);
}
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
picture.addEventListener("pointermove", event => { if (sketch) { sketch.here = snapped(event); drawSketch(); } });
picture.addEventListener("click", event => { if (sketch) { sketch.here = snapped(event); putPin(); } });
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
