"""How the page of a set looks, and the one script on it: without it everything is there, only nothing is filtered."""

from __future__ import annotations

__all__ = ["FORM", "SCRIPT", "STYLE"]

# What is out of sight is neither laid out nor painted, so that ten thousand icons load at once.
STYLE = """
:root { color-scheme: light dark; --ink: #14213d; --muted: #4a5468; --paper: #fff; --panel: #f1f4f7; --flat: #a9b3c1; }
@media (prefers-color-scheme: dark) {
  :root { --ink: #e8edf5; --muted: #b4bfd0; --paper: #10151f; --panel: #1b2331; --flat: #5c6980; }
}
* { box-sizing: border-box; }
body { margin: 0 auto; max-width: 90rem; padding: 1rem; background: var(--paper); color: var(--ink);
  font: 1rem/1.5 system-ui, sans-serif; }
a { color: inherit; }
a:focus-visible, summary:focus-visible, input:focus-visible, select:focus-visible {
  outline: 3px solid #c2410c; outline-offset: 2px; }
.skip { position: absolute; left: -99rem; }
.skip:focus { position: static; }
form { display: flex; flex-wrap: wrap; gap: .5rem 1.5rem; align-items: end; margin: 1rem 0; }
form label { display: grid; } input, select { font: inherit; padding: .25rem .5rem; }
.set { list-style: none; margin: 0; padding: 0; }
.set > li { background: var(--panel); border-radius: .5rem; padding: .75rem; margin: 0 0 .75rem;
  content-visibility: auto; contain-intrinsic-size: auto 9rem; }
.set > li[hidden] { display: none; }
.set > li:target, .one:target { outline: 3px solid var(--ink); }
h2 { font-size: 1.25rem; } h3 { font-size: 1rem; margin: 0; overflow-wrap: anywhere; }
.row { display: flex; flex-wrap: wrap; gap: .75rem 1.5rem; align-items: center; }
.row > svg, .row > .braille { flex: none; } .row > svg { width: 6rem; height: 6rem; }
.one { display: flex; gap: .75rem; align-items: center; }
.figure { flex: none; image-rendering: pixelated; border-radius: .25rem; print-color-adjust: exact; }
.full, .half, .flat { stroke: currentColor; stroke-linecap: round; }
.full { stroke-width: .8; } .half { stroke-width: .42; } .flat { stroke: var(--flat); stroke-width: .16; }
.braille { font-size: 1.5rem; line-height: 1.15; margin: .5rem 0; white-space: pre; }
p { margin: .25rem 0; } .muted { color: var(--muted); }
"""

FORM = """<form role="search" hidden>
<label>Search names, labels, categories <input type="search" id="words" autocomplete="off"></label>
<label>Doubt <select id="doubt"><option value="">all</option><option value="yes">in doubt</option>
<option value="no">not in doubt</option></select></label>
<label>Similarity at most <input type="number" id="most" min="0" max="1" step="0.05" value="1"></label>
<output id="shown" aria-live="polite"></output>
</form>"""

SCRIPT = """<script>
const form = document.querySelector("form"), cards = [...document.querySelectorAll(".set > li")];
const [words, doubt, most, shown] = ["words", "doubt", "most", "shown"].map(id => document.getElementById(id));
function choose() {
  const wanted = words.value.toLowerCase().split(/\\s+/).filter(Boolean), least = most.valueAsNumber;
  let count = 0;
  for (const card of cards) {
    const told = card.dataset;
    const fits = wanted.every(word => told.find.includes(word)) && (!doubt.value || told.doubt.includes(doubt.value)) &&
      !(Number(told.least) > least);
    card.hidden = !fits;
    count += fits ? Number(told.count) : 0;
  }
  shown.textContent = count + " icons shown";
}
form.hidden = false;
form.addEventListener("input", choose);
form.addEventListener("submit", event => event.preventDefault());
document.addEventListener("keydown", event => {
  if (event.key === "/" && !event.target.closest("input, select")) { event.preventDefault(); words.focus(); }
});
choose();
</script>"""
