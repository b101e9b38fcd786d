// ---- picture -------------------------------------------------------------------------------
const SVG = "http://www.w3.org/2000/svg";
function make(parent, name, attributes) {
  const element = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  parent.appendChild(element);
  return element;
}
const set = (element, attributes) => { for (const key in attributes) element.setAttribute(key, attributes[key]); };
const picture = byId("picture");
const parts = { ground: make(picture, "g", {}), images: make(picture, "g", { id: "images" }), curve: make(picture, "path", { class: "path", id: "curve" }) };
parts.traces = make(picture, "g", { id: "traces" });
parts.marks = make(picture, "g", { id: "marks" });
parts.bars = {}; parts.image = {};
for (const k of [2, 3, 4]) {
  parts.image[k] = make(parts.images, "image", { preserveAspectRatio: "none", id: `picture-${k}` });
  parts.bars[k] = make(picture, "line", { class: `bar b${k}`, id: `bar-${k}` });
}
parts.forces = make(picture, "g", { id: "arrows" });
parts.arrow = Object.fromEntries(FORCES.map(name => [name, {
  shaft: make(parts.forces, "line", { class: `force s-${name}`, id: `arrow-${name}` }),
  head: make(parts.forces, "path", { class: `head f-${name}` }),
}]));
parts.pins = Object.fromEntries(["O2", "A", "B", "O4"].map(name => [name, make(picture, "circle", { class: "pin", r: 6, id: `pin-${name}` })]));
parts.centres = make(picture, "g", { id: "centres" });
parts.centre = {};
for (const k of [2, 3, 4]) {
  const mark = parts.centre[k] = make(parts.centres, "g", { id: `centre-${k}` });
  make(mark, "circle", { class: "centre-disc", r: 7 });
  make(mark, "path", { class: "centre-fill", d: "M0 0H7A7 7 0 0 0 0 -7ZM0 0H-7A7 7 0 0 0 0 7Z" });
}
parts.labels = make(picture, "g", { id: "labels" });
parts.leaders = make(parts.labels, "path", { class: "axis" });
parts.label = {};
for (const name of ["O2", "A", "B", "O4", "1", "2", "3", "4", "G2", "G3", "G4", ...FORCES]) {
  const element = make(parts.labels, "text", { class: "label" + (FORCES.includes(name) ? ` f-${name}` : "") });
  const own = /^G?([234])$/.exec(name);
  if (own) element.style.fill = `var(--bar${own[1]})`;
  element.append(name[0]);
  if (name.length > 1) {
    const index = make(element, "tspan", { dy: 4, "font-size": 10 });
    index.textContent = name.slice(1);
  }
  parts.label[name] = element;
}
parts.legend = make(picture, "g", { id: "force-scale" });

// A bar is named by its number, and by its length where dimensions are wanted; the ground has a name only then.
function showDimensions() {
  for (const k of [1, 2, 3, 4]) parts.label[k].textContent = byId("show-dimensions").checked ? `${k}: ${rounded(shown(lengths[k - 1]), 5)} ${unit.name}` : String(k);
}

const toScreen = p => [view.x + view.k * p[0], view.y - view.k * p[1]];
const FIRST_PIN = { 2: "O2", 3: "A", 4: "O4" }, LAST_PIN = { 2: "A", 3: "B", 4: "B" };

function barPoint(p, k, r) {
  const angle = { 2: p.theta2, 3: p.theta3, 4: p.theta4 }[k], foot = p[FIRST_PIN[k]];
  const c = Math.cos(angle), s = Math.sin(angle);
  return [foot[0] + r[0] * c - r[1] * s, foot[1] + r[0] * s + r[1] * c];
}

const coupler = p => barPoint(p, 3, data.centres[3] ?? [0.5 * lengths[2], 0]);

