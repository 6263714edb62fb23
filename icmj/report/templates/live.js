// The live page: sliders, body, figures and words around the loop.
import { Chain, Loop } from "./loop.js";
import { flown, locus } from "./theory.js";
import { cleared, drawFigure, eye } from "./body.js";

const model = JSON.parse(document.getElementById("description").textContent);
const [byId, ruled] = [(id) => document.getElementById(id), model.table !== null];
const SECONDS = 8, SAMPLE = 0.008; // s, of the last figure, and between two samples
const MOST = 30; // intervals that are shown
const ALIKE = 2e-3, NEAR = 0.05; // relative: intervals of a settled motion, and of the predicted cycle (icmj.compare)
const SPEED = 0.02; // m/s, of the centre of mass after a push
const BUSY = 14; // ms of a frame for the loop: a slow machine shows slow motion

const chain = model.plant.chain && new Chain(model.plant.chain), loop = new Loop(model, { noise: model.noise.start });
const outputs = model.outputs, [n, m] = [loop.n, loop.m];
const page = { on: true, speed: 1, clock: 0, samples: [], intervals: [], output: Math.max(outputs.findLastIndex(([, unit]) => !unit.endsWith("/s")), 0), view: { yaw: 0.42, pitch: 0.1 }, push: null };

const element = (tag, attributes, parent, words) => {
  const made = Object.assign(document.createElement(tag), attributes);
  if (words !== undefined) made.textContent = words;
  parent.append(made);
  return made;
};
const sign = (text) => text.replace("-", "−");
const figures = (value, count = 3) => sign(Number.isFinite(value) ? (Math.abs(value) >= 1e4 || (value && Math.abs(value) < 1e-3) ?
  value.toExponential(count - 1) : value.toPrecision(count)) : "–");
const ordinal = (k) => ["first", "second", "third"][k - 1] ?? `${k}th`;
const seconds = (value, count = 4) => `${value.toFixed(count)} s`;
const unitOf = (k) => (outputs[k][1] === "°" ? "°" : outputs[k][1] ? ` ${outputs[k][1]}` : "");

// -- predictions ------------------------------------------------------------------------------------------------------

// the state of each orbit at its event, and which of them is the first of each row
const stored = ruled && (() => {
  const bytes = Uint8Array.from(atob(model.table.states), (sign) => sign.charCodeAt(0)), firsts = [0];
  for (const [, , orbits] of model.table.rows) firsts.push(firsts.at(-1) + orbits.length);
  return { values: new Float32Array(bytes.buffer), firsts };
})();

function lookUp({ b, delay, q, least }) {
  const { gains, rows, last } = model.table, { delays, controller } = model, resets = controller.resets[delays.indexOf(delay)];
  const row = delays.indexOf(delay) * gains.length + gains.indexOf(b), [shown, gaps, orbits] = rows[row], first = stored.firsts[row];
  const size = stored.values.length / (stored.firsts.at(-1) || 1);
  const R = controller.R.map((line) => line.map((value) => (value * model.q) / q));
  const share = (w) => Math.max(...controller.cuts.slice(1).map((end, j) => Math.hypot(...R.slice(controller.cuts[j], end)
    .map((line) => line.reduce((sum, value, k) => sum + value * w[n + k], 0)))));
  const catalogue = orbits.map(([delta, lambda, verdict, largest], k) => {
    const start = new Array(loop.size).fill(0);
    for (let i = 0; i < size; i++) start[i] = stored.values[(first + k) * size + i] * (q / model.q);
    const orbit = flown(model, { b, delay }, resets, start, delta);
    // earlier than at its end the rule must not be reached where it is watched
    const early = orbit.find(([t, w]) => t > Math.max(least, delay) + 1e-6 && t < 0.985 * delta && share(w) >= 1);
    return { delta, lambda, verdict, largest, start, orbit, early: early ? early[0] : null, settles: verdict === "attracting" || verdict === "family" };
  });
  const none = { delta: null, lambda: 0, verdict: "none", largest: null, start: null, orbit: null, early: null, settles: false };
  const at = catalogue[shown] ?? none, end = at.delta === null ? Math.min(last, 2) : Math.min(1.25 * at.delta + 0.1, last + 0.2);
  return { ...at, shown: at, catalogue, cycle: catalogue.some(({ settles }) => settles), gaps, exact: model.exact && b === 1, least, end };
}

const predicted = () => ruled && theory.delta !== null && theory.cycle;
const inWords = ({ delta, lambda, verdict }) => `${seconds(delta)} (λ = ${lambda > 0 ? "+1" : "−1"}), ${verdict}`;
let theory = null, paths = null, pathsOf = "";
function predict() {
  const { b, delay } = loop.settings;
  if (!ruled) return;
  theory = lookUp(loop.settings);
  byId("orbit").disabled = !predicted();
  for (const id of ["orbital", "lined"]) byId(id).hidden = !predicted();
  const wanted = `${b} ${delay}`;
  if (wanted !== pathsOf) [pathsOf, paths] = [wanted, null];
}
function trace() { // the eigenvalues, when there is time for them
  if (ruled && !paths) paths = locus(model, loop.settings, loop.resets, theory.end, 40);
}

// -- the body ---------------------------------------------------------------------------------------------------------

