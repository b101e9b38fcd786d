// ---- what acts: springs, loads, drive, flywheel, gravity, and rings around pins --------------------
parts.acting = make(picture, "g", { id: "acting" });
picture.insertBefore(parts.acting, parts.forces);
const COILS = 7, OPENING = 250 / DEG, RINGS = { viscous: 1.5, friction: 1.8, pin_friction: 1.8, flywheel: 4 };
const sizeOf = () => view.width < 480 ? 7 : 9;   // of a symbol, px

// A point in the frame of a bar, 1 to 4.
function framed(p, bar, z) {
  if (bar > 1) return barPoint(p, bar, z);
  const c = Math.cos(data.theta_1), s = Math.sin(data.theta_1);
  return [z[0] * c - z[1] * s, z[0] * s + z[1] * c];
}

// Points that the picture has to hold: the ends of springs, and where loads act.
const actingPoints = p => data.acting.flatMap(one => one.end ? [framed(p, one.bar, one.at), framed(p, ...one.end)] : one.kind === "force" ? [forceFoot(p, one)] : []);

function forceFoot(p, one) {
  const angle = one.turns ? { 2: p.theta2, 3: p.theta3, 4: p.theta4 }[one.bar] : 0, c = Math.cos(angle), s = Math.sin(angle);
  const foot = framed(p, one.bar, one.at), [x, y] = one.beyond;
  return [foot[0] + x * c - y * s, foot[1] + x * s + y * c];
}

const pathOf = points => points.map(([x, y], n) => `${n ? "L" : "M"}${x.toFixed(2)} ${y.toFixed(2)}`).join("");
const ring = (at, radius, from, turn, count) => Array.from({ length: count }, (_, n) => {
  const angle = from + turn * n / (count - 1);
  return [at[0] + radius * Math.cos(angle), at[1] - radius * Math.sin(angle)];
});

function headed(points, kind, group = parts.acting) {   // a line with an arrow head at its end
  make(group, "path", { class: `act act-${kind}`, d: pathOf(points) });
  const [x, y] = points[points.length - 1], [u, v] = points[points.length - 2], long = Math.hypot(x - u, y - v) || 1;
  const [a, b] = [(x - u) / long, (y - v) / long];
  make(group, "path", { class: `act-head act-${kind}`, d: `M${x + 7 * a} ${y + 7 * b}L${x - 4 * b} ${y + 4 * a}L${x + 4 * b} ${y - 4 * a}Z` });
}

function named(text, x, y) {
  make(parts.acting, "text", { class: "act-name", x: Math.min(view.width - 20, Math.max(20, x)), y: Math.min(view.height - 8, Math.max(10, y)) }).textContent = text;
}

function drawActing(p, i) {
  parts.acting.replaceChildren();
  if (!p || !byId("show-acting").checked) return;
  const S = sizeOf(), torque = valuesAt(i).torque;
  for (const one of data.acting) {
    const factor = one.factor === null ? 1 : edited ? 0 : one.factor[i];
    if (factor === 0) continue;
    if (one.kind === "gravity") {
      const size = Math.hypot(...one.vector), [x, y] = [one.vector[0] / size, -one.vector[1] / size], at = [view.width - 34, 34];
      headed([[at[0] - 12 * x, at[1] - 12 * y], [at[0] + 12 * x, at[1] + 12 * y]], "gravity");
      named("g", at[0] - 14, at[1]);
    } else if (one.kind === "spring") {
      const a = toScreen(framed(p, one.bar, one.at)), b = toScreen(framed(p, ...one.end)), along = [b[0] - a[0], b[1] - a[1]], long = Math.hypot(...along) || 1;
      const on = (share, out) => [a[0] + share * along[0] - out * along[1] / long, a[1] + share * along[1] + out * along[0] / long];
      const teeth = Array.from({ length: COILS }, (_, n) => on(0.15 + 0.7 * (n + 0.5) / COILS, (n % 2 ? -0.8 : 0.8) * S));
      make(parts.acting, "path", { class: "act act-spring", d: pathOf([a, on(0.15, 0), ...teeth, on(0.85, 0), b]) });
      for (const [x, y] of [a, b]) make(parts.acting, "circle", { class: "act-head act-spring", cx: x, cy: y, r: 3 });
    } else if (one.kind === "cylinder") {
      const a = toScreen(framed(p, one.bar, one.at)), b = toScreen(framed(p, ...one.end)), on = share => [0, 1].map(j => a[j] + share * (b[j] - a[j]));
      make(parts.acting, "path", { class: "act act-drive", d: pathOf([a, b]) });
      make(parts.acting, "path", { class: "act act-drive", style: "stroke-width:5", d: pathOf([on(0.1), on(0.6)]) });
      for (const [x, y] of [a, b]) make(parts.acting, "circle", { class: "act-head act-drive", cx: x, cy: y, r: 3 });
    } else if (one.kind === "force") {
      const foot = forceFoot(p, one), angle = one.turns ? { 2: p.theta2, 3: p.theta3, 4: p.theta4 }[one.bar] : 0;
      const direction = Math.atan2(one.vector[1], one.vector[0]) + angle + (factor < 0 ? Math.PI : 0), [x, y] = toScreen(foot);
      const [u, v] = [Math.cos(direction), -Math.sin(direction)];
      headed([[x, y], [x + 5 * S * u, y + 5 * S * v]], "force");
      named(one.name, x + 7.5 * S * u, y + 7.5 * S * v);
    } else if (one.kind === "moment" || one.kind === "drive") {
      const turn = Math.sign(one.kind === "moment" ? one.moment * factor : torque ?? 1);
      const middle = one.bar === 3 ? [0, 1].map(j => 0.5 * (p.A[j] + p.B[j])) : p[one.pin];
      const at = toScreen(one.kind === "moment" ? framed(p, one.bar, one.at) : middle), radius = (one.kind === "moment" ? 2.2 : 2.9) * S;
      if (turn) headed(ring(at, radius, -35 / DEG * turn, turn * OPENING, 30), one.kind);
      if (turn) named(one.name, at[0], at[1] - turn * (radius + 9));
    } else if (one.kind === "torsion") {
      const at = toScreen(p[one.pin]);
      make(parts.acting, "path", { class: "act act-spring", d: pathOf(Array.from({ length: 80 }, (_, n) => ring(at, S * (0.6 + 1.5 * n / 79), n / 79 * 2.5 * TURN, 0, 2)[0])) });
    } else {
      const at = toScreen(p[one.pin]);
      make(parts.acting, "circle", { class: `act act-${one.kind === "flywheel" ? "flywheel" : "pin"}`, cx: at[0], cy: at[1], r: RINGS[one.kind] * S });
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
    if (byId("show-labels").checked) make(parts.points, "text", { class: "act-name", x: x + 12, y: y - 9 }).textContent = point.name;
  }
}