// Paths of the coupler's mass centre and of the scene's points, in metres: those of a state that is kept are a target.
const couplerPlaces = () => [coupler, ...data.points.map(point => p => framed(p, point.bar, point.at))];
const couplerPaths = () => couplerPlaces().map(place => grid.map((_, i) => at(i) && `${i && at(i - 1) ? "L" : "M"}${place(at(i)).join(" ")}`).filter(Boolean).join(""));
// Dead centres and limits that the motion reaches: what each is, and its place on every path.
function couplerMarks() {
  const away = (a, b) => Math.abs(Math.atan2(Math.sin(a - b), Math.cos(a - b))), step = Math.max(INSIDE, 1.5 * Math.abs(grid[1] - grid[0]));
  const reached = ([, theta2, theta3]) => grid.some((theta, i) => at(i) && away(theta, theta2) < step && away(table().theta_3[i], theta3) < OTHER_BRANCH);
  return (data.turns ?? []).filter(reached).flatMap(([words, ...angles]) => couplerPlaces().map(place => [words, place(posed(...angles))]));
}
let shownMarks = [];
function drawMarks() {
  const own = couplerMarks(), kept = unchanged ? [] : reference?.marks ?? [];
  shownMarks = [...own, ...kept];
  parts.marks.replaceChildren();
  byId("turns").hidden = !own.length;
  for (const [more, marks] of [[" behind", kept], ["", own]]) for (const [words, place] of marks) {
    const [x, y] = toScreen(place), d = words.startsWith("limit") ? "m-5 -5l10 10m-10 0l10 -10" : "m-5 0l5 -5l5 5l-5 5z";
    make(make(parts.marks, "path", { class: `mark${more}`, d: `M${x} ${y}${d}` }), "title", {}).textContent = words;
  }
}
let tracedCorners = () => [];   // of a picture that is traced
let held = false;   // while something is dragged the scale stays
// Everything the sweep reaches fits into the picture, so that the scale does not change while it moves.
function fit() {
  view.width = Math.max(280, picture.parentElement.clientWidth);
  const small = view.width < 480;
  const most = lineAddress ? Math.max(240, window.innerHeight - 455) : 560;   // in the workbench curve and controls are seen too
  view.height = Math.round(Math.min(most, 560, (small ? 1 : 0.68) * view.width));
  picture.classList.toggle("small", small);
  set(picture, { viewBox: `0 0 ${view.width} ${view.height}` });
  const points = [[0, 0]], tips = [], curve = [], traces = [];
  let broken = true;
  for (let i = 0; i < grid.length; i++) {
    const p = at(i);
    if (!p) { broken = true; continue; }
    const g = coupler(p), reached = [p.A, p.B, p.O4, g];
    const own = [...[2, 4].filter(k => data.centres[k]).map(k => barPoint(p, k, data.centres[k])), ...data.points.map(point => framed(p, point.bar, point.at))];
    own.forEach((place, n) => { traces[n] = (traces[n] ?? "") + `${broken ? "M" : "L"}${place[0]} ${place[1]} `; });
    points.push(...reached, ...actingPoints(p), ...own);
    if (dynamic() && !held) for (const name of FORCES) tips.push([p[FORCE_PIN[name]], ...arrowShares(name, i)]);
    curve.push([broken ? "M" : "L", g]);
    broken = false;
  }
  const corners = tracedCorners(), alone = corners.length && document.body.classList.contains("sketching");
  if (!held) Object.assign(view, alone ? fitted(corners, [], 8, Infinity) : fitted([...points, ...corners], tips, small ? 30 : 58));
  parts.curve.setAttribute("d", curve.map(([step, g]) => step + toScreen(g).map(v => v.toFixed(2)).join(" ")).join(""));
  parts.traces.replaceChildren();   // in metres: the group carries the scale
  parts.traces.setAttribute("transform", `translate(${view.x} ${view.y}) scale(${view.k} ${-view.k})`);
  const of = [...[2, 4].filter(k => data.centres[k]).map(k => `trace b${k}`), ...data.points.map(() => "trace")];
  if (!unchanged) for (const d of reference?.paths ?? []) make(parts.traces, "path", { class: "trace behind", d, "vector-effect": "non-scaling-stroke" });
  traces.forEach((d, n) => make(parts.traces, "path", { class: of[n], d, "vector-effect": "non-scaling-stroke" }));
  drawMarks();
  drawGround();
  scaleForces();
  motionScales = null;
}