const magnified = () => {
  const size = model.body.magnification * (model.q / loop.settings.q), power = 10 ** Math.floor(Math.log10(size));
  return [1, 2, 5, 10].reduce((best, each) => (Math.abs(each * power - size) < Math.abs(best - size) ? each * power : best), power);
};
const figureChain = model.body && new Chain(model.body.chain);
function posture(x, factor) {
  const q = new Float64Array(figureChain.n);
  model.body.positions.forEach((state, i) => (q[i] = state < 0 ? 0 : factor * x[state]));
  figureChain.place(q);
  let [mass, cx, cz] = [0, 0, 0];
  figureChain.mass.forEach((each, i) => (mass += each, cx += each * figureChain.cx[i], cz += each * figureChain.cz[i]));
  const still = { at: [0, 0, 0], turn: [1, 0, 0, 0] };
  return {
    mark: mass > 0 ? [cx / mass, 0, cz / mass] : null,
    pose: (part) => (part ? { at: [figureChain.px[part - 1], 0, figureChain.pz[part - 1]],
      turn: [Math.cos(figureChain.angle[part - 1] / 2), 0, Math.sin(figureChain.angle[part - 1] / 2), 0] } : still),
  };
}

const stage = byId("body");
let touched = [];
function drawStage() {
  const [pen, wide, high] = cleared(stage, 600, 400), ink = colour("ink"), soft = colour("soft");
  if (!model.body) return drawDots(pen, wide, high, ink);
  const body = model.body, ground = high - 46, look = eye(page.view);
  const scale = Math.min((high - 82) / (1.04 * body.height), wide / (1.5 * body.height));
  touched = [];
  [["true sway", 1], [`sway × ${figures(magnified(), 2).replace(/\.0$/, "")}`, magnified()]].forEach(([words, factor], side) => {
    const middle = wide * (side ? 0.74 : 0.26), origin = look([body.middle, 0, body.floor]);
    const stand = { x: middle - scale * origin[0], y: ground + scale * origin[1], scale };
    const on = (point) => { const [x, y] = look(point); return [stand.x + scale * x, stand.y - scale * y]; };
    pen.save();
    pen.beginPath();
    pen.rect(side ? wide / 2 : 0, 0, wide / 2, high);
    pen.clip();
    // floor: rings about the feet, and a line that points where the body faces
    for (const [r, alpha] of [[0.42, 0.1], [0.28, 0.12]]) {
      pen.globalAlpha = alpha;
      pen.fillStyle = ink;
      pen.beginPath();
      for (let k = 0; k <= 48; k++) {
        const a = (k * Math.PI) / 24;
        pen.lineTo(...on([body.middle + r * body.height * Math.cos(a), r * body.height * Math.sin(a), body.floor]));
      }
      pen.fill();
    }
    pen.globalAlpha = 0.4;
    pen.strokeStyle = ink;
    pen.lineWidth = 1;
    pen.setLineDash([2, 4]);
    pen.beginPath();
    pen.moveTo(...on([body.middle, 0, body.floor]));
    pen.lineTo(...on([body.middle, 0, body.floor + 1.06 * body.height]));
    pen.stroke();
    pen.setLineDash([]);
    pen.globalAlpha = 1;
    const { pose, mark } = posture(loop.w, factor);
    const drawn = drawFigure(pen, body, stand, pose, { view: page.view, mark });
    touched.push({ drawn, on, side });
    if (page.push && performance.now() - page.push.when < 700) arrow(pen, on, body, drawn);
    pen.fillStyle = soft;
    pen.font = "13px system-ui, sans-serif";
    pen.textAlign = "center";
    pen.fillText(words, middle, high - 10);
    pen.restore();
  });
}
function arrow(pen, on, body, drawn) {
  const { height, way, link } = page.push, facing = Math.cos(page.view.yaw) >= 0 ? way : -way;
  const [shape] = drawn.filter(({ shape }) => shape.part === link + 1).sort((a, b) => b.wide - a.wide);
  const [x, y] = on([body.middle, 0, height]), at = (shape ? shape.middle[0] : x) + facing * (24 - (shape ? shape.wide + 8 : 24)), fade = 1 - (performance.now() - page.push.when) / 700;
  pen.globalAlpha = fade;
  pen.strokeStyle = pen.fillStyle = colour("theory");
  pen.lineWidth = 4;
  pen.beginPath();
  pen.moveTo(at - facing * 78, y);
  pen.lineTo(at - facing * 38, y);
  pen.stroke();
  pen.beginPath();
  pen.moveTo(at - facing * 24, y);
  pen.lineTo(at - facing * 40, y - 8);
  pen.lineTo(at - facing * 40, y + 8);
  pen.fill();
  pen.globalAlpha = 1;
}
function drawDots(pen, wide, high, ink) { // of a plant without a body: its outputs on a line each
  outputs.forEach(([name], k) => {
    const y = ((k + 0.5) / outputs.length) * high, reach = Math.max(1e-9, ...page.samples.map((row) => Math.abs(row.y[k])));
    pen.strokeStyle = pen.fillStyle = ink;
    pen.globalAlpha = 0.3;
    pen.beginPath();
    pen.moveTo(0.08 * wide, y);
    pen.lineTo(0.92 * wide, y);
    pen.moveTo(wide / 2, y - 12);
    pen.lineTo(wide / 2, y + 12);
    pen.stroke();
    pen.globalAlpha = 1;
    pen.font = "13px system-ui, sans-serif";
    pen.fillText(name, 0.08 * wide, y - 18);
    const last = page.samples.at(-1);
    pen.fillStyle = colour(`l${k % 6}`);
    pen.beginPath();
    pen.arc(wide / 2 + (0.4 * wide * (last ? last.y[k] : 0)) / reach, y, 9, 0, 7);
    pen.fill();
  });
}

// a push at a height of a link, forwards (1) or backwards (−1)
function push(way, link = null, height = null) {
  const size = Math.min(Math.max(loop.settings.q / model.q, 1e-3), 3), change = new Float64Array(n);
  let at = link;
  if (chain) {
    chain.place(loop.w);
    if (at === null) at = chain.n - 1;
    if (height === null) height = chain.cz[at];
    const mass = chain.mass.reduce((sum, each) => sum + each, 0);
    change.set(chain.struck(loop.settings.linear ? new Float64Array(n) : loop.w, at, height, way * size * SPEED * mass), chain.n);
  } else {
    const { B } = model.plant, most = Math.max(...B.map((row) => Math.abs(row[0]))) || 1;
    B.forEach((row, i) => (change[i] = (way * size * SPEED * row[0]) / most));
  }
  loop.push(change);
  page.push = { when: performance.now(), way, link: at, height };
  restart("push");
}

