"use strict";
// The body of a scene waits in a template until it is wanted: 200 scenes then open as fast as one.
function fill(scene) {
  const waiting = scene.querySelector(":scope > template");
  if (waiting) waiting.replaceWith(waiting.content);
}
function reveal() {
  const row = /^#row-(\d+)$/.exec(location.hash);
  if (row) {
    const line = Number(row[1]);
    for (const scene of document.querySelectorAll("details.scene"))
      if (line >= Number(scene.dataset.first) && line <= Number(scene.dataset.last)) fill(scene);
  }
  const target = location.hash && document.getElementById(location.hash.slice(1));
  if (!target) return;
  for (let above = target; above; above = above.parentElement)
    if (above.tagName === "DETAILS") { fill(above); above.open = true; }
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
