// ---- motion --------------------------------------------------------------------------------
let draw = (position = row) => {
  const i = Math.round(position), low = Math.floor(position), share = position - low;
  let p = at(i);
  if (share > 0 && p && at(low) && at(low + 1)) {   // between two positions while it plays: the picture moves on, the numbers stay those of the nearest
    const [one, next] = [at(low), at(low + 1)];
    p = posed(...["theta2", "theta3", "theta4"].map(name => one[name] + share * (next[name] - one[name])));
  }
  drawLinkage(p, i);
  showNumbers(i);
  showSpreads(i);
  moveCursor(i);
};

function stretch(i) {   // the positions around i that assemble without a gap
  let first = i, last = i;
  while (first > 0 && at(first - 1)) first--;
  while (last < grid.length - 1 && at(last + 1)) last++;
  return [first, last];
}
const turnsFully = () => axis().factor === DEG && Math.abs(axis().values[grid.length - 1] - axis().values[0] - TURN) < 1e-6 && grid.every((_, i) => at(i));

let run = null;
function play(on) {
  playing = on && grid.length > 1;
  if (playing) {
    if (!at(row)) row = grid.findIndex((_, i) => at(i));
    if (row < 0) { row = 0; playing = false; return; }
    run = { bounds: stretch(row), wraps: turnsFully() };
    if (timed()) {   // once through; from the end it starts anew
      direction = 1;
      if (row === run.bounds[1]) row = run.bounds[0];
    }
    if (run.bounds[0] === run.bounds[1]) { playing = false; return; }
    phase = row; lastTime = null;
    requestAnimationFrame(frame);
  } else {
    row = Math.round(phase);
    draw();
  }
  const button = byId("play");
  button.textContent = playing ? "Pause" : "Play";
  button.setAttribute("aria-pressed", String(playing));
}

function frame(time) {
  if (!playing) return;
  const seconds = lastTime === null ? 0 : Math.min(0.1, (time - lastTime) / 1000);
  lastTime = time;
  const [first, last] = run.bounds, span = last - first;
  const whole = timed() ? (data.time[grid.length - 1] - data.time[0]) / data.rate || 1 : SWEEP_SECONDS;   // its length on the screen, s
  phase += direction * seconds * Number(byId("speed").value) * (grid.length - 1) / whole;
  if (timed() && phase >= last) { phase = last; play(false); return; }
  if (run.wraps) phase = first + (((phase - first) % span) + span) % span;
  else {
    if (phase > last) { phase = Math.max(first, 2 * last - phase); direction = -1; }
    if (phase < first) { phase = Math.min(last, 2 * first - phase); direction = 1; }
  }
  row = Math.round(phase);
  if (!still || time - lastDraw > 500) { draw(still ? row : phase); lastDraw = time; }   // reduced motion: two pictures a second
  requestAnimationFrame(frame);
}

function go(i) {
  if (playing) play(false);
  row = Math.min(grid.length - 1, Math.max(0, i));
  phase = row;
  draw();
}
function step(by) {
  const last = grid.length - 1, wraps = turnsFully();
  let next = (playing ? Math.round(phase) : row) + by;
  if (wraps && next > last) next = 1;        // the first and the last position are the same
  if (wraps && next < 0) next = last - 1;
  go(next);
}

// ---- branch, reset ---------------------------------------------------------------------------
function nearest(theta) {
  let best = 0, distance = Infinity;
  grid.forEach((t, i) => {
    if (t === null) return;
    const away = Math.abs(Math.atan2(Math.sin(t - theta), Math.cos(t - theta)));
    if (away < distance) { best = i; distance = away; }
  });
  return best;
}

// What speed 1 means, and whether positions were left out.
function pace() {
  if (timed()) return data.pace;
  const { name, values } = axis(), turned = Math.abs(values[values.length - 1] - values[0]), words = [`At speed 1\u00d7 one sweep takes ${SWEEP_SECONDS} s`];
  const speed = name === data.over.name ? data.over.speed : 0, [symbol, si] = name === "stroke" ? ["stroke speed", "m/s"] : [AXES[name][1].replace("\u03b8", "\u03c9"), "rad/s"];
  if (speed) words[0] += `; at ${symbol} = ${rounded(inUnit(si, speed), 4)} ${nameOf(si)} the mechanism takes ${rounded(turned / Math.abs(speed), 3)} s`;
  if (data.positions > grid.length) words.push(`Shown are ${grid.length} of the ${data.positions} positions`);
  return words.join(". ") + ".";
}

