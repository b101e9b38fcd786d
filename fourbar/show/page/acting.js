// ---- what acts: springs, loads, drive, flywheel, gravity, and rings around pins --------------------
parts.acting = make(picture, "g", { id: "acting" });
picture.insertBefore(parts.acting, parts.forces);
parts.under = make(picture, "g", { id: "under" });   // springs, and what sits in the pins: it hides no bar
picture.insertBefore(parts.under, parts.bars[2]);
const BARREL = 0.85;   // of the shortest stroke of the sweep; the rod comes out of it
const COILS = 7, OPENING = 250 / DEG, RINGS = { viscous: 1.5, friction: 1.8, pin_friction: 1.8, flywheel: 4 };
const sizeOf = () => view.width < 480 ? 7 : 9;   // of a symbol, px

// Of a symbol at a pin: smaller where a bar there is short.
function smallAt(p, pin) {
  const ring = ["O2", "A", "B", "O4"], n = ring.indexOf(pin), S = sizeOf();
  const shortest = Math.min(...[1, 3].map(step => p[ring[(n + step) % 4]]).map(([x, y]) => Math.hypot(x - p[pin][0], y - p[pin][1])));
  return Math.min(S, Math.max(0.5 * S, 0.12 * view.k * shortest));
}

// Points off their bar are joined to it, from pin to point to pin, as a plate.
function drawPlate(p, bar, point) {
  const [a, c] = bar > 1 ? [p[FIRST_PIN[bar]], p[LAST_PIN[bar]]] : [p.O2, p.O4], [b, q] = [[c[0] - a[0], c[1] - a[1]], [point[0] - a[0], point[1] - a[1]]];
  const square = b[0] * b[0] + b[1] * b[1], along = (q[0] * b[0] + q[1] * b[1]) / square, across = (b[0] * q[1] - b[1] * q[0]) / square;
  if (Math.abs(across) < 1e-3 && along > -1e-3 && along < 1.001) return;
  make(parts.under, "path", { class: `plate b${bar}`, d: pathOf([a, point, c].map(toScreen)) });
}

// A point in the frame of a bar, 1 to 4.
function framed(p, bar, z) {
  if (bar > 1) return barPoint(p, bar, z);
  const c = Math.cos(data.theta_1), s = Math.sin(data.theta_1);
  return [z[0] * c - z[1] * s, z[0] * s + z[1] * c];
}

// Points that the picture has to hold: the ends of springs, and where loads act.
const actingPoints = p => data.acting.flatMap(one => one.end ? [framed(p, one.bar, one.at), framed(p, ...one.end)] : ["force", "push"].includes(one.kind) ? [forceFoot(p, one)] : []);

const forceFoot = (p, one) => framed(p, one.bar, one.at).map((x, j) => x + one.beyond[j]);

const pathOf = points => points.map(([x, y], n) => `${n ? "L" : "M"}${x.toFixed(2)} ${y.toFixed(2)}`).join("");
const ring = (at, radius, from, turn, count) => Array.from({ length: count }, (_, n) => {
  const angle = from + turn * n / (count - 1);
  return [at[0] + radius * Math.cos(angle), at[1] - radius * Math.sin(angle)];
});

function headed(points, kind, group = parts.acting) {   // a line with an arrow head at its end
  make(group, "path", { class: `act act-${kind}`, d: pathOf(points) });
  keepOff(points.filter((_, n) => n % 4 === 0 || n === points.length - 1), 2);
  const [x, y] = points[points.length - 1], [u, v] = points[points.length - 2], long = Math.hypot(x - u, y - v) || 1;
  const [a, b] = [(x - u) / long, (y - v) / long];
  make(group, "path", { class: `act-head act-${kind}`, d: `M${x + 7 * a} ${y + 7 * b}L${x - 4 * b} ${y + 4 * a}L${x + 4 * b} ${y - 4 * a}Z` });
}

function named(text, at, away, clear, group = parts.acting) {
  const element = make(group, "text", { class: "act-name" });
  element.textContent = text;
  want(element, at, away, clear);
}