// -- figures ----------------------------------------------------------------------------------------------------------

const palette = {};
const colour = (name) => (palette[name] ??= getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim());
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => Object.keys(palette).forEach((name) => delete palette[name]));

// round numbers between two ends
function ticks(low, high, count = 4) {
  const raw = (high - low) / count, power = 10 ** Math.floor(Math.log10(raw)), step = [1, 2, 2.5, 5, 10].find((each) => each * power >= raw * 0.999) * power;
  const found = [];
  for (let value = Math.ceil(low / step - 1e-9) * step; value <= high + 1e-9 * step; value += step) found.push(Math.abs(value) < 1e-9 * step ? 0 : value);
  return found;
}
const short = (value) => sign(String(+value.toPrecision(6)));
function axes(pen, box, [x0, x1], [y0, y1], { x = "", y = "", across = true, down = true } = {}) {
  const X = (value) => box.left + ((value - x0) / (x1 - x0)) * (box.right - box.left), Y = (value) => box.bottom - ((value - y0) / (y1 - y0)) * (box.bottom - box.top);
  pen.font = "11px system-ui, sans-serif";
  pen.lineWidth = 1;
  pen.strokeStyle = colour("hair");
  pen.fillStyle = colour("soft");
  if (across) for (const value of ticks(x0, x1)) {
    pen.beginPath();
    pen.moveTo(X(value), box.top);
    pen.lineTo(X(value), box.bottom);
    pen.stroke();
    pen.textAlign = "center";
    if (x !== null) pen.fillText(short(value), X(value), box.bottom + 14);
  }
  if (down) for (const value of ticks(y0, y1)) {
    pen.beginPath();
    pen.moveTo(box.left, Y(value));
    pen.lineTo(box.right, Y(value));
    pen.stroke();
    pen.textAlign = "right";
    pen.fillText(short(value), box.left - 5, Y(value) + 4);
  }
  pen.textAlign = "right";
  if (x) pen.fillText(x, box.right, box.bottom + 27);
  pen.textAlign = "left";
  if (y) pen.fillText(y, Math.max(box.left - 34, 2), box.top - 6);
  return [X, Y];
}
const line = (pen, points, paint, width = 1.5, dash = []) => {
  pen.strokeStyle = paint;
  pen.lineWidth = width;
  pen.setLineDash(dash);
  pen.beginPath();
  points.forEach(([x, y], k) => (k ? pen.lineTo(x, y) : pen.moveTo(x, y)));
  pen.stroke();
  pen.setLineDash([]);
};
const dot = (pen, x, y, r, paint, open = false) => {
  pen.beginPath();
  pen.arc(x, y, r, 0, 7);
  pen.fillStyle = pen.strokeStyle = paint;
  pen.lineWidth = 2;
  if (open) pen.stroke();
  else pen.fill();
};

// limits of an axis follow what is drawn, at once outwards and slowly inwards
const limits = {};
function reach(name, wanted) {
  const before = limits[name] ?? wanted;
  return (limits[name] = wanted > before ? wanted * 1.08 : Math.max(before * 0.985, wanted * 1.08));
}

const orbitRate = (w) => { // C ẋ of the linear plant
  const { A, B, C } = model.plant, { K } = model.controller.modes[0], u = K.map((row) => -row.reduce((sum, value, j) => sum + value * w[n + j], 0));
  const rate = A.map((row, i) => row.reduce((sum, value, j) => sum + value * w[j], 0) + loop.settings.b * B[i].reduce((sum, value, j) => sum + value * u[j], 0));
  return C.map((row) => row.reduce((sum, value, j) => sum + value * rate[j], 0));
};
const orbitPoints = () => {
  const k = page.output, factor = outputs[k][2];
  // an orbit's mirror image is an orbit: the one on the side of the last event
  const last = page.intervals.at(-1)?.w, side = last && theory.lambda > 0 && theory.start.slice(0, n).reduce((sum, value, i) => sum + value * last[i], 0) < 0 ? -1 : 1;
  if (page.orbitOf === theory.orbit && page.orbitOutput === k && page.orbitSide === side) return page.orbitDrawn;
  const once = theory.orbit.map(([, w]) => [side * factor * model.plant.C[k].reduce((sum, value, j) => sum + value * w[j], 0), side * factor * orbitRate(w)[k]]);
  [page.orbitOf, page.orbitOutput, page.orbitSide] = [theory.orbit, k, side];
  return (page.orbitDrawn = theory.lambda < 0 ? [...once, ...once.map(([x, y]) => [-x, -y])] : once);
};