// Both components of a force as shares of the longest arrow of the sweep, and of half the longest of its position.
function arrowShares(name, i) {
  const force = table()[name][i], sizes = FORCES.map(other => Math.hypot(...table()[other][i]));
  const size = Math.hypot(...force), top = sweepCeiling().top, here = Math.max(...sizes);
  if (!(size > 0) || force[0] === null) return [[0, 0]];
  return [Math.min(size, top) / top, 0.5 * size / here].map(share => [share * force[0] / size, share * force[1] / size]);
}

// The greatest scale at which pins keep a margin and arrows with their names stay inside, and the length of an arrow.
function fitted(points, tips, margin, longestBar = Math.min(view.width, view.height)) {
  const edge = 30, side = Math.min(view.width, view.height);
  // of all tips k foot + arrow share only those count that no other exceeds in both
  const far = (j, sign) => {
    let most = -Infinity;
    const both = tips.flatMap(([foot, ...shares]) => shares.map(share => [sign * foot[j], sign * share[j]]));
    return both.sort((p, q) => q[0] - p[0] || q[1] - p[1]).filter(([, share]) => share > most && ((most = share), true));
  };
  const ends = [0, 1].map(j => [-1, 1].map(sign => ({ point: points.reduce((most, point) => Math.max(most, sign * point[j]), -Infinity), tips: far(j, sign), sign })));
  const reach = (j, k, arrow) => ends[j].map(({ point, tips, sign }) => sign * Math.max(k * point + margin, ...tips.map(([foot, share]) => k * foot + arrow * share + edge)));
  const fits = (k, arrow) => [view.width, view.height].every((size, j) => { const [low, high] = reach(j, k, arrow); return high - low <= size; });
  // the scale at which it would fill the picture without margins
  const full = Math.min(...[view.width, view.height].map((size, j) => size / Math.max(1e-9 * lengths[0], ends[j].reduce((sum, { point }) => sum + point, 0))));
  const largest = arrow => {
    let low = 0, high = Math.min(full, longestBar / Math.max(...lengths));
    for (let n = 0; n < 24; n++) { const k = 0.5 * (low + high); if (fits(k, arrow)) low = k; else high = k; }
    return low;
  };
  let arrow = 0.3 * side, k = largest(arrow);
  while (k < 0.6 * full && arrow > 12) { arrow *= 0.85; k = largest(arrow); }   // a linkage too small to see is worse than short arrows
  const [left, right] = reach(0, k, arrow), [bottom, top] = reach(1, k, arrow);
  return { k, arrow, x: 0.5 * (view.width - left - right), y: 0.5 * (view.height + bottom + top) };
}

function drawGround() {
  parts.ground.replaceChildren();
  const O4 = [lengths[0] * Math.cos(data.theta_1), lengths[0] * Math.sin(data.theta_1)];
  const [p, q] = [toScreen([0, 0]), toScreen(O4)];
  make(parts.ground, "line", { class: "ground-line", x1: p[0], y1: p[1], x2: q[0], y2: q[1] });
  for (const [x, y] of [p, q]) {
    for (let i = -18; i < 18; i += 6) make(parts.ground, "line", { class: "hatch", x1: x + i + 6, y1: y + 20, x2: x + i, y2: y + 27 });
    make(parts.ground, "path", { class: "support", d: `M${x} ${y}L${x - 11} ${y + 20}H${x + 11}ZM${x - 18} ${y + 20}H${x + 18}` });
  }
}