function drawActing(p, i) {
  parts.acting.replaceChildren();
  parts.under.replaceChildren();
  if (!p) return;
  for (const point of data.points) drawPlate(p, point.bar, framed(p, point.bar, point.at));
  for (const k of [2, 3, 4]) if (data.centres[k] && byId("show-centres").checked) drawPlate(p, k, barPoint(p, k, data.centres[k]));
  if (!byId("show-acting").checked) return;
  const torque = valuesAt(i).torque;
  for (const one of data.acting) {
    const factor = one.factor === null ? 1 : one.factor[i];
    if (factor === 0) continue;
    const S = one.pin ? smallAt(p, one.pin) : one.kind === "moment" ? smallAt(p, FIRST_PIN[one.bar]) : sizeOf();
    if (["force", "push", "moment", "spring"].includes(one.kind)) drawPlate(p, one.bar, forceFoot(p, one));
    if (one.end) drawPlate(p, one.end[0], framed(p, ...one.end));
    if (one.kind === "gravity") {
      const size = Math.hypot(...one.vector), [x, y] = [one.vector[0] / size, -one.vector[1] / size], at = [view.width - 34, 34];
      headed([[at[0] - 12 * x, at[1] - 12 * y], [at[0] + 12 * x, at[1] + 12 * y]], "gravity");
      named("g", at, [-1, 0], 6);
    } else if (one.kind === "spring") {
      const a = toScreen(framed(p, one.bar, one.at)), b = toScreen(framed(p, ...one.end)), along = [b[0] - a[0], b[1] - a[1]], long = Math.hypot(...along) || 1;
      const on = (share, out) => [a[0] + share * along[0] - out * along[1] / long, a[1] + share * along[1] + out * along[0] / long];
      const teeth = Array.from({ length: COILS }, (_, n) => on(0.15 + 0.7 * (n + 0.5) / COILS, (n % 2 ? -0.6 : 0.6) * S));
      make(parts.under, "path", { class: "act act-spring", d: pathOf([a, on(0.15, 0), ...teeth, on(0.85, 0), b]) });
      keepOff([a, b], 0.6 * S);
      for (const [x, y] of [a, b]) make(parts.acting, "circle", { class: "act-head act-spring", cx: x, cy: y, r: 3 });
    } else if (one.kind === "cylinder") {
      const a = toScreen(framed(p, one.bar, one.at)), b = toScreen(framed(p, ...one.end)), on = share => [0, 1].map(j => a[j] + share * (b[j] - a[j]));
      const barrel = Math.min(0.95, BARREL * view.k * Math.min(...table().stroke.filter(s => s !== null)) / Math.hypot(b[0] - a[0], b[1] - a[1]));
      make(parts.acting, "path", { class: "act act-drive", d: pathOf([a, b]) });
      make(parts.acting, "path", { class: "act act-drive barrel", d: pathOf([on(0.1 * barrel), on(barrel)]) });
      keepOff([a, b], 3);
      named(one.name, on(0.5 * barrel), [b[1] - a[1], a[0] - b[0]], 4);
      for (const [x, y] of [a, b]) make(parts.acting, "circle", { class: "act-head act-drive", cx: x, cy: y, r: 3 });
    } else if (one.kind === "force" || one.kind === "push") {
      const foot = forceFoot(p, one), angle = one.turns ? { 2: p.theta2, 3: p.theta3, 4: p.theta4 }[one.bar] : 0;
      const direction = Math.atan2(one.vector[1], one.vector[0]) + angle + (factor < 0 ? Math.PI : 0), [x, y] = toScreen(foot);
      const [u, v] = [Math.cos(direction), -Math.sin(direction)];
      headed([[x, y], [x + 5 * S * u, y + 5 * S * v]], one.kind === "push" ? "drive" : "force");
      named(one.name, [x + 5 * S * u, y + 5 * S * v], [u, v], 7);
    } else if (one.kind === "moment" || one.kind === "drive") {
      const turn = Math.sign(one.kind === "moment" ? one.moment * factor : torque ?? 1);
      const middle = one.bar === 3 ? [0, 1].map(j => 0.5 * (p.A[j] + p.B[j])) : p[one.pin];
      const at = toScreen(one.kind === "moment" ? forceFoot(p, one) : middle), radius = (one.kind === "moment" ? 2.2 : 2.9) * S;
      if (turn) headed(ring(at, radius, -35 / DEG * turn, turn * OPENING, 30), one.kind);
      if (turn) named(one.name, at, [0, -turn], radius);
    } else if (one.kind === "torsion") {
      const at = toScreen(p[one.pin]);
      keepOff(ring(at, 2.1 * S, 0, TURN, 9));
      make(parts.under, "path", { class: "act act-spring", d: pathOf(Array.from({ length: 80 }, (_, n) => ring(at, S * (0.6 + 1.5 * n / 79), n / 79 * 2.5 * TURN, 0, 2)[0])) });
    } else {
      const at = toScreen(one.pin ? p[one.pin] : framed(p, one.bar, one.at));
      keepOff(ring(at, (RINGS[one.kind] ?? 2.1) * S, 0, TURN, 9));
      make(parts.under, "circle", { class: `act act-${one.kind === "flywheel" ? "flywheel" : "pin"}`, cx: at[0], cy: at[1], r: (RINGS[one.kind] ?? 2.1) * S });
    }
  }
}

// Velocities and accelerations of points as arrows, each kind to one scale: its longest of the sweep fits into the margin.
parts.motion = make(picture, "g", { id: "motion" });
let motionScales = null;   // of the sweep shown
function drawMotion(p, i) {
  parts.motion.replaceChildren();
  ["v", "a"].forEach((letter, n) => {
    if (!p || !byId(`show-${letter}`).checked) return;
    motionScales ??= [0, 1].map(m => ceiling(POINTS.flatMap(point => grid.map((_, k) => Math.hypot(...pointMotion(k, point)[m])))).top);
    for (const point of POINTS) {
      const own = pointMotion(i, point)[n], size = Math.hypot(...own), long = (view.width < 480 ? 22 : 50) * Math.min(size / motionScales[n], 1);
      if (!(long > 3)) continue;
      const [x, y] = toScreen(framed(p, point[1], point[2]())), tip = [x + long * own[0] / size, y - long * own[1] / size];
      headed([[x, y], tip], letter, parts.motion);
    }
  });
}

// The scene's own points, each with its name.
parts.points = make(picture, "g", { id: "points" });
function drawPoints(p) {
  parts.points.replaceChildren();
  if (!p) return;
  for (const point of data.points) {
    const [x, y] = toScreen(framed(p, point.bar, point.at));
    make(parts.points, "path", { class: "own-point", d: `M${x - 5} ${y}L${x} ${y - 5}L${x + 5} ${y}L${x} ${y + 5}Z` });
    mark([x, y], 6);
    if (byId("show-labels").checked) named(point.name, [x, y], [1, -0.7], 6, parts.points);
  }
}