function drawPlane() {
  const [pen, wide, high] = cleared(byId("plane"), 300, 262), k = page.output, box = { left: 40, right: wide - 8, top: 20, bottom: high - 32 };
  const from = Math.max(loop.t - Math.max(SECONDS, 3 * (theory?.delta ?? 0)), 0), rows = page.samples.filter(({ t }) => t >= from);
  const orbit = ruled && theory.orbit && theory.start ? orbitPoints() : [];
  const most = (of, index) => Math.max(1e-12, ...rows.map((row) => Math.abs(row[of][k])), ...(predicted() ? orbit.map((point) => Math.abs(point[index])) : []));
  const [x, y] = [reach("x", most("y", 0)), reach("v", most("v", 1))], unit = outputs[k][1];
  const [X, Y] = axes(pen, box, [-x, x], [-y, y], { x: `${outputs[k][0]}${unit ? ` (${unit})` : ""}`, y: `rate (${unit || "1"}/s)` });
  for (let i = 1; i < rows.length; i += 1) {
    pen.globalAlpha = 0.12 + 0.88 * ((rows[i].t - from) / (loop.t - from || 1)) ** 1.5;
    line(pen, [rows[i - 1], rows[i]].map((row) => [X(row.y[k]), Y(row.v[k])]), colour("live"), 1.7);
  }
  pen.globalAlpha = 1;
  for (const row of rows) if (row.event) dot(pen, X(row.y[k]), Y(row.v[k]), 2.6, colour("live"));
  if (predicted()) line(pen, [...orbit, orbit[0]].map(([a, b]) => [X(a), Y(b)]), colour("theory"), 2, [6, 4]);
  const last = rows.at(-1);
  if (last) dot(pen, X(last.y[k]), Y(last.v[k]), 5, colour("ink"));
}

function drawCircle() {
  const [pen, wide, high] = cleared(byId("circle"), 300, 262), size = Math.min(wide, high) / 2 - 12, [cx, cy] = [wide / 2, high / 2];
  const scale = size / 1.28, at = ([re, im]) => [cx + scale * re, cy - scale * im], since = loop.t - loop.last;
  pen.save();
  pen.beginPath();
  pen.rect(0, 0, wide, high);
  pen.clip();
  line(pen, [[cx - size, cy], [cx + size, cy]], colour("hair"), 1);
  line(pen, [[cx, cy - size], [cx, cy + size]], colour("hair"), 1);
  pen.beginPath();
  pen.arc(cx, cy, scale, 0, 7);
  pen.strokeStyle = colour("soft");
  pen.lineWidth = 1.3;
  pen.stroke();
  pen.fillStyle = colour("soft");
  pen.font = "11px system-ui, sans-serif";
  pen.textAlign = "left";
  pen.fillText("+1", cx + scale + 5, cy - 5);
  pen.textAlign = "right";
  pen.fillText("−1", cx - scale - 5, cy - 5);
  if (paths) {
    // where each eigenvalue has been and will go, and where it is at the time since the last event
    for (const [, values] of paths) for (const value of values) {
      const [x, y] = at(value);
      if (Math.hypot(...value) > 0.02 && Math.hypot(...value) < 1.35) (pen.globalAlpha = 0.22), dot(pen, x, y, 1.3, colour("soft"));
    }
    pen.globalAlpha = 1;
    const nearest = paths.reduce((best, each) => (Math.abs(each[0] - since) < Math.abs(best[0] - since) ? each : best));
    if (since <= theory.end * 1.03) for (const value of nearest[1]) {
      const length = Math.hypot(...value), real = Math.abs(value[1]) < 1e-6 && theory.delta !== null && value[0] * theory.lambda > 0;
      const critical = real && predicted() && length === Math.max(...nearest[1].filter(([re, im]) => Math.abs(im) < 1e-6 && re * theory.lambda > 0).map(([re]) => Math.abs(re)));
      if (length < 1.6) dot(pen, ...at(value), critical ? 6 : 3.6, critical ? colour("theory") : colour("soft"));
    }
  }
  if (predicted()) dot(pen, cx + theory.lambda * scale, cy, 9, colour("theory"), true);
  pen.restore();
  byId("grown").textContent = since < 99 ? `${since.toFixed(2)} s` : "";
}

function drawIntervals() {
  const [pen, wide, high] = cleared(byId("intervals"), 300, 262), box = { left: 36, right: wide - 8, top: 20, bottom: high - 32 };
  const shown = page.intervals.slice(-MOST), open = loop.t - loop.last, delta = predicted() ? theory.delta : 0;
  const y = reach("interval", Math.max(0.05, 1.25 * delta, ...shown.map(({ interval }) => interval), Math.min(open, 3 * Math.max(delta, 1)))), first = loop.fired - shown.length;
  const [X, Y] = axes(pen, box, [first + 0.2, first + MOST + 1.8], [0, y], { x: ruled ? "number of the event" : "number of the switch", y: "interval (s)" });
  if (delta) {
    line(pen, [[box.left, Y(delta)], [box.right, Y(delta)]], colour("theory"), 2, [6, 4]);
    pen.fillStyle = colour("theory");
    pen.textAlign = "right";
    pen.fillText(`predicted ${seconds(delta, 3)}`, box.right, Y(delta) - 6);
  }
  for (const one of ruled ? theory.catalogue : []) if (one.settles && one.orbit !== theory.orbit && one.delta < y)
    line(pen, [[box.left, Y(one.delta)], [box.right, Y(one.delta)]], colour("theory"), 1, [2, 4]);
  if (ruled && loop.wait > 0.02) line(pen, [[box.left, Y(loop.wait)], [box.right, Y(loop.wait)]], colour("soft"), 1, [1, 3]);
  const top = Y(Math.min(open, y));
  pen.fillStyle = colour("live");
  pen.globalAlpha = 0.28;
  pen.fillRect(X(loop.fired + 1) - 4, top, 8, box.bottom - top);
  pen.globalAlpha = 1;
  shown.forEach(({ interval }, k) => dot(pen, X(first + k + 1), Y(interval), 3.4, colour("live")));
}

