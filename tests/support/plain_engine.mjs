// An engine in JavaScript: loop by the circles' intersection, speeds by Cramer's rule, torque by the power of all bars.
import { createInterface } from "node:readline";

const names = ["theta_3", "theta_4", "omega_3", "omega_4", "torque"];
const dot = (p, q) => p[0] * q[0] + p[1] * q[1];
const turned = (p, k = 1) => [-k * p[1], k * p[0]];
const add = (...all) => [all.reduce((s, p) => s + p[0], 0), all.reduce((s, p) => s + p[1], 0)];
const times = (k, p) => [k * p[0], k * p[1]];
const polar = (r, phi) => [r * Math.cos(phi), r * Math.sin(phi)];

function answer({ lengths, bars = {}, effects = {} }, theta, omega, alpha, branch) {
  const { ground: d, input: a, coupler: b, output: c, ground_angle = 0 } = lengths;
  const field = polar(...(effects.gravity ?? [0, 0])), ground = polar(d, ground_angle), r2 = polar(a, theta);
  const gap = add(ground, times(-1, r2)), along = (dot(gap, gap) + b * b - c * c) / (2 * dot(gap, gap));
  const across = branch * Math.sqrt((b * b) / dot(gap, gap) - along * along);
  const r3 = add(times(along, gap), times(across, turned(gap))), r4 = add(r2, r3, times(-1, ground));
  const cross = dot(turned(r4), r3);
  const solve = (known) => [dot(known, r4) / cross, dot(known, r3) / cross];
  const v = turned(r2, omega), [w3, w4] = solve(v);
  const acc = add(turned(r2, alpha), times(-omega * omega, r2));
  const [a3, a4] = solve(add(acc, times(-w3 * w3, r3), times(w4 * w4, r4)));
  const still = [0, 0], motions = [[r2, omega, alpha, still, still], [r3, w3, a3, v, acc], [r4, w4, a4, still, still]];
  let power = 0;
  ["input", "coupler", "output"].forEach((name, i) => {
    const [r, w, w_dot, pin, pin_acc] = motions[i], length = Math.hypot(...r);
    const { mass = 0, inertia = (mass * length * length) / 12, centre = [length / 2, 0] } = bars[name] ?? {};
    const arm = polar(centre[0], Math.atan2(r[1], r[0]) + centre[1]);
    const force = times(mass, add(pin_acc, turned(arm, w_dot), times(-w * w, arm), times(-1, field)));
    power += dot(force, add(pin, turned(arm, w))) + inertia * w_dot * w;
  });
  return [Math.atan2(r3[1], r3[0]), Math.atan2(r4[1], r4[0]), w3, w4, power / omega];
}

createInterface({ input: process.stdin }).on("line", (line) => {
  const { id, ask, scene, command } = JSON.parse(line);
  let reply = { engine: "plain", answers: names, effects: ["gravity"] };
  if (ask === "answer") {
    const rows = command.theta_2.map((t) => answer(scene, t, command.omega_2, command.alpha_2, command.branch));
    reply = { answers: Object.fromEntries(names.map((name, k) => [name, rows.map((row) => row[k])])) };
  }
  console.log(JSON.stringify({ id, ...reply }));
});