function ceiling(values) {
  const sizes = values.filter(Number.isFinite).map(Math.abs).sort((x, y) => x - y);
  if (!sizes.length) return { top: 0, cut: false };
  const ordinary = sizes[Math.floor(ORDINARY * (sizes.length - 1))], largest = sizes[sizes.length - 1];
  return ordinary > 0 && largest > OUTLIER * ordinary ? { top: CLIPPED * ordinary, cut: true } : { top: largest, cut: false };
}

let ceilings = {};   // by branch
function sweepCeiling() {
  return ceilings[branch] ??= ceiling(FORCES.flatMap(name => table()[name].map(f => f[0] === null ? NaN : Math.hypot(f[0], f[1]))));
}

function scaleForces() {
  parts.legend.replaceChildren();
  const shown = dynamic() && byId("show-forces").checked;
  parts.forces.style.display = shown ? "" : "none";
  if (!dynamic()) return;
  forceScale = { ...sweepCeiling() };
  forceScale.pixels = forceScale.top > 0 ? view.arrow / forceScale.top : 0;
  if (!shown || forceScale.pixels === 0) return;
  forceLegend();
}

// With one scale for the whole sweep arrows can be compared from position to position; scaled to the
// position, small forces stay visible where others diverge.
function forceLegend() {
  parts.legend.replaceChildren();
  const top = inUnit("N", forceScale.top), step = 10 ** Math.floor(Math.log10(top));
  const round = [5, 2, 1].map(m => m * step).find(v => v <= 0.75 * top) ?? 0.5 * step;
  const y = view.height - 12, long = round * forceScale.pixels * forceScale.top / top;
  make(parts.legend, "line", { class: "scale", x1: 14, x2: 14 + long, y1: y, y2: y });
  make(parts.legend, "text", { class: "small", x: 14, y: y - 7 }).textContent =
    `${rounded(round, 1)} ${nameOf("N")}` + (forceScale.cut ? `, arrows over ${rounded(top, 2)} ${nameOf("N")} cut (dashed)` : "");
}

// The length, in pixels, of the greatest force with which no arrow of a position leaves the picture.
function insideTip(i, s, top) {
  let length = Infinity;
  for (const name of FORCES) {
    const [fx, fy] = table()[name][i], [x, y] = s[FORCE_PIN[name]], edge = 30;   // space for its name
    if (fx) length = Math.min(length, (fx > 0 ? view.width - edge - x : x - edge) * top / Math.abs(fx));
    if (fy) length = Math.min(length, (fy > 0 ? y - edge : view.height - edge - y) * top / Math.abs(fy));
  }
  return length;
}