function drawCourse() {
  const [pen, wide, high] = cleared(byId("course"), 300, 262), split = Math.round(high * 0.55), to = Math.max(loop.t, SECONDS), from = to - SECONDS;
  const rows = page.samples.filter(({ t }) => t >= from), above = { left: 40, right: wide - 8, top: 20, bottom: split - 8 };
  const below = { left: 40, right: wide - 8, top: split + 18, bottom: high - 32 }, inputs = model.inputs;
  const u = reach("u", Math.max(1e-9, ...rows.flatMap((row) => row.u.map(Math.abs))));
  const alike = inputs.every(([, unit]) => unit === inputs[0][1]);
  const [X, U] = axes(pen, above, [from, to], [-u, u], { x: null, y: `command${alike && inputs[0][1] ? ` (${inputs[0][1]})` : ""}` });
  const top = ruled ? 1.15 : 1.3, [, E] = axes(pen, below, [from, to], [0, top], { x: "time (s)", y: ruled ? "model minus body, as a share of the threshold" : "feedback on", down: ruled });
  for (const row of rows) if (row.event) line(pen, [[X(row.t), above.top], [X(row.t), below.bottom]], colour("rule"), 1, [1, 3]);
  inputs.forEach((_, k) => line(pen, rows.map((row) => [X(row.t), U(row.u[k])]), colour(`l${k % 6}`), 1.5));
  if (inputs.length > 1) {
    pen.textAlign = "right";
    let x = above.right;
    for (let k = inputs.length - 1; k >= 0; k--) {
      const words = inputs[k][0].replace(/_torque$/, "");
      pen.fillStyle = colour(`l${k % 6}`);
      pen.fillText(words, x, above.top - 6);
      x -= pen.measureText(words).width + 9;
    }
  }
  if (ruled) line(pen, [[below.left, E(1)], [below.right, E(1)]], colour("theory"), 1.4, [6, 4]);
  const level = (row) => (ruled ? Math.min(row.share, top) : row.mode);
  line(pen, rows.map((row) => [X(row.t), E(level(row))]), colour("live"), 1.6);
}

// -- words ------------------------------------------------------------------------------------------------------------

// the last intervals repeat after so many events; 0 where they do not
function period() {
  const all = page.intervals.slice(page.since).map(({ interval }) => interval);
  for (const p of [1, 2, 3, 4]) {
    const last = all.slice(-3 * p - 3);
    if (last.length >= 3 * p + 3 && last.slice(p).every((value, i) => Math.abs(value - last[i]) < ALIKE * value)) return p;
  }
  return 0;
}
function mirrored() {
  const [before, last] = page.intervals.slice(-2).map(({ w }) => w.slice(0, n));
  return before && last && before.reduce((sum, value, i) => sum + value * last[i], 0) < 0;
}

