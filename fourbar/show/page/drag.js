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
    const direction = Math.atan2(arrow.vector[1], arrow.vector[0]) + own;
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
  const here = event => {
    const box = picture.getBoundingClientRect();
    return [(event.clientX - box.left) * view.width / box.width, (event.clientY - box.top) * view.height / box.height];
  };
  circle.addEventListener("pointerdown", event => {
    event.preventDefault();
    circle.focus();
    circle.setPointerCapture(event.pointerId);
    circle.classList.add("held");
    holding = { ...circle.given, gesture: `drag:${++drags}` };
    held = true;
  });
  circle.addEventListener("pointermove", event => { if (holding) dragged(here(event)); });
  const end = () => {
    if (!holding) return;
    circle.classList.remove("held");
    holding = null; held = false;
    refresh();
  };
  for (const name of ["pointerup", "pointercancel", "lostpointercapture"]) circle.addEventListener(name, end);
  circle.addEventListener("blur", () => { circle.gesture = null; });
  circle.addEventListener("keydown", event => {
    const way = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
    if (!way) return;
    event.preventDefault(); event.stopPropagation();
    const far = event.shiftKey ? 10 : 2;
    circle.gesture = { ...circle.given, gesture: `keys:${++drags}` };
    holding = circle.gesture;
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