function drawLinkage(p, i) {
  const show = id => byId(id).checked;
  parts.curve.style.display = parts.traces.style.display = parts.marks.style.display = show("show-curve") ? "" : "none";
  parts.labels.style.display = show("show-labels") ? "" : "none";
  for (const element of Object.values(parts.label)) element.style.display = "none";
  clearLabels();
  for (const [, place] of shownMarks) mark(toScreen(place), 6);
  const O4 = [lengths[0] * Math.cos(data.theta_1), lengths[0] * Math.sin(data.theta_1)], fixed = { O2: [0, 0], O4 };
  const known = p ?? (grid[i] === null ? fixed : { ...fixed, theta2: grid[i], A: [lengths[1] * Math.cos(grid[i]), lengths[1] * Math.sin(grid[i])] });
  const s = Object.fromEntries(["O2", "A", "B", "O4"].filter(name => known[name]).map(name => [name, toScreen(known[name])]));
  const pins = Object.values(s), middle = [0, 1].map(j => pins.reduce((sum, q) => sum + q[j], 0) / pins.length);
  for (const name of ["O2", "A", "B", "O4"]) {
    parts.pins[name].style.display = s[name] ? "" : "none";
    if (!s[name]) continue;
    const [x, y] = s[name], fixed = name[0] === "O";
    set(parts.pins[name], { cx: x, cy: y });
    mark(s[name], 7);
    if (fixed) mark([x, y + 14], 19, 14);
    want(parts.label[name], s[name], fixed ? [x < middle[0] ? -1 : 1, 0.3] : [x - middle[0], y - middle[1]], 7);
  }
  keepOff([s.O2, s.O4]);
  if (show("show-dimensions")) want(parts.label[1], middleOf(s.O2, s.O4), [0, 1], 2);
  for (const k of [2, 3, 4]) {
    const p1 = s[FIRST_PIN[k]], p2 = s[LAST_PIN[k]], drawn = Boolean(p1 && p2);
    parts.bars[k].style.display = drawn ? "" : "none";
    parts.image[k].style.display = drawn && data.pictures[k] && show("show-pictures") ? "" : "none";
    parts.centre[k].style.display = drawn && data.centres[k] && show("show-centres") ? "" : "none";
    if (!drawn) continue;
    set(parts.bars[k], { x1: p1[0], y1: p1[1], x2: p2[0], y2: p2[1] });
    const [u, v] = [p2[0] - p1[0], p2[1] - p1[1]], mid = middleOf(p1, p2), long = Math.hypot(u, v) || 1;
    let side = (mid[1] - middle[1]) * u - (mid[0] - middle[0]) * v >= 0 ? 1 : -1;
    if (data.centres[k] && Math.abs(data.centres[k][1]) * view.k > 10) side = Math.sign(data.centres[k][1]);   // off the bar, G has the other side
    keepOff([p1, p2], 4.5);
    want(parts.label[k], mid, [-side * v, side * u], 5);
    if (data.pictures[k]) {
      const height = long * (parts.image[k].ratio ?? 0.3), angle = Math.atan2(p2[1] - p1[1], p2[0] - p1[0]) * DEG;
      set(parts.image[k], { x: 0, y: -0.5 * height, width: long, height, transform: `translate(${p1[0]} ${p1[1]}) rotate(${angle})` });
      parts.bars[k].classList.toggle("pictured", show("show-pictures"));
    }
    if (data.centres[k]) {
      const g = toScreen(barPoint(known, k, data.centres[k]));
      parts.centre[k].setAttribute("transform", `translate(${g[0]} ${g[1]})`);
      if (show("show-centres")) {
        mark(g, 8);
        want(parts.label[`G${k}`], g, [side * v, -side * u], 8);
      }
    }
  }
  const forces = dynamic() && show("show-forces");
  if (forces && p && byId("arrow-scale").value === "position") {
    const top = Math.max(...FORCES.map(name => Math.hypot(...table()[name][i])));
    forceScale = { top, cut: false, pixels: top > 0 ? Math.max(0.5 * view.arrow, Math.min(view.arrow, insideTip(i, s, top))) / top : 0 };
    if (top > 0) forceLegend(); else parts.legend.replaceChildren();
  }
  if (parts.legend.childElementCount) {
    const box = parts.legend.getBBox();
    mark([box.x + 0.5 * box.width, box.y + 0.5 * box.height], 0.5 * box.width, 0.5 * box.height);
  }
  for (const name of FORCES) {
    const arrow = parts.arrow[name], f = forces && p ? table()[name][i] : [null, null];
    const size = f[0] === null ? 0 : Math.hypot(f[0], f[1]), cut = size > forceScale.top;
    const long = Math.min(size, forceScale.top) * forceScale.pixels, drawn = long > 2;
    for (const element of Object.values(arrow)) element.style.display = drawn ? "" : "none";
    if (!drawn) continue;
    const [x, y] = s[FORCE_PIN[name]], ux = f[0] / size, uy = -f[1] / size, head = Math.min(11, long);
    const tip = [x + long * ux, y + long * uy], neck = [tip[0] - head * ux, tip[1] - head * uy];
    set(arrow.shaft, { x1: x, y1: y, x2: neck[0], y2: neck[1] });
    arrow.shaft.classList.toggle("cut", cut);
    arrow.head.setAttribute("d", `M${tip[0]} ${tip[1]}L${neck[0] - 0.45 * head * uy} ${neck[1] + 0.45 * head * ux}L${neck[0] + 0.45 * head * uy} ${neck[1] - 0.45 * head * ux}Z`);
    keepOff([[x, y], tip], 2);
    mark(middleOf(neck, tip), 6);
    if (long > 10) want(parts.label[name], tip, [ux, uy], 2);   // next to a shorter arrow its name would stand on the pin's
  }
  drawPoints(p);
  drawActing(p, i);
  drawMotion(p, i);
  placeLabels();
}
const middleOf = (p, q) => [0.5 * (p[0] + q[0]), 0.5 * (p[1] + q[1])];


