// ---- tolerances ------------------------------------------------------------------------------
// On the scene's branch: spreads at this position, their shares, and bands over the motion.
let loose = data.tolerances;
const bands = byId("bands");
let banded = null;
const factorOf = spread => ({ rad: DEG, m: unit.factor }[spread.unit] ?? inUnit(spread.unit, 1));   // lengths as everywhere on the page
const spreadUnit = spread => ({ rad: "deg", m: unit.name }[spread.unit] ?? nameOf(spread.unit));
const spreadsShown = () => loose !== null && branch === data.branch && Object.keys(loose.parts).length > 0;

function cells(row, texts) {
  const line = row.insertRow(), head = document.createElement("th");
  head.scope = "row"; head.textContent = texts[0];
  line.append(head);
  for (const value of texts.slice(1)) line.insertCell().textContent = value;
}

// A number with as many digits as show what its spread changes.
function within(value, spread) {
  if (value === null || !spread) return text(value);
  return text(value, Math.min(12, Math.max(5, 3 + Math.ceil(Math.log10(Math.abs(value / spread)) || 0))));
}

function showSpreads(i) {
  if (!spreadsShown()) return;
  byId("spreads").tBodies[0].replaceChildren();
  for (const [part, s] of Object.entries(loose.parts)) {
    const f = factorOf(s), scaled = name => s[name][i] === null ? null : s[name][i] * f, n = scaled("nominal"), worst = scaled("worst");
    const ends = ["low", "high", "least", "greatest"].map(name => within(n === null || scaled(name) === null ? null : n + scaled(name), worst));
    cells(byId("spreads").tBodies[0], [`${typeset(part)}, ${spreadUnit(s)}`, within(n, worst), text(scaled("deviation"), 3), ends[0], ends[1], `\u00b1${text(worst, 3)}`, ends[2], ends[3]]);
  }
  byId("shares").tBodies[0].replaceChildren();
  loose.keys.forEach((key, k) => {
    const shares = Object.values(loose.parts).map(s => s.shares[k][i]);
    cells(byId("shares").tBodies[0], [key, ...shares.map(share => share === null ? "–" : (100 * share).toFixed(0))]);
  });
  if (banded) set(banded.cursor, { x1: banded.x(banded.over[i]), x2: banded.x(banded.over[i]) });
}

function drawBands() {
  byId("tolerances").hidden = loose === null;
  if (loose === null) return;
  byId("tolerance-note").textContent = [...loose.lines, ...spreadsShown() || !Object.keys(loose.parts).length ? [] : ["They belong to the branch of the scene and are hidden."]].join(". ");
  for (const element of document.querySelectorAll(".spread")) element.hidden = !spreadsShown();
  if (!spreadsShown()) return;
  const s = loose.parts[byId("tolerance-quantity").value], f = factorOf(s), scaled = name => s[name].map(v => v === null ? NaN : v * f);
  const away = Object.fromEntries(["low", "high", "least", "greatest", "worst"].map(name => [name, scaled(name)]));
  const all = Object.values(away).flat().filter(Number.isFinite), limit = ceiling(all), top = limit.top || 1;
  byId("band-unit").textContent = `, ${spreadUnit(s)}`;
  byId("band-note").textContent = limit.cut ? cutNote("band", top, text(Math.abs(peakOf(all)), 3)) : "";
  banded = chartFrame(bands, -top, top);
  const { x, y, over } = banded, inside = v => Math.max(-top, Math.min(top, v));
  const line = values => values.map((v, i) => Number.isFinite(v) ? `${i && Number.isFinite(values[i - 1]) ? "L" : "M"}${x(over[i]).toFixed(2)} ${y(inside(v)).toFixed(2)}` : "").join("");
  const known = over.map((_, i) => i).filter(i => Number.isFinite(away.low[i]));
  const edge = (values, order) => order.map(i => `${x(over[i]).toFixed(2)} ${y(inside(values[i])).toFixed(2)}`).join("L");
  make(bands, "path", { class: "band", d: `M${edge(away.high, known)}L${edge(away.low, known.reverse())}Z` });
  for (const name of ["least", "greatest"]) make(bands, "path", { class: "edge", d: line(away[name]) });
  for (const sign of [1, -1]) make(bands, "path", { class: "worst", d: line(away.worst.map(v => sign * v)) });
  banded.cursor = make(bands, "line", { class: "cursor", y1: 10, y2: banded.height - banded.bottom });
}

function furnishTolerances() {
  loose = data.tolerances;
  if (loose === null) return;
  byId("tolerance-quantity").replaceChildren(...Object.keys(loose.parts).map(part => new Option(typeset(part), part)));
  while (byId("shares").tHead.rows[0].cells.length > 1) byId("shares").tHead.rows[0].deleteCell(1);
  byId("shares").tHead.rows[0].append(...Object.keys(loose.parts).map(part => Object.assign(document.createElement("th"), { scope: "col", textContent: typeset(part) })));
}
byId("tolerance-quantity").addEventListener("change", () => { drawBands(); showSpreads(row); });

