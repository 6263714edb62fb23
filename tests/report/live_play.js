// Acts on the page as a reader would, and says what came of it. Time is what the loop makes of it.
const L = window.icmjLive, { loop, page } = L, found = { faults: window.faults };
page.on = false;
const go = (seconds) => {
  const end = loop.t + seconds;
  while (loop.t < end && !loop.ended) L.step();
  L.say();
  const { kind, number, seen, theory } = L.words(), period = document.getElementById("period").textContent;
  const orbits = [...document.querySelectorAll("#orbits li")];
  return { orbits: orbits.map((each) => each.textContent), bold: orbits.findIndex((each) => each.className === "shown"), kind, number, period, seen, theory, last: loop.t - loop.last, interval: page.intervals.at(-1)?.interval, predicted: L.theory()?.delta ?? null };
};
const start = (settings, seconds, orbit = false) => {
  for (const [name, value] of Object.entries(settings)) L.change(name, value);
  const begin = L.theory()?.start;
  L.begin(orbit ? { x: begin.slice(0, loop.n), a: begin.slice(loop.n) } : undefined);
  page.on = false;
  return go(seconds);
};
const slide = (name, value) => {
  const input = document.getElementById(`slide-${name}`);
  input.value = name === "b" ? L.model.table.gains.indexOf(value) : value;
  input.dispatchEvent(new Event("input"));
};
const key = (name) => document.body.dispatchEvent(new KeyboardEvent("keydown", { key: name, bubbles: true }));

found.first = go(20);
if (L.model.table) {
  // in the middle of an open loop
  while (loop.t - loop.last < 0.3 || loop.share > 0.8) L.step();
  const before = [loop.fired, loop.t, loop.grid, loop.count, ...loop.w];
  slide("b", 1.1);
  slide("q", +document.getElementById("slide-q").value + 0.02);
  const after = [loop.fired, loop.t, loop.grid, loop.count, ...loop.w];
  found.moved = { same: JSON.stringify(before) === JSON.stringify(after), b: loop.settings.b, q: loop.settings.q };
  L.step();
  found.moved.fired = loop.fired - before[0];
  found.mirrored = start({ q: L.model.q, b: 1.1 }, 20);
  found.exact = start({ b: 1 }, 4);
  found.coexisting = [[1.28, 0], [1.3, 0], [0.75, 0.1], [1.21, 0.1]].map(([b, delay]) => start({ b, delay }, 60));
  found.chosen = [[1.29, 0], [1.2, 0.1]].map(([b, delay]) => start({ b, delay }, 20, true));
  found.noise = start({ b: 0.9, delay: 0, noise: 1 }, 30);
  found.ruled = start({ noise: 0, least: 0.9 }, 1.5);
  found.zero = start({ least: 0.3 }, 1).interval; // the start counts as an event
  found.firstly = page.intervals[0].interval;
  start({ least: 0.01 }, 2.2);
  const [x, fired] = [loop.w.slice(0, loop.n), loop.fired];
  key("ArrowRight");
  found.pushed = Array.from(loop.w.slice(0, loop.n), (value, i) => value - x[i]);
  found.pushed.push(loop.fired - fired);
}
key(" ");
found.playing = page.on;
document.getElementById("play").click();
found.paused = !page.on;
await new Promise((done) => setTimeout(done, 700));
found.text = document.body.innerText;
found.named = [...document.querySelectorAll("canvas, input, select, button")].filter((each) => !each.hidden && !(each.getAttribute("aria-label") || each.textContent.trim() || each.labels?.length)).length;
const canvas = document.getElementById("body"), plain = canvas.toDataURL();
page.view = { yaw: 2, pitch: 0.1 };
await new Promise((done) => setTimeout(done, 100));
found.turned = canvas.toDataURL() !== plain;
const pre = document.createElement("pre");
pre.id = "found";
pre.textContent = JSON.stringify(found);
document.body.append(pre);
