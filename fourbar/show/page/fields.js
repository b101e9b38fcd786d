// ---- the fields of a scene, made from its file ---------------------------------------------------
const ORDER = ["title", "source", "lengths", "pins", "bars", "motion", "drive", "points", "loads", "effects", "tolerances", "picture"];
let offers = null, plain = {}, shape = "", typing = 0;
const fieldId = path => `field:${path.join("/")}`;
const entryAt = (node, path) => path.reduce((inner, step) => inner?.[step], node);
const scalar = value => typeof value !== "object" || value === null;
const LETTERS = { theta: "angle \u03b8", omega: "speed \u03c9", alpha: "acceleration \u03b1" };
const nameOfKey = key => key.replace(/^(theta|omega|alpha)_(\d)$/, (_, letter, n) => LETTERS[letter] + "\u2080\u2081\u2082\u2083\u2084"[n]).replaceAll("_", " ");
// The name of the entry at a path as it is written beside it: one of a list has the name of the list and its number.
function labelOf(path) {
  const key = path[path.length - 1], holder = path[path.length - 2];
  if (path[0] === "pins" && path.length === 3 || holder === "drawn") return "xy"[key];
  return offers.pairs[holder]?.[key] ?? (typeof key === "number" ? `${nameOfKey(holder).replace(/s$/, "")} ${key + 1}` : nameOfKey(key));
}
// What an entry can be, as rows of value and name; undefined where it is not one of a few.
function choicesOf(path) {
  const key = path[path.length - 1], moving = path[0] === "loads" || path[1] === "flywheel" || path[0] === "drive" && path.length === 2;
  if (key === "bar") return Object.entries(offers.bars).slice(moving ? 1 : 0);
  return offers.words[key]?.map(word => [word, word]);
}
// What is commanded: theta_2 to theta_4, or the stroke of a cylinder.
function commanded() {
  const stated = Object.keys(plain.motion ?? {});
  if (stated.some(key => key.startsWith("stroke") || key === "side")) return "stroke";
  const bar = stated.map(key => /^(?:theta|omega|alpha)_([34])$/.exec(key)?.[1]).find(Boolean) ?? Object.keys(plain.motion?.law ?? {}).map(key => /^theta_([34])$/.exec(key)?.[1]).find(Boolean);
  return `theta_${bar ?? 2}`;
}
const without = (table, left) => Object.fromEntries(Object.entries(table).filter(([key]) => key !== left));
// The empty fields of a table: those that apply beside what is stated.
function fieldsAt(path, example) {
  if (!path.length) return without(example, plain.pins ? "lengths" : "");   // the pins state lengths and assembly
  if (path.length !== 1) return example;
  if (path[0] === "drive" && plain.drive?.from) return {};
  if (path[0] !== "motion") return example;
  const every = offers.commands[commanded()].fields, fields = plain.pins ? without(every, "branch") : every;
  return plain.motion?.law ? Object.fromEntries(Object.entries(fields).filter(([key]) => key === "branch")) : fields;
}
function commandField() {
  const input = element("select", { id: "command" }, ...Object.entries(offers.commands).filter(([key]) => key !== "stroke" || plain.drive?.from).map(([key, { label }]) => new Option(label, key, false, key === commanded())));
  input.addEventListener("change", () => ask({ do: "command", command: input.value, theta_2: grid[row] }, null, grid[row]));
  return element("label", { className: "field long" }, "commanded", input);
}
const element = (name, attributes = {}, ...inner) => {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) if (key in made) made[key] = value; else made.setAttribute(key, value);
  made.append(...inner);
  return made;
};