function describeMotion() {
  const { b, delay } = loop.settings, noise = model.noise.noisy ? loop.settings.noise : 0, all = page.intervals.slice(page.since).map(({ interval }) => interval);
  const recent = all.slice(-20), mean = recent.reduce((sum, value) => sum + value, 0) / (recent.length || 1);
  const spread = Math.sqrt(recent.reduce((sum, value) => sum + (value - mean) ** 2, 0) / Math.max(recent.length - 1, 1));
  const open = loop.t - loop.last, p = noise > 0 ? 0 : period(), said = { number: "–", kind: "", seen: "", theory: "" };
  const last = all.at(-1);
  if (loop.ended) {
    const [, , name] = model.limit.find(([i, most]) => Math.abs(loop.w[i]) > most) ?? [];
    said.kind = "fallen";
    said.seen = loop.ended === "fell" ? `Fallen after ${loop.t.toFixed(1)} s: “${name}” has gone beyond its limit. Start again.` : "The motion has left all bounds. Start again.";
  } else if (!ruled) {
    const count = page.intervals.filter(({ t }) => t > loop.t - 10).length, [mode] = [model.controller.modes[loop.mode].name];
    said.kind = `mode ${mode}`;
    said.seen = model.controller.modes.length > 1 ? `Feedback is ${mode}; it has switched ${count} times in the last 10 s.` : "Feedback acts all the time.";
    said.number = count && recent.length ? seconds(mean, 2) : "–";
  } else if (noise > 0) {
    said.kind = "noise";
    if (recent.length > 2) {
      said.number = `${mean.toFixed(3)} ± ${seconds(spread, 3)}`;
      said.seen = `Under noise no two intervals are alike: mean and standard deviation of the last ${recent.length} are ${mean.toFixed(3)} s and ${spread.toFixed(3)} s.`;
    } else said.seen = "Noise acts. Wait for a few events.";
  } else if (p && open < 3 * Math.max(...all.slice(-p))) {
    const values = all.slice(-p);
    said.number = p === 1 ? seconds(last) : values.map((value) => value.toFixed(3)).join(", ") + " s";
    said.kind = `settled ${p}`;
    said.seen = p > 1 ? `The motion repeats after ${p} events.` :
      loop.wait > 0 && last < loop.wait * 1.0001 ? "Events come as fast as the least interval allows, because the threshold is passed at once every time." :
      `Settled on a cycle: an event every ${seconds(last)}, each the ${mirrored() ? "mirror image of the one before" : "same as the one before"}.`;
  } else if (!all.length || open > 3 * Math.max(last ?? 0, theory.delta ?? 0, 1)) {
    said.kind = "quiet";
    said.seen = open > 2 ? `No event for ${open.toFixed(1)} s, because body and model differ by less than the threshold.` : "Open loop: until body and model differ by the threshold, the model alone commands the muscles.";
  } else {
    said.kind = "settling";
    said.number = seconds(last);
    said.seen = `${p ? "" : "Not settled yet: "}the last interval was ${seconds(last, 3)}.`;
  }
  if (!ruled) {
    said.theory = `This controller has no internal model and no event rule, and so no critical interval. It acts on what was sensed ${delay.toFixed(2)} s ago.`;
    return said;
  }
  // a motion is compared with the orbit that it has settled on, or beside: of a family, on cycles of unequal intervals
  const meets = (one) => one.settles && (p === 1 || (p === 2 && one.verdict === "family")) && said.kind.startsWith("settled") &&
    all.slice(-p).every((value) => Math.abs(value / one.delta - 1) < NEAR) && mirrored() === one.lambda < 0;
  const met = theory.catalogue.filter(meets).sort((one, other) => Math.abs(last / one.delta - 1) - Math.abs(last / other.delta - 1))[0];
  Object.assign(theory, met ?? theory.shown);
  const { delta, lambda, cycle, verdict, early, exact, catalogue } = theory, percent = `${+Math.abs(100 * (b - 1)).toPrecision(2)} %`;
  const muscles = b === 1 ? "are as strong as" : `are ${percent} ${b < 1 ? "weaker" : "stronger"} than`;
  const wrong = exact ? "" : `The muscles ${muscles} the model assumes${model.exact ? "" : b === 1 ? ", but the body differs from the model otherwise" : ", and the body differs from the model otherwise, too"}. `;
  const settled = met !== undefined;
  const other = said.kind.startsWith("settled") && !settled && loop.ended === "";
  if (exact && delta === null) {
    said.theory = "The model is exact (b = 1): its errors die out, no eigenvalue reaches the circle, and no cycle is predicted, hence no interval." +
      (!all.length || said.kind === "quiet" ? "" : noise > 0 ? " Events still come, because of the noise." :
        loop.settings.linear || !model.plant.chain ? " Events that still come stem from the start or the last push, and grow rare." :
        " Events that still come stem from the start, the last push, or what the model does not know of the nonlinear body; on the linear plant they grow rare.");
  } else if (delta === null) said.theory = `${wrong}No eigenvalue reaches +1 or −1 within ${model.table.last} s, so no cycle is predicted.`;
  else if (!cycle) said.theory = `${wrong}At Δ = ${seconds(delta, 3)} an eigenvalue reaches ${lambda > 0 ? "+1" : "−1"}, but ${verdict === "repelling" ? "the orbit there repels: small departures from it grow" : "an event comes earlier on the orbit there"}${catalogue.length > 1 ? ", and no other orbit attracts" : ""}. So no cycle is predicted.`;
  else {
    const why = `${wrong}If events are Δ = ${seconds(delta)} apart, an eigenvalue reaches ${lambda > 0 ? "+1: every event repeats the one before, and the period is one interval" : `−1: every event mirrors the one before, and the period is two intervals, ${seconds(2 * delta, 3)}`}.`;
    if (loop.wait >= delta) said.theory = `${why} But no event is allowed before ${seconds(loop.wait, 2)}, so this cycle is ruled out.`;
    else if (early !== null) said.theory = `${why} But on that orbit the threshold would be reached earlier, after ${seconds(early, 2)}, so there is no such cycle.`;
    else if (noise > 0) said.theory = `${why} The orbit that is drawn, and its interval, are those without noise.`;
    else if (settled) said.theory = `${why} The body has settled ${p === 1 ? "on" : "beside"} this cycle: interval predicted ${seconds(delta)}, measured ${seconds(last)}.`;
    else if (other && mirrored() === lambda < 0 && Math.abs(last / delta - 1) < 0.25 && !loop.settings.linear)
      said.theory = `${why} The motion is near that cycle and not on it, because linear theory is for small sway. Lower the threshold, or take the linear plant.`;
    else if (other) said.theory = `${why} The motion has reached another cycle, which exists beside it; start on the predicted orbit to reach the predicted one.`;
    else said.theory = why;
    if (verdict === "family") said.theory += " The orbit is one of a family: a motion that starts beside it settles on a neighbour.";
    if (catalogue.length > 1) said.theory += ` Of ${catalogue.length} orbits this is the ${ordinal(catalogue.findIndex((one) => one.orbit === theory.orbit) + 1)}.`;
  }
  if (theory.gaps) said.theory += ` ${theory.gaps[0].toUpperCase()}${theory.gaps.slice(1)}.`;
  said.settled = settled;
  said.kind += settled ? " predicted" : other ? " other" : "";
  return said;
}

let spoken = "", spokenAt = 0;
function say() {
  const said = describeMotion();
  byId("seen").textContent = said.seen;
  byId("said").textContent = said.theory;
  byId("measured").textContent = said.number;
  if (ruled) {
    byId("measuring").textContent = model.noise.noisy && loop.settings.noise > 0 ? "measured interval, mean ± SD" : said.kind.startsWith("settled") ? "measured interval" : "last interval";
    byId("predicted").textContent = predicted() ? seconds(theory.delta) : "none";
    const { catalogue, orbit } = theory, list = byId("orbits");
    list.replaceChildren();
    for (const one of catalogue) element("li", { className: one.orbit === orbit ? "shown" : "" }, list, inWords(one));
    byId("catalogue").hidden = !catalogue.length;
    byId("period").textContent = predicted() ? (theory.lambda > 0 ? "period: one interval" : `period: two intervals, ${seconds(2 * theory.delta, 3)}`) : "";
  }
  // a reader of the screen hears of what has changed in kind, and not of every number
  const now = performance.now(), heard = `${said.kind} ${Boolean(theory?.cycle)}`;
  if (heard !== spoken && now - spokenAt > 3000) {
    [spoken, spokenAt] = [heard, now];
    byId("aloud").textContent = `${said.seen} ${said.theory}`;
    stage.setAttribute("aria-label", `The body. ${said.seen}`);
  }
}

// -- running ----------------------------------------------------------------------------------------------------------