// The scene file of what is shown: on another branch where one was chosen.
const sceneFile = () => branch === data.branch ? data.toml : data.toml.replace(/^branch = .*$/m, `branch = "${branch === 1 ? "open" : "crossed"}"`);

const SINES = { theta_2: "|sin(\u03b8\u2084 \u2212 \u03b8\u2083)|", theta_3: "|sin(\u03b8\u2084 \u2212 \u03b8\u2082)|", theta_4: "|sin(\u03b8\u2083 \u2212 \u03b8\u2082)|", stroke: "sine of its bar times lever" };
function refresh() {
  showDimensions();
  byId("type").textContent = data.type;
  byId("pace").textContent = pace();
  byId("theta").max = grid.length - 1;
  byId("theta").disabled = grid.length < 2;
  byId("branch").parentElement.hidden = byId("branch-key").hidden = oneBranch();
  const [what, symbol] = AXES[axis().name];
  byId("axis").textContent = `${what} ${symbol}`;
  byId("over").textContent = timed() ? "Over time" : `Over ${symbol}`;
  byId("sine").textContent = SINES[data.over.commanded];
  const needed = { driven: "torque", pushed: "drive_force", stroked: "stroke", erring: "torque_error", energy: "energy" };
  for (const [kind, name] of Object.entries(needed)) for (const element of document.querySelectorAll(`.${kind}`)) element.hidden = !shows(name);
  for (const element of document.querySelectorAll(".dynamic")) element.hidden = !dynamic();
  byId("show-forces").disabled = byId("arrow-scale").disabled = !dynamic();
  fit();
  drawChart();
  drawBands();
  draw();
}

const shown = value => Number((value * unit.factor).toPrecision(12));
function reset() {
  if (playing) play(false);
  branch = data.branch;
  byId("branch").value = branch;
  direction = data.over.speed < 0 ? -1 : 1;
  row = phase = data.start;
  refresh();
}
function toggle(id) {
  const box = byId(id);
  if (!box.disabled) { box.checked = !box.checked; box.dispatchEvent(new Event("change")); }
}
// Whether there is no other branch to choose: the motion has one, or it is a field of the scene, as in the workbench.
const oneBranch = () => single() || lineAddress !== "";
function chooseBranch(value) {
  if (oneBranch()) return;
  const wasPlaying = playing;
  if (playing) play(false);
  branch = value;
  byId("branch").value = value;
  refresh();
  if (wasPlaying) play(true);
}

byId("play").addEventListener("click", () => play(!playing));
byId("back").addEventListener("click", () => step(-1));
byId("forward").addEventListener("click", () => step(1));
byId("reset").addEventListener("click", reset);
byId("theta").addEventListener("input", event => go(Number(event.target.value)));
byId("branch").addEventListener("change", event => chooseBranch(Number(event.target.value)));
byId("quantity").addEventListener("change", () => { drawChart(); moveCursor(row); });
byId("arrow-scale").addEventListener("change", () => { scaleForces(); draw(playing ? phase : row); });
for (const name of ["labels", "acting", "v", "a", "dimensions", "centres", "curve", "forces", "pictures"]) byId(`show-${name}`).addEventListener("change", () => { showDimensions(); scaleForces(); draw(playing ? phase : row); });
document.addEventListener("keydown", event => {
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  const own = event.target.closest("button, select, input, a");   // controls keep their own keys
  if (!own) {
    const action = { " ": () => play(!playing), ArrowRight: () => step(1), ArrowLeft: () => step(-1), Home: reset }[event.key];
    if (action) { event.preventDefault(); action(); return; }
  }
  if (event.target === picture) {
    const action = { b: () => chooseBranch(-branch), f: () => toggle("show-forces"), m: () => toggle("show-centres"), c: () => toggle("show-curve"), l: () => toggle("show-labels") }[event.key.toLowerCase()];
    if (action) { event.preventDefault(); action(); }
  }
});
new ResizeObserver(() => { if (Math.max(280, picture.parentElement.clientWidth) !== view.width) refresh(); }).observe(picture.parentElement);

