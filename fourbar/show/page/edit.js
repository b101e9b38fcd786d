// ---- the line to the formulas: requests one at a time, of a gesture only the latest -----------------
const waiting = [], latencies = [];
let line = null, inFlight = null, asked = 0, greeted = false, goal = null;
const me = Math.random().toString(36).slice(2);

function ask(request, path = null, theta = null) {
  const last = waiting[waiting.length - 1];
  if (request.gesture && last?.request.gesture === request.gesture) waiting.pop();
  waiting.push({ request, path, theta, since: performance.now() });
  pump();
}
function pump() {
  while (waiting[0]?.request.do === "undo" && dropRefused()) waiting.shift();
  if (inFlight || !waiting.length || line?.readyState !== WebSocket.OPEN || !greeted) return;
  inFlight = waiting.shift();
  inFlight.request.id = `${me}:${++asked}`;
  line.send(JSON.stringify(inFlight.request));
}

// An entry that was refused is no state of the history: undo takes it back and leaves the last good state.
function dropRefused() {
  const refused = document.querySelector(".editor [aria-invalid=true]");
  if (inFlight || !refused) return false;
  restore(refused);
  return true;
}

let cut = null;   // since when there is no line to the server
function connect() {
  line = new WebSocket(lineAddress);
  line.binaryType = "arraybuffer";
  line.addEventListener("open", () => {
    greeted = true; cut = null;
    if (inFlight) { waiting.unshift(inFlight); inFlight = null; }
    waiting.unshift({ request: { do: "hello" }, path: null, theta: null, since: performance.now() });
    pump();
  });
  line.addEventListener("message", event => take(unpacked(event.data)));
  line.addEventListener("close", () => {
    greeted = false; cut ??= Date.now();
    say(`The server has stopped. The state is kept in ${fileName}.edit: to go on from it, run fourbar edit ${fileName} and use the page that it opens.`, true);
    setTimeout(connect, Date.now() - cut < 120000 ? 1000 : 30000);
  });
}
let fileName = "SCENE", fileText = "";

// JSON and its columns of doubles, as fourbar.edit.exports packs them; NaN is null as in a saved page.
function unpacked(buffer) {
  const long = new DataView(buffer).getUint32(0, true), about = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, long)));
  let offset = 4 + long;
  const number = x => Number.isFinite(x) ? x : null;
  for (const [sign, name, count, vector] of about.columns ?? []) {
    const doubles = new Float64Array(buffer, offset, count * vector);
    about.data.branches[sign][name] = vector === 1 ? Array.from(doubles, number) : Array.from({ length: count }, (_, i) => [number(doubles[2 * i]), number(doubles[2 * i + 1])]);
    offset += 8 * count * vector;
  }
  return about;
}

function say(words, warn = false) {
  byId("bench").textContent = words;
  byId("bench").className = warn ? "warning" : "hint";
}

function take(about) {
  const own = inFlight && about.for === inFlight.request.id ? inFlight : null;
  if (own) inFlight = null;
  if (about.check) showCheck(about.check);
  if (about.compared) { keptData = about; compareAnew(); }
  if (about.offers) { sketchAgain ||= about.fresh && !offers; offers = about.offers; fileName = about.file; shape = ""; }
  if (about.refused !== undefined) refuse(own?.request.do === "text" ? TEXT : own?.path ?? null, about.refused);
  else if (own) { refuse(own.path, ""); refuse(null, ""); if (own.request.do === "text") refuse(TEXT, ""); }
  if (about.ask) { byId("ask").firstElementChild.textContent = about.ask; byId("ask").hidden = false; }
  if (about.data && !about.compared && !(about.settled && (inFlight || waiting.length))) show(about, own);
  if (about.tolerances && data.summary) { data.tolerances = about.tolerances; furnishTolerances(); drawBands(); showSpreads(row); }
  if (about.note) say(about.note);
  byId("exported").textContent = own?.request.do === "export" ? about.note ?? about.refused : "";
  if (about.bodies) { byId("bodies-picture").src = about.bodies; byId("bodies-picture").hidden = false; }
  if (own && about.data) {
    const spent = performance.now() - own.since;
    requestAnimationFrame(() => latencies.push([spent, performance.now() - own.since]));
  }
  pump();
}