function sample(event = false) {
  const y = Array.from(loop.y), v = Array.from(loop.y), { C } = model.plant;
  C.forEach((row, k) => {
    let [value, rate] = [0, 0];
    row.forEach((each, j) => ((value += each * loop.w[j]), (rate += each * loop.k[0][j])));
    [y[k], v[k]] = [value * outputs[k][2], rate * outputs[k][2]];
  });
  const mode = loop.mode === 0 && model.controller.modes.length > 1 ? 1 : model.controller.modes.length > 1 ? 0 : 1;
  page.samples.push({ t: loop.t, y, v, u: Array.from(loop.u), share: event ? 1 : loop.share, mode, event });
  if (page.samples.length > 6000) page.samples.splice(0, 2000);
  page.next = loop.t + SAMPLE;
}
function seen(fired) {
  if (!fired && loop.t < page.next) return;
  sample(fired);
  if (!fired) return;
  page.intervals.push(loop.events.at(-1));
  if (loop.events.length > 50) loop.events.splice(0, 40);
  if (page.intervals.length > 400) [page.intervals, page.since] = [page.intervals.slice(200), Math.max(page.since - 200, 0)];
  if (ruled) sample();
}
// what was measured before a change says nothing about what comes after it
function restart() {
  page.since = page.intervals.length;
}
function begin(start) {
  loop.reset(start);
  Object.assign(page, { clock: 0, samples: [], intervals: [], since: 0, next: 0, push: null });
  sample();
  restart();
  play(true);
}

let before, frames = 0, described = 0;
function frame(now) {
  const passed = before === undefined ? 0 : Math.min((now - before) / 1000, 0.1);
  before = now;
  frames++;
  if (page.on && !loop.ended) {
    page.clock = Math.max(page.clock + passed * page.speed, loop.t - 0.1);
    const begun = performance.now();
    while (loop.t < page.clock && !loop.ended && performance.now() - begun < BUSY) seen(loop.step());
    if (loop.t < page.clock - 0.1) page.clock = loop.t;
  }
  drawStage();
  // the figures take turns: each is drawn in every other frame
  if (frames % 2) (drawPlane(), ruled && drawCircle());
  else (drawIntervals(), drawCourse());
  if (now - described > 200) {
    described = now;
    say();
    trace();
  }
  requestAnimationFrame(frame);
}
function play(on) {
  page.on = on;
  byId("play").textContent = on ? "Pause" : "Play";
}

// -- controls ---------------------------------------------------------------------------------------------------------

function slider(parent, { name, label, note, min, max, step, value, show, set, ends, log }) {
  const box = element("div", { className: "slider" }, parent), id = `slide-${name}`;
  const words = element("label", { htmlFor: id }, box, label);
  if (note) element("span", {}, words, ` ${note}`);
  const out = element("output", { htmlFor: id }, box);
  const input = element("input", { type: "range", id, min, max, step }, box);
  const last = element("div", { className: "ends" }, box);
  for (const each of ends) element("span", {}, last, each);
  const write = (real) => {
    out.textContent = show(real);
    input.setAttribute("aria-valuetext", show(real));
  };
  input.value = log ? Math.log10(value) : value;
  write(value);
  input.addEventListener("input", () => {
    const real = log ? 10 ** +input.value : +input.value;
    write(set(real) ?? real);
  });
  return { input, last };
}
function change(name, value) {
  loop.set(name, value);
  predict();
  restart();
  say();
}