function field(path, value, example) {
  const key = path[path.length - 1], words = choicesOf(path), id = fieldId(path);
  const needed = key === "side" || key === "bar" && example === undefined, without = `(${words?.find(([word]) => word === String(example))?.[1] ?? "left out"})`;
  const input = words ? element("select", { id }, ...needed ? [] : [new Option(without, "")], ...words.map(([word, name]) => new Option(name, word))) : element("input", { id, placeholder: example ?? "", spellcheck: false, autocomplete: "off" });
  input.value = value ?? "";
  input.setAttribute("aria-describedby", `${id}!`);
  let gesture = "";
  input.addEventListener("focus", () => { gesture = `type:${id}:${++typing}`; });
  input.addEventListener("blur", () => {
    if (!unsettled(input)) input.value = entryAt(plain, path) ?? "";
    widen(input);
  });
  const changed = () => ask({ do: "set", path, value: input.value, gesture }, path);
  input.addEventListener("input", changed);
  const by = (direction, event) => {
    const next = stepped(input.value || input.placeholder, direction, event.shiftKey);
    if (words || next === null) return;
    event.preventDefault();
    input.value = next;
    changed();
  };
  input.addEventListener("keydown", event => {
    if (event.key === "ArrowUp" || event.key === "ArrowDown") by(event.key === "ArrowUp" ? 1 : -1, event);
    if (event.key === "Escape") restore(input);
  });
  input.addEventListener("wheel", event => { if (document.activeElement === input) by(event.deltaY < 0 ? 1 : -1, event); }, { passive: false });
  const made = element("label", { className: "field" }, labelOf(path), input, element("span", { id: `${id}!`, className: "warning", hidden: true }));
  widen(input);
  return made;
}

// A value that half the width would cut off has the whole: 98.595131725659 in without its unit says little.
const HALF = 14;   // characters that half the width shows
function widen(input) {
  const whole = ["title", "source"].some(name => input.id === fieldId([name])) || input.value.length > HALF;
  input.parentElement.classList.toggle("long", whole);
}

// A number a hundredth larger or smaller, in round steps; the unit stays. Null where there is no number.
function stepped(text, direction, coarse) {
  const found = /^\s*([+-]?\d*\.?\d+(?:e[+-]?\d+)?)(.*)$/i.exec(text);
  if (!found) return null;
  const value = Number(found[1]), whole = !found[2].trim() && Number.isInteger(value);
  const size = (coarse ? 10 : 1) * (whole ? 1 : value ? 10 ** (Math.floor(Math.log10(Math.abs(value)) + 1e-9) - 2) : 1);
  const digits = Math.max((found[1].split(".")[1] ?? "").length, -Math.floor(Math.log10(size) + 1e-9), 0);
  return (value + direction * size).toFixed(Math.min(digits, 15)) + found[2];
}

const TEXT = ["file", "text"];   // in place of the path of an entry: the whole file
function refuse(path, words) {
  const input = path === TEXT ? byId("file-text") : path && document.getElementById(fieldId(path)), place = input && path !== TEXT ? document.getElementById(`${fieldId(path)}!`) : byId("refused");
  if (input) input.setAttribute("aria-invalid", String(words !== ""));
  place.textContent = words;
  place.hidden = words === "";
  if (words) byId("undo").disabled = false;   // it takes the entry back
}

// Whether what a field says is no state yet: it was refused, or the answer is on its way.
function unsettled(input) {
  const asked = [inFlight, ...waiting].some(own => own?.path && own.path !== TEXT && fieldId(own.path) === input.id);
  return asked || input.getAttribute("aria-invalid") === "true";
}

// What a field says in the last good state.
function restore(input) {
  const path = input.id === "file-text" ? TEXT : entryPath(input);
  input.value = path === TEXT ? fileText : entryAt(plain, path) ?? "";
  refuse(path, "");
}
const entryPath = input => input.id.slice(6).split("/").map((step, n, all) => /^\d+$/.test(step) && Array.isArray(entryAt(plain, all.slice(0, n))) ? Number(step) : step);

function group(path, node, example) {
  example = fieldsAt(path, example);
  const box = element("div", { className: "group" }, ...path.length === 1 && path[0] === "motion" ? [commandField()] : []);
  const keys = Array.isArray(node) ? node.keys() : new Set([...(path.length ? [] : ORDER), ...Object.keys(node ?? {}), ...Object.keys(example ?? {})]);
  for (const key of keys) {
    const inner = node?.[key], own = [...path, key], model = scalar(example) ? undefined : example[key];
    if (scalar(inner ?? model) && (inner ?? model) !== undefined) box.append(field(own, inner, model));
    else if (path.length || inner !== undefined || model !== undefined || partsAt(own).length) box.append(branchOf(own, inner, model));
  }
  for (const part of partsAt(path)) box.append(part);
  if (offers.pairs[path[path.length - 1]]?.[0] === "distance") {   // a place, stated in one of two ways
    const by = Array.isArray(node) ? "xy" : "polar", other = element("button", { type: "button", className: "take", textContent: by === "xy" ? "By x and y" : "By distance and angle" });
    other.addEventListener("click", () => ask({ do: "restate", path, by }));
    box.append(other);
  }
  if ((path.length > 1 || path[0] === "drive" && node?.from) && entryAt(plain, path) !== undefined && !(["bars", "pins"].includes(path[0]) && path.length === 2) && !["from", "to"].includes(path[path.length - 1])) {
    const take = element("button", { type: "button", className: "take", textContent: `Remove ${path.slice(path.length > 2 ? -2 : -1).map((_, n, last) => labelOf(path.slice(0, path.length - last.length + n + 1))).join(", ")}` });
    take.addEventListener("click", () => ask({ do: "remove", path }));
    box.append(take);
  }
  return box;
}