let keptData = null;
// The curves behind are those of the same formulas, in the units of now.
function compareAnew() {
  const shown = data, at = row;
  adopt(keptData.data); furnish();
  reference = captured(keptData.compared);
  adopt(shown); furnish();
  row = phase = at;
}

function show(about, own) {
  const ofPins = about.data.drawn !== null && own && (own.request.do === "draw" || typeof own.request.what === "string");   // they are dragged at the position that is drawn
  const theta = ofPins ? about.data.drawn : own?.theta ?? grid[row], same = about.data.theta_2.length === grid.length && about.data.theta_2[0] === grid[0] && about.data.theta_2[grid.length - 1] === grid[grid.length - 1];
  const keep = row;
  adopt(about.data);
  if (holding?.what === "O2" && own?.request.what === "O2") Object.assign(view, moved(holding.from, own.request.to));   // the others stay
  unchanged = !about.changed;
  row = same && own?.theta == null && !ofPins ? keep : single() && own?.request.do !== "command" ? Math.min(keep, grid.length - 1) : nearest(theta);
  if (!playing) phase = row;
  furnish();
  refresh();
  if (playing) { run = { bounds: stretch(row), wraps: turnsFully() }; if (run.bounds[0] === run.bounds[1]) play(false); }
  plain = about.plain; keysOfScene = Object.keys(about.keys);
  if (offers) showFields();
  if ([fileText, about.text].includes(byId("file-text").value) || own?.request.do === "text") byId("file-text").value = about.text;   // a draft stays
  fileText = about.text;
  showUnits(about.units);
  byId("pressure").parentElement.hidden = !about.plain.drive?.from;
  if (document.activeElement !== byId("pressure")) byId("pressure").value = about.pressure;
  byId("undo").disabled = !about.undo; byId("redo").disabled = !about.redo;
  byId("reference").replaceChildren(...about.kept.map(name => new Option(name, name, false, name === about.reference)));
  document.querySelector("h1").textContent = document.title = about.plain.title || "Four-bar linkage";
  document.querySelector(".source").textContent = about.plain.source ?? "";
  byId("measure").hidden = byId("place").parentElement.hidden = !data.traced;
  byId("computing").hidden = "summary" in about.data;
  showStrip();
  if (about.data.summary) byId("summary").replaceChildren(...about.data.summary.map(lineOf));
  if (about.saved !== undefined) say(about.saved ? `${fileName} is saved` : `${fileName}: not saved yet; kept in ${fileName}.edit`);
  else if (own && own.request.do !== "hello") say(`${fileName}: changed`);
  showPositions();
  isFresh = about.fresh;
  if (sketchAgain && own && (own.request.do === "hello" || own.request.path?.[0] === "picture")) beginSketch();
}

// A line of what is printed: one of a table keeps its columns, any other breaks.
function lineOf(line) {
  const shown = element("div", { textContent: line || "\u00a0" });
  if (/^ {20,}\S|\S {2,}\S.* {2,}\S|\u2500/.test(line)) shown.className = "columns";
  return shown;
}

// ---- the strip beside the drawing: the largest numbers -----------------------------------
let typeBefore = null;
function showStrip() {
  byId("strip").textContent = data.headline;
  if (typeBefore && typeBefore !== data.type) {
    byId("type-change").textContent = `The type has changed from ${typeBefore} to ${data.type}.`;
    byId("type-change").hidden = false;
  }
  typeBefore = data.type;
}