function build() {
  byId("lead").innerHTML = ruled ?
    "An internal model of the body commands the muscles in open loop. Only when body and model differ by a threshold does an <b>event</b> occur: " +
    "feedback corrects the model. <b>b</b> is the actual strength of the muscles, as a multiple of what the model assumes. Move it: " +
    "<b>a wrong model can make the body sway in a cycle, and eigenvalues predict the interval between its events.</b>" :
    "This controller has no internal model: it feeds back what was sensed a delay ago" + (model.controller.modes.length > 1 ?
      ", and is switched <b>on</b> where the body falls away and <b>off</b> where it comes back by itself." : ", all the time.") +
    " Move the delay and the strength of the muscles, b, and compare with the page of another controller.";
  byId("touch").textContent = model.body ? (chain ? "Tap the body to push it; drag beside it to turn the view." : "Drag to turn the view.") : "";
  const first = byId("first"), rest = byId("rest"), { noise } = model;
  const gains = ruled ? model.table.gains : Array.from({ length: 101 }, (_, k) => (50 + k) / 100), last = gains.length - 1;
  // of places in a list: the b of the run file need not be a round number
  const b = slider(first, { name: "b", label: "b", note: `strength of the muscles, actual / ${ruled ? "assumed" : "of the run file"}`, min: 0, max: last, step: 1,
    value: gains.reduce((best, each, k) => (Math.abs(each - model.b) < Math.abs(gains[best] - model.b) ? k : best), 0),
    show: (at) => (gains[at] * 100) % 1 > 1e-6 && (gains[at] * 100) % 1 < 1 - 1e-6 ? gains[at].toFixed(3) : gains[at].toFixed(2),
    set: (at) => (change("b", gains[at]), at), ends: ["weaker", "", "stronger"] });
  const middle = b.last.children[1];
  middle.className = "middle";
  middle.style.left = `${(100 * gains.indexOf(1)) / last}%`;
  middle.textContent = ruled ? (model.exact ? "▲ exact model" : "▲ as assumed") : "▲ 1";
  if (ruled) {
    const factor = outputs.every(([, unit]) => unit === outputs[0][1]) ? outputs[0][2] : 1, unit = factor === 1 ? "" : unitOf(0);
    slider(rest, { name: "q", label: "threshold", log: true, min: Math.log10(model.q / 100), max: Math.log10(3 * model.q), step: 0.02, value: model.q,
      show: (value) => `${figures(value * factor, 2)}${unit}`, set: (value) => change("q", value), ends: ["how far body and model may differ; the sway grows with it, the interval does not"] });
    const { delays } = model;
    slider(rest, { name: "delay", label: "delay", min: 0, max: delays.length - 1, step: 1, value: delays.indexOf(model.delay),
      show: (at) => seconds(delays[at] ?? at, 2), set: (at) => (change("delay", delays[at]), at), ends: ["from an event to its action, bridged by prediction"] });
    slider(rest, { name: "least", label: "least interval", min: 0, max: Math.max(1.2, 2 * model.least), step: 0.01, value: model.least,
      show: (value) => seconds(value, 2), set: (value) => (change("least", value)), ends: ["between two events: a refractory period"] });
  } else {
    slider(rest, { name: "delay", label: "delay", min: model.delays[0], max: model.delays[1], step: 0.01, value: model.delay,
      show: (value) => seconds(value, 2), set: (value) => change("delay", value), ends: ["from what is sensed to the command"] });
  }
  slider(rest, { name: "noise", label: noise.noisy ? "noise" : "disturbance", min: 0, max: noise.most, step: noise.most / 50, value: noise.start,
    show: (value) => (noise.own ? `× ${value.toFixed(2)}` : `${figures(value, 2)}${noise.unit ? ` ${noise.unit}` : ""}`), set: (value) => change("noise", value), ends: [noise.own ? "that of the run file, times this" : `of the torque${model.inputs.length > 1 ? `s, ${model.inputs[0][0].replace(/_torque$/, "")} first` : ""}: standard deviation`] });

  outputs.forEach(([name], k) => element("option", { value: k }, byId("output"), name));
  byId("which").hidden = outputs.length < 2;
  byId("output").value = page.output;
  byId("output").addEventListener("change", (event) => ((page.output = +event.target.value), delete limits.x, delete limits.v));
  byId("play").addEventListener("click", () => play(!page.on));
  byId("speed").addEventListener("change", (event) => (page.speed = +event.target.value));
  byId("forth").addEventListener("click", () => push(1));
  byId("back").addEventListener("click", () => push(-1));
  byId("reset").addEventListener("click", () => begin());
  byId("orbit").addEventListener("click", () => theory?.start && begin({ x: theory.start.slice(0, n), a: theory.start.slice(n) }));
  byId("bodies").hidden = !model.plant.chain;
  byId("plant").addEventListener("change", (event) => change("linear", event.target.value === "linear"));
  if (!ruled) {
    for (const id of ["orbit", "panel-circle", "orbital", "lined"]) byId(id).hidden = true;
    document.querySelector(".panels").classList.add("few");
    document.querySelector("#numbers .theory").hidden = true;
    byId("measuring").textContent = "mean time between switches";
    byId("named").textContent = "Times between switches";
    byId("coursed").innerHTML = "<b>Command</b> and <b>mode</b>, the last seconds";
    byId("key-intervals").textContent = "Dots: times between switches; bar: the time since the last one.";
    byId("key-course").textContent = "Dotted: switches.";
    byId("key-plane").textContent = "Large dot: now; small dots: switches.";
    if (model.controller.modes.length < 2) byId("panel-intervals").hidden = byId("numbers").hidden = true;
  }
  byId("plain").textContent = model.plant.chain ?
    "The body is simulated as links in a plane, with the full nonlinear mechanics, by a Runge–Kutta rule of fourth order; the time of each event is located within its step. The linear plant is the same body’s equations, linearised at the pose in which it is balanced; the predictions are those for it." :
    `The body on this page is the linear plant: ${model.why}.`;
  touch();
  keys();
}

function touch() {
  let start = null;
  const at = (event) => {
    const { left, top } = stage.getBoundingClientRect();
    return [event.clientX - left, event.clientY - top];
  };
  stage.addEventListener("pointerdown", (event) => (start = { x: event.clientX, yaw: page.view.yaw, moved: false }));
  stage.addEventListener("pointermove", (event) => {
    if (!start || !(event.buttons || event.pointerType === "touch")) return;
    if (Math.abs(event.clientX - start.x) > 6) start.moved = true;
    if (start.moved) page.view = { ...page.view, yaw: start.yaw + (event.clientX - start.x) / 120 };
  });
  for (const kind of ["pointerup", "pointercancel", "pointerleave"]) stage.addEventListener(kind, (event) => {
    if (kind === "pointerup" && start && !start.moved && chain) tap(...at(event));
    start = null;
  });
  function tap(x, y) {
    const pen = stage.getContext("2d"), ratio = window.devicePixelRatio || 1;
    for (const { drawn, on } of touched) for (const { path, middle, reach: round, shape } of [...drawn].reverse()) {
      pen.lineWidth = 2 * round + 16; // a finger is wide
      if (shape.part && (pen.isPointInPath(path, x * ratio, y * ratio) || pen.isPointInStroke(path, x * ratio, y * ratio))) {
        const high = on([0, 0, 1]), low = on([0, 0, 0]), height = (y - low[1]) / (high[1] - low[1]);
        const away = x < middle[0] ? 1 : -1;
        return push(Math.cos(page.view.yaw) >= 0 ? away : -away, shape.part - 1, height);
      }
    }
  }
}
function keys() {
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || event.target.closest("input, select, textarea")) return;
    const button = event.target.closest("button");
    const acts = { " ": () => !button && play(!page.on), ArrowLeft: () => push(-1), ArrowRight: () => push(1), r: () => begin(), o: () => byId("orbit").click() };
    const act = acts[event.key.length > 1 ? event.key : event.key.toLowerCase()];
    if (!act || (event.key === " " && button)) return;
    event.preventDefault();
    act();
  });
}

build();
predict();
begin();
if (matchMedia("(prefers-reduced-motion: reduce)").matches) play(false);
requestAnimationFrame(frame);
window.icmjLive = { model, loop, page, Loop, locus, frames: () => frames, theory: () => theory, words: describeMotion, say, begin, change, push, step: () => seen(loop.step()) };