// A table of the file: its name opens and closes it, which is the index of entries where the page is narrow.
function branchOf(path, node, model) {
  const inner = group(path, node, scalar(model) ? {} : model);
  if (path.length > 1) return element("fieldset", { className: "group" }, element("legend", {}, labelOf(path)), inner);
  const made = element("details", { className: "table" }, element("summary", {}, labelOf(path)), inner);
  made.open = opened[path[0]] ?? (window.innerWidth > 860 || path[0] === "lengths");
  made.addEventListener("toggle", () => { opened[path[0]] = made.open; });
  return made;
}
const opened = {};   // tables that were opened or closed by hand

const nextPoint = () => ["P", "Q", "R", "S"].find(letter => !(letter in (plain.points ?? {}))) ?? "T";
// Buttons for what can be added here.
function partsAt(path) {
  const rows = offers.parts.map((part, n) => [part, n]).filter(([{ at }]) => at.length === path.length + 1 && path.every((step, k) => at[k] === step));
  const free = rows.filter(([{ at }]) => {
    const last = at[at.length - 1], inner = entryAt(plain, at);
    if (last === "drive") return !plain.drive?.from;
    if (path[0] === "motion" && commanded() !== "theta_2") return false;
    return last === -1 || last === "" ? path.length === 1 || entryAt(plain, path) !== undefined : path.length === 2 && path[0] === "effects" ? entryAt(plain, path) !== undefined && inner === undefined : inner === undefined || (at[0] === "motion" && last === "theta_2" && scalar(inner));
  });
  if (!free.length) return [];
  const made = element("div", { className: "parts" });
  for (const [{ at, label }, n] of free) {
    const last = at[at.length - 1], button = element("button", { type: "button", textContent: `+ ${label ?? nameOfKey(last)}` });
    let name = null;
    if (last === "") {
      name = path[0] === "tolerances" ? element("select", { className: "tolerated" }, ...tolerated()) : element("input", { value: nextPoint(), spellcheck: false });
      made.append(element("label", { className: "field" }, path[0] === "tolerances" ? "number" : "name", name));
    }
    button.addEventListener("click", () => ask({ do: "add", part: n, name: name?.value ?? "" }));
    made.append(button);
  }
  return [made];
}

let keysOfScene = [];   // of its numbers, as tolerances name them
const tolerated = () => keysOfScene.map(key => new Option(key, key, false, key === "lengths.input"));

// Build the fields anew where the file has other entries than before; otherwise only their values.
function showFields() {
  for (const list of byId("fields").querySelectorAll(".tolerated")) if (list.length !== keysOfScene.length) list.replaceChildren(...tolerated());
  const outline = (node, path) => scalar(node) ? path.join("/") : Object.keys(node).map(key => outline(node[key], [...path, key])).join();
  const now = outline(plain, []);
  if (now !== shape) {
    const focused = document.activeElement?.id, open = shape !== "";
    const refused = [...byId("fields").querySelectorAll("[aria-invalid=true]")].map(input => [input.id, input.value, document.getElementById(`${input.id}!`)?.textContent]);
    shape = now;
    byId("fields").replaceChildren(group([], plain, offers.fields));
    for (const [id, value, words] of refused) {
      const input = document.getElementById(id);
      if (input) { input.value = value; refuse(entryPath(input), words); }
    }
    if (open && focused) document.getElementById(focused)?.focus();
  }
  for (const input of byId("fields").querySelectorAll("[id^='field:']:is(input,select)")) {
    if (input === document.activeElement && !input.dataset.follows || unsettled(input)) continue;
    const value = entryAt(plain, entryPath(input));
    if (scalar(value ?? null) && input.value !== String(value ?? "")) input.value = value ?? "";
    widen(input);
  }
}