// ---- labels: each takes the free place nearest to what it names; one without any is left out ------------
let wanted = [], boxes = [], strokes = [];   // labels to be placed; what none may cover; lines that few should
const GAPS = [3, 8, 14, 22, 32, 44, 58], TURNS = 16, LED = 20, COVERED = 100, halves = new Map();
const mark = ([x, y], half, high = half) => boxes.push([x, y, half, high]);
const keepOff = (points, half = 1) => points.slice(1).forEach((q, n) => strokes.push([...points[n], ...q, half]));
// A label beside a point, first in the direction away; `clear`: radius of the mark there.
const want = (element, at, away, clear) => wanted.push({ element, at, away: Math.atan2(away[1], away[0]), clear });
function clearLabels() { wanted = []; boxes = []; strokes = []; }

// Half the width and height of a label, as it is written at this size of the picture.
function halfOf(element) {
  const key = `${element.textContent}|${element.getAttribute("class")}|${picture.classList}`;
  if (!halves.has(key)) {
    const box = element.getBBox();
    halves.set(key, [0.5 * box.width + 1, 0.5 * box.height - 1]);
  }
  return halves.get(key);
}
function crosses(x, y, w, h, [x1, y1, x2, y2, half]) {   // whether a line meets a box
  const u = x2 - x1, v = y2 - y1, reach = w + half, high = h + half;
  if (Math.abs(u) < 1e-9 && Math.abs(x1 - x) > reach || Math.abs(v) < 1e-9 && Math.abs(y1 - y) > high) return false;
  const [a, b] = u ? [(x - reach - x1) / u, (x + reach - x1) / u] : [-Infinity, Infinity], [c, d] = v ? [(y - high - y1) / v, (y + high - y1) / v] : [-Infinity, Infinity];
  return Math.max(0, Math.min(a, b), Math.min(c, d)) < Math.min(1, Math.max(a, b), Math.max(c, d));
}
function placeLabels() {
  let leaders = "";
  for (const { element, at: [px, py], away, clear } of wanted) {
    element.style.display = "";
    const [w, h] = halfOf(element), inside = (x, y) => x > w + 2 && y > h + 2 && x < view.width - w - 2 && y < view.height - h - 2;
    let best = null, least = COVERED;
    for (let n = 0; n < GAPS.length * TURNS && n / TURNS < least; n++) {
      const gap = clear + GAPS[Math.floor(n / TURNS)], k = n % TURNS, angle = away + (k % 2 ? 1 : -1) * Math.ceil(k / 2) * TURN / TURNS;
      const x = px + Math.cos(angle) * (gap + w), y = py + Math.sin(angle) * (gap + h);
      if (!inside(x, y) || boxes.some(box => Math.abs(x - box[0]) < w + box[2] && Math.abs(y - box[1]) < h + box[3])) continue;
      const cost = n / TURNS + 4 * strokes.filter(stroke => crosses(x, y, w, h, stroke)).length;
      if (cost < least) { least = cost; best = [x, y, gap]; }
    }
    if (!best) { element.style.display = "none"; continue; }
    const [x, y, gap] = best;
    set(element, { x, y });
    boxes.push([x, y, w, h]);
    if (gap - clear > LED) leaders += `M${px} ${py}L${Math.max(x - w, Math.min(x + w, px))} ${Math.max(y - h, Math.min(y + h, py))}`;
  }
  parts.leaders.setAttribute("d", leaders);
}