// ---- the table of positions --------------------------------------------------------------------------
const COLUMNS = ["torque", "torque_error", "drive_force", "drive_force_error", "power", ...FORCES, "transmission"];
const LABELS = { torque_error: ["error bar", "N m"], torque: ["torque", "N m"], power: ["power", "W"], drive_force: ["drive force", "N"], drive_force_error: ["error bar", "N"], transmission: ["transmission angle", "rad"] };
function showPositions() {
  const body = byId("positions").tBodies[0], t = table(), names = COLUMNS.filter(name => name in t);
  if (!byId("table-of").open) return;
  const factor = si => si === "rad" ? DEG : inUnit(si, 1), unitName = si => si === "rad" ? "deg" : nameOf(si);
  const heads = ["\u03b8\u2082, deg", ...single() ? [`${AXES[data.over.name].join(" ").toLowerCase()},${axis().factor === DEG ? " deg" : axis().sign}`] : [], ...names.map(name => LABELS[name] ? `${LABELS[name][0]}, ${unitName(LABELS[name][1])}` : `|${typeset(name)}|, ${nameOf("N")}`)];
  byId("positions").tHead.replaceChildren(element("tr", {}, ...heads.map(head => element("th", { scope: "col", textContent: head }))));
  const every = Number(byId("every").value), rows = grid.map((_, i) => i).filter(i => i % every === 0 || i === grid.length - 1);
  while (body.rows.length > rows.length) body.deleteRow(-1);
  rows.forEach((i, n) => {
    const at = body.rows[n] ?? rowOf(body);
    at.dataset.row = i;
    const here = valuesAt(i);
    const texts = names.map(name => ranged(here, name, v => Array.isArray(v) ? text(v[0] === null ? null : inUnit("N", Math.hypot(...v))) : text(v === null ? null : v * factor(LABELS[name][1]), name.endsWith("_error") ? 2 : 5)));
    at.cells[0].firstChild.textContent = grid[i] === null ? "\u2013" : fixed(grid[i] * DEG, 2);
    if (single()) texts.unshift(fixed(axis().values[i] * axis().factor, timed() ? clock : 2));
    while (at.cells.length > texts.length + 1) at.deleteCell(-1);
    texts.forEach((shown, k) => { (at.cells[k + 1] ?? at.insertCell()).textContent = shown; });
  });
  markPosition();
}
function rowOf(body) {
  const made = body.insertRow(), button = element("button", { type: "button" });
  made.insertCell().append(button);
  made.addEventListener("click", () => go(Number(made.dataset.row)));
  return made;
}
function markPosition() {
  for (const one of byId("positions").tBodies[0].rows) one.classList.toggle("here", Number(one.dataset.row) === row);
}

// ---- the harness ---------------------------------------------------------------------------------------
function showCheck(check) {
  byId("stop").hidden = !check.running;
  byId("check").disabled = check.running;
  byId("verdict").hidden = false;
  const state = check.running ? "checking" : check.stopped ? "stopped" : check.status === 0 ? "all hold" : "not all hold, or the check did not run";
  byId("verdict").replaceChildren(...[state, ...check.lines].map(lineOf));
  byId("report").hidden = !check.report;
  byId("report").href = location.href.replace(/[^/]*$/, "report");
}

// ---- buttons and keys ------------------------------------------------------------------------------------
const press = (id, what) => byId(id).addEventListener("click", () => ask(what()));
for (const name of ["undo", "redo", "save", "keep", "check", "stop"]) press(name, () => ({ do: name }));
press("overwrite", () => { byId("ask").hidden = true; return { do: "save", over: true }; });
press("apply", () => ({ do: "text", text: byId("file-text").value }));
press("export", () => ({ do: "export", format: byId("format").value }));
press("bodies", () => ({ do: "bodies", position: timed() ? valuesAt(row)[data.over.commanded] : axis().values[row] }));
byId("reference").addEventListener("change", event => ask({ do: "refer", to: event.target.value }));
const OTHER = "another list";
function showUnits(name) {
  const names = [...offers?.units ?? [], ...offers?.units.includes(name) ? [] : [name]];
  byId("units").replaceChildren(...[...names, OTHER].map(one => new Option(one, one, false, one === name)));
  byId("unit-list").parentElement.hidden = document.activeElement !== byId("unit-list");
}
byId("units").addEventListener("change", event => {
  if (event.target.value !== OTHER) { ask({ do: "units", units: event.target.value }); return; }
  byId("unit-list").parentElement.hidden = false;
  byId("unit-list").focus();
});
byId("unit-list").addEventListener("change", event => ask({ do: "units", units: event.target.value }));
byId("pressure").addEventListener("change", event => ask({ do: "pressure", pressure: event.target.value }));
byId("sketch").addEventListener("click", beginSketch);
byId("every").addEventListener("change", showPositions);
byId("table-of").addEventListener("toggle", showPositions);
document.addEventListener("keydown", event => {
  const key = event.key.toLowerCase();
  if (!(event.ctrlKey || event.metaKey) || !["z", "y", "s"].includes(key)) return;
  event.preventDefault();
  ask({ do: key === "s" ? "save" : key === "y" || event.shiftKey ? "redo" : "undo" });
});
byId("table-of").open = window.innerWidth > 860;
const drawn = draw;
draw = position => { drawn(position); drawTraced(); drawHandles(); markPosition(); };
connect();
