// ---- the fields of a scene, made from its file ---------------------------------------------------
const ORDER = ["title", "source", "lengths", "bars", "motion", "drive", "points", "loads", "effects", "tolerances"];
const PAIRS = Object.fromEntries([...["centre", "from_pin", "at"].map(key => [key, ["distance", "angle"]]), ...["force", "gravity"].map(key => [key, ["size", "angle"]])]);
let offers = null, plain = {}, shape = "", typing = 0;
const fieldId = path => `field:${path.join("/")}`;
const entryAt = (node, path) => path.reduce((inner, step) => inner?.[step], node);
const scalar = value => typeof value !== "object" || value === null;
const nameOfKey = key => typeof key === "number" ? String(key + 1) : key.replace(/^(theta|omega|alpha)_(\d)$/, (_, letter, n) => ({ theta: "\u03b8", omega: "\u03c9", alpha: "\u03b1" })[letter] + "\u2080\u2081\u2082\u2083\u2084"[n]).replaceAll("_", " ");
const element = (name, attributes = {}, ...inner) => {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) if (key in made && key !== "list") made[key] = value; else made.setAttribute(key, value);
  made.append(...inner);
  return made;
};

function field(path, value, example) {
  const key = path[path.length - 1], words = offers.words[key], id = fieldId(path), long = ["title", "source"].includes(key);
  const input = words ? element("select", { id }, ...["", ...words].map(word => new Option(word || `(${example ?? "left out"})`, word))) : element("input", { id, placeholder: example ?? "", spellcheck: false, autocomplete: "off" });
  input.value = value ?? "";
  input.setAttribute("aria-label", path.map(nameOfKey).join(" "));
  input.setAttribute("aria-describedby", `${id}!`);
  let gesture = "";
  input.addEventListener("focus", () => { gesture = `type:${id}:${++typing}`; });
  input.addEventListener("blur", () => { if (input.getAttribute("aria-invalid") !== "true") input.value = entryAt(plain, path) ?? ""; });
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
  const shown = PAIRS[path[path.length - 2]]?.[key] ?? nameOfKey(key);
  return element("label", { className: long ? "field long" : "field" }, shown, input, element("span", { id: `${id}!`, className: "warning", hidden: true }));
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
}

// What a field says in the last good state.
function restore(input) {
  const path = input.id === "file-text" ? TEXT : entryPath(input);
  input.value = path === TEXT ? fileText : entryAt(plain, path) ?? "";
  refuse(path, "");
}
const entryPath = input => input.id.slice(6).split("/").map((step, n, all) => /^\d+$/.test(step) && Array.isArray(entryAt(plain, all.slice(0, n))) ? Number(step) : step);

function group(path, node, example) {
  const box = element("div", { className: "group" });
  const keys = Array.isArray(node) ? node.keys() : new Set([...(path.length ? [] : ORDER), ...Object.keys(node ?? {}), ...Object.keys(example ?? {})]);
  for (const key of keys) {
    const inner = node?.[key], own = [...path, key], model = scalar(example) ? undefined : example[key];
    if (scalar(inner ?? model) && (inner ?? model) !== undefined) box.append(field(own, inner, model));
    else if (path.length || inner !== undefined || model !== undefined || partsAt(own).length) box.append(branchOf(own, inner, model));
  }
  for (const part of partsAt(path)) box.append(part);
  if ((path.length > 1 || path[0] === "drive" && node?.from) && entryAt(plain, path) !== undefined && !(path[0] === "bars" && path.length === 2)) {
    const name = path.map(nameOfKey).join(" "), take = element("button", { type: "button", className: "take", textContent: "Remove", ariaLabel: `Remove ${name}` });
    take.addEventListener("click", () => ask({ do: "remove", path }));
    box.append(take);
  }
  return box;
}

const branchOf = (path, node, model) => element("fieldset", { className: "group" }, element("legend", {}, nameOfKey(path[path.length - 1])), group(path, node, scalar(model) ? {} : model));

// Buttons for what can be added here.
function partsAt(path) {
  const rows = offers.parts.map((part, n) => [part, n]).filter(([{ at }]) => at.length === path.length + 1 && path.every((step, k) => at[k] === step));
  const free = rows.filter(([{ at }]) => {
    const last = at[at.length - 1], inner = entryAt(plain, at);
    if (last === "drive") return !plain.drive?.from;
    return last === -1 || last === "" ? path.length === 1 || entryAt(plain, path) !== undefined : path.length === 2 && path[0] === "effects" ? entryAt(plain, path) !== undefined && inner === undefined : inner === undefined || (at[0] === "motion" && last === "theta_2" && scalar(inner));
  });
  if (!free.length) return [];
  const made = element("div", { className: "parts" });
  for (const [{ at, label }, n] of free) {
    const last = at[at.length - 1], button = element("button", { type: "button", textContent: `+ ${label ?? nameOfKey(last)}` });
    let name = null;
    if (last === "") {
      name = element("input", { value: path[0] === "points" ? ["P", "Q", "R", "S"].find(letter => !(letter in (plain.points ?? {}))) ?? "T" : "lengths.input", list: path[0] === "tolerances" ? "keys" : "", spellcheck: false });
      name.setAttribute("aria-label", `name of the ${label}`);
      made.append(name);
    }
    button.addEventListener("click", () => ask({ do: "add", part: n, name: name?.value ?? "" }));
    made.append(button);
  }
  return [made];
}

// Build the fields anew where the file has other entries than before; otherwise only their values.
function showFields() {
  const outline = (node, path) => scalar(node) ? path.join("/") : Object.keys(node).map(key => outline(node[key], [...path, key])).join();
  const now = outline(plain, []);
  if (now !== shape) {
    const focused = document.activeElement?.id, open = shape !== "";
    shape = now;
    byId("fields").replaceChildren(group([], plain, offers.fields), element("datalist", { id: "keys" }));
    if (open && focused) document.getElementById(focused)?.focus();
  }
  for (const input of byId("fields").querySelectorAll("input[id],select[id]")) {
    if (input === document.activeElement && !input.dataset.follows) continue;
    const value = entryAt(plain, entryPath(input));
    if (!scalar(value ?? null) || input.value === String(value ?? "")) continue;
    input.value = value ?? "";
    input.removeAttribute("aria-invalid");
    const place = document.getElementById(`${input.id}!`);
    if (place) place.hidden = true;
  }
}