// The bars as a sheet lists them: about G the inertia, from the first pin the place of G along the bar and to its left.
const BAR_NAMES = { 1: "ground", 2: "input", 3: "coupler", 4: "output" };
// An inertia has the units of mass and length where the mass has one of its own, as in pounds and inches.
function inertiaUnit() {
  const mass = data.units.kg;
  return mass ? [`${mass[0]} ${unit.name}\u00b2`, mass[1] * unit.factor ** 2] : ["kg m\u00b2", 1];
}
function listBars() {
  const body = byId("bars").querySelector("tbody"), [inertiaName, inertiaFactor] = inertiaUnit();
  body.replaceChildren();
  byId("inertia-unit").textContent = inertiaName;
  for (const k of [1, 2, 3, 4]) {
    const line = body.insertRow(), [mass, inertia] = data.bars[k] ?? [null, null], centre = data.centres[k];
    const heading = document.createElement("th");
    heading.scope = "row";
    heading.textContent = `${k} ${BAR_NAMES[k]}`;
    line.append(heading);
    const place = centre ? centre.map(z => text(z * unit.factor)).join(", ") : "\u2013";
    const shownMass = text(inUnit("kg", mass)), shownInertia = text(inertia === null ? null : inertia * inertiaFactor);
    for (const shownText of [text(lengths[k - 1] * unit.factor), shownMass, shownInertia, place]) line.insertCell().textContent = shownText;
  }
}

// A printed page is a sheet: the linkage stands still, and each bar shows its length.
let dimensioned = false;
window.addEventListener("beforeprint", () => {
  if (playing) play(false);
  dimensioned = byId("show-dimensions").checked;
  if (!dimensioned) toggle("show-dimensions");
});
window.addEventListener("afterprint", () => { if (!dimensioned) toggle("show-dimensions"); });

// What of the page depends on the data: names, units, and what there is to show.
function furnish() {
  ceilings = {};
  QUANTITIES = quantitiesOf();
  furnishTolerances();
  listBars();
  byId("drive").textContent = data.drive_bar;
  for (const element of document.querySelectorAll("[data-unit]")) element.textContent = nameOf(element.dataset.unit);
  byId("branch").value = branch;
  for (const element of document.querySelectorAll(".unit")) element.textContent = unit.name;
  [...byId("branch").options].forEach((option, n) => { option.textContent = ["open", "crossed"][n]; });
  const hide = (id, hidden) => { byId(id).parentElement.hidden = hidden; };
  hide("show-pictures", !Object.keys(data.pictures).length);
  hide("show-centres", !Object.values(data.centres).some(Boolean));
  for (const element of document.querySelectorAll(".moving")) element.hidden = !("omega_3" in table());
  hide("show-acting", !data.acting.length);
  hide("show-forces", !dynamic());
  hide("arrow-scale", !dynamic());
  byId("download").hidden = data.toml === null;
  for (const [k, source] of Object.entries(data.pictures)) {
    if (parts.image[k].getAttribute("href") === source) continue;
    const probe = new Image();
    probe.onload = () => { parts.image[k].ratio = probe.naturalHeight / probe.naturalWidth; draw(playing ? phase : row); };
    parts.image[k].setAttribute("href", source);
    probe.src = source;
  }
}
for (const letter of "va") byId(`show-${letter}`).checked = data.vectors;
if (dynamic()) {   // one scale for all positions, unless most arrows would then be too short to see
  const sizes = FORCES.flatMap(name => table()[name].map(f => f[0] === null ? NaN : Math.hypot(f[0], f[1]))).filter(Number.isFinite).sort((x, y) => x - y);
  const most = ceiling(sizes);
  if (most.cut || sizes[Math.floor(0.5 * sizes.length)] < 0.1 * most.top) byId("arrow-scale").value = "position";
}
byId("download").addEventListener("click", event => {
  event.target.href = URL.createObjectURL(new Blob([sceneFile()], { type: "application/toml" }));
});
chart.addEventListener("click", event => {   // a click on the curve sets the position
  const at = (event.clientX - chart.getBoundingClientRect().left) * chart.viewBox.baseVal.width / chart.clientWidth;
  const away = plotted.over.map(t => Math.abs(plotted.x(t) - at));
  go(away.indexOf(Math.min(...away)));
});
furnish();
refresh();
