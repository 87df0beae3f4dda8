// Live updates for pages that also work without this. Nothing here moves the focus out of a field.

const said = document.querySelector("#said");
const say = (words) => { if (said.textContent !== words) said.textContent = words; };

// A complaint that came with the page is what to read first.
document.querySelector("[data-focus]")?.focus();

// What only works with this is hidden without it.
for (const one of document.querySelectorAll("[data-script]")) one.hidden = false;

// Work that is going on: its progress in words, a bar, what is felt, and the page anew once it is over. Hidden tabs hold
// no connection: browsers have few of them, and STOP needs one.
for (const box of document.querySelectorAll("[data-progress]")) {
  const bar = box.querySelector("progress"), words = box.querySelector("[data-words]");
  let told = "", source = null;
  const hear = (event) => {
    const now = JSON.parse(event.data);
    words.textContent = now.words;
    if (now.percent === null) bar.removeAttribute("value"); else bar.value = now.percent;
    mirror(now.shown);
    // Few words aloud: a new stage, and the end.
    const stage = now.words.split(":")[0];
    if (stage !== told) { told = stage; say(stage); }
    if (now.over) { source.close(); source = null; box.remove(); renew("#main", location.href, now.error || "Done."); }
  };
  const open = () => {
    if (document.hidden) { source?.close(); source = null; }
    else if (!source && box.isConnected) { source = new EventSource(box.dataset.progress); source.onmessage = hear; }
  };
  document.addEventListener("visibilitychange", open);
  open();
}

// What is felt now: the words stand still for whoever reads them, and are not said aloud.
function mirror(shown) {
  const seen = document.querySelector("[data-seen]"), place = document.querySelector("[data-mirror]");
  if (seen && shown.words && seen.textContent !== shown.words) seen.textContent = shown.words;
  const list = document.querySelector("[data-lines]");
  if (list && shown.lines) list.replaceChildren(...shown.lines.filter(Boolean).map((line) => {
    const item = document.createElement("li"); item.textContent = line; return item;
  }));
  if (!place || !shown.levels) return;
  const rows = shown.levels.length, cols = shown.levels[0].length, name = "http://www.w3.org/2000/svg";
  if (!place.firstChild) {
    const svg = document.createElementNS(name, "svg");
    const set = { viewBox: `0 0 ${cols} ${rows}`, width: 24 * cols, height: 24 * rows, "aria-hidden": "true" };
    for (const [key, value] of Object.entries(set)) svg.setAttribute(key, value);
    for (let at = 0; at < rows * cols; at++) for (const kind of ["dot", "felt"]) {
      const disc = document.createElementNS(name, "circle");
      const about = { class: kind, cx: at % cols + 0.5, cy: Math.floor(at / cols) + 0.5, r: kind === "dot" ? 0.42 : 0,
        "stroke-width": 0.05 };
      for (const [key, value] of Object.entries(about)) disc.setAttribute(key, value);
      svg.append(disc);
    }
    place.append(svg);
  }
  const discs = place.querySelectorAll(".felt");
  shown.levels.flat().forEach((level, at) => discs[at].setAttribute("r", 0.42 * Math.sqrt(Math.min(level, 1.2))));
}

// While something plays a page says that it is there, and when it goes: with the last one the outputs go to zero.
if (document.body.dataset.playing) {
  setInterval(() => fetch("/watch").catch(() => {}), 2000);
  addEventListener("pagehide", () => navigator.sendBeacon("/left"));
}

// Puts the same part of another answer in place of what stands here, keeping the focus where it was.
async function renew(part, address, words) {
  const answer = await fetch(address);
  const page = new DOMParser().parseFromString(await answer.text(), "text/html");
  const fresh = page.querySelector(part), here = document.querySelector(part);
  if (!fresh || !here) return;
  const kept = document.activeElement?.id, inside = here.contains(document.activeElement);
  here.replaceChildren(...fresh.childNodes);
  if (inside) (document.getElementById(kept) ?? here).focus();
  if (words) say(words);
  steppers();
}

// Forms that answer while one types: the part they name is made anew.
for (const form of document.querySelectorAll("form[data-live]")) {
  let busy = false, again = false;
  const ask = async () => {
    if (busy) { again = true; return; }
    busy = true;
    const address = `${form.getAttribute("action")}?${new URLSearchParams(new FormData(form))}`;
    await renew(form.dataset.live, address, "");
    history.replaceState(null, "", address);
    performance.mark("answered");
    const summary = document.querySelector(`${form.dataset.live} [data-summary]`);
    clearTimeout(form.quiet);
    form.quiet = setTimeout(() => summary && say(summary.textContent.trim()), 700);
    busy = false;
    if (again) { again = false; ask(); }
  };
  form.addEventListener("input", (event) => {
    // A slider and its number field say the same.
    const twin = event.target.dataset.twin && document.getElementById(event.target.dataset.twin);
    if (twin) twin.value = event.target.value;
    ask();
  });
}

// A choice that is made in one form and kept by another.
addEventListener("change", (event) => {
  const keeping = document.querySelector(`[data-keeps="${event.target.name}"]`);
  if (keeping) keeping.value = event.target.value;
});

// Frames one by one: play, pause, step. Without this all stand below each other.
function steppers() {
  for (const box of document.querySelectorAll("[data-stepper]:not([data-ready])")) {
    box.dataset.ready = "";
    const frames = [...document.querySelectorAll(`#${box.dataset.stepper} > li`)];
    const controls = box.querySelector("[hidden]"), where = box.querySelector("[data-where]");
    let at = 0, timer = null;
    const go = (to) => {
      frames[at].removeAttribute("aria-current");
      at = Math.max(0, Math.min(frames.length - 1, to));
      frames[at].setAttribute("aria-current", "step");
      where.textContent = `Frame ${at + 1} of ${frames.length}: ${frames[at].dataset.words}`;
    };
    const play = box.querySelector("[data-play]");
    const pause = () => { clearTimeout(timer); timer = null; play.textContent = "Play"; };
    const next = () => {
      timer = setTimeout(() => { if (at + 1 < frames.length) { go(at + 1); next(); } else pause(); },
        1000 * Number(frames[at].dataset.seconds));
    };
    play.onclick = () => {
      if (timer) { pause(); return; }
      if (at + 1 === frames.length) go(0);
      play.textContent = "Pause"; next();
    };
    box.querySelector("[data-back]").onclick = () => { pause(); go(at - 1); };
    box.querySelector("[data-on]").onclick = () => { pause(); go(at + 1); };
    controls.hidden = false;
    go(0);
  }
}
steppers();
