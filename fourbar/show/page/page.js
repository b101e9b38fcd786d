// ---- motion --------------------------------------------------------------------------------
let draw = (position = row) => {
  const i = Math.round(position), low = Math.floor(position), share = position - low;
  let p = at(i);
  if (share > 0 && p && at(low) && at(low + 1)) {   // between two positions while it plays: the picture moves on, the numbers stay those of the nearest
    p = closeLoop(lengths, data.theta_1, grid[low] + share * (grid[low + 1] - grid[low]), signAt(i)) ?? p;
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

// ---- lengths, branch, reset ------------------------------------------------------------------
function gridFor(theta) {   // the sweep of edited lengths: a full turn, or the interval that is at or next after theta
  const intervals = closingIntervals(lengths);
  if (!intervals.length) return null;
  if (intervals[0][1] - intervals[0][0] >= TURN) return Array.from({ length: ROWS + 1 }, (_, i) => i * TURN / ROWS);
  const offset = ([low]) => (((theta - data.theta_1 - low) % TURN) + TURN) % TURN;
  const [low, high] = intervals.find(one => offset(one) <= one[1] - one[0]) ?? intervals[0];
  const inset = Math.min(1 / DEG, 0.01 * (high - low));   // as fourbar does: 1 deg short of the limit positions
  return Array.from({ length: ROWS + 1 }, (_, i) => data.theta_1 + low + inset + i * (high - low - 2 * inset) / ROWS);
}

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
  if (!edited && data.positions > grid.length) words.push(`Shown are ${grid.length} of the ${data.positions} positions`);
  return words.join(". ") + ".";
}

// The scene file of what is shown: other lengths, with the range swept here, and the branch.
function sceneFile() {
  if (!edited && branch === data.branch) return data.toml;
  let file = data.toml;
  Object.values(BAR_NAMES).forEach((name, k) => { file = file.replace(new RegExp(`^${name} = .*$`, "m"), () => `${name} = "${lengths[k]} m"`); });
  if (edited && !single()) {
    const range = `theta_2 = { from = "${grid[0]} rad", to = "${grid[grid.length - 1]} rad", steps = ${grid.length - 1} }`;
    file = file.replace(/^theta_2 = (\[[^\]]*\]|.*)\n/m, "").replace(/^\[motion\]\n/m, () => `[motion]\n${range}\n`);
  }
  return file.replace(/^branch = .*$/m, `branch = "${branch === 1 ? "open" : "crossed"}"`);
}

const SINES = { theta_2: "|sin(\u03b8\u2084 \u2212 \u03b8\u2083)|", theta_3: "|sin(\u03b8\u2084 \u2212 \u03b8\u2082)|", theta_4: "|sin(\u03b8\u2083 \u2212 \u03b8\u2082)|", stroke: "sine of its bar times lever" };
function refresh() {
  showDimensions();
  const type = typeName(lengths), was = typeName(data.lengths);
  byId("type").textContent = type === was ? type : `${type}; with the original lengths ${was}`;
  byId("pace").textContent = pace();
  byId("theta").max = grid.length - 1;
  byId("theta").disabled = grid.length < 2;
  byId("edited").hidden = !edited || !("F12" in table());
  byId("branch").parentElement.hidden = single() && !edited || lineAddress !== "";
  const [what, symbol] = AXES[axis().name];
  byId("axis").textContent = `${what} ${symbol}`;
  byId("over").textContent = timed() ? "Over time" : `Over ${symbol}`;
  byId("sine").textContent = edited ? SINES.theta_2 : SINES[data.over.commanded];
  for (const element of document.querySelectorAll(".driven")) element.hidden = !shows("torque");
  for (const element of document.querySelectorAll(".pushed")) element.hidden = !shows("drive_force");
  for (const element of document.querySelectorAll(".erring")) element.hidden = !shows("torque_error");
  for (const element of document.querySelectorAll(".energy")) element.hidden = !shows("energy");
  byId("original").disabled = !edited;
  for (const element of document.querySelectorAll(".dynamic")) element.hidden = !dynamic();
  byId("show-forces").disabled = byId("arrow-scale").disabled = !dynamic();
  fit();
  drawChart();
  drawBands();
  draw();
}

function readLengths() {
  const theta = grid[row], inputs = [1, 2, 3, 4].map(k => byId(`length-${k}`)), error = byId("length-error");
  const values = inputs.map((input, k) => input.value === String(shown(data.lengths[k])) ? data.lengths[k] : Number(input.value) / unit.factor);
  let message = "";
  inputs.forEach((input, k) => {
    const good = input.value.trim() !== "" && Number.isFinite(values[k]) && values[k] > 0;
    input.setAttribute("aria-invalid", String(!good));
    if (!good) message = "Every length must be a number greater than 0.";
  });
  const longest = Math.max(...values), total = values.reduce((x, y) => x + y, 0);
  if (!message && 2 * longest > total) message = "These bars can never close: the longest exceeds the sum of the other three.";
  error.hidden = !message;
  error.textContent = message;
  if (message) return;
  if (playing) play(false);
  lengths = values;
  const wasSingle = single() && !edited;
  edited = values.some((value, k) => value !== data.lengths[k]);
  const before = row;
  grid = edited ? gridFor(theta) ?? grid : data.theta_2;
  row = phase = single() && !edited && wasSingle ? before : nearest(theta);
  refresh();
}
const shown = value => Number((value * unit.factor).toPrecision(12));

function original() {
  data.lengths.forEach((value, k) => { byId(`length-${k + 1}`).value = shown(value); });
  readLengths();
}
function reset() {
  if (playing) play(false);
  branch = data.branch;
  byId("branch").value = branch;
  direction = data.over.speed < 0 ? -1 : 1;
  original();
  row = phase = data.start;
  draw();
}
function toggle(id) {
  const box = byId(id);
  if (!box.disabled) { box.checked = !box.checked; box.dispatchEvent(new Event("change")); }
}
function chooseBranch(value) {
  if (lineAddress) return;   // there it is a field of the scene
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
byId("original").addEventListener("click", original);
byId("theta").addEventListener("input", event => go(Number(event.target.value)));
byId("branch").addEventListener("change", event => chooseBranch(Number(event.target.value)));
byId("quantity").addEventListener("change", () => { drawChart(); moveCursor(row); });
for (const k of [1, 2, 3, 4]) byId(`length-${k}`).addEventListener("input", readLengths);
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

// What of the page depends on the data: names, units, and what there is to show.
function furnish() {
  ceilings = {};
  QUANTITIES = quantitiesOf();
  furnishTolerances();
  byId("drive").textContent = data.drive_bar;
  for (const element of document.querySelectorAll("[data-unit]")) element.textContent = nameOf(element.dataset.unit);
  byId("branch").value = branch;
  for (const element of document.querySelectorAll(".unit")) element.textContent = unit.name;
  [...byId("branch").options].forEach((option, n) => { option.textContent = ["open", "crossed"][n] + (data.followed && n === (branch === 1 ? 0 : 1) ? " (followed)" : ""); });
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
  data.lengths.forEach((value, k) => { byId(`length-${k + 1}`).value = shown(value); });
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
