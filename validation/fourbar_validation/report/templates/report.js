"use strict";
// The body of a scene waits packed until it is wanted: 200 scenes then open almost as fast as one.
async function fill(scene) {
  const packed = scene.querySelector(":scope > script");
  if (!packed) return;
  const bytes = Uint8Array.from(atob(packed.textContent), character => character.charCodeAt(0));
  packed.remove();
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  scene.insertAdjacentHTML("beforeend", await new Response(stream).text());
}
async function reveal() {
  const row = /^#row-(\d+)$/.exec(location.hash);
  if (row) {
    const line = Number(row[1]);
    for (const scene of document.querySelectorAll("details.scene"))
      if (line >= Number(scene.dataset.first) && line <= Number(scene.dataset.last)) await fill(scene);
  }
  const target = location.hash && document.getElementById(location.hash.slice(1));
  if (!target) return;
  for (let above = target; above; above = above.parentElement)
    if (above.tagName === "DETAILS") { await fill(above); above.open = true; }
  target.scrollIntoView({ block: row ? "center" : "start" });
}
document.addEventListener("toggle", event => { if (event.target.open) fill(event.target); }, true);
addEventListener("hashchange", reveal);
// a link to the row that the address already names changes no hash
document.addEventListener("click", event => {
  const link = event.target.closest?.('a[href^="#"]');
  if (link && link.getAttribute("href") === location.hash) reveal();
});
reveal();
